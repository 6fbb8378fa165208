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
mod control;
mod counted;
mod explain;
mod film;
mod filter;
mod finished;
mod fog;
mod identity;
mod media;
mod metadata;
mod path;
mod rounds;
pub(crate) mod sampler;
mod settings;
mod shadows;
mod tiles;
mod wavefront;
mod whitted;

use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

pub use adaptive::Adaptive;
pub use aov::{Aov, Expression};
pub use checkpoint::Checkpoint;
pub(crate) use checkpoint::is_checkpoint;
pub use control::Control;
pub use counted::Counted;
pub use explain::{Explanation, HitTrail, LightTrail, RayTrail, SampleTrail};
pub use filter::Filter;
pub use finished::Finished;
pub use rounds::Picture;
pub use sampler::Sampling;
pub use settings::{Crop, MAX_LIGHT_SAMPLES, Settings};
pub use tiles::{MAX_TILE, TileOrder};

use crate::error::{Error, Result};
use crate::image::Image;
use crate::math::{DVec2, Vec3, Vec4};
use crate::plan::Plan;
use crate::ray::Ray;
use crate::scene::{Camera, Integrator, Material, Scene};
use crate::shade::EnvironmentLight;
use crate::shade::lights::Lights;
use crate::trace::{Tracer, World};
use aov::Request;
use camera::View;
use film::Film;
use filter::{Balance, FilterSampler};
use sampler::{Dimension, Pattern, Sampler};
use tiles::{Tile, tiles};
use wavefront::Buffers;

/// The most samples that are balanced between where the filter is positive and where it is negative: of more, chance
/// has them nearly so, and to count them takes longer.
const MAX_BALANCED: u32 = 64;

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

impl fmt::Debug for Renderer<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { camera, settings, plan, .. } = self;
        f.debug_struct("Renderer")
            .field("camera", camera)
            .field("settings", settings)
            .field("plan", plan)
            .finish_non_exhaustive()
    }
}

/// What is wrong with a camera, with the file where it is one of that.
fn told_of(error: Error, camera: &Camera, scene: &Scene) -> Error {
    match (error, scene.files.first()) {
        (Error::Usage(message), Some(file)) if scene.cameras.contains(camera) => {
            let place =
                if camera.name.is_empty() { "its camera".to_owned() } else { format!("camera {:?}", camera.name) };
            Error::input(file, place, message)
        }
        (other, _) => other,
    }
}

impl<'a> Renderer<'a> {
    /// Plans the render.
    ///
    /// # Errors
    /// [`Error::Usage`] for a size or a sample count of 0, a side above [`MAX_SIDE`](crate::scene::MAX_SIDE), a camera
    /// that cannot be, and settings that do not go together: a sampler of a whole grid with adaptive sampling or paths,
    /// adaptive sampling of a part of the picture, channels that need what is not there; and for a world that is
    /// another scene's. [`Error::Input`] where the camera is one of the scene's file.
    pub fn new(scene: &'a Scene, world: &'a World, camera: Camera, settings: Settings) -> Result<Self> {
        let Settings { width, height, spp, seed, sampling, filter, .. } = settings;
        settings.check()?;
        if !world.is_of(scene) {
            return Err(Error::Usage("the world is another scene's: make it of this one".to_owned()));
        }
        let request = Request::new(&settings.aovs, scene)?;
        // Of what samples are spread over.
        let most = settings.adaptive.map_or(spp, |adaptive| adaptive.max_spp);
        let view = View::new(&camera, world.centre, width, height).map_err(|error| told_of(error, &camera, scene))?;
        let [open, close] = camera.shutter;
        if !(0.0 <= open && open <= close && close <= 1.0) {
            let message = format!("a shutter from {open} to {close}: things move from time 0 to 1, and it closes last");
            return Err(Error::Usage(message));
        }
        let plan = Plan::new(scene, world, &settings.plan_options());
        if plan.integrator == Integrator::Path && sampling == Sampling::Grid {
            let why = "its numbers are the same for every pixel, and what one path misses all of them miss";
            return Err(Error::Usage(format!("the sampler \"grid\" does not go with path tracing: {why}; take sobol")));
        }
        let environment = scene.environment.as_ref().filter(|_| plan.environment);
        // A headlight stays where the camera is half-way.
        let eye = camera.pose(f64::from(open.midpoint(close))).eye;
        let mut renderer = Self {
            camera,
            scene,
            world,
            view,
            shutter: [open, close],
            sampler: Sampler::new(sampling, most, seed),
            light_sampler: Sampler::new(sampling, most.saturating_mul(settings.light_samples), seed),
            // A single sample is the pixel's middle, whatever the filter.
            filter: FilterSampler::new(if most == 1 { Filter::Box } else { filter }),
            lights: Lights::default(),
            environment: environment.map(|light| Arc::new(EnvironmentLight::new(light))),
            ambient: if plan.ambient { scene.ambient } else { Vec3::ZERO },
            fallback: Material::default(),
            request,
            plan,
            settings,
        };
        renderer.lights = renderer.plan_lights(eye - world.centre);
        Ok(renderer)
    }

    /// What is rendered, as the engines hold it.
    pub const fn world(&self) -> &'a World {
        self.world
    }

    /// Width and height of the whole picture.
    pub const fn size(&self) -> [u32; 2] {
        [self.settings.width, self.settings.height]
    }

    /// What the render will do.
    pub const fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The part of the picture that is rendered.
    pub fn window(&self) -> Crop {
        self.settings.window()
    }

    /// Renders the colours of the picture, or of the part of it that is asked for, on rayon's current thread pool;
    /// [`Renderer::picture`] gives what else is asked for.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once `control.cancel` is set, and
    /// [`Error::Memory`] for a picture that does not fit into memory.
    ///
    /// # Panics
    /// Where the tracer was built for another world than [`Renderer::world`], and names what is not there.
    pub fn render<T: Tracer + ?Sized>(&self, tracer: &T, control: Control<'_>) -> Result<Image> {
        if self.settings.adaptive.is_some() {
            return Ok(self.rounds(tracer, control, None)?.0.image());
        }
        let window = self.window();
        let film = Film::new(window.width, window.height)?;
        self.each_tile(|tile, buffers| {
            if control.is_cancelled() {
                return ControlFlow::Break(());
            }
            let pixels = self.tile(tracer, tile, buffers);
            let on_film = tile.within(&window);
            film.put(&on_film, pixels);
            if let Some(on_pixels) = control.on_pixels {
                on_pixels(Finished::new(&on_film, pixels));
            }
            if let Some(on_tile) = control.on_tile {
                on_tile(tile.len() as u64);
            }
            ControlFlow::Continue(())
        });
        control.check()?;
        Ok(film.into_image())
    }

    /// How many camera rays of the whole picture hit something. The same loop as [`Renderer::render`] on the same pool,
    /// from pixels to hits, without what follows: what an engine is worth to a renderer can be measured with it.
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
        let Crop { x, y, width, height } = self.window();
        let tiles = tiles(width, height, self.settings.tile, self.settings.tile_order);
        let next = AtomicUsize::new(0);
        // Each thread takes the next tile in order; a parallel iterator would begin in the middle of the list.
        rayon::broadcast(|_| {
            let mut buffers = Buffers::default();
            while let Some(tile) = tiles.get(next.fetch_add(1, Ordering::Relaxed)) {
                let tile = Tile { x: x + tile.x, y: y + tile.y, ..*tile };
                if work(&tile, &mut buffers).is_break() {
                    return;
                }
            }
        });
    }

    /// One pixel, the same to the bit as in the whole picture; of a picture with [`Settings::adaptive`], with its
    /// fewest samples. A tracer that records what it is asked learns every ray that the pixel depends on.
    ///
    /// The same to the bit holds for an engine whose answer to a ray does not depend on the batch it came in: the
    /// native ones, and Embree with [`Width::One`](crate::Width).
    pub fn pixel<T: Tracer + ?Sized>(&self, tracer: &T, x: u32, y: u32) -> Vec4 {
        self.tile(tracer, &Tile { x, y, width: 1, height: 1 }, &mut Buffers::default())[0]
    }

    /// A point on the film, in pixels from its top left corner: the place of one of a pixel's samples; and whether the
    /// filter is negative there.
    #[inline]
    fn place(&self, pixel: &Pattern, sample: u32) -> (DVec2, bool) {
        let (within, is_negative) = self.filter.place(self.sampler.film(pixel, sample));
        (pixel.corner() + within, is_negative)
    }

    /// What the samples of a pixel count, by a filter that is negative somewhere. Few are balanced; of many, and where
    /// it is not known how many there will be, which then are [`adaptive`]'s sixteen at least, each counts 1 or -1.
    fn balance(&self, pixel: &Pattern) -> Balance {
        let Settings { spp, adaptive, .. } = self.settings;
        if adaptive.is_some() || spp > MAX_BALANCED {
            return Balance::SIGNS;
        }
        let negative = (0..spp).filter(|&sample| self.place(pixel, sample).1).count() as u32;
        self.filter.balance(spp - negative, negative)
    }

    /// The camera ray of one sample of a pixel.
    pub fn camera_ray(&self, x: u32, y: u32, sample: u32) -> Ray {
        self.ray(&self.sampler.pattern(x, y), sample)
    }

    fn ray(&self, pixel: &Pattern, sample: u32) -> Ray {
        let time = if self.has_times() { self.time(pixel, sample) } else { 0.0 };
        self.view.ray(self.place(pixel, sample).0, || self.sampler.pair(pixel, sample, Dimension::LENS), time)
    }

    /// Whether rays depend on when they are sent.
    fn has_times(&self) -> bool {
        self.plan.motion || self.view.moves()
    }

    /// When a sample of a pixel is taken.
    fn time(&self, pixel: &Pattern, sample: u32) -> f32 {
        let [open, close] = self.shutter;
        let share = self.sampler.pair(pixel, sample, Dimension::TIME).x as f32;
        open + (close - open) * share
    }
}
