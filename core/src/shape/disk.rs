//! A disk: the part of a plane within a circle.
//!
//! With m = f x d, where f leads from the centre to the ray's origin, (n . d)(x - c) = n x m for the point x where the
//! line meets the plane. So the line passes within the circle, its edge included, when |n x m|^2 <= r^2 (n . d)^2: a
//! sign that is decided exactly.

use super::flat::Flat;
use super::line::{Line, NO_ROOTS, Roots};
use super::round::{disk_reach, outwards, turn};
use super::{InvalidShape, in_f32};
use crate::math::number::{Formula, Number, cross, dot, minus, vector};
use crate::math::{Aabb, DVec2, DVec3, Vec3, is_traceable, tangents};
use crate::ray::Ray;

/// A disk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    /// The middle.
    pub centre: Vec3,
    /// The side that it faces; of any length but 0.
    pub normal: Vec3,
    /// The radius, above 0.
    pub radius: f32,
}

impl Disk {
    /// The disk of `radius` around `centre`, across `normal`.
    ///
    /// # Errors
    /// For a normal that is zero, a radius that is not above 0, and for what is not finite.
    pub fn new(centre: Vec3, normal: Vec3, radius: f32) -> Result<Self, InvalidShape> {
        let disk = Self { centre, normal, radius };
        disk.check().map(|()| disk)
    }

    pub(super) fn check(&self) -> Result<(), InvalidShape> {
        InvalidShape::unless(is_traceable(self.centre), || format!("the centre {} is not finite", self.centre))?;
        InvalidShape::unless_direction("normal", self.normal)?;
        InvalidShape::unless_radius(self.radius)
    }

    pub(super) fn bounds(&self) -> Aabb {
        outwards(self.centre.as_dvec3(), disk_reach(self.normal.as_dvec3(), self.radius.into()))
    }

    pub(super) fn translated(&self, offset: DVec3) -> Self {
        Self { centre: in_f32(self.centre.as_dvec3() + offset), ..*self }
    }

    #[inline]
    pub(super) fn roots(&self, ray: &Ray) -> Roots {
        let line = Line::new(ray, self.centre.abs().max_element().max(self.radius));
        let flat = Flat::new(line, self.centre, self.normal);
        let circle = Circle { radius: line.length(self.radius), flat };
        if circle.signs()[0] > 0 { NO_ROOTS } else { [circle.flat.t(), None] }
    }

    pub(super) fn normal(&self) -> DVec3 {
        self.normal.as_dvec3().normalize()
    }

    /// The angle over [0, 1], clockwise as seen from outside, and the distance from the centre in radii.
    pub(super) fn uv(&self, at: DVec3) -> DVec2 {
        let from = at - self.centre.as_dvec3();
        let [x, y] = tangents(self.normal());
        DVec2::new(turn(-from.dot(y), from.dot(x)), from.length() / f64::from(self.radius))
    }
}

/// Above 0 where the line passes outside.
struct Circle {
    flat: Flat,
    radius: f64,
}

impl Formula<1> for Circle {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 1] {
        let (n, d) = (vector::<N>(self.flat.normal), vector::<N>(self.flat.line.direction));
        let f = minus(&vector(self.flat.line.origin), &vector(self.flat.point));
        let x = cross(&n, &cross(&f, &d));
        let r = N::new(self.radius).mul(&dot(&n, &d));
        [dot(&x, &x).sub(&r.mul(&r))]
    }
}
