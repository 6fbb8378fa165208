//! Triangles as a ray's line sees them, without rounding: in integers where their digits allow ([`Integers`]), else in
//! expansions. Which of two is nearer is told here in integers alone; what has no room there is for
//! [`super::distance`].

use std::cmp::Ordering;

use super::triangle::{Corners, TriangleHit};
use crate::math::DVec3;
use crate::math::expansion::Expansion;
use crate::math::integers::Integers;
use crate::math::number::{Ring, Vector, cross, dot, minus, vector};

/// Numbers without rounding.
pub(super) trait Exact: Ring {
    /// -1, 0 or 1.
    fn sign(&self) -> i32;
    /// The quotient, off by three roundings at most.
    fn over(&self, other: &Self) -> f64;
}

impl Exact for Expansion {
    fn sign(&self) -> i32 {
        self.signum()
    }
    fn over(&self, other: &Self) -> f64 {
        self.estimate() / other.estimate()
    }
}

impl Exact for i128 {
    fn sign(&self) -> i32 {
        self.signum() as i32
    }
    fn over(&self, other: &Self) -> f64 {
        *self as f64 / *other as f64
    }
}

/// K triangles, and a line.
pub(super) struct Seen<N, const K: usize> {
    direction: Vector<N>,
    /// Corners, relative to where the line starts.
    triangles: [[Vector<N>; 3]; K],
    /// t is meant to be multiplied by 2 to this power.
    exponent: i32,
}

impl<const K: usize> Seen<i128, K> {
    /// In integers, if corners are f64 and integers suffice.
    #[inline]
    pub fn in_integers(origin: DVec3, direction: DVec3, triangles: [Option<[DVec3; 3]>; K]) -> Option<Self> {
        let mut corners = [[DVec3::ZERO; 3]; K];
        for (to, triangle) in corners.iter_mut().zip(triangles) {
            *to = triangle?;
        }
        let Integers { direction, points, exponent } = Integers::new(origin, direction, &corners)?;
        let wide = |v: Vector<i64>| v.map(i128::from);
        Some(Self { direction: wide(direction), triangles: points.map(|corners| corners.map(wide)), exponent })
    }
}

impl Seen<Expansion, 1> {
    /// In expansions.
    pub fn in_expansions(origin: DVec3, direction: DVec3, triangle: &impl Corners) -> Self {
        let origin = vector(origin);
        let corners = triangle.exact().map(|corner| minus(&corner, &origin));
        Self { direction: vector(direction), triangles: [corners], exponent: 0 }
    }
}

impl<N: Exact> Seen<N, 1> {
    /// Where the line meets the triangle, at any t.
    #[inline]
    pub fn hit(&self) -> Option<TriangleHit> {
        let (d, [[a, b, c]]) = (&self.direction, &self.triangles);
        let bc = cross(b, c);
        let volumes = [dot(d, &bc), dot(d, &cross(c, a)), dot(d, &cross(a, b))];
        let signs = [volumes[0].sign(), volumes[1].sign(), volumes[2].sign()];
        if signs.contains(&1) == signs.contains(&-1) {
            // Outside, or all three zero: no area seen from the ray.
            return None;
        }
        let slope = volumes[0].add(&volumes[1]).add(&volumes[2]);
        let t = libm::scalbn(dot(a, &bc).over(&slope), self.exponent);
        Some(TriangleHit { t, u: volumes[1].over(&slope), v: volumes[2].over(&slope) })
    }

    /// The signs of the volumes, and what they are after the move that [`super::crossing`] describes.
    pub fn signs_aside(&self) -> [[i32; 2]; 3] {
        let (d, [corners]) = (&self.direction, &self.triangles);
        [0, 1, 2].map(|k| {
            let (from, to) = (&corners[(k + 1) % 3], &corners[(k + 2) % 3]);
            let sign = dot(d, &cross(from, to)).sign();
            // 0 for an edge along the ray, which hit triangles lack.
            let aside = || cross(d, &minus(to, from)).iter().map(N::sign).find(|&sign| sign != 0).unwrap_or(0);
            [sign, if sign != 0 { sign } else { aside() }]
        })
    }
}

impl Seen<i128, 2> {
    /// Which of both triangles, which it hits, the line meets first.
    #[inline]
    pub fn order(&self) -> Ordering {
        // t is a quotient of these.
        let [(a, b), (c, d)] = self.triangles.each_ref().map(|corners| {
            let normal = normal(corners);
            (dot(&corners[0], &normal), dot(&self.direction, &normal))
        });
        let signs = [a.signum() * b.signum(), c.signum() * d.signum()];
        let product = |x: i128, y: i128| product(x.unsigned_abs(), y.unsigned_abs());
        let sizes = || product(a, d).cmp(&product(c, b));
        signs[0].cmp(&signs[1]).then_with(|| if signs[0] < 0 { sizes().reverse() } else { sizes() })
    }
}

/// The normal of the plane of three corners.
#[inline]
pub(super) fn normal<N: Ring>([a, b, c]: &[Vector<N>; 3]) -> Vector<N> {
    cross(&minus(b, a), &minus(c, a))
}

/// Of 256 bits: the upper half and the lower.
fn product(x: u128, y: u128) -> [u128; 2] {
    let halves = |x: u128| (x >> 64, x & u128::from(u64::MAX));
    let ((x1, x0), (y1, y0)) = (halves(x), halves(y));
    let (low, cross) = (x0 * y0, x1 * y0);
    // Less than 2^128, all of them.
    let middle = x0 * y1 + (cross & u128::from(u64::MAX)) + (low >> 64);
    [x1 * y1 + (cross >> 64) + (middle >> 64), (middle << 64) | (low & u128::from(u64::MAX))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::number::Number;
    use proptest::prelude::*;

    /// Of up to so many binary digits, times a power of two.
    fn number(digits: u32, exponent: std::ops::Range<i32>) -> impl Strategy<Value = f64> {
        let most = (1i64 << digits) - 1;
        (-most..=most, exponent).prop_map(|(whole, exponent)| libm::scalbn(whole as f64, exponent))
    }

    fn point(digits: u32, exponent: std::ops::Range<i32>) -> impl Strategy<Value = DVec3> {
        let [x, y, z] = [0; 3].map(|_| number(digits, exponent.clone()));
        (x, y, z).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    /// Few digits, so that zeros come up; those of f32; and as many as 128 bits hold, or more.
    fn points() -> impl Strategy<Value = [DVec3; 8]> {
        let of = |digits, exponent| prop::array::uniform8(point(digits, exponent));
        prop_oneof![
            of(2, 0..1),
            of(3, -150..-140),
            of(24, 0..3),
            of(24, 0..30),
            of(39, 0..1),
            of(40, 0..1),
            of(53, -1..1)
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        #[test]
        fn integers_see_what_expansions_see([origin, direction, a, b, c, d, e, f] in points(), length in -60..60) {
            let direction = direction * libm::scalbn(1.0, length);
            let triangles = [[a, b, c], [d, e, f]];
            let exact = triangles.map(|triangle| Seen::in_expansions(origin, direction, &triangle));
            for (triangle, exact) in triangles.iter().zip(&exact) {
                let Some(seen) = Seen::in_integers(origin, direction, [Some(*triangle)]) else { continue };
                prop_assert_eq!(seen.signs_aside(), exact.signs_aside());
                let (hit, expected) = (seen.hit(), exact.hit());
                prop_assert_eq!(hit.is_some(), expected.is_some());
                if let (Some(hit), Some(expected)) = (hit, expected) {
                    for (x, y) in [(hit.t, expected.t), (hit.u, expected.u), (hit.v, expected.v)] {
                        prop_assert!((x - y).abs() <= 4.0 * f64::EPSILON * y.abs(), "{} {}", x, y);
                    }
                }
            }
            let [(a, b), (c, d)] = exact.map(|Seen { direction, triangles: [[a, b, c]], .. }| {
                let normal = cross(&minus(&b, &a), &minus(&c, &a));
                (dot(&a, &normal), dot(&direction, &normal))
            });
            if let Some(seen) = Seen::in_integers(origin, direction, triangles.map(Some))
                && b.sign() * d.sign() != 0
            {
                let difference = a.mul(&d).sub(&c.mul(&b)).sign();
                prop_assert_eq!(seen.order(), (difference * b.sign() * d.sign()).cmp(&0));
            }
        }
    }

    #[test]
    fn products_are_those_of_big_integers() {
        use num_bigint::BigUint;
        let numbers =
            [0, 1, 3, u64::MAX.into(), 1 << 64, u128::MAX, u128::MAX - 12345, 0x1234_5678_9abc_def0_fedc_ba98];
        for (x, y) in numbers.iter().flat_map(|x| numbers.map(|y| (*x, y))) {
            let [high, low] = product(x, y).map(BigUint::from);
            assert_eq!((high << 128) + low, BigUint::from(x) * BigUint::from(y));
        }
    }

    /// What f32 coordinates of one size ask for is held by integers, and what no i128 holds is left to others.
    #[test]
    fn integers_are_for_what_fits() {
        let corners = [DVec3::X, DVec3::Y, DVec3::Z].map(|v| (v * std::f64::consts::PI).as_vec3().as_dvec3());
        let origin = DVec3::splat(0.1f32.into());
        let fits = |origin, direction, corners| Seen::in_integers(origin, direction, [Some(corners)]).is_some();
        assert!(fits(origin, DVec3::splat(0.3f32.into()), corners));
        let far = libm::scalbn(1.0, 100);
        assert!(fits(origin * far, DVec3::splat(1.0 / far), corners.map(|p| p * far)));
        assert!(fits(origin, DVec3::ZERO, corners) && fits(DVec3::ZERO, DVec3::X, [DVec3::ZERO; 3]));
        assert!(!fits(origin, DVec3::new(1.0, 1e-30, 0.0), corners));
        assert!(!fits(origin * far, DVec3::X, corners));
        let wide = |bits: i32| {
            let far = DVec3::X * libm::scalbn(1.0, bits);
            fits(-far, DVec3::ONE, [far + DVec3::Y, DVec3::X, DVec3::Z])
        };
        assert!(wide(52) && !wide(62), "differences must fit into an i64");
        assert!(!fits(DVec3::splat(0.1), DVec3::splat(0.3), corners.map(|p| p / 3.0)));
    }

    /// An object whose transform moves corners to f64 is seen in integers as it is in expansions; one that does not is
    /// not.
    #[test]
    fn placed_corners_are_f64_or_none() {
        use crate::math::{Affine3, Vec3};
        use crate::shape::triangle::Placed;
        use glam::Quat;
        let corners = [Vec3::new(0.1, 0.2, 0.3), Vec3::new(3.0, 0.5, 0.25), Vec3::new(-1.0, 0.7, 2.0)];
        let moved = Affine3::from_scale_rotation_translation(
            Vec3::new(2.0, 3.0, -1.5),
            Quat::from_rotation_z(0.0),
            Vec3::new(10.0, -5.0, 0.125),
        );
        let turned = Affine3::from_quat(Quat::from_scaled_axis(Vec3::new(0.3, 0.7, 0.1)));
        for (to_world, is_f64) in [(&Affine3::IDENTITY, true), (&moved, true), (&turned, false)] {
            let placed = Placed { corners, to_world };
            let Some(world) = placed.in_f64() else {
                assert!(!is_f64, "{to_world}");
                continue;
            };
            let exact = placed.exact();
            for (corner, exact) in world.iter().zip(&exact) {
                for axis in 0..3 {
                    assert_eq!(exact[axis].sub(&Expansion::new(corner[axis])).sign(), 0);
                }
            }
        }
    }
}
