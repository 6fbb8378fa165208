//! A sphere.

use super::line::{Line, NO_ROOTS, Roots};
use super::quadric::{Inside, Quadric};
use super::round::{outwards, spherical};
use super::{InvalidShape, in_f32};
use crate::math::number::{Formula, Number, cross, dot, minus, vector};
use crate::math::{Aabb, DVec3, Vec2, Vec3, is_traceable};
use crate::ray::Ray;

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// The middle.
    pub centre: Vec3,
    /// The radius; a sphere whose radius is not above 0 cannot be hit.
    pub radius: f32,
}

impl Sphere {
    pub(super) fn check(&self) -> Result<(), InvalidShape> {
        InvalidShape::unless(is_traceable(self.centre), || format!("the centre {} is not finite", self.centre))?;
        InvalidShape::unless_radius(self.radius)
    }

    pub(super) fn bounds(&self) -> Aabb {
        outwards(self.centre.as_dvec3(), DVec3::splat(self.radius.into()))
    }

    pub(super) fn translated(&self, offset: DVec3) -> Self {
        Self { centre: in_f32(self.centre.as_dvec3() + offset), ..*self }
    }

    #[inline]
    pub(super) fn roots(&self, ray: &Ray) -> Roots {
        let line = Line::new(ray, self.centre.abs().max_element().max(self.radius));
        let seen = Seen { line, centre: line.place(self.centre), radius: line.length(self.radius) };
        match seen.solve() {
            Inside::Between(roots) => roots.ends().map(|t| t.map(|t| line.t(t))),
            Inside::Nothing | Inside::All | Inside::Beyond(_) => NO_ROOTS,
        }
    }

    pub(super) fn normal(&self, point: DVec3) -> DVec3 {
        (point - self.centre.as_dvec3()).normalize_or(DVec3::Y)
    }

    pub(super) fn uv(&self, point: DVec3) -> Vec2 {
        spherical(self.normal(point))
    }
}

/// From the ray's line. The short discriminant is r^2 d^2 - |f x d|^2, with f from the centre to the ray's origin.
struct Seen {
    line: Line,
    centre: DVec3,
    radius: f64,
}

impl Formula<5> for Seen {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 5] {
        let d = vector::<N>(self.line.direction);
        let f = minus(&vector::<N>(self.line.origin), &vector(self.centre));
        let r = N::new(self.radius);
        let (a, rr, m) = (dot(&d, &d), r.mul(&r), cross(&f, &d));
        let (b, c, e) = (dot(&f, &d), dot(&f, &f).sub(&rr), rr.mul(&a).sub(&dot(&m, &m)));
        [a, b, c, e, N::new(1.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::quadric::tests::assert_discriminant;
    use super::*;

    #[test]
    fn the_short_discriminant_is_the_discriminant() {
        let sphere = Sphere { centre: Vec3::new(1.3, -7.1, 0.2), radius: 0.7 };
        for i in 0..50 {
            let x = i as f32;
            let ray = Ray::new(Vec3::new(x.sin(), x, 3.0), Vec3::new(0.1, x.cos(), 1.7));
            let line = Line::new(&ray, 8.0);
            assert_discriminant(&Seen { line, centre: line.place(sphere.centre), radius: line.length(0.7) });
        }
    }
}
