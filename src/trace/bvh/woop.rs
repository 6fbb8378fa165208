//! Rays against triangles in f32, a lane a pair, with bounds on the rounding: one ray and eight triangles ([`super::filter`]), or eight
//! rays and one triangle ([`super::packet`]); of a ray in a bundle, the edge functions alone ([`super::tile`]).
//!
//! The test is Woop's (Woop, Benthin, Wald 2013, *Watertight ray/triangle intersection*): corners relative to the
//! origin are sheared so that the ray runs along its largest axis, and the edge functions are 2 x 2 determinants. Here it
//! only rejects: a triangle falls out when two edge functions have opposite signs by more than their rounding error, or
//! when t is out of range by more than its own. What remains is noted where there is no doubt, else goes to the exact test.
//!
//! With u = 2^-24, a triangle that is hit has its corners, after the shear, within S = (1 + k) s of the ray, s being the
//! largest component of its edges and k of the shear; so no component of a corner relative to the origin is larger
//! than k Z + S, Z being the largest along the ray. A single ray's k is at most 1, a packet's rays' 2, a bundle's 16. With L = Z + S a sheared component errs by e = (3 + 5 k) u L (a subtraction, k u Z + u S;
//! of the other component a subtraction, the shear's two roundings and a product, 4 k u Z; the last subtraction, u S; the rest is spare), an edge
//! function by 4 e S + 2 e^2 and its own rounding 4 u S^2, t by three such errors. A triangle that is not hit may be bounded wrongly, to no harm. Bounds
//! of t are 2^-126 wider, for t that is no normal number.
//!
//! A ray in an object's coordinates is not quite the one that is meant ([`Blur`]). With its origin off by b, and each component
//! of the direction by r times the largest, r <= 2^-10, and k <= 1: the shear is off by (1 + k) r / (1 - r), so that a sheared component
//! errs by 2 b + 2.1 r (Z + S) besides ((1 + k) b for a larger k); the corners' depths by b, which the sum of edges times depths multiplies by the sum of edges, all of one sign
//! but for their errors; and t |along| by r.
//!
//! Corners may be rounded themselves, by c each: the terms above have room for that, with b + 3 c in place of b, since an edge is then off
//! by 2 c. Only the distance from a plane ([`Planes`](super::planes::Planes)) counts on edges that are exact, and is not asked for such corners.

use super::place::Blur;
use super::planes::Heights;
use super::simd::{Mask, Vector};
use crate::math::UNIT_ROUNDOFF;

/// Slack of t for its own rounding and that of products with it.
pub(super) const SLACK: f32 = 8.0 * UNIT_ROUNDOFF;

/// Against underflow.
const TINY: f32 = 1e-36;

/// From the corners to the origins, each ray running along its third component.
pub(super) struct Sheared<V> {
    pub x: [V; 3],
    pub y: [V; 3],
    pub z: [V; 3],
}

/// A ray made ready for the test, but for its origin and its shear.
#[derive(Clone, Copy)]
pub(super) struct Aim<V> {
    /// 1 more than the larger shear.
    pub width: V,
    /// Direction along the third axis.
    pub along: V,
    /// 1 over its magnitude.
    pub shorten: V,
    /// Least t, rounded down, times the magnitude of `along`.
    pub begin: V,
}

/// Pairs of which the ray may hit the triangle.
pub(super) struct Judged<V: Vector> {
    /// A bit for each of them.
    pub lanes: u32,
    /// Those that it hits without doubt, at a t between `low` and `high`, and so that t, u and v can be computed in f64.
    pub sure: V::Mask,
    pub low: V,
    pub high: V,
}

/// The edge functions of pairs, and the bound on their error.
pub(super) struct Sides<V> {
    u: V,
    v: V,
    w: V,
    least: V,
    most: V,
    bound: V,
}

impl<V: Vector> Sides<V> {
    /// `width` is as of [`Aim`]; `size` is at least the largest component of an edge.
    #[inline(always)]
    pub fn new(&Sheared { x, y, z }: &Sheared<V>, width: V, size: V, blur: Blur) -> Self {
        let splat = V::splat;
        let (u, v, w) = (edge(x, y, 2, 1), edge(x, y, 0, 2), edge(x, y, 1, 0));
        let reach = width.mul(size);
        let deep = z[0].abs().add(size);
        // e, S + e, and (S + e) (5 e + 6 u (S + e)), which is more than wanted, for the rounding of the bound. 6 u (S + e) is
        // less than e.
        // (1 + 5 k) u and (4 + 5 k) u, one u of which is for the bound's own rounding.
        let of_depth = width.mul_add(splat(5.0 * UNIT_ROUNDOFF), splat(2.2 * blur.direction - 4.0 * UNIT_ROUNDOFF));
        let of_size = of_depth.add(splat(3.0 * UNIT_ROUNDOFF));
        let e = deep.mul_add(of_depth, reach.mul_add(of_size, splat(2.2 * blur.origin)));
        let bound = e.add(reach).mul(e).mul_add(splat(6.0), splat(TINY));
        Self { u, v, w, least: u.min(v).min(w), most: u.max(v).max(w), bound }
    }

    /// A bit for each pair whose edge functions may have one sign. Whatever overflowed is not rejected where the bound has, too; so it has where shears
    /// are at most 2, sheared corners being below 1e20.
    #[inline(always)]
    pub fn passed(&self) -> u32 {
        !self.bound.less(self.most.min(V::splat(0.0).sub(self.least))).bits()
    }

    /// The pairs of which no edge function has overflowed. That of a ray with shears up to 2 does so only for triangles that it misses.
    #[inline(always)]
    pub fn are_finite(&self) -> V::Mask {
        self.u.add(self.v).add(self.w).abs().less(V::splat(f32::INFINITY))
    }

    /// The pairs whose edge functions have one sign for sure.
    #[inline(always)]
    pub fn inside(&self) -> V::Mask {
        self.bound.less(self.least.max(V::splat(0.0).sub(self.most)))
    }
}

/// The pairs, of those of the bit mask `lanes`, of which the ray may hit the triangle up to `limit`; `size` is at least the largest
/// component of an edge. If it is not `BLURRED`, the ray is the one that is meant. `heights`
/// are asked only if corners are not `ROUNDED`.
#[inline(always)]
pub(super) fn judge<V: Vector, const BLURRED: bool, const ROUNDED: bool>(
    &Sheared { x, y, z }: &Sheared<V>,
    aim: &Aim<V>,
    limit: V,
    size: V,
    lanes: u32,
    blur: Blur,
    heights: impl FnOnce() -> Heights<V>,
) -> Option<Judged<V>> {
    let (splat, zero) = (V::splat, V::splat(0.0));
    let blur = if BLURRED { blur } else { Blur::NONE };
    let sides = Sides::new(&Sheared { x, y, z }, aim.width, size, blur);
    let Sides { u, v, w, bound, .. } = sides;
    let passed = sides.passed() & lanes;
    if passed == 0 {
        return None;
    }
    let deep = z[0].abs().add(size);
    let Blur { origin: blur, direction } = blur;
    let slack = SLACK + 2.0 * direction;
    // t |along| = depth / determinant, both multiplied by the determinant.
    let determinant = u.add(v).add(w);
    let area = determinant.abs();
    let error = bound.mul_add(splat(4.0), area.mul(splat(SLACK))).mul(area);
    let square = determinant.mul(determinant);
    let (least_square, most_square) = (square.sub(error), square.add(error));
    let begin = least_square.mul(if BLURRED { aim.begin.mul(splat(1.0 - slack)) } else { aim.begin });
    let end = most_square.mul(limit.mul(aim.along.abs()).mul(splat(1.0 + slack)));
    let turn = V::select(aim.along.less(zero), zero.sub(determinant), determinant);
    let depth = zero.sub(u.mul_add(z[0], v.mul_add(z[1], w.mul(z[2])))).mul(turn);
    // The sum of all edges is at most the determinant and 6 bounds.
    let depth_error = error.mul_add(deep, splat(f32::MIN_POSITIVE));
    let depth_error = if BLURRED { most_square.mul_add(splat(1.6 * blur), depth_error) } else { depth_error };
    let (near, far) = (depth.sub(depth_error), depth.add(depth_error));
    // What is too large for f32 is neither rejected for it nor sure.
    let infinite = splat(f32::INFINITY);
    let outside = far.less(begin).and(begin.less(infinite)).or(end.less(near).and(near.less(infinite)));
    let mut lanes = passed & !outside.bits();
    let four = splat(4.0);
    let is_precise = depth_error.mul(four).less(depth).and(depth.less(infinite));
    if !ROUNDED && lanes & !is_precise.bits() != 0 {
        // The origin is close to the plane, for the size of the triangle: mostly a ray that starts on it.
        let Heights { height, error } = heights();
        let (depth, depth_error) = (height.mul(turn), error.mul_add(area, splat(f32::MIN_POSITIVE)));
        let (near, far) = (depth.sub(depth_error), depth.add(depth_error));
        // Where rounding leaves the determinant's sign open, as from far away, this has no sign either.
        let outside = far.less(begin).and(begin.less(infinite)).or(end.less(near).and(near.less(infinite)));
        lanes &= !outside.and(zero.less(least_square)).bits();
    }
    if lanes == 0 {
        return None;
    }
    // Precise to a quarter in f32 is more than enough in f64, unless the origin all but touches the triangle: both
    // count the same products of components, but f64 is wanted 2^18 times as precise, and is 2^29 times.
    let precise = error.mul(four).less(square).and(square.less(infinite)).and(is_precise);
    let apart = size.mul(splat(1.0 / 32.0)).less(deep);
    Some(Judged {
        lanes,
        sure: sides.inside().and(precise).and(apart),
        low: near.div(most_square).mul_add(aim.shorten.mul(splat(1.0 - slack)), splat(-f32::MIN_POSITIVE)),
        high: far.div(least_square).mul_add(aim.shorten.mul(splat(1.0 + slack)), splat(f32::MIN_POSITIVE)),
    })
}

/// The edge function of the edge from corner `a` to corner `b`, each of which is at (x, y).
#[inline(always)]
fn edge<V: Vector>(x: [V; 3], y: [V; 3], a: usize, b: usize) -> V {
    x[a].mul_sub(y[b], y[a].mul(x[b]))
}
