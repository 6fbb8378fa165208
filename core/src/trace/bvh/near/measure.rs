//! The point of a triangle that is nearest to a given one, in f64, of all three edges at a time.
//!
//! The same operations in the same order as [`closest_point`](crate::shape::closest::closest_point), so the same bits;
//! but which end of an edge comes first, and on which part of the triangle the point is, is decided without a branch,
//! for which is anyone's guess. Everything is scaled by a power of two, by which a triangle comes to be neither so
//! small that products of four lengths vanish, nor so large that they overflow.

use std::hint::select_unpredictable;

use crate::math::DVec3;
use crate::shape::closest::TrianglePoint;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::simd::doubles::{cross, dot, minus, plus, times};
use crate::trace::bvh::simd::{Array, Doubles, Simd};

/// The corners of a triangle: of each axis those of all three, and a number that means nothing.
pub(super) type Corners = [[f64; 4]; 3];

/// The corners, axis by axis.
pub(super) fn by_axis([a, b, c]: [DVec3; 3]) -> Corners {
    [[a.x, b.x, c.x, 0.0], [a.y, b.y, c.y, 0.0], [a.z, b.z, c.z, 0.0]]
}

/// The corners of one triangle of a block, axis by axis.
#[inline(always)]
pub(super) fn of_block<S: Simd>(block: &Block, lane: usize) -> [S::D4; 3] {
    let [x, y, z] = &block.corners;
    [wide::<S>(x, lane), wide::<S>(y, lane), wide::<S>(z, lane)]
}

#[inline(always)]
fn wide<S: Simd>([a, b, c]: &[[f32; LANES]; 3], lane: usize) -> S::D4 {
    S::D4::widen(S::V4::load(&[a[lane], b[lane], c[lane], 0.0]))
}

/// A triangle as seen from a point, in scaled coordinates. Edge i is the one from corner i to the next, in lane i.
pub(super) struct Measured<D> {
    /// The nearest points of the edges.
    offset: [D; 3],
    /// Where they are, from each edge's first corner to its second.
    share: D,
    /// Their squared distances.
    square: [f64; 4],
    /// The foot of the perpendicular: where it is, and the weights of the corners.
    foot: DVec3,
    weight: D,
    /// Infinite if it is outside.
    foot_square: f64,
}

/// Of each corner the next one.
#[inline(always)]
fn next<D: Doubles>([x, y, z]: [D; 3]) -> [D; 3] {
    [x.yzx(), y.yzx(), z.yzx()]
}

/// Of a vector in each lane the first component that is not zero; zero if there is none.
#[inline(always)]
fn first_other_than_zero<D: Doubles>([x, y, z]: [D; 3]) -> D {
    let zero = D::splat(0.0);
    let y = y.less_select(zero, y, zero.less_select(y, y, z));
    x.less_select(zero, x, zero.less_select(x, x, y))
}

/// In each lane `yes` where `a` is less than `b`, else `no`.
#[inline(always)]
fn less_select<D: Doubles>(a: D, b: D, yes: [D; 3], no: [D; 3]) -> [D; 3] {
    [a.less_select(b, yes[0], no[0]), a.less_select(b, yes[1], no[1]), a.less_select(b, yes[2], no[2])]
}

impl<D: Doubles> Measured<D> {
    /// `corners` one for each axis, `scale` a power of two.
    #[inline(always)]
    pub fn new(point: DVec3, corners: [D; 3], scale: f64) -> Self {
        let (zero, one) = (D::splat(0.0), D::splat(1.0));
        let p = times(minus(corners, [D::splat(point.x), D::splat(point.y), D::splat(point.z)]), D::splat(scale));
        let q = next(p);
        let along = minus(q, p);

        // An edge is taken from the end whose first coordinate that differs is the lower one.
        let differs = first_other_than_zero(along);
        let low = less_select(differs, zero, q, p);
        let high = less_select(differs, zero, p, q);
        let edge = minus(high, low);
        let length = dot(edge, edge);
        let way = zero.less_select(length, zero.sub(dot(low, edge)), zero);
        let share = way.div(length);
        let between = plus(low, times(edge, share));
        let offset = less_select(zero, way, less_select(way, length, between, high), low);
        let share = zero.less_select(way, way.less_select(length, share, one), zero);
        let share = differs.less_select(zero, one.sub(share), share);

        // From the first corner to the third: the third edge, turned round.
        let third = minus([zero; 3], next(next(along)));
        let [x, y, z] = cross(along, third);
        let normal = [x.first(), y.first(), z.first()];
        let areas = dot(normal, cross(p, q)).yzx();
        let sum = D::sums([areas; 4]);
        let weight = areas.div(sum);
        let [x, y, z] = times(p, weight);
        let [x, y, z, _] = D::sums([x, y, z, zero]).to_array();
        let foot = DVec3::new(x, y, z);
        let is_inside = zero.less(areas) & sum.less(D::splat(f64::INFINITY)) & 0b111 == 0b111;
        let foot_square = select_unpredictable(is_inside, foot.length_squared(), f64::INFINITY);
        Self { offset, share, square: dot(offset, offset).to_array(), foot, weight, foot_square }
    }

    /// The squared distance, scaled.
    #[inline(always)]
    pub fn square(&self) -> f64 {
        let least = |a: f64, b: f64| if b < a { b } else { a };
        let [a, b, c, _] = self.square;
        least(least(least(self.foot_square, a), b), c)
    }

    /// The nearest point; offset and distance are scaled.
    #[inline(always)]
    pub fn point(&self) -> TrianglePoint {
        let distance_squared = self.square();
        let [_, u, v, _] = self.weight.to_array();
        if self.foot_square == distance_squared {
            return TrianglePoint { offset: self.foot, distance_squared, u, v };
        }
        let [xs, ys, zs] = [self.offset[0].to_array(), self.offset[1].to_array(), self.offset[2].to_array()];
        let edge = (0..3).find(|&edge| self.square[edge] == distance_squared).unwrap_or(0);
        let share = self.share.to_array()[edge];
        let mut weights = [0.0; 3];
        (weights[edge], weights[(edge + 1) % 3]) = (1.0 - share, share);
        let offset = DVec3::new(xs[edge], ys[edge], zs[edge]);
        TrianglePoint { offset, distance_squared, u: weights[1], v: weights[2] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::closest::closest_point;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::isa::{Kernel, Present, dispatch};

    struct Measure(DVec3, [DVec3; 3], f64);

    impl Kernel for Measure {
        type Output = (f64, TrianglePoint);

        #[inline(always)]
        fn run<S: Simd>(self) -> Self::Output {
            let [x, y, z] = by_axis(self.1);
            let measured = Measured::new(self.0, [S::D4::load(&x), S::D4::load(&y), S::D4::load(&z)], self.2);
            (measured.square(), measured.point())
        }
    }

    /// Every number is that of the scalar one, in all regions, for corners that agree in some coordinates or in all,
    /// slivers and points on them.
    #[test]
    fn numbers_are_those_of_one_edge_after_the_other() {
        let mut random = Random::new(11);
        let mut foots = 0;
        for round in 0..20_000 {
            // Few different coordinates, so that many agree; or any.
            let mut coordinate = || {
                let x = f64::from(random.unit());
                if round % 3 == 0 { (2.0 * x).round() } else { x }
            };
            let mut vector = || DVec3::new(coordinate(), coordinate(), coordinate());
            let (mut corners, mut point) = ([vector(), vector(), vector()], vector());
            match round % 8 {
                0 => corners[2] = corners[0],
                1 => corners[1] = (corners[0] + corners[2]) * 0.5,
                2 => corners[2] = corners[1] + (corners[2] - corners[1]) * 1e-9,
                3 => point = corners[0],
                4 => point = (corners[0] + corners[1]) * 0.5,
                5 => point = (corners[0] + corners[1] + corners[2]) / 3.0 + point * 0.1,
                _ => {}
            }
            let expected = closest_point(point, corners);
            foots += usize::from(expected.u > 0.0 && expected.v > 0.0 && expected.u + expected.v < 1.0);
            for isa in Present::all() {
                // Also where products of four lengths would vanish, or overflow.
                for size in [1.0, 2f64.powi(-400), 2f64.powi(300)] {
                    let found = dispatch(isa, Measure(point * size, corners.map(|corner| corner * size), size.recip()));
                    assert_eq!(
                        found,
                        (expected.distance_squared, expected),
                        "{isa:?}: {point} from {corners:?}, {size}"
                    );
                }
            }
        }
        assert!((2000..18_000).contains(&foots), "{foots} above the middle");
    }
}
