//! How far a point is at least from children of a node, and from the triangles of a block.
//!
//! The distance from a triangle is that of its nearest edge, or of its plane where the point may stand above it. With
//! u = 2^-24, L the farthest corner and S the longest edge, a point of an edge that is computed to be nearest is off by
//! less than 16 u L, for products are not divided by anything small; the height above the plane, times the normal N, by
//! 32 u L S S, and the side of an edge that the point is on, likewise multiplied, by 32 u L L S S. What cancels in a
//! sliver thus leaves the plane without a say, and its distance counts as 0.

use super::discs::Discs;
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::node::{Child, Node};
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector, size};

/// The children of `parent`, whose node is given, that are no farther than the square root of `limit_squared`, and no
/// more than the squared distance of each. Each component of the difference between a corner and the point may be less
/// by `pad` than it seems.
#[inline(always)]
pub(super) fn enter<S: Simd>(
    discs: &Discs,
    parent: Child,
    node: &Node,
    point: Vec3,
    pad: f32,
    limit_squared: f32,
) -> (<S::V8 as Vector>::Mask, S::V8) {
    let (zero, padding) = (S::V8::splat(0.0), S::V8::splat(pad));
    let mut square = zero;
    for axis in 0..3 {
        let p = S::V8::splat(point[axis]);
        let below = S::V8::load(&node.bounds[2 * axis]).sub(p);
        let above = p.sub(S::V8::load(&node.bounds[2 * axis + 1]));
        let outside = below.max(above).sub(padding).max(zero);
        square = outside.mul_add(outside, square);
    }
    // Empty slots are infinitely far away.
    let near = square.mul(S::V8::splat(1.0 - 8.0 * UNIT_ROUNDOFF)).max(discs.near::<S>(parent, point, pad));
    (near.at_most(S::V8::splat(limit_squared.min(f32::MAX))), near)
}

/// Of each triangle of a block what its distance is no less than.
#[derive(Clone, Copy)]
pub(super) struct Lower<V> {
    /// The squared distance, roughly: what comes first.
    square: [f32; LANES],
    /// By how much the distance may be less.
    error: V,
    /// A triangle is out of reach where this,
    bound: V,
    /// is more than the squared reach times this: 1 for an edge, for a plane the squared normal.
    weight: V,
}

impl<V: Vector> Lower<V> {
    /// Of no triangles.
    #[inline(always)]
    pub fn none() -> Self {
        let zero = V::splat(0.0);
        Self { square: [0.0; LANES], error: zero, bound: zero, weight: zero }
    }

    /// A bit for each lane whose triangle may be within `limit`.
    #[inline(always)]
    pub fn within(&self, limit: f32) -> u32 {
        let reach = V::splat(limit).add(self.error);
        let most = reach.mul(reach).mul(self.weight).mul(V::splat(1.0 + 1e-5));
        // Written so that NaN is within.
        !most.less(self.bound).bits()
    }

    /// The nearest of some lanes.
    #[inline(always)]
    pub fn nearest(&self, open: u32) -> usize {
        let mut best = open.trailing_zeros() as usize % LANES;
        let mut rest = open & (open - 1);
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize % LANES;
            rest &= rest - 1;
            if self.square[lane] < self.square[best] {
                best = lane;
            }
        }
        best
    }
}

type V3<V> = [V; 3];

#[inline(always)]
fn sub<V: Vector>(a: V3<V>, b: V3<V>) -> V3<V> {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

#[inline(always)]
fn dot<V: Vector>(a: V3<V>, b: V3<V>) -> V {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2].mul(b[2])))
}

#[inline(always)]
fn cross<V: Vector>(a: V3<V>, b: V3<V>) -> V3<V> {
    [a[1].mul_sub(b[2], a[2].mul(b[1])), a[2].mul_sub(b[0], a[0].mul(b[2])), a[0].mul_sub(b[1], a[1].mul(b[0]))]
}

/// The squared distance of zero from the segment from `a` along `edge`.
#[inline(always)]
fn segment<V: Vector>(a: V3<V>, edge: V3<V>) -> V {
    let (zero, one) = (V::splat(0.0), V::splat(1.0));
    let length = dot(edge, edge).max(V::splat(f32::MIN_POSITIVE));
    let share = zero.sub(dot(a, edge)).div(length).max(zero).min(one);
    let q = [edge[0].mul_add(share, a[0]), edge[1].mul_add(share, a[1]), edge[2].mul_add(share, a[2])];
    dot(q, q)
}

/// `error` is by how much a corner and the point may be off, both together, in each component; a corner besides by
/// `rounding` times its distance from the point.
#[inline(always)]
pub(super) fn lower_bounds<S: Simd>(block: &Block, point: Vec3, error: f32, rounding: f32) -> Lower<S::V8> {
    let (zero, splat) = (S::V8::splat(0.0), S::V8::splat);
    let p = [S::V8::splat(point.x), S::V8::splat(point.y), S::V8::splat(point.z)];
    let [xs, ys, zs] = &block.corners;
    let a = [S::V8::load(&xs[0]), S::V8::load(&ys[0]), S::V8::load(&zs[0])];
    let b = [S::V8::load(&xs[1]), S::V8::load(&ys[1]), S::V8::load(&zs[1])];
    let c = [S::V8::load(&xs[2]), S::V8::load(&ys[2]), S::V8::load(&zs[2])];
    // Before the point is the origin: their rounding is then as small as they are.
    let (ab, bc, ca) = (sub(b, a), sub(c, b), sub(a, c));
    let (a, b, c) = (sub(a, p), sub(b, p), sub(c, p));
    let edges = segment(a, ab).min(segment(b, bc)).min(segment(c, ca));

    let normal = cross(ab, bc);
    let square = dot(normal, normal);
    let height = dot(normal, a).abs();
    // On the inner side of each edge, seen along the normal.
    let sides = dot(normal, cross(b, bc)).min(dot(normal, cross(c, ca))).min(dot(normal, cross(a, ab)));
    let farthest = size(a).add(S::V8::splat(block.size));
    // What the corners and the point are off by counts as rounding does.
    let relative = S::V8::splat(32.0 * UNIT_ROUNDOFF);
    let error = farthest.mul_add(splat(rounding), splat(error));
    let off = farthest.mul_add(relative, error.mul(splat(8.0)));
    let area = S::V8::splat(3.0 * block.size * block.size);
    // A plane that is tilted is farther off the farther away it is.
    let tilt = error.mul(splat(24.0 * block.size)).mul(farthest);
    let height_error = off.mul(area).mul(S::V8::splat(3.0)).add(tilt);
    let side_error = off.mul(area).mul(S::V8::splat(9.0)).mul(farthest);
    // Not surely outside.
    let above = zero.sub(side_error).at_most(sides);
    let least = height.sub(height_error).max(zero);
    let plane = height.mul(height).div(square.max(S::V8::splat(f32::MIN_POSITIVE)));
    // The normal is off as well, each component by 4 (error + u S) S, and with it the square.
    let normal_error = error.mul_add(splat(16.0 * block.size), splat(32.0 * UNIT_ROUNDOFF * block.size * block.size));
    let size = normal_error.mul(area).mul(S::V8::splat(4.0)).add(square);
    Lower {
        square: S::V8::select(above, plane.min(edges), edges).to_array(),
        error: off,
        bound: S::V8::select(above, least.mul(least), edges),
        weight: S::V8::select(above, size, S::V8::splat(1.0)),
    }
}
