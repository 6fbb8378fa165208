//! What picture to make.

use super::tiles::DEFAULT_TILE;
use super::{Adaptive, Aov, Filter, MAX_TILE, Sampling, TileOrder};
use crate::error::{Error, Result};
use crate::math::Vec3;
use crate::plan::{Complete, Plan, PlanOptions, Rays};
use crate::scene::{Integrator, MAX_DEPTH, MAX_SIDE, MAX_SPP, Request};
use crate::trace::Batch;

/// The most shadow rays to a light from one place.
pub const MAX_LIGHT_SAMPLES: u32 = 4096;

/// What picture to make of a scene.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples a pixel, 1 to [`MAX_SPP`]; 1 is the pixel's centre. With [`Settings::adaptive`] the fewest that a pixel
    /// has.
    pub spp: u32,
    /// Chooses among equally good sample patterns.
    pub seed: u64,
    /// How samples are spread.
    pub sampling: Sampling,
    /// How samples become a pixel.
    pub filter: Filter,
    /// How rays are bundled; never changes a native picture.
    pub batch: Batch,
    /// Which tiles come first; never changes a picture.
    pub tile_order: TileOrder,
    /// Edge of a tile in pixels, a power of two from 4 to [`MAX_TILE`]; never changes a native picture.
    pub tile: u32,
    /// Linear RGB behind everything, opaque. None is the scene's own, which where black is transparent.
    pub background: Option<Vec3>,
    /// Shadow rays to each extended light where a ray hits, 1 to [`MAX_LIGHT_SAMPLES`]; paths ask one light, once.
    pub light_samples: u32,
    /// How far light is followed; none for the cheapest way that shows all the scene contains.
    pub integrator: Option<Integrator>,
    /// How often a ray may be sent on, up to [`MAX_DEPTH`]; what it would see after that is black. None is
    /// [`DEFAULT_DEPTH`](crate::plan::DEFAULT_DEPTH), for paths
    /// [`DEFAULT_PATH_DEPTH`](crate::plan::DEFAULT_PATH_DEPTH).
    pub max_depth: Option<u32>,
    /// The only part that is rendered; none for all of it. Its pixels are those of the whole picture.
    pub crop: Option<Crop>,
    /// What [`Renderer::picture`](super::Renderer::picture) tells of each pixel beside its colour.
    pub aovs: Vec<Aov>,
    /// Takes samples where they are needed; none takes as many for each pixel.
    pub adaptive: Option<Adaptive>,
    /// What is modelled whether the scene needs it or not; never changes a picture, but for roundings of what is placed
    /// by transforms, what is too faint to be seen, and noise of paths.
    pub complete: Complete,
}

impl Default for Settings {
    /// 1280 x 720 pixels of 4 samples, as deep as is usual.
    fn default() -> Self {
        Self {
            width: 1280,
            height: 720,
            spp: 4,
            seed: 0,
            sampling: Sampling::default(),
            filter: Filter::default(),
            batch: Batch::default(),
            tile_order: TileOrder::default(),
            tile: DEFAULT_TILE,
            background: None,
            light_samples: 1,
            integrator: None,
            max_depth: None,
            crop: None,
            aovs: Vec::new(),
            adaptive: None,
            complete: Complete::NOTHING,
        }
    }
}

/// A part of the picture; not empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Crop {
    /// Columns to the left of it.
    pub x: u32,
    /// Rows above it.
    pub y: u32,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Crop {
    /// How many pixels.
    pub(crate) const fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Where a pixel of the whole picture is in a list of those of this part, row by row.
    pub(super) const fn index(&self, (x, y): (u32, u32)) -> usize {
        (y - self.y) as usize * self.width as usize + (x - self.x) as usize
    }
}

impl Settings {
    /// What a scene's file asks for, and what is usual where it says nothing.
    pub fn of_request(request: &Request) -> Self {
        let &Request {
            size,
            spp,
            seed,
            integrator,
            max_depth,
            // No settings: where the picture goes, what a camera makes of it, and how the scene is searched.
            output: _,
            exposure: _,
            white_balance: _,
            response: _,
            search: _,
        } = request;
        let usual = Self::default();
        let [width, height] = size.unwrap_or([usual.width, usual.height]);
        Self {
            width,
            height,
            spp: spp.unwrap_or(usual.spp),
            seed: seed.unwrap_or(usual.seed),
            integrator,
            max_depth,
            ..usual
        }
    }

    /// What a plan follows from beside the scene.
    pub fn plan_options(&self) -> PlanOptions {
        let Self { integrator, background, max_depth, complete, .. } = *self;
        PlanOptions { integrator, background, max_depth, complete }
    }

    /// The rays to expect of a render by `plan`.
    pub fn expected_rays(&self, plan: &Plan) -> Rays {
        let pixels = self.window().len() as u64;
        plan.work.rays(pixels.saturating_mul(self.spp.into()), self.light_samples)
    }

    /// The part of the picture that is rendered.
    pub(crate) fn window(&self) -> Crop {
        let Self { width, height, crop, .. } = *self;
        crop.unwrap_or(Crop { x: 0, y: 0, width, height })
    }

    /// What no scene and no camera can make right.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub(crate) fn check(&self) -> Result<()> {
        let Self { width, height, spp, sampling, .. } = *self;
        for side in [width, height] {
            if side == 0 || side > MAX_SIDE {
                let message = format!("size {width}x{height}: both sides must be 1 to {MAX_SIDE} pixels");
                return Err(Error::Usage(message));
            }
        }
        if self.background.is_some_and(|color| !color.is_finite()) {
            return Err(Error::Usage("a background that is not finite".to_owned()));
        }
        if !(1..=MAX_SPP).contains(&spp) {
            return Err(Error::Usage(format!("{spp} samples a pixel: 1 to {MAX_SPP} are possible")));
        }
        if let Some(Crop { x, y, width: columns, height: rows }) = self.crop {
            let inside = |start: u32, length: u32, whole: u32| length > 0 && length <= whole.saturating_sub(start);
            if !(inside(x, columns, width) && inside(y, rows, height)) {
                let message =
                    format!("the part {columns}x{rows} at {x},{y} does not lie in the picture of {width}x{height}");
                return Err(Error::Usage(message));
            }
        }
        if !self.tile.is_power_of_two() || self.tile < 4 || self.tile > MAX_TILE {
            let message = format!("tiles of {0}x{0} pixels: 4, 8, 16, 32 or {MAX_TILE} is possible", self.tile);
            return Err(Error::Usage(message));
        }
        if let Some(adaptive) = &self.adaptive {
            adaptive.check(spp)?;
            if self.crop.is_some() {
                let why = "a pixel's samples depend on its neighbours' noise";
                return Err(Error::Usage(format!("no part of a picture alone with a noise threshold: {why}")));
            }
            if matches!(sampling, Sampling::Stratified | Sampling::Grid) {
                let why = "must know the number of samples beforehand";
                return Err(Error::Usage(format!(
                    "the sampler \"{sampling}\" {why}: with a noise threshold take sobol"
                )));
            }
        }
        if let Some(depth) = self.max_depth.filter(|depth| *depth > MAX_DEPTH) {
            return Err(Error::Usage(format!("a depth of {depth}: a ray may be sent on {MAX_DEPTH} times at most")));
        }
        let count = self.light_samples;
        if !(1..=MAX_LIGHT_SAMPLES).contains(&count) {
            return Err(Error::Usage(format!("{count} shadow rays to a light: 1 to {MAX_LIGHT_SAMPLES} are possible")));
        }
        Ok(())
    }
}
