//! Four pairs of ray and triangle at a time, in f64: one ray against a block, or four rays against what each of them hits.
//!
//! The same operations in the same order as [`triangle::intersect`](crate::shape::triangle::intersect), so the same bits;
//! none is fused. Its bounds on the rounding are replaced by simpler ones, from above: what they leave open is asked of
//! it, ray by ray.

use super::simd::{Array, Doubles, Simd};
use crate::shape::triangle::{ROUNDING, T_PRECISION};

/// Four triangles as seen from the origins of four rays.
pub(super) struct Quad<D> {
    direction: [D; 3],
    /// Corners relative to the origin, and the edges opposite to them.
    corners: [[D; 3]; 3],
    edges: [[D; 3]; 3],
    /// As in [`triangle`](crate::shape::triangle): opposite to each corner, their sum, and t times that.
    volumes: [D; 3],
    slope: D,
    height: D,
}

/// t, u and v of four hits.
pub(super) struct Numbers {
    pub t: [f64; 4],
    pub t32: [f32; 4],
    pub u: [f32; 4],
    pub v: [f32; 4],
}

/// What is certain, as bits of the four.
pub(super) struct Verdict {
    /// The line passes inside, and [`Quad::numbers`] holds; t may be outside of the ray's range.
    pub hit: u32,
    /// Anything may be.
    pub open: u32,
}

impl<D: Doubles> Quad<D> {
    /// Rays from `origin`; component i of corner k is `corners[3 * k + i]`.
    #[inline(always)]
    pub fn new<S: Simd<D4 = D>>(origin: [D; 3], direction: [D; 3], corners: &[[f32; 4]; 9]) -> Self {
        let (pa, pb, pc) = (corner::<S>(corners, 0), corner::<S>(corners, 1), corner::<S>(corners, 2));
        let (a, b, c) = (minus(pa, origin), minus(pb, origin), minus(pc, origin));
        let (ea, eb, ec) = (minus(pc, pb), minus(pa, pc), minus(pb, pa));
        let normal = cross(eb, ec);
        Self {
            direction,
            corners: [a, b, c],
            edges: [ea, eb, ec],
            volumes: [dot(direction, cross(b, ea)), dot(direction, cross(c, eb)), dot(direction, cross(a, ec))],
            slope: dot(direction, normal),
            height: dot(a, normal),
        }
    }

    /// Only what is asked for is computed: the compiler drops the rest.
    #[inline(always)]
    pub fn numbers<S: Simd<D4 = D>>(&self) -> Numbers {
        let inverse = D::splat(1.0).div(self.slope);
        let t = self.height.mul(inverse);
        let (u, v) = (self.volumes[1].mul(inverse), self.volumes[2].mul(inverse));
        Numbers { t: t.to_array(), t32: t.narrow().to_array(), u: u.narrow().to_array(), v: v.narrow().to_array() }
    }

    /// With A, B, C the largest components of corners and L of edges, and D of the direction: a volume is off by at most
    /// 6 K D max(A, B, C) L, as its permanent has six terms; t by 6 K L^2 (A / |height| + D / |slope|) of itself.
    #[inline(always)]
    pub fn verdict(&self) -> Verdict {
        let [a, b, c] = self.corners;
        let [ea, eb, ec] = self.edges;
        let far = size(a).max(size(b)).max(size(c));
        let long = size(ea).max(size(eb)).max(size(ec));
        let steep = size(self.direction);
        let factor = D::splat(6.0 * ROUNDING);
        let bound = factor.mul(steep).mul(far).mul(long);
        let zero = D::splat(0.0);
        let [u, v, w] = self.volumes;
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        let miss = least.less(zero.sub(bound)) & bound.less(most);
        let inside = bound.less(least) | most.less(zero.sub(bound));
        let sizes = size(a).mul(self.slope.abs()).add(steep.mul(self.height.abs()));
        let error = factor.mul(long.mul(long)).mul(sizes);
        let precise = error.less(self.height.mul(self.slope).abs().mul(D::splat(T_PRECISION)));
        Verdict { hit: inside & precise, open: !(miss | inside & precise) & 0b1111 }
    }
}

#[inline(always)]
pub(super) fn widen<S: Simd>(values: &[f32; 4]) -> S::D4 {
    S::D4::widen(S::V4::load(values))
}

#[inline(always)]
fn corner<S: Simd>(corners: &[[f32; 4]; 9], k: usize) -> [S::D4; 3] {
    [widen::<S>(&corners[3 * k]), widen::<S>(&corners[3 * k + 1]), widen::<S>(&corners[3 * k + 2])]
}

#[inline(always)]
fn minus<D: Doubles>(p: [D; 3], q: [D; 3]) -> [D; 3] {
    [p[0].sub(q[0]), p[1].sub(q[1]), p[2].sub(q[2])]
}

#[inline(always)]
fn cross<D: Doubles>(p: [D; 3], q: [D; 3]) -> [D; 3] {
    [p[1].mul(q[2]).sub(q[1].mul(p[2])), p[2].mul(q[0]).sub(q[2].mul(p[0])), p[0].mul(q[1]).sub(q[0].mul(p[1]))]
}

#[inline(always)]
fn dot<D: Doubles>(p: [D; 3], q: [D; 3]) -> D {
    p[0].mul(q[0]).add(p[1].mul(q[1])).add(p[2].mul(q[2]))
}

/// The largest magnitude of a component.
#[inline(always)]
fn size<D: Doubles>(p: [D; 3]) -> D {
    p[0].abs().max(p[1].abs()).max(p[2].abs())
}
