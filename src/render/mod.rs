//! From pixels to camera rays, and from radiance to a film.

use std::sync::atomic::AtomicBool;

use crate::error::Result;
use crate::image::Image;
use crate::math::Vec4;
use crate::ray::Ray;
use crate::scene::{Camera, Scene};
use crate::trace::{Batch, Tracer, World};

/// What picture to make of a scene.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples a pixel; 1 is the pixel's centre.
    pub spp: u32,
    /// Chooses among equally good sample patterns.
    pub seed: u64,
    /// How rays are bundled; never changes a native picture.
    pub batch: Batch,
}

/// How a running render is watched and stopped.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// Set to stop: the render then returns [`Error::Interrupted`](crate::Error::Interrupted).
    pub cancel: Option<&'a AtomicBool>,
    /// Called after each tile, from any thread, with the number of its pixels.
    pub on_tile: Option<&'a (dyn Fn(u64) + Sync)>,
}

/// A scene, a camera and settings, ready to be traced by any engine.
pub struct Renderer<'a> {
    scene: &'a Scene,
    world: &'a World,
    camera: Camera,
    settings: Settings,
}

impl<'a> Renderer<'a> {
    /// Plans the render.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) for a size or a sample count of 0.
    pub fn new(scene: &'a Scene, world: &'a World, camera: Camera, settings: Settings) -> Result<Self> {
        Ok(Self { scene, world, camera, settings })
    }

    /// What is rendered, as the engines hold it.
    pub const fn world(&self) -> &'a World {
        self.world
    }

    /// Renders the whole picture on rayon's current thread pool.
    ///
    /// # Errors
    /// [`Error::Interrupted`](crate::Error::Interrupted) once `control.cancel` is set.
    pub fn render<T: Tracer>(&self, _tracer: &T, _control: Control<'_>) -> Result<Image> {
        todo!()
    }

    /// One pixel, the same to the bit as in the whole picture. A tracer that records what it is asked learns every ray
    /// that the pixel depends on.
    pub fn pixel<T: Tracer>(&self, _tracer: &T, _x: u32, _y: u32) -> Vec4 {
        todo!()
    }

    /// The camera ray of one sample of a pixel.
    pub fn camera_ray(&self, _x: u32, _y: u32, _sample: u32) -> Ray {
        todo!()
    }
}
