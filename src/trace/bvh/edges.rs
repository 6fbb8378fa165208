//! Four triangles seen from the common origin of a bundle: normals of their edges, and bounds on the rounding.
//!
//! With A, B, C the corners relative to the origin, the edge function at A is d . (B x C) = d . (B x (C - B)). The second
//! form is computed: its products are of the size of the edge, not of the distance, so it does not cancel. With u =
//! 2^-24, L the largest component of a corner relative to the origin, s the largest of an edge, D the largest of a
//! direction, and the origin off by at most b:
//!
//! | value | rounding | origin off |
//! | --- | --- | --- |
//! | edge function | 42 u D L s: corner, edge, product, difference (4 u of 2 L s a component), three products and sums | 6 D b s |
//! | slope d . N | 42 u D s^2 | 0 |
//! | height A . N | 48 u L s^2 | 6 b s^2 |

use super::block::LANES;
use super::bundle::Bundle;
use super::simd::{Simd, Vector};
use crate::math::UNIT_ROUNDOFF;

/// Numbers of four triangles; the sign is such that the bundle sees each from its front (slope > 0).
pub(super) struct Edges {
    /// Component i of the normal of edge k is `normals[3 * k + i]`; the fourth is the triangle's own.
    pub normals: [[f32; LANES]; 12],
    /// t times the slope.
    pub height: [f32; LANES],
    pub edge_error: [f32; LANES],
    pub slope_error: [f32; LANES],
    pub height_error: [f32; LANES],
    /// A bit for every triangle that rays of the bundle may see from both sides.
    pub is_two_sided: u32,
}

impl Edges {
    /// Also a bit for every triangle that some ray of the bundle may hit before `most`.
    #[inline(always)]
    pub fn new<S: Simd>(corners: &[[f32; LANES]; 9], bundle: &Bundle, most: f32) -> (u32, Self) {
        let splat = S::V4::splat;
        let (pa, pb, pc) = (corner::<S>(corners, 0), corner::<S>(corners, 1), corner::<S>(corners, 2));
        let o = [splat(bundle.origin[0]), splat(bundle.origin[1]), splat(bundle.origin[2])];
        let (a, b, c) = (minus(pa, o), minus(pb, o), minus(pc, o));
        let (ea, eb, ec) = (minus(pc, pb), minus(pa, pc), minus(pb, pa));
        let mut normals = [cross(b, ea), cross(c, eb), cross(a, ec), cross(eb, ec)];
        let n = normals[3];
        let mut height = a[0].mul(n[0]).add(a[1].mul(n[1])).add(a[2].mul(n[2]));

        let (far, long) = (size(a).max(size(b)).max(size(c)), size(ea).max(size(eb)).max(size(ec)));
        let u = UNIT_ROUNDOFF;
        let tiny = splat(1e-36);
        let reach = far.mul_add(splat(56.0 * u), splat(8.0 * bundle.blur));
        let edge_error = long.mul(splat(bundle.largest)).mul_add(reach, tiny);
        let square = long.mul(long);
        let slope_error = square.mul_add(splat(56.0 * u * bundle.largest), tiny);
        let height_error = square.mul_add(reach, tiny);

        let slopes = ends::<S>(n, bundle);
        let front = slope_error.less(slopes.0);
        let back = slopes.1.less(splat(0.0).sub(slope_error));
        let two_sided = !(front | back) & 0b1111;
        // Turned so that the slope is positive.
        let sign = S::V4::load(&SIGNS[back as usize]);
        for normal in &mut normals {
            *normal = [normal[0].mul(sign), normal[1].mul(sign), normal[2].mul(sign)];
        }
        height = height.mul(sign);
        let most_slope = slopes.1.mul(sign).max(slopes.0.mul(sign));

        let outside = splat(0.0).sub(edge_error);
        let mut misses = 0;
        for normal in &normals[..3] {
            misses |= ends::<S>(*normal, bundle).1.less(outside);
        }
        // t at the least: height over the steepest slope. Behind the origin it is negative for all.
        let behind = height.add(height_error).less(splat(0.0));
        let nearest = height.sub(height_error);
        let beyond = most_slope.add(slope_error).mul(splat(most * (1.0 + 1e-6))).less(nearest);
        let culled = (misses | behind | beyond) & !two_sided;

        let mut stored = [[0.0; LANES]; 12];
        for (k, normal) in normals.iter().enumerate() {
            for axis in 0..3 {
                stored[3 * k + axis] = normal[axis].to_array();
            }
        }
        let edges = Self {
            normals: stored,
            height: height.to_array(),
            edge_error: edge_error.to_array(),
            slope_error: slope_error.to_array(),
            height_error: height_error.to_array(),
            is_two_sided: two_sided,
        };
        (!culled & 0b1111, edges)
    }
}

/// -1 for every set bit, 1 for the others.
const SIGNS: [[f32; LANES]; 16] = {
    let mut signs = [[1.0; LANES]; 16];
    let mut i = 0;
    while i < 16 * LANES {
        if (i / LANES) >> (i % LANES) & 1 != 0 {
            signs[i / LANES][i % LANES] = -1.0;
        }
        i += 1;
    }
    signs
};

// Functions, not closures: these are inlined into the kernel of the instruction set without fail.

#[inline(always)]
fn corner<S: Simd>(corners: &[[f32; LANES]; 9], k: usize) -> [S::V4; 3] {
    [S::V4::load(&corners[3 * k]), S::V4::load(&corners[3 * k + 1]), S::V4::load(&corners[3 * k + 2])]
}

#[inline(always)]
fn minus<V: Vector<LANES>>(p: [V; 3], q: [V; 3]) -> [V; 3] {
    [p[0].sub(q[0]), p[1].sub(q[1]), p[2].sub(q[2])]
}

#[inline(always)]
fn cross<V: Vector<LANES>>(p: [V; 3], q: [V; 3]) -> [V; 3] {
    [p[1].mul(q[2]).sub(p[2].mul(q[1])), p[2].mul(q[0]).sub(p[0].mul(q[2])), p[0].mul(q[1]).sub(p[1].mul(q[0]))]
}

/// The largest magnitude of a component.
#[inline(always)]
fn size<V: Vector<LANES>>(p: [V; 3]) -> V {
    p[0].abs().max(p[1].abs()).max(p[2].abs())
}

/// The least and the largest scalar product with a direction of the bundle.
#[inline(always)]
fn ends<S: Simd>(n: [S::V4; 3], bundle: &Bundle) -> (S::V4, S::V4) {
    let (mut least, mut most) = (S::V4::splat(0.0), S::V4::splat(0.0));
    for (axis, component) in n.into_iter().enumerate() {
        let p = component.mul(S::V4::splat(bundle.low[axis]));
        let q = component.mul(S::V4::splat(bundle.high[axis]));
        least = least.add(p.min(q));
        most = most.add(p.max(q));
    }
    (least, most)
}
