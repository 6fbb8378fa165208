//! What a surface does with light: a sum of lobes, read alike by every integrator.
//!
//! [`Shading`] is what has a value for every direction and costs nothing more: emission, Lambert's lobe, the highlight.
//! [`SpecularDirections`] are the mirrored and the refracted direction, each with its share. [`Bsdf`] joins the two for
//! integrators that choose among them. A caster of rays stops at the first, Whitted's recursion takes the first two,
//! the path tracer all three.
//!
//! Values are pi f cos: the share of the light from a direction that goes to the viewer, where a white matte surface
//! that faces the light has 1. Lights come in that unit, and the classic highlight, which has no cosine, has no other.

mod bsdf;
mod fresnel;
mod highlight;
mod shading;
mod specular;
mod warp;

pub use bsdf::{Bsdf, BsdfSample, BsdfValue};
pub use shading::Shading;
pub use specular::{SpecularDirection, SpecularDirections};
