//! Four f64 at a time, and vectors of them, component by component.
//!
//! Nothing is fused, and sums are added up from the left, as glam does: so the bits are those of the same operations on
//! a [`DVec3`](crate::math::DVec3).

use super::{Array, Three};

/// Four values of f64.
pub(in crate::trace::bvh) trait Doubles: Three + Copy {
    /// As many f32.
    type F: Array<4>;
    fn splat(value: f64) -> Self;
    fn load(values: &[f64; 4]) -> Self;
    /// Exact.
    fn widen(values: Self::F) -> Self;
    /// Rounded to nearest.
    fn narrow(self) -> Self::F;
    fn to_array(self) -> [f64; 4];
    /// The first lane in all of them.
    fn first(self) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// The second where one is NaN.
    fn max(self, other: Self) -> Self;
    /// The second where one is NaN.
    fn min(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// Bit i is set where self is less than other in lane i; not for NaN.
    fn less(self, other: Self) -> u32;
    /// `yes` where self is less than other, `no` elsewhere and for NaN.
    fn less_select(self, other: Self, yes: Self, no: Self) -> Self;
    /// Of each of them the sum of its first three lanes, in their order.
    fn sums(of: [Self; 4]) -> Self;
}

/// The largest magnitude of a component.
#[inline(always)]
pub(in crate::trace::bvh) fn size<D: Doubles>(p: [D; 3]) -> D {
    p[0].abs().max(p[1].abs()).max(p[2].abs())
}

#[inline(always)]
pub(in crate::trace::bvh) fn minus<D: Doubles>(p: [D; 3], q: [D; 3]) -> [D; 3] {
    [p[0].sub(q[0]), p[1].sub(q[1]), p[2].sub(q[2])]
}

#[inline(always)]
pub(in crate::trace::bvh) fn plus<D: Doubles>(p: [D; 3], q: [D; 3]) -> [D; 3] {
    [p[0].add(q[0]), p[1].add(q[1]), p[2].add(q[2])]
}

#[inline(always)]
pub(in crate::trace::bvh) fn times<D: Doubles>(p: [D; 3], factor: D) -> [D; 3] {
    [p[0].mul(factor), p[1].mul(factor), p[2].mul(factor)]
}

#[inline(always)]
pub(in crate::trace::bvh) fn cross<D: Doubles>(p: [D; 3], q: [D; 3]) -> [D; 3] {
    [p[1].mul(q[2]).sub(q[1].mul(p[2])), p[2].mul(q[0]).sub(q[2].mul(p[0])), p[0].mul(q[1]).sub(q[0].mul(p[1]))]
}

#[inline(always)]
pub(in crate::trace::bvh) fn dot<D: Doubles>(p: [D; 3], q: [D; 3]) -> D {
    p[0].mul(q[0]).add(p[1].mul(q[1])).add(p[2].mul(q[2]))
}
