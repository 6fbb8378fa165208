//! The part of Twincast that no feature changes: scenes as data, the native tracer, shading, and the plan of a render.
//!
//! A crate by itself so that it is compiled once, whichever of Embree, OpenImageIO and Open Image Denoise a build has.
//! The crate `twincast` has all of it under its own names, and is what programs use.
#![deny(unsafe_code)]
#![warn(missing_docs)]

#[doc(hidden)]
pub mod error;
pub mod image;
pub mod math;
#[doc(hidden)]
pub mod memory;
#[doc(hidden)]
pub mod once;
#[doc(hidden)]
pub mod output;
pub mod plan;
#[doc(hidden)]
pub mod ray;
pub mod scene;
pub mod shade;
#[doc(hidden)]
pub mod shape;
pub mod trace;

pub use error::{Error, Result, Warning};
pub use image::Image;
pub use ray::{Hit, Ray};
pub use scene::Scene;
pub use shape::triangle::TriangleHit;
pub use shape::{
    Cone, Cuboid, Cylinder, Disk, Ellipsoid, InvalidShape, Plane, Polygon, Shape, ShapeHit, Sphere, SphereMethod,
    TriangleMethod,
};
pub use trace::{Batch, Tracer, Width, World};
