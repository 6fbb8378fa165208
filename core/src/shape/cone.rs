//! A cone between two points with a radius each, open or capped: a whole cone where one of the radii is 0.
//!
//! With the axis a = q - p, f from p to the ray's origin, k = r1 - r0 and g = r0 a^2 + k f . a: a point is on the
//! (double) cone where a^2 |f x a|^2 = g^2. The discriminant is a^4 (a^2 w^2 - (a^2 + k^2)(a . m)^2) with m = f x d and
//! w = d x (r0 a + k f), which follows from Lagrange's identity. It cancels only where the line touches the cone, and
//! no point is squared that lies farther away than it must.

use super::InvalidShape;
use super::axis::Frustum;
use super::line::{Line, Roots};
use crate::math::number::{Formula, Number, cross, dot, minus, plus, times, vector};
use crate::math::{DVec3, Vec3};
use crate::ray::Ray;

/// A cone, or a part of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// The middle of one end.
    pub base: Vec3,
    /// The radius there, at least 0.
    pub base_radius: f32,
    /// The middle of the other end.
    pub apex: Vec3,
    /// The radius there, at least 0; not both are 0.
    pub apex_radius: f32,
    /// Whether disks close the ends.
    pub capped: bool,
}

impl Cone {
    /// The cone from `base` with `base_radius` to `apex` with `apex_radius`; a cylinder where they are equal.
    ///
    /// # Errors
    /// For ends that are one point, a radius below 0 or two of 0, and for what is not finite.
    pub fn new(base: Vec3, base_radius: f32, apex: Vec3, apex_radius: f32, capped: bool) -> Result<Self, InvalidShape> {
        let cone = Self { base, base_radius, apex, apex_radius, capped };
        cone.check().map(|()| cone)
    }

    pub(super) fn check(&self) -> Result<(), InvalidShape> {
        self.frustum().check()?;
        let (smaller, larger) = (self.base_radius.min(self.apex_radius), self.base_radius.max(self.apex_radius));
        InvalidShape::unless(smaller >= 0.0, || format!("a radius is {smaller}; it must not be below 0"))?;
        InvalidShape::unless_radius(larger)
    }

    /// What it has in common with other surfaces around an axis.
    pub(super) fn frustum(&self) -> Frustum {
        let radii = [self.base_radius, self.apex_radius];
        Frustum { ends: [self.base, self.apex], radii, capped: self.capped }
    }

    pub(super) fn translated(&self, offset: DVec3) -> Self {
        let [base, apex] = self.frustum().moved_ends(offset);
        Self { base, apex, ..*self }
    }

    #[inline]
    pub(super) fn roots(&self, ray: &Ray) -> Roots {
        let frustum = self.frustum();
        let line = Line::new(ray, frustum.size());
        let seen = Seen {
            base: line.place(self.base),
            apex: line.place(self.apex),
            radii: [line.length(self.base_radius), line.length(self.apex_radius)],
            line,
        };
        frustum.roots(&line, &seen, Widening(&seen).signs()[0] > 0)
    }
}

/// From the ray's line.
struct Seen {
    line: Line,
    base: DVec3,
    apex: DVec3,
    radii: [f64; 2],
}

impl Formula<5> for Seen {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 5] {
        let (d, base) = (vector::<N>(self.line.direction), vector::<N>(self.base));
        let f = minus(&vector(self.line.origin), &base);
        let axis = minus(&vector(self.apex), &base);
        let r0 = N::new(self.radii[0]);
        let k = N::new(self.radii[1]).sub(&r0);
        let aa = dot(&axis, &axis);
        let (g, h) = (r0.mul(&aa).add(&k.mul(&dot(&f, &axis))), k.mul(&dot(&d, &axis)));
        let (f_a, d_a) = (cross(&f, &axis), cross(&d, &axis));
        let a = aa.mul(&dot(&d_a, &d_a)).sub(&h.mul(&h));
        let b = aa.mul(&dot(&f_a, &d_a)).sub(&g.mul(&h));
        let c = aa.mul(&dot(&f_a, &f_a)).sub(&g.mul(&g));
        let w = cross(&d, &plus(&times(&axis, &r0), &times(&f, &k)));
        let moment = dot(&axis, &cross(&f, &d));
        let e = aa.mul(&dot(&w, &w)).sub(&aa.add(&k.mul(&k)).mul(&moment.mul(&moment)));
        [a, b, c, e, aa]
    }
}

/// Above 0 where the line goes towards larger radii.
struct Widening<'a>(&'a Seen);

impl Formula<1> for Widening<'_> {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 1] {
        let Seen { line, base, apex, radii: [r0, r1] } = self.0;
        let axis = minus(&vector::<N>(*apex), &vector(*base));
        [N::new(*r1).sub(&N::new(*r0)).mul(&dot(&vector(line.direction), &axis))]
    }
}

#[cfg(test)]
mod tests {
    use super::super::quadric::tests::assert_discriminants;
    use super::*;

    #[test]
    fn the_short_discriminant_is_the_discriminant() {
        for apex_radius in [0.0, 0.2, 0.3, 1.7] {
            let radii = [0.3, apex_radius];
            assert_discriminants(|line, v| Seen { base: v(0.3), apex: v(0.7), radii, line });
        }
    }
}
