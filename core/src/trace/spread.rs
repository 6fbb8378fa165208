//! How far rays that are rounded in objects may be from where they are in the world.
//!
//! Boxes of placed triangles are exact in the world. Those of placed shapes are not, since these are met by a ray that
//! is rounded to f32 in the object ([`Placement::object_ray`]): it strays by |M| times what it strays in the object,
//! with |o'| at most
//! |B| (|o| + |T|), M and T being the transform and B its inverse. The largest of that over all placements is linear in |o|: a matrix
//! and a vector, found when the scene is built.

use super::Placement;
use super::motion::Extremes;
use crate::math::{Aabb, DMat3, DVec3, UNIT_ROUNDOFF, gamma64};
use crate::ray::Ray;

/// How much of the coordinates a hit of a shape may lie beside where the ray is: 2^-24 for the rounding of the ray, and
/// as much again for hits at rims, which may lie 2^-26 of their t beside the shape; twice that.
pub(super) const SHAPE_ERROR: f64 = 4.0 * UNIT_ROUNDOFF as f64;

/// The largest row sum of |B M - 1|, doubled, rounding and all; huge where the inverse is worth nothing.
pub(super) fn residual(placement: &Placement) -> f64 {
    let (forward, inverse) = (placement.to_world.as_daffine3().matrix3, placement.to_object.matrix3);
    let residual = (inverse * forward + DMat3::IDENTITY * -1.0).abs();
    let rounding = inverse.abs() * forward.abs() * gamma64(8);
    let rows = (residual + rounding) * DVec3::ONE;
    let residual = 2.0 * rows.max_element();
    // The bound holds for |R| up to a half. Beyond, everything is let pass.
    if residual <= 1.0 { residual } else { 1e30 }
}

/// That distance, by the origin of a ray.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    of_origin: DMat3,
    constant: DVec3,
}

impl Spread {
    pub const NONE: Self = Self { of_origin: DMat3::ZERO, constant: DVec3::ZERO };

    /// With another object, which holds shapes within `bounds`.
    pub fn include(self, placement: &Placement, bounds: &Aabb) -> Self {
        let Extremes { forward, inverse, translation, residual: moved } = placement.extremes();
        let residual = if moved <= 1.0 { moved.max(residual(placement)) } else { 1e30 };
        let reach = bounds.min.abs().max(bounds.max.abs()).as_dvec3();
        let ones = DMat3::from_cols(DVec3::ONE, DVec3::ONE, DVec3::ONE);
        // From the size of coordinates in the object to the error in the world. Origin and direction are rounded each,
        // the latter for as long as the shape is away: at most the origin and the shape are together.
        let error = forward * (DMat3::IDENTITY * (4.0 * SHAPE_ERROR) + ones * (2.0 * residual));
        let matrix = error * inverse;
        let constant = matrix * translation + error * reach;
        let column = |i: usize| self.of_origin.col(i).max(matrix.col(i));
        Self { of_origin: DMat3::from_cols(column(0), column(1), column(2)), constant: self.constant.max(constant) }
    }

    /// For one ray.
    pub fn of(&self, ray: &Ray) -> DVec3 {
        self.of_origin * ray.origin.abs().as_dvec3() + self.constant
    }
}
