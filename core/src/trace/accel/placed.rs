//! How far a ray strays from where it should be in an object's coordinates.
//!
//! **In an object.** The object's index is asked with the ray M^-1 (o, d), computed in f64. With B the inverse that a
//! [`Placement`] holds and R = B M - 1, what should be is (1 + R)^-1 B (o, d); so a vector B v is off by at most 2 |R|
//! |B v|, and its own computation by gamma(8) |B| |v| more, translation and all. R is computed when the scene is built
//! ([`residual`]).
//!
//! **Shapes** are met by the ray rounded to f32 ([`Placement::object_ray`]), and a hit at a rim may lie 2^-26 of its t
//! beside the shape: 2^-24 of the coordinates for the rounding, as much again for the rims.
//!
//! At t the ray is off by the sum of origin's error and t times the direction's; and where it is in the object's box,
//! |t| is at most (reach +
//! |origin|) / |direction| on the axis where the direction is largest.

use std::borrow::Cow;

use super::items::reach;
use super::ray::IndexRay;
use crate::math::{Aabb, DVec3, UNIT_ROUNDOFF, gamma64};
use crate::ray::Ray;
use crate::trace::Placement;
use crate::trace::spread::{SHAPE_ERROR, residual};

/// How far hits of shapes lie beside a ray that is not rounded, in coordinates of at most `reach`.
pub(super) fn stray_of_shapes(ray: &Ray, reach: DVec3) -> DVec3 {
    SHAPE_ERROR * (ray.origin.abs().as_dvec3() + reach)
}

/// A placement, and how good its inverse is.
#[derive(Clone)]
pub(super) struct Placed {
    pub placement: Placement,
    /// As [`residual`] says.
    residual: f64,
}

impl Placed {
    pub fn new(placement: &Placement) -> Self {
        Self { placement: placement.clone(), residual: residual(placement) }
    }

    /// Where it stands at a time.
    pub fn at(&self, time: f32) -> Cow<'_, Self> {
        match self.placement.motion {
            None => Cow::Borrowed(self),
            Some(_) => Cow::Owned(Self::new(&self.placement.at(time))),
        }
    }

    /// The ray in the object's coordinates, made ready for its index.
    pub fn index_ray(&self, ray: &Ray, bounds: &Aabb, has_shapes: bool) -> IndexRay {
        let (to_object, reach) = (&self.placement.to_object, reach(bounds));
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (origin, direction) = (to_object.transform_point3(o), to_object.transform_vector3(d));
        let magnitudes = to_object.matrix3.abs();
        let towards = (magnitudes * self.placement.to_world.translation.as_dvec3().abs()) + to_object.translation.abs();
        let mut origin_error = DVec3::splat(self.residual * (origin.abs().element_sum() + towards.element_sum()))
            + gamma64(8) * (magnitudes * o.abs() + towards);
        let mut direction_error =
            DVec3::splat(self.residual * direction.abs().element_sum()) + gamma64(8) * (magnitudes * d.abs());
        let span = reach + origin.abs();
        let mut stray = DVec3::ZERO;
        if has_shapes {
            let rounding = |v: DVec3| f64::from(UNIT_ROUNDOFF) * v.abs() + f64::from(f32::from_bits(1));
            origin_error += rounding(origin);
            direction_error += rounding(direction);
            stray = SHAPE_ERROR * span;
        }
        let longest = 2.0 * span.max_element() / direction.abs().max_element();
        stray += 2.0 * (origin_error + direction_error * longest);
        IndexRay::new(origin, direction, ray.tmin, reach, stray)
    }
}
