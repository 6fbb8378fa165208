//! From hits to radiance: what stands at a hit, how much light reaches it, how much of it is sent to the viewer.
//!
//! [`surface`] is the only place that knows what a [`Hit`](crate::Hit) means geometrically; [`light`] and
//! [`scattering`] see a [`SurfacePoint`] and never a primitive. Shading is f32 arithmetic without fused operations, and
//! sines and powers come from libm, so that a picture is the same with every C library.

pub mod appearance;
mod area;
mod bodies;
pub mod coverage;
mod ellipse;
mod emitters;
mod environment;
pub mod fog;
pub mod light;
pub mod lights;
pub mod normal_map;
mod rectangle;
pub mod scattering;
pub mod surface;
pub mod texture;

pub use environment::EnvironmentLight;
pub use surface::{Attributes, SurfacePoint};
