//! A sphere.

use super::line::{Line, NO_ROOTS, Roots};
use super::quadric::{Inside, Quadric};
use super::round::{outwards, spherical};
use super::{InvalidShape, in_f32};
use crate::math::number::{Bounded, Formula, Number, cross, dot, exactly, minus, vector};
use crate::math::{Aabb, DVec2, DVec3, UNIT_ROUNDOFF_64, Vec3, is_traceable};
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
            Inside::Nothing | Inside::Along | Inside::All | Inside::Beyond(_) => NO_ROOTS,
        }
    }

    pub(super) fn normal(&self, point: DVec3) -> DVec3 {
        (point - self.centre.as_dvec3()).normalize_or(DVec3::Y)
    }

    pub(super) fn uv(&self, point: DVec3) -> DVec2 {
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

    /// The bounds by hand, for spheres are many: with u the roundoff, f is off by u |f|, so a product of k factors of
    /// it that are summed up by at most (2 k + 4) u of the sum of magnitudes. All are rounded up to 8 u.
    #[inline]
    fn values(&self, good: impl Fn(&[Bounded; 5]) -> bool) -> [f64; 5] {
        const U: f64 = 8.0 * UNIT_ROUNDOFF_64;
        let (d, f) = (self.line.direction, self.line.origin - self.centre);
        let (a, rr, ff, m) = (d.length_squared(), self.radius * self.radius, f.length_squared(), f.cross(d));
        let (x, y) = (d.abs(), f.abs());
        // The vector product with every sign a plus.
        let p = DVec3::new(y.y * x.z + y.z * x.y, y.z * x.x + y.x * x.z, y.x * x.y + y.y * x.x);
        let (mm, ra) = (m.length_squared(), rr * a);
        // The square of m + U p.
        let mm_error = U * (mm + 2.0 * m.abs().dot(p) + U * p.length_squared());
        let bounded = |value: f64, error: f64| Bounded { value, error };
        let values = [
            bounded(a, U * a),
            bounded(f.dot(d), U * y.dot(x)),
            bounded(ff - rr, U * (ff + rr)),
            bounded(ra - mm, mm_error + U * ra),
            Bounded::new(1.0),
        ];
        if good(&values) { values.map(|x| x.value) } else { exactly(self) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::quadric::tests::assert_discriminants;
    use super::*;

    #[test]
    fn the_short_discriminant_is_the_discriminant() {
        assert_discriminants(|line, v| Seen { centre: v(0.3), radius: 0.7, line });
    }

    #[test]
    fn the_bounds_by_hand_cover_the_errors() {
        use crate::math::Random;
        use crate::math::expansion::Expansion;
        use crate::math::number::Ring;
        for case in 0..5000 {
            let mut random = Random::new(1, case);
            let sphere = Sphere { centre: random.vector() * 9.0, radius: random.unit() };
            let origin = random.vector() * 10f32.powi(random.below(6) as i32);
            let ray = Ray::new(origin, sphere.centre + random.direction() * sphere.radius - origin);
            let line = Line::new(&ray, 9.0);
            let seen = Seen { line, centre: line.place(sphere.centre), radius: line.length(sphere.radius) };
            let exact = seen.evaluate::<Expansion>();
            seen.values(|values| {
                for (value, exact) in values.iter().zip(&exact) {
                    let error = exact.sub(&Expansion::new(value.value)).estimate().abs();
                    assert!(error <= value.error, "{value:?} {error} {ray:?}");
                }
                true
            });
        }
    }
}
