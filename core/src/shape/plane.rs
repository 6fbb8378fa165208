//! A plane, which has no bounds.

use super::flat::Flat;
use super::line::{Line, Roots};
use super::{InvalidShape, in_f32};
use crate::math::{DVec2, DVec3, Vec3, is_traceable, tangents};
use crate::ray::Ray;

/// An unbounded plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// One of its points.
    pub point: Vec3,
    /// The side that it faces; of any length but 0.
    pub normal: Vec3,
}

impl Plane {
    /// The plane through `point` across `normal`.
    ///
    /// # Errors
    /// For a normal that is zero, and for what is not finite.
    pub fn new(point: Vec3, normal: Vec3) -> Result<Self, InvalidShape> {
        let plane = Self { point, normal };
        plane.check().map(|()| plane)
    }

    pub(super) fn check(&self) -> Result<(), InvalidShape> {
        InvalidShape::unless(is_traceable(self.point), || format!("the point {} is not finite", self.point))?;
        InvalidShape::unless_direction("normal", self.normal)
    }

    pub(super) fn translated(&self, offset: DVec3) -> Self {
        Self { point: in_f32(self.point.as_dvec3() + offset), ..*self }
    }

    #[inline]
    pub(super) fn roots(&self, ray: &Ray) -> Roots {
        let line = Line::new(ray, self.point.abs().max_element());
        [Flat::new(line, self.point, self.normal).t(), None]
    }

    pub(super) fn normal(&self) -> DVec3 {
        self.normal.as_dvec3().normalize()
    }

    /// Coordinates in the plane, in units of length, from the point.
    pub(super) fn uv(&self, at: DVec3) -> DVec2 {
        let from = at - self.point.as_dvec3();
        let [x, y] = tangents(self.normal());
        DVec2::new(from.dot(x), from.dot(y))
    }
}
