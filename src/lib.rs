//! Twincast casts rays with two engines that know nothing of each other: Intel's Embree, and a native BVH.
//!
//! Data flows one way: [`io`] reads a file into a [`Scene`], [`World`] makes it ready for tracing, a
//! [`Tracer`] answers [`Hit`]s, [`Renderer`] turns them into an [`Image`].
#![deny(unsafe_code)]
#![warn(missing_docs)]

#[doc(hidden)]
pub mod cli;
mod error;
pub mod image;
pub mod io;
pub mod lab;
pub mod math;
pub mod output;
pub mod plan;
mod ray;
pub mod render;
pub mod scene;
pub mod shade;
mod shape;
pub mod trace;

pub use error::{Error, Result, Warning};
pub use image::Image;
pub use ray::{Hit, Ray};
pub use render::{Renderer, Settings};
pub use scene::Scene;
pub use shape::{Shape, ShapeHit, Sphere};
pub use trace::{Backend, Batch, Tracer, Width, World};
