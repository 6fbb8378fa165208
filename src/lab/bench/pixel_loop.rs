//! The whole loop from pixel to hit, as the renderer runs it: camera rays are made, traced and answered tile by tile,
//! and all of that is timed.
//!
//! The loop is the renderer's own, stopped at the hits ([`Renderer::count_hits`]). A loop made for the benchmark would
//! be simpler, and could show rates that no render has.

use std::sync::{Mutex, PoisonError};

use super::rays::{Kind, TILE};
use super::run::WIDTHS;
use super::subject::Subject;
use crate::error::Result;
use crate::ray::{Hit, Ray};
use crate::render::{Renderer, Settings};
use crate::trace::{Batch, Tracer, Width};

/// A picture of the subject, one sample a pixel, at every width.
pub(super) struct PixelLoop<'a>([Renderer<'a>; WIDTHS.len()]);

impl<'a> PixelLoop<'a> {
    /// A picture of `side` x `side` pixels, whole tiles.
    ///
    /// # Errors
    /// Those of [`Renderer::new`].
    pub fn new(subject: &'a Subject, side: usize) -> Result<Self> {
        let side = u32::try_from(side.next_multiple_of(TILE)).unwrap_or(u32::MAX);
        let renderer = |width| {
            let batch = Kind::Pixel.batch(width);
            let settings = Settings { width: side, height: side, spp: 1, batch, ..Settings::default() };
            Renderer::new(&subject.scene, &subject.world, subject.camera.clone(), settings)
        };
        let [one, eight, sixteen] = WIDTHS.map(renderer);
        Ok(Self([one?, eight?, sixteen?]))
    }

    /// Traces all rays and counts the hits.
    pub fn pass(&self, tracer: &dyn Tracer, width: Width) -> u64 {
        let at = WIDTHS.iter().position(|&w| w == width).unwrap_or_default();
        self.0[at].count_hits(tracer)
    }

    /// The rays of the loop, so that the answers to them can be compared: those that it asks a tracer for, tile by
    /// tile.
    pub fn rays(&self) -> Vec<Ray> {
        let recorder = Recorder(Mutex::default());
        self.0[0].count_hits(&recorder);
        recorder.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Keeps what it is asked for, and answers that nothing is hit.
struct Recorder(Mutex<Vec<Ray>>);

impl Tracer for Recorder {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.closest_batch(std::slice::from_ref(ray), &mut [None], Batch::default());
        None
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }

    fn closest_batch(&self, rays: &[Ray], _hits: &mut [Option<Hit>], _batch: Batch) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(rays);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::UpAxis;
    use crate::trace::bvh::Bvh;

    #[test]
    fn the_loop_sees_what_the_prepared_rays_see() {
        for (name, side) in [("terrain20", 40), ("instances3", 32), ("architecture1", 24)] {
            let (subject, _) = Subject::new(name, UpAxis::Y).expect("made by rule");
            let pixels = PixelLoop::new(&subject, side).expect("a picture");
            let rays = pixels.rays();
            let bvh = Bvh::build(&subject.world);
            let prepared = subject.view.rays(&subject.world, &bvh, &[Kind::Primary], side);
            let prepared = &prepared[0].rays;
            assert_eq!((rays.len(), prepared.len()), (side * side, side * side));
            for ray in prepared {
                let close = |other: &&Ray| (other.direction - ray.direction).length() < 1e-6;
                assert_eq!(rays.iter().filter(close).count(), 1, "{name}: one for each pixel");
                assert!((rays[0].origin - ray.origin).length() < 1e-5 * ray.origin.length());
            }
            let hits = rays.iter().filter(|ray| bvh.closest(ray).is_some()).count() as u64;
            assert!(hits > 0);
            for width in WIDTHS {
                assert_eq!(pixels.pass(&bvh, width), hits, "{name}");
            }
        }
    }
}
