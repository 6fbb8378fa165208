//! Two questions, closest hit and occluded, answered by engines that know nothing of each other.
//!
//! A tracer is built from a [`World`] and answers [`Hit`](crate::Hit)s. Every engine obeys the same conventions: a hit counts for
//! `tmin <= t <= tmax`; at equal t the lowest (instance, geometry, primitive) wins; a ray that
//! [is not valid](crate::Ray::is_valid) misses.

#[cfg(feature = "embree")]
pub mod embree;

#[doc(inline)]
pub use twincast_core::trace::{
    Batch, Motion, Part, Placement, Primitives, Tracer, Width, World, accel, brute, bvh, precise,
};
