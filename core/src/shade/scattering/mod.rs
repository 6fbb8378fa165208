//! What a surface does with light: a sum of lobes, read alike by every integrator.
//!
//! [`Shading`] is what has a value for every direction and costs nothing more: emission, Lambert's lobe, the highlight.
//! [`Ways`] are the mirrored and the refracted direction, each with its share. [`Lobes`] joins the two for integrators that choose among
//! them. A caster of rays stops at the first, Whitted's recursion takes the first two, the path tracer all three.
//!
//! Values are pi f cos: the share of the light from a direction that goes to the viewer, where a white matte surface
//! that faces the light has 1. Lights come in that unit, and the classic highlight, which has no cosine, has no other.

mod fresnel;
mod highlight;
mod lobes;
mod shading;
mod warp;
mod ways;

pub use lobes::{Lobes, Scattered, Value};
pub use shading::Shading;
pub use ways::{Way, Ways};
