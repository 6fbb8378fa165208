//! t, u and v of four rays at a time, each known to hit its triangle.
//!
//! The same operations in the same order as [`triangle::intersect`](crate::shape::triangle::intersect), so the same bits;
//! none is fused. That asks besides whether these numbers are precise enough. Here they are: a hit that the bundle is
//! sure of has bounds on t' that are an eighth of it apart at most. They come from rounding in f32, which is 2^29 times
//! that of f64, and 2^21 is wanted (see [`super::edges`]; both count 32 to 64 roundings of the same products).

use super::simd::{Array, Doubles, Simd};

/// Where four rays meet four triangles.
pub(super) struct Inside {
    pub t: [f64; 4],
    pub t32: [f32; 4],
    pub u: [f32; 4],
    pub v: [f32; 4],
}

/// Rays from `origin`; component i of corner k is `corners[3 * k + i]`.
#[inline(always)]
pub(super) fn inside<S: Simd>(origin: [f32; 3], direction: [[f32; 4]; 3], corners: &[[f32; 4]; 9]) -> Inside {
    let [dx, dy, dz] = direction;
    let wide = [load::<S>(&dx), load::<S>(&dy), load::<S>(&dz)];
    let [x, y, z] = origin;
    let origin = [S::D4::splat(x.into()), S::D4::splat(y.into()), S::D4::splat(z.into())];
    let (pa, pb, pc) = (corner::<S>(corners, 0), corner::<S>(corners, 1), corner::<S>(corners, 2));
    let (a, c) = (minus(pa, origin), minus(pc, origin));
    let (eb, ec) = (minus(pa, pc), minus(pb, pa));
    let normal = cross(eb, ec);
    let (slope, height) = (dot(wide, normal), dot(a, normal));
    let (u, v) = (dot(wide, cross(c, eb)), dot(wide, cross(a, ec)));
    let inverse = S::D4::splat(1.0).div(slope);
    let (t, u, v) = (height.mul(inverse), u.mul(inverse), v.mul(inverse));
    Inside { t: t.to_array(), t32: t.narrow().to_array(), u: u.narrow().to_array(), v: v.narrow().to_array() }
}

#[inline(always)]
fn load<S: Simd>(values: &[f32; 4]) -> S::D4 {
    S::D4::widen(S::V4::load(values))
}

#[inline(always)]
fn corner<S: Simd>(corners: &[[f32; 4]; 9], k: usize) -> [S::D4; 3] {
    [load::<S>(&corners[3 * k]), load::<S>(&corners[3 * k + 1]), load::<S>(&corners[3 * k + 2])]
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
