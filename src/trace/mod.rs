//! Two questions, closest hit and occluded, answered by engines that know nothing of each other.
//!
//! A tracer is built from a [`World`] and answers [`Hit`]s. Every engine obeys the same conventions: a hit counts for
//! `tmin <= t <= tmax`; at equal t the lowest (instance, geometry, primitive) wins; a ray that
//! [is not valid](Ray::is_valid) misses.

pub mod accel;
pub mod brute;
pub mod bvh;
mod crossings;
#[cfg(feature = "embree")]
pub mod embree;
mod leaf;
mod limits;
mod motion;
mod nearest;
pub mod precise;
mod spread;
mod unbounded;
mod world;

pub use motion::Motion;
pub use world::{Part, Placement, Primitives, World};

use crate::ray::{Hit, Ray};

/// An engine that finds where rays meet a scene.
///
/// The two required methods define the answer; the batch methods give the same answers for many rays at a time, and
/// an engine overrides them where it has something faster.
pub trait Tracer: Sync {
    /// The nearest hit.
    fn closest(&self, ray: &Ray) -> Option<Hit>;

    /// Whether there is any hit.
    fn occluded(&self, ray: &Ray) -> bool;

    /// The nearest hit of each ray, into `hits` of the same length.
    fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>], _batch: Batch) {
        assert_eq!(rays.len(), hits.len(), "one hit a ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.closest(ray);
        }
    }

    /// Whether each ray has any hit, into `occluded` of the same length.
    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool], _batch: Batch) {
        assert_eq!(rays.len(), occluded.len(), "one answer a ray");
        for (ray, answer) in rays.iter().zip(occluded) {
            *answer = self.occluded(ray);
        }
    }
}

/// How a batch is traced. It changes the speed, never a native answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Batch {
    /// Rays of a packet, for engines that trace packets; the native tracer goes ray by ray, or by bundles where
    /// `coherent` promises some.
    pub width: Width,
    /// Whether neighbours in the batch start and point alike.
    pub coherent: bool,
}

/// Rays in a packet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Width {
    /// Ray by ray.
    #[default]
    One,
    /// Packets of 4.
    Four,
    /// Packets of 8.
    Eight,
    /// Packets of 16.
    Sixteen,
}

impl Width {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::One, Self::Four, Self::Eight, Self::Sixteen];

    /// How many rays.
    pub const fn rays(self) -> usize {
        match self {
            Self::One => 1,
            Self::Four => 4,
            Self::Eight => 8,
            Self::Sixteen => 16,
        }
    }
}
