//! From pixels to camera rays, and from radiance to a film.
//!
//! A picture depends on scene, camera, size, samples and seed. Threads, tiles and their order, and how rays are bundled
//! change when a pixel is computed, never what.

mod adaptive;
mod alpha;
mod aov;
mod camera;
mod canvas;
mod checkpoint;
mod counted;
mod film;
mod filter;
mod identity;
mod path;
mod rounds;
pub(crate) mod sampler;
mod tiles;
mod wavefront;
mod whitted;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

pub use adaptive::Adaptive;
pub use aov::{Aov, Expression};
pub use checkpoint::Checkpoint;
pub use counted::Counted;
pub use filter::Filter;
pub use rounds::Picture;
pub use sampler::Sampling;
pub use tiles::{LARGEST_TILE, TileOrder};

use crate::error::{Error, Result};
use crate::image::Image;
use crate::math::{DVec2, Vec3, Vec4};
use crate::plan::{Plan, Wishes};
use crate::ray::Ray;
use crate::scene::{Camera, Integrator, Material, Scene};
use crate::shade::EnvironmentLight;
use crate::shade::lights::Lights;
use crate::trace::{Batch, Tracer, World};
use aov::Request;
use camera::View;
use film::Film;
use filter::FilterSampler;
use sampler::{Dimension, Pattern, Sampler};
use tiles::{Tile, USUAL_TILE, tiles};
use wavefront::Buffers;

/// Most pixels a picture may have along one side.
pub const LARGEST_SIDE: u32 = 65_536;

/// What picture to make of a scene.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples a pixel; 1 is the pixel's centre. With [`Settings::adaptive`] the fewest that a pixel has.
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
    /// Edge of a tile in pixels, a power of two from 4 to [`LARGEST_TILE`]; never changes a native picture.
    pub tile: u32,
    /// Linear RGB behind everything, opaque. None is the scene's own, which where black is transparent.
    pub background: Option<Vec3>,
    /// Shadow rays to each extended light where a ray hits; paths ask one light, once.
    pub light_samples: u32,
    /// How far light is followed; none for the cheapest way that shows all the scene contains.
    pub integrator: Option<Integrator>,
    /// How often a ray may be sent on; what it would see after that is black. None is [`USUAL_DEPTH`](crate::plan::USUAL_DEPTH), for paths
    /// [`USUAL_PATH_DEPTH`](crate::plan::USUAL_PATH_DEPTH).
    pub max_depth: Option<u32>,
    /// What [`Renderer::picture`] tells of each pixel beside its colour.
    pub aovs: Vec<Aov>,
    /// Takes samples where they are needed; none takes as many for each pixel.
    pub adaptive: Option<Adaptive>,
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
            tile: USUAL_TILE,
            background: None,
            light_samples: 1,
            integrator: None,
            max_depth: None,
            aovs: Vec::new(),
            adaptive: None,
        }
    }
}

/// How a running render is watched and stopped.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// Set to stop: the render then returns [`Error::Interrupted`].
    pub cancel: Option<&'a AtomicBool>,
    /// Called after each tile, from any thread, with the number of its pixels.
    pub on_tile: Option<&'a (dyn Fn(u64) + Sync)>,
}

/// A scene, a camera and settings, ready to be traced by any engine.
pub struct Renderer<'a> {
    scene: &'a Scene,
    world: &'a World,
    settings: Settings,
    camera: Camera,
    plan: Plan,
    view: View,
    /// When it opens and when it closes.
    shutter: [f32; 2],
    sampler: Sampler,
    filter: FilterSampler,
    /// Of all shadow rays of a pixel to a light.
    light_sampler: Sampler,
    lights: Lights,
    /// What is around the scene; none where that is black.
    environment: Option<Arc<EnvironmentLight>>,
    /// Ambient light, zero where the plan leaves it out.
    ambient: Vec3,
    /// What a geometry is made of whose material does not exist.
    fallback: Material,
    /// What is told of each pixel beside its colour; none where nothing is asked for.
    request: Option<Request>,
}

impl<'a> Renderer<'a> {
    /// Plans the render.
    ///
    /// # Errors
    /// [`Error::Usage`] for a size or a sample count of 0, a side above [`LARGEST_SIDE`], and a
    /// camera that cannot be.
    pub fn new(scene: &'a Scene, world: &'a World, camera: Camera, settings: Settings) -> Result<Self> {
        let Settings { width, height, spp, seed, sampling, filter, .. } = settings;
        for side in [width, height] {
            if side == 0 || side > LARGEST_SIDE {
                let message = format!("size {width}x{height}: both sides must be 1 to {LARGEST_SIDE} pixels");
                return Err(Error::Usage(message));
            }
        }
        if spp == 0 {
            return Err(Error::Usage("0 samples a pixel: at least 1 is needed".to_owned()));
        }
        if !settings.tile.is_power_of_two() || settings.tile < 4 || settings.tile > LARGEST_TILE {
            let message = format!("tiles of {0}x{0} pixels: 4, 8, 16, 32 or {LARGEST_TILE} is possible", settings.tile);
            return Err(Error::Usage(message));
        }
        if let Some(adaptive) = &settings.adaptive {
            adaptive.check(spp)?;
            if matches!(sampling, Sampling::Stratified | Sampling::Grid) {
                let why = "must know the number of samples beforehand";
                return Err(Error::Usage(format!(
                    "the sampler \"{sampling}\" {why}: with a noise threshold take sobol"
                )));
            }
        }
        let request = Request::new(&settings.aovs, scene)?;
        // Of what samples are spread over.
        let most = settings.adaptive.map_or(spp, |adaptive| adaptive.max_spp);
        let view = View::new(&camera, world.centre, width, height)?;
        let [open, close] = camera.shutter;
        if !(0.0 <= open && open <= close && close <= 1.0) {
            let message = format!("a shutter from {open} to {close}: things move from time 0 to 1, and it closes last");
            return Err(Error::Usage(message));
        }
        if settings.light_samples == 0 {
            return Err(Error::Usage("0 shadow rays to a light: at least 1 is needed".to_owned()));
        }
        let environment = scene.environment.as_ref().map(EnvironmentLight::new).filter(|light| !light.is_black());
        let Settings { integrator, background, max_depth, .. } = settings;
        let plan = Plan::new(scene, world, &Wishes { integrator, background, max_depth });
        if plan.integrator == Integrator::Path && sampling == Sampling::Grid {
            let why = "its numbers are the same for every choice of a path, which makes a wrong picture";
            return Err(Error::Usage(format!("the sampler \"grid\" does not go with path tracing: {why}; take sobol")));
        }
        let mut renderer = Self {
            scene,
            world,
            view,
            shutter: camera.shutter,
            camera,
            sampler: Sampler::new(sampling, most, seed),
            light_sampler: Sampler::new(sampling, most.saturating_mul(settings.light_samples), seed),
            // A single sample is the pixel's middle, whatever the filter.
            filter: FilterSampler::new(if most == 1 { Filter::Box } else { filter }),
            lights: Lights::default(),
            environment: environment.map(Arc::new),
            ambient: if plan.ambient { scene.ambient } else { Vec3::ZERO },
            fallback: Material::default(),
            request,
            plan,
            settings,
        };
        renderer.lights = renderer.plan_lights(renderer.camera.eye - world.centre);
        Ok(renderer)
    }

    /// What is rendered, as the engines hold it.
    pub const fn world(&self) -> &'a World {
        self.world
    }

    /// What the render will do.
    pub const fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Renders the colours of the whole picture on rayon's current thread pool; [`Renderer::picture`] gives what else is asked for.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once `control.cancel` is set, and
    /// [`Error::Usage`] for a picture that does not fit into memory.
    pub fn render<T: Tracer + ?Sized>(&self, tracer: &T, control: Control<'_>) -> Result<Image> {
        if self.settings.adaptive.is_some() {
            return Ok(self.rounds(tracer, control, None)?.0.image());
        }
        let cancelled = || control.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed));
        let film = Film::new(self.settings.width, self.settings.height)?;
        self.each_tile(|tile, buffers| {
            if cancelled() {
                return ControlFlow::Break(());
            }
            film.put(tile, self.tile(tracer, tile, buffers));
            if let Some(on_tile) = control.on_tile {
                on_tile(tile.len() as u64);
            }
            ControlFlow::Continue(())
        });
        if cancelled() { Err(Error::Interrupted) } else { Ok(film.into_image()) }
    }

    /// How many camera rays of the whole picture hit something. The same loop as [`Renderer::render`] on the same pool, from pixels
    /// to hits, without what follows: what an engine is worth to a renderer can be measured with it.
    pub fn count_hits<T: Tracer + ?Sized>(&self, tracer: &T) -> u64 {
        let sum = AtomicU64::new(0);
        self.each_tile(|tile, buffers| {
            sum.fetch_add(self.tile_hits(tracer, tile, buffers), Ordering::Relaxed);
            ControlFlow::Continue(())
        });
        sum.into_inner()
    }

    /// Calls `work` with each tile, on all threads of rayon's current pool, until it breaks off.
    fn each_tile(&self, work: impl Fn(&Tile, &mut Buffers) -> ControlFlow<()> + Sync) {
        let tiles = tiles(self.settings.width, self.settings.height, self.settings.tile, self.settings.tile_order);
        let next = AtomicUsize::new(0);
        // Each thread takes the next tile in order; a parallel iterator would begin in the middle of the list.
        rayon::broadcast(|_| {
            let mut buffers = Buffers::default();
            while let Some(tile) = tiles.get(next.fetch_add(1, Ordering::Relaxed)) {
                if work(tile, &mut buffers).is_break() {
                    return;
                }
            }
        });
    }

    /// One pixel, the same to the bit as in the whole picture; of a picture with [`Settings::adaptive`], with its fewest samples. A tracer that records what it is asked learns every ray
    /// that the pixel depends on.
    ///
    /// The same to the bit holds for an engine whose answer to a ray does not depend on the batch it came in: the
    /// native ones, and Embree with [`Width::One`](crate::Width).
    pub fn pixel<T: Tracer + ?Sized>(&self, tracer: &T, x: u32, y: u32) -> Vec4 {
        self.tile(tracer, &Tile { x, y, width: 1, height: 1 }, &mut Buffers::default())[0]
    }

    /// A point on the film, in pixels from its top left corner: the place of one of a pixel's samples; and its weight.
    #[inline]
    fn place(&self, pixel: &Pattern, sample: u32) -> (DVec2, f32) {
        let (within, weight) = self.filter.place(self.sampler.film(pixel, sample));
        (pixel.corner() + within, weight)
    }

    /// The camera ray of one sample of a pixel.
    pub fn camera_ray(&self, x: u32, y: u32, sample: u32) -> Ray {
        self.ray(&self.sampler.pattern(x, y), sample)
    }

    fn ray(&self, pixel: &Pattern, sample: u32) -> Ray {
        let ray = self.view.ray(self.place(pixel, sample).0, || self.sampler.pair(pixel, sample, Dimension::LENS));
        Ray { time: if self.plan.motion { self.time(pixel, sample) } else { 0.0 }, ..ray }
    }

    /// When a sample of a pixel is taken.
    fn time(&self, pixel: &Pattern, sample: u32) -> f32 {
        let [open, close] = self.shutter;
        let share = self.sampler.pair(pixel, sample, Dimension::TIME).x as f32;
        open + (close - open) * share
    }
}
