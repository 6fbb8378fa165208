//! Two questions, closest hit and occluded, answered by engines that know nothing of each other.
//!
//! A [`Tracer`] is built from a [`World`] and answers [`Hit`](crate::Hit)s. Those of our own, the [`bvh`] and what it
//! is compared with, are the core's; Embree is here.

#[cfg(feature = "embree")]
pub mod embree;

#[doc(inline)]
pub use twincast_core::trace::{
    Batch, Motion, Part, Placement, Primitives, Tracer, Width, World, accel, brute, bvh, precise,
};
#[cfg(feature = "embree")]
use twincast_core::trace::{nearest, unbounded};
