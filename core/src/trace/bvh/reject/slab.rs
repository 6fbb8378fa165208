//! A ray against eight boxes at once, conservatively.
//!
//! A slab's t is bound * (1 / direction) - origin * (1 / direction): with u = 2^-24, the reciprocal, both products, the
//! sum and the offset below round by less than 5 u |1/d| (|bound| + |origin|) together, fused or not. Boxes in the tree
//! are wider by 7 u |bound| than what is in them ([`crate::trace::bvh::node::widened`]), and the near and far t are
//! moved apart by 6 u |1/d| |origin|: an exact hit is never lost, and there is slack for the rounding of the hit's own
//! t. (Ize 2013, *Robust BVH ray traversal*, moves the far t by a relative 2 ulp instead, which needs bound - origin to
//! be formed first: twice the operations. To move both t by the largest coordinate in the tree makes rays in the middle
//! of a large ground enter all that is near them.) What is no normal number rounds by more than that: hence another
//! 2^-126, of t and of lengths.
//!
//! A direction component that is zero, or small against the largest, is replaced by 1e-18 of it, and the pad by how far
//! the ray strays then: 1/d stays finite, and no 0 * infinity arises. An axis on which something still overflows, or
//! 1/d is no normal number, which may be flushed to zero, is left open: [`OPEN`]. An infinite pad would do for boxes,
//! but empty slots, whose bounds are infinite, would pass as well.
//!
//! A ray in an object's coordinates may be off by more ([`Blur`]), its origin by b and its direction by r times the
//! largest component: at the t of a hit, at most the largest span over that component, the span being what is between
//! the origin and the box, it is off by b + r span, and the pad is wider by this over the component. Boxes are wider by
//! 5 u of their largest coordinate, so that the span is the origin's largest coordinate unless r is more than
//! [`SLIGHT`], and else that and the reach, the largest coordinate in the tree.

use super::Blur;
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;
use crate::trace::bvh::node::{Node, WIDENED, WIDENED_ALL};
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector, size};

/// A ray made ready for slab tests in one tree.
#[derive(Clone, Copy, Debug)]
pub(in crate::trace::bvh) struct SlabRay {
    /// Of each axis, and one number more, as a vector is stored.
    pub reciprocal: [f32; 4],
    /// -origin / direction, less the pad.
    pub near_offset: [f32; 4],
    /// -origin / direction, plus the pad.
    pub far_offset: [f32; 4],
    /// On each axis which of a node's rows has the sides that are met first, as [`SlabRay::first_rows`] says.
    pub first: [u32; 3],
    /// Rounded down, for t is rounded before it is held against it; not below 0.
    pub tmin: f32,
}

/// The smallest share of the largest direction component that a component keeps.
pub(in crate::trace::bvh) const SMALLEST: f32 = 1e-18;

/// Directions that are off by no more need no pad for how far away boxes are.
pub(in crate::trace::bvh) const SLIGHT: f32 = 4.5 * UNIT_ROUNDOFF;

const _: () = assert!(1.1 * SLIGHT < WIDENED_ALL && 6.0 * UNIT_ROUNDOFF < WIDENED);

/// Products of this size are not trusted to be finite after a sum.
pub(in crate::trace::bvh) const HUGE: f32 = 1e37;

/// The magnitude of 1/d on an axis that is open: products with coordinates are finite, those with the bounds of an
/// empty slot are not. Offsets are the largest numbers then, so that every box is entered at once, and not left.
const OPEN: f32 = f32::MIN_POSITIVE;

impl SlabRay {
    /// `reach` is the tree's.
    #[inline(always)]
    pub fn new<S: Simd>(ray: &Ray, reach: Vec3, blur: Blur) -> Self {
        let Slabs { reciprocal, near, far, is_negative } = Slabs::of_ray::<S>(ray, reach, blur);
        let negative = is_negative.bits();
        Self {
            reciprocal: reciprocal.to_array(),
            near_offset: near.to_array(),
            far_offset: far.to_array(),
            first: Self::first_rows(negative),
            tmin: least_t(ray.tmin),
        }
    }

    /// The rows of bounds that a ray meets first, one of two for each axis: how many bytes after the first row they
    /// start. A bit is set for each axis along which it goes down.
    #[inline(always)]
    pub fn first_rows(negative: u32) -> [u32; 3] {
        [
            (negative & 1) * Node::ROW,
            (negative >> 1 & 1) * Node::ROW + 2 * Node::ROW,
            (negative >> 2 & 1) * Node::ROW + 4 * Node::ROW,
        ]
    }

    /// The children the ray may hit something in, up to `limit`; and where it enters each, not below 0.
    #[inline(always)]
    pub fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        self.enter_rows::<S>(
            limit,
            #[inline(always)]
            |offset| S::row(node, offset),
        )
    }

    /// The same of the rows of bounds that are so many bytes after a node's first one.
    #[inline(always)]
    pub fn enter_rows<S: Simd>(&self, limit: f32, row: impl Fn(u32) -> S::V8) -> (<S::V8 as Vector>::Mask, S::V8) {
        let mut near = S::V8::splat(self.tmin);
        let mut far = S::V8::splat(limit);
        for axis in 0..3 {
            let first = row(self.first[axis]);
            let second = row(self.first[axis] ^ Node::ROW);
            let reciprocal = S::V8::splat(self.reciprocal[axis]);
            // The accumulator second, so that a NaN (infinity less infinity) is passed over.
            near = first.mul_add(reciprocal, S::V8::splat(self.near_offset[axis])).max(near);
            far = second.mul_add(reciprocal, S::V8::splat(self.far_offset[axis])).min(far);
        }
        (near.at_most(far), near)
    }
}

/// Slabs, each in a lane: of one ray an axis a lane, or of one axis a ray a lane.
#[derive(Clone, Copy)]
pub(in crate::trace::bvh) struct Slabs<V: Vector> {
    pub reciprocal: V,
    pub near: V,
    pub far: V,
    pub is_negative: V::Mask,
}

impl<V: Vector> Slabs<V> {
    /// Of one ray; the fourth lane means nothing.
    #[inline(always)]
    pub fn of_ray<S: Simd<V4 = V>>(ray: &Ray, reach: Vec3, blur: Blur) -> Self {
        let splat = S::V4::splat;
        let (o, d) = (lanes::<S>(ray.origin), lanes::<S>(ray.direction));
        let largest = ray.direction.abs().max_element();
        let smallest = (SMALLEST * largest).max(f32::MIN_POSITIVE);
        let away = o.abs();
        let span = away.add(lanes::<S>(reach));
        let farthest = (ray.origin.abs() + reach).max_element();
        let strayed = if blur.direction <= SLIGHT { ray.origin.abs().max_element() } else { farthest };
        let stray =
            4.0 * (smallest / largest) * farthest + 1.1 * (blur.direction * strayed + blur.origin) + f32::MIN_POSITIVE;
        Self::new(o, d, away, span, splat(smallest), splat(stray))
    }

    /// Of as many rays as there are lanes, axis by axis. Origins are off by `off`, directions by `turn` of their
    /// largest component.
    #[inline(always)]
    pub fn of_rays(origin: [V; 3], direction: [V; 3], reach: [V; 3], off: V, turn: V) -> [Self; 3] {
        let splat = V::splat;
        let ([x, y, z], [dx, dy, dz], [rx, ry, rz]) = (origin, direction, reach);
        let largest = size(direction);
        let smallest = largest.mul(splat(SMALLEST)).max(splat(f32::MIN_POSITIVE));
        let [ax, ay, az] = [x.abs(), y.abs(), z.abs()];
        let [sx, sy, sz] = [ax.add(rx), ay.add(ry), az.add(rz)];
        let farthest = sx.max(sy).max(sz);
        let strayed = V::select(turn.at_most(splat(SLIGHT)), ax.max(ay).max(az), farthest);
        let stray = turn.mul_add(strayed, off).mul_add(splat(1.1), splat(f32::MIN_POSITIVE));
        let stray = smallest.div(largest).mul(splat(4.0)).mul_add(farthest, stray);
        [
            Self::new(x, dx, ax, sx, smallest, stray),
            Self::new(y, dy, ay, sy, smallest, stray),
            Self::new(z, dz, az, sz, smallest, stray),
        ]
    }

    /// `away` is the origin's magnitude, `span` that and the reach, `smallest` what a direction's component is at least
    /// taken to be, and `stray` how far the ray may be off besides rounding, with room for lengths that are no normal
    /// numbers.
    #[inline(always)]
    fn new(origin: V, direction: V, away: V, span: V, smallest: V, stray: V) -> Self {
        let (splat, zero) = (V::splat, V::splat(0.0));
        let is_negative = direction.less(zero);
        let least = V::select(is_negative, zero.sub(smallest), smallest);
        let reciprocal = splat(1.0).div(V::select(direction.abs().less(smallest), least, direction));
        let steep = reciprocal.abs();
        let width = steep.mul_add(away.mul_add(splat(6.0 * UNIT_ROUNDOFF), stray), splat(f32::MIN_POSITIVE));
        let is_small = steep.mul(span).less(splat(HUGE)).and(width.less(splat(HUGE)));
        let is_small = is_small.and(splat(OPEN).at_most(steep));
        let offset = zero.sub(origin).mul(reciprocal);
        let open = V::select(is_negative, splat(-OPEN), splat(OPEN));
        let reciprocal = V::select(is_small, reciprocal, open);
        let near = V::select(is_small, offset.sub(width), splat(-f32::MAX));
        let far = V::select(is_small, offset.add(width), splat(f32::MAX));
        Self { reciprocal, near, far, is_negative }
    }
}

/// A least t, rounded down, for t is rounded before it is held against it; not below 0.
#[inline(always)]
pub(in crate::trace::bvh) fn least_t(tmin: f32) -> f32 {
    (tmin * (1.0 - 4.0 * UNIT_ROUNDOFF) - f32::MIN_POSITIVE).max(0.0)
}

/// A most t, rounded up, for t is rounded before it is held against it.
#[inline(always)]
pub(in crate::trace::bvh) fn most_t(tmax: f32) -> f32 {
    tmax * (1.0 + MOST_T_SLACK) + f32::MIN_POSITIVE
}

/// By how much [`most_t`] is above.
pub(super) const MOST_T_SLACK: f32 = 8.0 * UNIT_ROUNDOFF;

#[inline(always)]
fn lanes<S: Simd>(v: Vec3) -> S::V4 {
    S::V4::load(&[v.x, v.y, v.z, 0.0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Aabb;
    use crate::trace::bvh::alone::SingleRay;
    use crate::trace::bvh::node::Child;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::reject::ready::ReadyRays;
    use crate::trace::bvh::simd::Portable;
    use crate::trace::bvh::tree::Tree;

    /// The box around a point of a ray is entered at its t, whoever makes the ray ready, and whatever lies beside it
    /// far away; also where the ray is off.
    #[test]
    fn no_point_of_a_ray_is_lost() {
        let (mut random, mut valid) = (Random::new(31), 0);
        for round in 0..240_000 {
            let turn = [0.0, SLIGHT * 0.99][round / 16 % 2];
            let Some((ray, bounds)) = random.ray_and_point(turn) else { continue };
            valid += 1;
            let mut node = Node::empty();
            let slot = round % 8;
            node.set(slot, &bounds, Child::leaf(0, 1));
            if round / 32 % 2 == 0 {
                let far = Vec3::splat(1e9);
                node.set((slot + 1) % 8, &Aabb { min: far, max: far }, Child::leaf(1, 1));
            }
            let tree = Tree::new(vec![node]);
            let limit = ray.tmax * (1.0 + 4.0 * UNIT_ROUNDOFF) + f32::MIN_POSITIVE;
            // An origin in an object's coordinates is never without.
            let blur = if turn == 0.0 { Blur::NONE } else { Blur { origin: f32::MIN_POSITIVE, direction: turn } };
            let mut rays = ReadyRays::new(std::slice::from_ref(&ray), tree.reach(), blur);
            rays.next::<Portable>().expect("a valid ray");
            let (single, reach) = (SingleRay::from(&ray), tree.reach_row());
            let single = if turn == 0.0 {
                single.ready::<Portable, false>(reach, blur)
            } else {
                single.ready::<Portable, true>(reach, blur)
            };
            let (single, _) = single.expect("a valid ray");
            let slabs = [SlabRay::new::<Portable>(&ray, tree.reach(), blur), rays.ready().slab(), single];
            for (slab, how) in slabs.iter().zip(["by itself", "of eight", "alone"]) {
                let (entered, _) = slab.enter::<Portable>(&node, limit);
                assert!(entered.bits() >> slot & 1 == 1, "{how}: {ray:?}, off by {turn}, misses {bounds:?}");
            }
        }
        assert!(valid > 150_000, "{valid}");
    }
}
