//! Counting rays.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::ray::{Hit, Ray};
use crate::trace::{Batch, Tracer};

/// A tracer that passes everything on and counts it; a batch costs one atomic addition.
pub struct Counted<'a, T: ?Sized> {
    tracer: &'a T,
    closest: AtomicU64,
    occluded: AtomicU64,
}

impl<'a, T: ?Sized> Counted<'a, T> {
    /// Counts from zero.
    pub const fn new(tracer: &'a T) -> Self {
        Self { tracer, closest: AtomicU64::new(0), occluded: AtomicU64::new(0) }
    }

    /// Rays whose nearest hit was asked for so far: camera rays, mirrored and refracted ones.
    pub fn closest_rays(&self) -> u64 {
        self.closest.load(Ordering::Relaxed)
    }

    /// Rays that were asked whether anything is in their way: shadow rays.
    pub fn occluded_rays(&self) -> u64 {
        self.occluded.load(Ordering::Relaxed)
    }
}

impl<T: Tracer + ?Sized> Tracer for Counted<'_, T> {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.closest.fetch_add(1, Ordering::Relaxed);
        self.tracer.closest(ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.occluded.fetch_add(1, Ordering::Relaxed);
        self.tracer.occluded(ray)
    }

    fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>], batch: Batch) {
        self.closest.fetch_add(rays.len() as u64, Ordering::Relaxed);
        self.tracer.closest_batch(rays, hits, batch);
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool], batch: Batch) {
        self.occluded.fetch_add(rays.len() as u64, Ordering::Relaxed);
        self.tracer.occluded_batch(rays, occluded, batch);
    }
}
