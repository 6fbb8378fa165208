//! How far a hit is, and which of two is nearer, exactly.
//!
//! The t of a hit is an f64 that is off by at most 2^-26 of itself. Two that are farther apart are in order as they
//! are. Of the others, and there are none but where surfaces all but touch, t is a fraction: with p a point of the
//! plane that is hit and n its normal, t = (p - o) . n / d . n for a ray from o along d. Both its parts are sums of
//! products of the numbers that are stored, and are computed without rounding (`Integers`, or [`Expansion`]); so are
//! the products that tell which fraction is the smaller. Triangles of one plane are hit at exactly the same t, whatever
//! the order of their corners; most show it at a glance (`are_coplanar`).
//!
//! To compute t in more digits, the simpler alternative, would never say that two are equal.

use std::cmp::Ordering;

use super::exactly::{Seen, normal};
use super::triangle::{Corners, Placed};
use crate::math::expansion::{Expansion, count_decision};
use crate::math::number::{Vector, dot, minus, vector};
use crate::math::{Affine3, DVec3, Vec3};
use crate::ray::Ray;

/// How far along a ray a hit is.
#[derive(Clone, Copy, Debug)]
pub struct Distance {
    /// In units of the ray's direction, off by at most 2^-26 of itself.
    pub t: f64,
    /// What it is exactly.
    pub support: Support,
}

/// What the t of a hit follows from.
#[derive(Clone, Copy, Debug)]
pub enum Support {
    /// Nothing: t is what it is. So it is of round shapes, of shapes that are placed (where the ray in their
    /// coordinates is rounded already), and of the textbooks' methods.
    Itself,
    /// It is not known here.
    Unknown,
    /// The plane of a triangle in the world.
    Triangle([Vec3; 3]),
    /// The plane of a triangle under the transform that places it.
    Placed([Vec3; 3], Affine3),
    /// A plane in the world, by a point and its normal.
    Plane(DVec3, DVec3),
}

/// How far apart two t may be, relative to the larger, whose order is not that of what they stand for: twice the error
/// of each.
const UNORDERED: f64 = 1.0 / (1 << 25) as f64;

impl Support {
    /// Of a triangle, in the world, where f64 holds them.
    fn corners(&self) -> Option<[DVec3; 3]> {
        match self {
            Self::Triangle(corners) => corners.in_f64(),
            Self::Placed(corners, to_world) => Placed { corners: *corners, to_world }.in_f64(),
            Self::Itself | Self::Unknown | Self::Plane(..) => None,
        }
    }
}

impl Distance {
    /// One that is known to be in order with every other.
    pub const fn itself(t: f64) -> Self {
        Self { t, support: Support::Itself }
    }

    /// Which of two hits of a ray is nearer; None where it is not known from what they follow.
    #[inline]
    pub fn order(&self, other: &Self, ray: &Ray) -> Option<Ordering> {
        let size = self.t.abs().max(other.t.abs());
        if (self.t - other.t).abs() > size * UNORDERED {
            Some(self.t.total_cmp(&other.t))
        } else {
            self.order_exactly(other, ray)
        }
    }

    #[cold]
    #[inline(never)]
    fn order_exactly(&self, other: &Self, ray: &Ray) -> Option<Ordering> {
        use Support::{Itself, Unknown};
        match (&self.support, &other.support) {
            (Unknown, _) | (_, Unknown) => None,
            // Infinite where a scale is beyond f64: no fraction, and no other hit to be told from.
            (Itself, Itself) => Some(self.t.total_cmp(&other.t)),
            _ if !(self.t.is_finite() && other.t.is_finite()) => Some(self.t.total_cmp(&other.t)),
            (Support::Triangle(one), Support::Triangle(other)) if are_coplanar(one, other) => Some(Ordering::Equal),
            (Support::Placed(one, way), Support::Placed(other, other_way))
                if way == other_way && are_coplanar(one, other) =>
            {
                Some(Ordering::Equal)
            }
            _ => {
                count_decision();
                let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
                let corners = [self.support.corners(), other.support.corners()];
                if let Some(seen) = Seen::in_integers(origin, direction, corners) {
                    return Some(seen.order());
                }
                let ([a, b], [c, d]) = (self.fraction(ray), other.fraction(ray));
                let difference = (&(&a * &d) - &(&c * &b)).signum();
                Some((difference * b.signum() * d.signum()).cmp(&0))
            }
        }
    }

    /// t, exactly, as a numerator and a denominator that is near 1.
    fn fraction(&self, ray: &Ray) -> [Expansion; 2] {
        let (point, normal) = match self.support {
            Support::Itself | Support::Unknown => return [self.t.into(), 1.0f64.into()],
            Support::Triangle(corners) => plane(corners.exact()),
            Support::Placed(corners, to_world) => plane(Placed { corners, to_world: &to_world }.exact()),
            Support::Plane(point, normal) => (vector(point), vector(normal)),
        };
        let way = minus(&point, &vector(ray.origin.as_dvec3()));
        let (height, slope) = (dot(&way, &normal), dot(&vector(ray.direction.as_dvec3()), &normal));
        // So that products neither overflow nor underflow, whatever the scale.
        let scale = 1.0 / power_of_two(slope.estimate());
        [height.scaled(scale), slope.scaled(scale)]
    }
}

/// Whether two triangles with an area are seen to lie in one plane: by the same three corners, or by one component that
/// all corners share. So nearly all surfaces show it that lie on each other: faces that a file holds twice, turned or
/// not; floors, walls, and what lies on them.
#[inline]
pub(crate) fn are_coplanar(one: &[Vec3; 3], other: &[Vec3; 3]) -> bool {
    let is_same = |axis: usize| one.iter().chain(other).all(|corner| corner[axis] == one[0][axis]);
    one.iter().all(|corner| other.contains(corner)) || (0..3).any(is_same)
}

/// A point and the normal of the plane of three corners.
fn plane(corners: [Vector<Expansion>; 3]) -> (Vector<Expansion>, Vector<Expansion>) {
    let normal = normal(&corners);
    let [point, ..] = corners;
    (point, normal)
}

/// The largest power of two that is not above the magnitude of `x`; 1 for zero and for what has no reciprocal.
fn power_of_two(x: f64) -> f64 {
    let power = f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000);
    if power.is_finite() && (1.0 / power).is_normal() { power } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Mat3;
    use crate::shape::triangle;

    fn of(ray: &Ray, corners: [Vec3; 3]) -> Distance {
        let t = triangle::intersect(ray, &corners).expect("it is hit").t;
        Distance { t, support: Support::Triangle(corners) }
    }

    #[test]
    fn corners_in_any_order_are_as_far() {
        // Of so few digits that the middle of two is f32.
        let [a, b, c] = [Vec3::new(-0.7, -0.4, 0.1), Vec3::new(0.9, -0.3, -0.2), Vec3::new(0.1, 0.8, 0.3)]
            .map(|p| (p * 1_048_576.0).round() / 1_048_576.0);
        let (mut differ, mut halves) = (0, 0);
        for i in 0..200u8 {
            let from = Vec3::new(f32::from(i) * 0.013, 0.7, 3.1);
            let target = a.lerp(b, f32::from(i % 7) / 9.0).lerp(c, f32::from(i % 11) / 17.0);
            let ray = Ray::new(from, target - from);
            if triangle::intersect(&ray, &[a, b, c]).is_none() {
                continue;
            }
            let one = of(&ray, [a, b, c]);
            for other in [[b, c, a], [c, a, b], [a, c, b], [c, b, a], [b, a, c]] {
                let other = of(&ray, other);
                differ += u32::from(other.t != one.t);
                assert_eq!(one.order(&other, &ray), Some(Ordering::Equal));
            }
            // Half of it, which does not show that it lies in the same plane.
            let half = [a.lerp(b, 0.5), b, c];
            if triangle::intersect(&ray, &half).is_some() {
                assert_eq!(of(&ray, half).order(&one, &ray), Some(Ordering::Equal));
                halves += 1;
            }
        }
        assert!(differ > 50 && halves > 20, "f64 alone tells {differ} apart; {halves}");
    }

    /// Squares 2^-40 of the distance apart, in closed form.
    #[test]
    fn what_f64_just_tells_is_in_order_and_so_is_what_it_does_not() {
        for step in [24, 30, 40, 50, 60, 100] {
            let z = libm::scalbnf(1.0, -step);
            let low = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];
            let high = low.map(|p| p.with_z(z));
            let ray = Ray::new(Vec3::new(0.1, 0.2, 1.0), Vec3::new(0.01, -0.02, -1.0));
            let (far, near) = (of(&ray, low), of(&ray, high));
            assert_eq!(near.order(&far, &ray), Some(Ordering::Less), "2^-{step}");
            assert_eq!(far.order(&near, &ray), Some(Ordering::Greater), "2^-{step}");
            let plane = Support::Plane(DVec3::Z * f64::from(z), DVec3::NEG_Z * 3.0);
            assert_eq!(Distance { support: plane, ..near }.order(&near, &ray), Some(Ordering::Equal));
            assert_eq!(Distance { support: Support::Unknown, ..near }.order(&near, &ray), None);
        }
    }

    #[test]
    fn scales_do_not_matter() {
        for scale in [1e-38f32, 1e-20, 1e17] {
            let corners = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p * scale);
            for length in [f32::MIN_POSITIVE, 1.0, f32::MAX] {
                let ray = Ray::new(Vec3::new(0.3, 0.3, 1.0) * scale, Vec3::NEG_Z * length);
                if !(scale / length).is_finite() {
                    continue;
                }
                let one = of(&ray, corners);
                let to_world = Affine3 { matrix3: Mat3::from_diagonal(Vec3::splat(scale)), translation: Vec3::ZERO };
                let placed = Support::Placed([Vec3::Y, Vec3::ZERO, Vec3::X], to_world);
                let other = Distance { t: one.t, support: placed };
                assert_eq!(one.order(&other, &ray), Some(Ordering::Equal), "{scale} {length}");
                let behind = of(&ray, corners.map(|p| p.with_z(-0.5 * scale)));
                assert_eq!(other.order(&behind, &ray), Some(Ordering::Less), "{scale} {length}");
            }
        }
    }

    /// The same corners elsewhere are another plane, and what shares neither corners nor a coordinate is none at a
    /// glance.
    #[test]
    fn what_is_placed_elsewhere_is_not_as_far() {
        let corners = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];
        let ray = Ray::new(Vec3::new(0.1, 0.2, 1.0), Vec3::new(0.01, -0.02, -1.0));
        let at = |z: f32| {
            let to_world = Affine3::from_translation(Vec3::Z * z);
            let t = triangle::intersect(&ray, &Placed { corners, to_world: &to_world }).expect("hit").t;
            Distance { t, support: Support::Placed(corners, to_world) }
        };
        let (far, near) = (at(0.0), at(libm::scalbnf(1.0, -30)));
        assert_eq!(near.order(&far, &ray), Some(Ordering::Less));
        assert_eq!(far.order(&near, &ray), Some(Ordering::Greater));
        assert_eq!(far.order(&at(-0.0), &ray), Some(Ordering::Equal));
        let [a, b, c] = corners;
        assert!(are_coplanar(&corners, &[b, c, a]) && are_coplanar(&corners, &[a * 2.0, c * 3.0, b]));
        assert!(
            !are_coplanar(&[a, b, Vec3::Z], &[a, b, Vec3::ONE])
                && !are_coplanar(&corners, &corners.map(|p| p.with_z(1.0)))
        );
        assert!(!are_coplanar(&corners, &corners.map(|p| p.with_z(f32::NAN))));
    }
}
