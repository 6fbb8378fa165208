//! Eight triangles seen from the common origin of a bundle: normals of their edges, and bounds on the rounding.
//!
//! With A, B, C the corners relative to the origin, the edge function at A is d . (B x C) = d . (B x (C - B)). The
//! second form is computed: its products are of the size of the edge, not of the distance, so it does not cancel. The
//! direction is the bundle's (p, q, +-1), with p and q off by 2 u. With u = 2^-24, L the largest component of a corner
//! relative to the origin, s the largest of an edge, D >= 1 the largest of a direction, and the origin off by at most
//! b:
//!
//! | value | rounding | origin off |
//! | --- | --- | --- |
//! | edge function | 46 u D L s: corner, edge, product, difference (8 u L s a component), the slopes, products and sums | 6 D b s |
//! | slope d . N | 46 u D s^2 | 0 |
//! | height A . N | 48 u L s^2 | 6 b s^2 |
//!
//! Where the bundle is turned, a ray's own origin is at its far end, most often on a surface. On which side of the
//! plane it lies, t' is too coarse to tell, but C . N does, C being A less the ray's end: C is off by u L + b and
//! small, N by 8 u s^2 a component, and product and sum by as much again.
//!
//! In an object's coordinates slopes are off by 4 u of themselves and u / 4, not by 2 u: that makes 55 u of the first
//! two. All three are taken to be 64 u. That a ray's own origin is less precise is in the bundle's b. Nothing may
//! overflow ([`Bundle::may_overflow`]) but C . N, whose C is as long as the ray: that counts only where it is finite.

use super::rays::Bundle;
use crate::math::UNIT_ROUNDOFF;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector, axes, size};

/// Numbers of a block of triangles; the sign is such that the bundle sees each from its front (slope > 0).
pub(super) struct Edges {
    /// On the bundle's axes, the third turned forward: the scalar product with (p, q, 1) is the edge function, and with
    /// the fourth, the triangle's own normal, the slope; in a parallel bundle t'.
    pub normals: [[[f32; LANES]; 3]; 4],
    /// t' times the slope, for the least and the most that t' may be in view of all rounding; of a parallel bundle,
    /// what is added to t' instead.
    pub near_height: [f32; LANES],
    pub far_height: [f32; LANES],
    pub edge_error: [f32; LANES],
    /// The first corner relative to the bundle's origin, on the same axes as the normals.
    pub corner: [[f32; LANES]; 3],
    /// Of a parallel bundle: the third component of the triangle's normal, of such a length that a unit along the rays
    /// adds 1; the other two are those of the fourth normal, with signs changed.
    pub facing: [f32; LANES],
    /// Error of a corner relative to a ray's own origin, and of a normal's component.
    pub corner_error: [f32; LANES],
    pub normal_error: [f32; LANES],
    /// A bit for every triangle that rays of the bundle may see from both sides, or too obliquely to bound t'.
    pub is_vague: u32,
}

impl Edges {
    /// Also a bit for every triangle that some ray of the bundle may hit before `most`; none if there is none.
    #[inline(always)]
    pub fn new<S: Simd>(block: &Block, bundle: &Bundle, most: f32) -> Option<(u32, Self)> {
        let splat = S::V8::splat;
        let Corners { relative: [a, b, c], opposite: [ea, eb, ec], normal: n, height, far, long } =
            Corners::new::<S>(block, bundle);

        let u = UNIT_ROUNDOFF;
        let tiny = splat(1e-36);
        let reach = far.mul_add(splat(64.0 * u), splat(8.0 * bundle.blur));
        let edge_error = long.mul(splat(bundle.largest)).mul_add(reach, tiny);
        let square = long.mul(long);
        let slope_error = square.mul_add(splat(64.0 * u * bundle.largest), tiny);
        let height_error = square.mul_add(reach, tiny);

        let forward = splat(bundle.forward);
        let mut normals = [
            turned(cross(b, ea), forward),
            turned(cross(c, eb), forward),
            turned(cross(a, ec), forward),
            turned(n, forward),
        ];
        let (least_slope, most_slope) = ends::<S>(&normals[3], bundle);
        let zero = splat(0.0);
        let front = slope_error.less(least_slope);
        let back = most_slope.less(zero.sub(slope_error));
        let two_sided = !front.or(back).bits() & 0b1111_1111;
        // Turned so that the slope is positive.
        let sign = S::V8::select(back, splat(-1.0), splat(1.0));
        for normal in &mut normals {
            *normal = [normal[0].mul(sign), normal[1].mul(sign), normal[2].mul(sign)];
        }
        let height = height.mul(sign);
        let (least_slope, most_slope) = (least_slope.mul(sign), most_slope.mul(sign));
        let (least_slope, most_slope) = (least_slope.min(most_slope), least_slope.max(most_slope));

        let outside = zero.sub(edge_error);
        let misses = ends::<S>(&normals[0], bundle).1.less(outside);
        let misses = misses.or(ends::<S>(&normals[1], bundle).1.less(outside));
        let misses = misses.or(ends::<S>(&normals[2], bundle).1.less(outside));
        // t' at the least: height over the steepest slope. Behind the origin it is negative for all.
        let behind = height.add(height_error).less(zero);
        let nearest = height.sub(height_error);
        let beyond = most_slope.add(slope_error).mul(splat(most * (1.0 + 1e-6))).less(nearest);
        let culled = misses.or(behind).or(beyond).bits() & !two_sided;
        let lanes = !culled & block.lanes;
        if lanes == 0 {
            return None;
        }
        // t' is off by (1 + x)(1 + y) - 1, x and y being the relative errors of height and slope, and by a few
        // roundings.
        let (x, y) = (height_error.div(height), slope_error.div(least_slope.sub(slope_error)));
        let quarter = splat(0.25);
        let tame = zero.less(x).and(x.at_most(quarter)).and(zero.less(y)).and(y.at_most(quarter));
        let error = x.add(y).mul_add(splat(1.25), splat(16.0 * u));
        let mut stored = [[[0.0; LANES]; 3]; 4];
        for k in 0..4 {
            let normal = &normals[k];
            stored[k] = [normal[0].to_array(), normal[1].to_array(), normal[2].to_array()];
        }
        let a = turned(a, forward);
        let edges = Self {
            normals: stored,
            near_height: height.sub(height.mul(error)).to_array(),
            far_height: height.add(height.mul(error)).to_array(),
            edge_error: edge_error.to_array(),
            corner: [a[0].to_array(), a[1].to_array(), a[2].to_array()],
            facing: [0.0; LANES],
            corner_error: far.mul_add(splat(2.0 * u), splat(2.0 * bundle.blur)).to_array(),
            normal_error: square.mul(splat(24.0 * u)).to_array(),
            is_vague: two_sided | !tame.bits(),
        };
        Some((lanes, edges))
    }
}

/// The corners of eight triangles as a bundle sees them.
pub(super) struct Corners<V> {
    /// To its origin, on its axes; these turn in a cycle, so that a cross product is what it was.
    pub relative: [[V; 3]; 3],
    /// The edges that are opposite to them.
    pub opposite: [[V; 3]; 3],
    pub normal: [V; 3],
    /// The scalar product of a corner with the normal.
    pub height: V,
    /// The largest components of a corner and of an edge.
    pub far: V,
    pub long: V,
}

impl<V: Vector> Corners<V> {
    #[inline(always)]
    pub fn new<S: Simd<V8 = V>>(block: &Block, bundle: &Bundle) -> Self {
        let (corners, axes) = (&block.corners, axes(bundle.axis));
        let origin = origin::<S>(bundle);
        let (pa, pb, pc) =
            (corner::<S>(corners, 0, axes), corner::<S>(corners, 1, axes), corner::<S>(corners, 2, axes));
        let (a, b, c) = (minus(pa, origin), minus(pb, origin), minus(pc, origin));
        let (ea, eb, ec) = (minus(pc, pb), minus(pa, pc), minus(pb, pa));
        let n = cross(eb, ec);
        Self {
            relative: [a, b, c],
            opposite: [ea, eb, ec],
            normal: n,
            height: a[0].mul(n[0]).add(a[1].mul(n[1])).add(a[2].mul(n[2])),
            far: size(a).max(size(b)).max(size(c)),
            long: size(ea).max(size(eb)).max(size(ec)),
        }
    }
}

// Functions, not closures: these are inlined into the kernel of the instruction set without fail.

/// A bundle's origin, on its axes.
#[inline(always)]
pub(super) fn origin<S: Simd>(bundle: &Bundle) -> [S::V8; 3] {
    let [p, q, along] = axes(bundle.axis);
    [S::V8::splat(bundle.origin[p]), S::V8::splat(bundle.origin[q]), S::V8::splat(bundle.origin[along])]
}

/// A corner of each triangle, on the given axes.
#[inline(always)]
pub(super) fn corner<S: Simd>(corners: &[[[f32; LANES]; 3]; 3], k: usize, axes: [usize; 3]) -> [S::V8; 3] {
    let [x, y, z] = axes;
    [S::V8::load(&corners[x][k]), S::V8::load(&corners[y][k]), S::V8::load(&corners[z][k])]
}

/// The third component turned forward.
#[inline(always)]
fn turned<V: Vector>(n: [V; 3], forward: V) -> [V; 3] {
    [n[0], n[1], n[2].mul(forward)]
}

#[inline(always)]
pub(super) fn minus<V: Vector>(p: [V; 3], q: [V; 3]) -> [V; 3] {
    [p[0].sub(q[0]), p[1].sub(q[1]), p[2].sub(q[2])]
}

#[inline(always)]
fn cross<V: Vector>(p: [V; 3], q: [V; 3]) -> [V; 3] {
    [p[1].mul_sub(q[2], p[2].mul(q[1])), p[2].mul_sub(q[0], p[0].mul(q[2])), p[0].mul_sub(q[1], p[1].mul(q[0]))]
}

/// The least and the largest scalar product with a direction of the bundle.
#[inline(always)]
pub(super) fn ends<S: Simd>(n: &[S::V8; 3], bundle: &Bundle) -> (S::V8, S::V8) {
    let splat = S::V8::splat;
    let ([p, q, r], [low_p, low_q], [high_p, high_q]) = (*n, bundle.low, bundle.high);
    let (a, b) = (p.mul(splat(low_p)), p.mul(splat(high_p)));
    let (c, d) = (q.mul(splat(low_q)), q.mul(splat(high_q)));
    (r.add(a.min(b)).add(c.min(d)), r.add(a.max(b)).add(c.max(d)))
}
