//! Rays against triangles in f32, a lane a pair, with bounds on the rounding: one ray and eight triangles
//! ([`super::filter`]), or eight rays and one triangle ([`crate::trace::bvh::packet`]); or a ray of a bundle and eight
//! triangles ([`crate::trace::bvh::bundle`]).
//!
//! The test is Woop's (Woop, Benthin, Wald 2013, *Watertight ray/triangle intersection*): corners relative to the
//! origin are sheared so that the ray runs along its largest axis, and the edge functions are 2 x 2 determinants. Here
//! it only rejects: a triangle falls out when two edge functions have opposite signs by more than their rounding error,
//! or when t is out of range by more than its own. What remains is noted where there is no doubt, else goes to the
//! exact test.
//!
//! With u = 2^-24, a triangle that is hit has its corners, after the shear, within S = (1 + k) s of the ray, s being
//! the largest component of its edges and k of the shear; so no component of a corner relative to the origin is larger
//! than k Z + S, Z being the largest along the ray. A single ray's k is at most 1, a packet's rays' 2, a bundle's 16.
//! With L = Z + S a sheared component errs by e = (3 + 5 k) u L (a subtraction, k u Z + u S; of the other component a
//! subtraction, the shear's two roundings and a product, 4 k u Z; the last subtraction, u S; the rest is spare), an
//! edge function by B = 4 e S + 2 e^2 + 4 u S^2. A triangle that is not hit may be bounded wrongly: to no harm where it
//! is rejected for it. But one that is seen edge-on from far beside it has edge functions that are nothing but
//! rounding, of u times its distance squared, and these may agree by more than B. So nothing is sure but where the
//! sheared corners, as computed, lie on both sides of the ray in x and in y. They are then within S + 2 e of it, and
//! twice the triangle's area, as the ray sees it, is at most (S + 2 e)^2; where that is more than 3 B, of the B that is
//! computed, 6 e (S + e), e is less than S / 14, and this B has room for the 2 e.
//!
//! **Depth.** The ray meets the plane at the mean T of the corners' depths z, weighted with the edge functions E, which
//! have one sign. So T is between the least and the largest z, which are less than s apart. With functions e that are
//! off by up to B each, and a the magnitude of their sum, the mean is T', and T - T' = sum((E - e) (z - T')) / sum(E):
//! errors of the weights are multiplied by differences of depths, not by depths. For a > 16 B the sum of E is more than
//! 13/16 a, that of the magnitudes of e less than 5/4 a, and T' at most s / 8 outside; so T - T' is less than 3 B s /
//! a. The rounding of z, of products, sums and the quotient adds less than 10 u (Z + s). Bounds of t are 2^-126 wider,
//! for t that is no normal number.
//!
//! **f64.** [`triangle::intersect`](crate::shape::triangle::intersect) asks for exact arithmetic where t is off by
//! 2^-27 of itself, counting a unit of 2^-48. What is inside for sure, with a > 16 B and T' more than four times what
//! it is off by, does not come to that: with H = Z + s, the products that are counted are at most 4 s^2 H for a ray
//! along the axis, and a T more than 12 B times the larger of s and T, B more than 6 u s (H + 4 s), so that they are
//! less than 2^20 a T. For larger shears both grow alike.
//!
//! A ray in an object's coordinates is not quite the one that is meant ([`Blur`]). With its origin off by b, and each
//! component of the direction by r times the largest, r <= 2^-10, and k <= 1: the shear is off by (1 + k) r / (1 - r),
//! so that a sheared component errs by 2 b + 2.1 r (Z + S) besides ((1 + k) b for a larger k); the corners' depths, and
//! so their mean, by b, and s by 2 b, which together is less than 3/2 b; and t |along| by r.
//!
//! Corners may be rounded themselves, by c each: the terms above have room for that, with b + 3 c in place of b, since
//! an edge is then off by 2 c. What c is by the distance of corners, and not for all alike, is in r: with c = x (Z +
//! S), 3 x in r is 6.3 c in a sheared component; of depths 3/2 of 3 c count besides, where x is taken to be u. Only the
//! distance from a plane ([`Planes`](super::planes::Planes)) counts on edges that are exact, and is not asked for such
//! corners.

use super::Blur;
use super::planes::Heights;
use super::slab::HUGE;
use crate::math::UNIT_ROUNDOFF;
use crate::trace::bvh::simd::{Mask, Vector};

/// Slack of t for its own rounding and that of products with it.
pub(in crate::trace::bvh) const SLACK: f32 = 8.0 * UNIT_ROUNDOFF;

/// Against underflow.
const TINY: f32 = 1e-36;

/// From the corners to the origins, each ray running along its third component.
pub(in crate::trace::bvh) struct Sheared<V> {
    pub x: [V; 3],
    pub y: [V; 3],
    pub z: [V; 3],
}

/// What the bound on the error of edge functions takes of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::trace::bvh) struct Margin<V> {
    /// 1 more than the larger shear: S is so many times s.
    pub width: V,
    /// How much a sheared component errs for each unit of depth of the first corner, |z|; which Z is less than s above.
    pub of_depth: V,
    /// And for each unit of s.
    pub of_size: V,
}

impl<V: Vector> Margin<V> {
    /// `direction` is of [`Blur`].
    #[inline(always)]
    pub fn new(width: V, direction: V) -> Self {
        let splat = V::splat;
        // (1 + 5 k) u and (4 + 5 k) u, one u of which is for the bound's own rounding.
        let of_depth = width.mul_add(splat(5.0 * UNIT_ROUNDOFF), splat(-4.0 * UNIT_ROUNDOFF));
        let of_depth = direction.mul_add(splat(2.2), of_depth);
        Self { width, of_depth, of_size: width.mul_add(of_depth.add(splat(3.0 * UNIT_ROUNDOFF)), of_depth) }
    }
}

impl Margin<f32> {
    /// As [`Margin::new`], of one ray.
    #[inline(always)]
    pub fn of_one(width: f32, direction: f32) -> Self {
        let of_depth = width * (5.0 * UNIT_ROUNDOFF) - 4.0 * UNIT_ROUNDOFF + 2.2 * direction;
        Self { width, of_depth, of_size: width * (of_depth + 3.0 * UNIT_ROUNDOFF) + of_depth }
    }

    /// In every lane.
    #[inline(always)]
    pub fn splat<V: Vector>(self) -> Margin<V> {
        let Self { width, of_depth, of_size } = self;
        Margin { width: V::splat(width), of_depth: V::splat(of_depth), of_size: V::splat(of_size) }
    }
}

/// A ray made ready for the test, but for its origin, its shear and its margin.
#[derive(Clone, Copy)]
pub(in crate::trace::bvh) struct Aim<V> {
    /// Direction along the third axis, negative.
    pub against: V,
    /// 1 over its magnitude.
    pub shorten: V,
    /// Least t, rounded down, times the magnitude of `against`.
    pub begin: V,
}

/// Pairs of which the ray may hit the triangle.
pub(in crate::trace::bvh) struct Judged<V: Vector> {
    /// A bit for each of them.
    pub lanes: u32,
    /// Those that it hits without doubt, at a t between `low` and `high`, and so that t, u and v can be computed in
    /// f64.
    pub sure: V::Mask,
    pub low: V,
    pub high: V,
}

/// Where the rays of some pairs meet the planes.
pub(in crate::trace::bvh) struct Met<V: Vector> {
    /// A bit for each pair that is left.
    pub lanes: u32,
    /// The pairs that meet without doubt, between `near` and `far` along the third axis, and so that t, u and v can be
    /// computed in f64.
    pub sure: V::Mask,
    /// Twice the area of the triangle as the ray sees it, by which the following are multiplied.
    pub area: V,
    pub near: V,
    pub far: V,
}

/// How far a ray looks along the third axis, and which way it runs.
pub(in crate::trace::bvh) struct Span<V> {
    /// Least and largest depth, rounded outwards.
    pub begin: V,
    pub end: V,
    /// Less than zero where it runs along the axis, more where against it.
    pub against: V,
}

/// The edge functions of pairs, and the bound on their error.
#[derive(Clone, Copy)]
pub(in crate::trace::bvh) struct Sides<V: Vector> {
    u: V,
    v: V,
    w: V,
    bound: V,
    /// Of [`Sheared`].
    z: [V; 3],
    /// The pairs whose triangle has corners on both sides of the ray, in x and in y.
    bounded: V::Mask,
}

impl<V: Vector> Sides<V> {
    /// `size` is at least the largest component of an edge, `blur` how far the ray's origin is off.
    #[inline(always)]
    pub fn new(&Sheared { x, y, z }: &Sheared<V>, margin: &Margin<V>, size: V, blur: Option<f32>) -> Self {
        let splat = V::splat;
        let (u, v, w) = (edge(x, y, 2, 1), edge(x, y, 0, 2), edge(x, y, 1, 0));
        // e, S + e, and (S + e) (5 e + 6 u (S + e)), which is more than wanted, for the rounding of the bound. 6 u (S +
        // e) is about e at most.
        let of_size = margin.of_size.mul(size);
        let of_size = if let Some(blur) = blur { of_size.add(splat(2.2 * blur)) } else { of_size };
        let e = z[0].abs().mul_add(margin.of_depth, of_size);
        let bound = margin.width.mul_add(size, e).mul(e).mul_add(splat(6.0), splat(TINY));
        Self { u, v, w, bound, z, bounded: on_both_sides(x).and(on_both_sides(y)) }
    }

    /// Of no pairs.
    #[inline(always)]
    pub fn none() -> Self {
        let zero = V::splat(0.0);
        Self { u: zero, v: zero, w: zero, bound: zero, z: [zero; 3], bounded: zero.less(zero) }
    }

    /// The least and the largest edge function.
    #[inline(always)]
    fn extremes(&self) -> (V, V) {
        let Self { u, v, w, .. } = *self;
        (u.min(v).min(w), u.max(v).max(w))
    }

    /// A bit for each pair whose edge functions may have one sign. Whatever overflowed is not rejected where the bound
    /// has, too; so it has where shears are at most 2, sheared corners being below 1e20.
    #[inline(always)]
    pub fn passed(&self) -> u32 {
        let (least, most) = self.extremes();
        !self.bound.less(most.min(V::splat(0.0).sub(least))).bits()
    }

    /// The pairs of which no edge function has overflowed. That of a ray with shears up to 2 does so only for triangles
    /// that it misses.
    #[inline(always)]
    pub fn are_finite(&self) -> V::Mask {
        self.u.add(self.v).add(self.w).abs().less(V::splat(f32::INFINITY))
    }

    /// The pairs whose edge functions have one sign for sure.
    #[inline(always)]
    pub fn inside(&self) -> V::Mask {
        let (least, most) = self.extremes();
        self.bound.less(least.max(V::splat(0.0).sub(most))).and(self.bounded)
    }

    /// The pairs, of those of the bit mask `lanes`, whose triangle the ray may meet within `span`. Depths of corners
    /// may be off by `blur`; the rest is as before. `heights` are asked only if corners are not `ROUNDED`.
    #[inline(always)]
    pub fn meet<const ROUNDED: bool>(
        &self,
        size: V,
        blur: Option<f32>,
        span: &Span<V>,
        lanes: u32,
        heights: impl FnOnce() -> Heights<V>,
    ) -> Met<V> {
        let (splat, zero, infinite) = (V::splat, V::splat(0.0), V::splat(f32::INFINITY));
        let Self { u, v, w, bound, z, .. } = *self;
        let determinant = u.add(v).add(w);
        let area = determinant.abs();
        // All depths times the area. The corners' are counted from them to the origin.
        let turn = determinant.flip(span.against);
        let depth = u.mul_add(z[0], v.mul_add(z[1], w.mul(z[2]))).flip(turn);
        // What has overflowed says nothing, not even by its sign: one product may be infinite where another is not, and
        // is larger.
        let finite = area.less(splat(HUGE)).and(depth.abs().less(infinite));
        let tame = bound.mul(splat(16.0)).less(area).and(finite);
        // 4, not 3; and room for products that underflow.
        let of_edges = bound.mul(size).mul_add(splat(4.0), splat(16.0 * f32::MIN_POSITIVE));
        let of_depth = z[0].abs().add(size).mul(splat(if ROUNDED { 17.0 } else { 12.0 } * UNIT_ROUNDOFF));
        let of_depth = if let Some(blur) = blur { of_depth.add(splat(1.6 * blur)) } else { of_depth };
        let off = of_depth.mul_add(area, of_edges);
        let (near, far) = (depth.sub(off), depth.add(off));
        let (begin, end) = (span.begin.mul(area), span.end.mul(area));
        let mut lanes = lanes & !far.less(begin).or(end.less(near)).and(tame).bits();
        let is_precise = off.mul(splat(4.0)).less(depth).and(tame);
        if !ROUNDED && lanes & !is_precise.bits() != 0 {
            // The origin is close to the plane, for the size of the triangle: mostly a ray that starts on it.
            let Heights { height, error } = heights();
            let area_error = bound.mul_add(splat(4.0), area.mul(splat(SLACK)));
            let (least, most) = (area.sub(area_error), area.add(area_error));
            let (begin, end) = (span.begin.mul(least), span.end.mul(most));
            let height = zero.sub(height.flip(turn));
            let (near, far) = (height.sub(error), height.add(error));
            let outside = far.less(begin).or(end.less(near)).and(height.abs().less(infinite));
            // Where rounding leaves the determinant's sign open, as from far away, this has no sign either.
            lanes &= !outside.and(zero.less(least)).bits();
        }
        Met { lanes, sure: self.inside().and(is_precise), area, near, far }
    }
}

/// The pairs, of those of the bit mask `passed`, of which the ray may hit the triangle up to `limit`; `size` is at
/// least the largest component of an edge. If it is not `BLURRED`, the ray is the one that is meant. `heights` are
/// asked only if corners are not `ROUNDED`.
#[inline(always)]
pub(in crate::trace::bvh) fn judge<V: Vector, const BLURRED: bool, const ROUNDED: bool>(
    sides: &Sides<V>,
    aim: &Aim<V>,
    limit: V,
    size: V,
    passed: u32,
    blur: Blur,
    heights: impl FnOnce() -> Heights<V>,
) -> Option<Judged<V>> {
    let splat = V::splat;
    let blur = if BLURRED { blur } else { Blur::NONE };
    let slack = SLACK + 2.0 * blur.direction;
    let span = Span {
        begin: if BLURRED { aim.begin.mul(splat(1.0 - slack)) } else { aim.begin },
        end: limit.mul(aim.against.abs()).mul(splat(1.0 + slack)),
        against: aim.against,
    };
    let off = BLURRED.then_some(blur.origin);
    let Met { lanes, sure, area, near, far } = sides.meet::<ROUNDED>(size, off, &span, passed, heights);
    if lanes == 0 {
        return None;
    }
    let inverse = splat(1.0).div(area);
    let (near, far) = (near.mul(inverse), far.mul(inverse));
    Some(Judged {
        lanes,
        sure,
        low: near.mul_add(aim.shorten.mul(splat(1.0 - slack)), splat(-f32::MIN_POSITIVE)),
        high: far.mul_add(aim.shorten.mul(splat(1.0 + slack)), splat(f32::MIN_POSITIVE)),
    })
}

/// Where a triangle has corners on both sides.
#[inline(always)]
fn on_both_sides<V: Vector>([a, b, c]: [V; 3]) -> V::Mask {
    a.differs_in_sign(b).or(a.differs_in_sign(c))
}

/// The edge function of the edge from corner `a` to corner `b`, each of which is at (x, y).
#[inline(always)]
fn edge<V: Vector>(x: [V; 3], y: [V; 3], a: usize, b: usize) -> V {
    x[a].mul_sub(y[b], y[a].mul(x[b]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_rays_margin_is_that_of_many() {
        for width in [1.0, 1.25, 1.7, 2.0, 17.0] {
            for direction in [0.0, UNIT_ROUNDOFF, 1e-3, f32::INFINITY] {
                let of_many = Margin::<[f32; 4]>::new([width; 4], [direction; 4]);
                assert_eq!(Margin::of_one(width, direction).splat(), of_many, "{width} {direction}");
            }
        }
    }
}
