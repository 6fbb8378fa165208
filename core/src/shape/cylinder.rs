//! A cylinder between two points, open or capped.
//!
//! With the axis a = q - p, f from p to the ray's origin o, and m = f x d: a point x is on the surface where
//! |(x - p) x a|^2 = r^2 a^2. The discriminant is a^2 (r^2 |d x a|^2 - (a . m)^2): whether the line passes the axis at a
//! distance below r.

use super::InvalidShape;
use super::axis::Frustum;
use super::line::{Line, Roots};
use crate::math::number::{Formula, Number, cross, dot, minus, vector};
use crate::math::{DVec3, Vec3};
use crate::ray::Ray;

/// A cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// The middle of one end.
    pub base: Vec3,
    /// The middle of the other.
    pub apex: Vec3,
    /// The radius, above 0.
    pub radius: f32,
    /// Whether disks close the ends.
    pub capped: bool,
}

impl Cylinder {
    /// The cylinder of `radius` from `base` to `apex`.
    ///
    /// # Errors
    /// For ends that are one point, a radius that is not above 0, and for what is not finite.
    pub fn new(base: Vec3, apex: Vec3, radius: f32, capped: bool) -> Result<Self, InvalidShape> {
        let cylinder = Self { base, apex, radius, capped };
        cylinder.check().map(|()| cylinder)
    }

    pub(super) fn check(&self) -> Result<(), InvalidShape> {
        self.frustum().check()?;
        InvalidShape::unless_radius(self.radius)
    }

    /// What it has in common with other surfaces around an axis.
    pub(super) fn frustum(&self) -> Frustum {
        Frustum { ends: [self.base, self.apex], radii: [self.radius; 2], capped: self.capped }
    }

    pub(super) fn translated(&self, offset: DVec3) -> Self {
        let [base, apex] = self.frustum().moved_ends(offset);
        Self { base, apex, ..*self }
    }

    #[inline]
    pub(super) fn roots(&self, ray: &Ray) -> Roots {
        let frustum = self.frustum();
        let line = Line::new(ray, frustum.size());
        let seen =
            Seen { base: line.place(self.base), apex: line.place(self.apex), radius: line.length(self.radius), line };
        frustum.roots(&line, &seen, false)
    }
}

/// From the ray's line.
struct Seen {
    line: Line,
    base: DVec3,
    apex: DVec3,
    radius: f64,
}

impl Formula<5> for Seen {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 5] {
        let (d, base) = (vector::<N>(self.line.direction), vector::<N>(self.base));
        let f = minus(&vector(self.line.origin), &base);
        let axis = minus(&vector(self.apex), &base);
        let (f_a, d_a) = (cross(&f, &axis), cross(&d, &axis));
        let (aa, a, r) = (dot(&axis, &axis), dot(&d_a, &d_a), N::new(self.radius));
        let (rr, moment) = (r.mul(&r), dot(&axis, &cross(&f, &d)));
        let e = aa.mul(&rr.mul(&a).sub(&moment.mul(&moment)));
        let (b, c) = (dot(&f_a, &d_a), dot(&f_a, &f_a).sub(&rr.mul(&aa)));
        [a, b, c, e, N::new(1.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::quadric::tests::assert_discriminants;
    use super::*;

    #[test]
    fn the_short_discriminant_is_the_discriminant() {
        assert_discriminants(|line, v| Seen { base: v(0.3), apex: v(0.7), radius: 0.3, line });
    }
}
