//! The rays of a packet as one: what bounds their origins and directions, held against eight boxes at a time.
//!
//! By interval arithmetic (Wald, Boulos, Shirley 2007, *Ray tracing deformable scenes using dynamic bounding volume
//! hierarchies*): with x the least that a slab's distance from an origin may be, no ray enters it before x times the
//! least magnitude of 1 / d, if it is ahead of the origins; with x the largest, none leaves it after x times the
//! largest. What is behind gives something below 0 either way, which as an entry means the same as 0, and as an exit
//! that nothing is met. The one origin and the one reciprocal of a side belong together, so the product may be computed
//! as that of a single ray is ([`crate::trace::bvh::reject::slab`]), bound times reciprocal and an offset. Intervals of
//! origin / d and of 1 / d would vary apart from each other, which rays that start in one point do not.
//!
//! With u = 2^-24, the moved origin, the reciprocal, both products and the sum round by less than 5 u |1/d| (|bound| +
//! |origin|) together, fused or not; the origin is moved by 10 u of itself, and boxes, in the tree
//! ([`crate::trace::bvh::node::widened`]) and around triangles, are wide by as much of their bounds, which leaves room
//! for the rounding of the hit's own t. The origin is moved by another 2^-126, and each offset by 2^-124, for lengths
//! and t that are no normal numbers, be they flushed to zero. Small components of directions are replaced as for single
//! rays.

use super::Packet;
use crate::math::{Aabb, UNIT_ROUNDOFF};
use crate::trace::bvh::block::Block;
use crate::trace::bvh::node::{Node, WIDENED, WIDENED_ALL};
use crate::trace::bvh::reject::slab::{HUGE, SMALLEST, least_t};
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector, axes};
use crate::trace::bvh::walk::Enter;

/// Rays that go the same way.
pub(super) struct Beam {
    /// The axis along which directions are large, before it the two that follow it.
    pub axes: [usize; 3],
    /// The farthest t that any ray wants, rounded up.
    pub limit: f32,
    /// Whether rays are so far apart, for the size of the scene, that they have little in common.
    pub is_wide: bool,
    /// On each axis whether a box's upper side is met first.
    pub is_backward: [bool; 3],
    /// Of the sides that are met first: on each axis less the origin farthest on, and the pad, times the reciprocal.
    /// One number more, here and below, as a vector is stored.
    near_offset: [f32; 4],
    /// Of the sides that are met last: less the origin farthest back, moved back by the pad, times the reciprocal.
    far_offset: [f32; 4],
    /// 1 / direction, of the least magnitude.
    least: [f32; 4],
    /// The same of the largest.
    most: [f32; 4],
    /// The least of all, rounded down.
    tmin: f32,
}

/// By what share of themselves origins are moved, and boxes are wide.
const ROUNDING: f32 = 10.0 * UNIT_ROUNDOFF;

const _: () = assert!(ROUNDING < WIDENED + WIDENED_ALL);

/// Directions longer than this have reciprocals that may vanish.
const LONGEST: f32 = 1e30;

/// Share of the scene that the rays of a beam among triangles may be apart.
pub(super) const WIDE: f32 = 1.0 / 16.0;

impl Beam {
    /// Of rays of which each is valid; none where they go different ways. It is wide where they are more than the share
    /// `wide` of `bounds` apart.
    #[inline(always)]
    pub fn new<S: Simd, const N: usize>(packets: &[&Packet; N], bounds: Aabb, wide: f32) -> Option<Self> {
        let (mut least, mut most) = (S::V8::splat(f32::INFINITY), S::V8::splat(f32::NEG_INFINITY));
        for packet in packets {
            // Each row a ray: the least and the most of all its numbers at once.
            for ray in S::transpose(packet.rows::<S>()) {
                (least, most) = (ray.min(least), ray.max(most));
            }
        }
        let magnitude = least.abs().max(most.abs());
        // The least magnitude, where all rays run one way.
        let [_, _, _, x, y, z, ..] = least.max(S::V8::splat(0.0).sub(most)).to_array();
        let (along, depth) = if x > y && x > z {
            (0, x)
        } else if y > z {
            (1, y)
        } else {
            (2, z)
        };
        // What `woop` allows.
        let is_gentle = magnitude.at_most(S::V8::splat((2.0 * depth).min(LONGEST))).bits() >> 3 & 0b111 == 0b111;
        if depth <= 0.0 || !is_gentle {
            return None;
        }
        let [ox, oy, oz, mut dx, mut dy, mut dz, tmin, _] = least.to_array();
        let [px, py, pz, mut ex, mut ey, mut ez, _, tmax] = most.to_array();
        let smallest = (2.0 * SMALLEST * depth).max(f32::MIN_POSITIVE);
        let is_clamped = x.min(y).min(z) < smallest;
        if is_clamped {
            ([dx, dy, dz], [ex, ey, ez]) = clamp([dx, dy, dz], [ex, ey, ez], smallest)?;
        }
        // An axis a lane; the fourth means nothing.
        let splat = S::V4::splat;
        let (first, last) = (S::V4::load(&[ox, oy, oz, 0.0]), S::V4::load(&[px, py, pz, 0.0]));
        let (low, high) = (S::V4::load(&[dx, dy, dz, 1.0]), S::V4::load(&[ex, ey, ez, 1.0]));
        let [rx, ry, rz] = bounds.min.abs().max(bounds.max.abs()).to_array();
        let away = first.abs().max(last.abs());
        let span = away.add(S::V4::load(&[rx, ry, rz, 0.0]));
        let stray = if is_clamped { 4.0 * (smallest / depth) * span.largest() } else { 0.0 };
        let pad = away.mul_add(splat(ROUNDING), splat(stray + f32::MIN_POSITIVE));
        let (shortest, longest) = (splat(1.0).div(high), splat(1.0).div(low));
        let steepest = shortest.abs().max(longest.abs());
        if steepest.mul(span.add(pad)).less(splat(HUGE)).bits() & 0b111 != 0b111 {
            return None;
        }
        let is_backward = low.less(splat(0.0));
        let (back, on) = (first.sub(pad), last.add(pad));
        let extent = (bounds.max - bounds.min).max_element();
        let apart = high.sub(low).mul_add(splat(extent / depth), last.sub(first));
        let backward = is_backward.bits();
        let least = S::V4::select(is_backward, longest, shortest);
        let most = S::V4::select(is_backward, shortest, longest);
        let (near_origin, far_origin) = (S::V4::select(is_backward, back, on), S::V4::select(is_backward, on, back));
        let tiny = splat(4.0 * f32::MIN_POSITIVE);
        let zero = splat(0.0);
        Some(Self {
            axes: axes(along),
            limit: tmax.next_up(),
            is_wide: apart.less(splat(wide * extent)).bits() & 0b111 != 0b111,
            is_backward: [backward & 1 != 0, backward & 2 != 0, backward & 4 != 0],
            near_offset: zero.sub(near_origin.mul_add(least, tiny)).to_array(),
            far_offset: zero.sub(far_origin.mul_sub(most, tiny)).to_array(),
            least: least.to_array(),
            most: most.to_array(),
            tmin: least_t(tmin),
        })
    }

    /// Between the sides that are met first and those that are met last.
    #[inline(always)]
    fn between<V: Vector>(&self, near_side: [V; 3], far_side: [V; 3], limit: f32) -> (V::Mask, V) {
        let (mut near, mut far) = (V::splat(self.tmin), V::splat(limit));
        for axis in 0..3 {
            let first = near_side[axis].mul_add(V::splat(self.least[axis]), V::splat(self.near_offset[axis]));
            let last = far_side[axis].mul_add(V::splat(self.most[axis]), V::splat(self.far_offset[axis]));
            (near, far) = (first.max(near), last.min(far));
        }
        (near.at_most(far), near)
    }

    /// A bit for each triangle of a block whose box some ray may meet up to `limit`.
    #[inline(always)]
    pub fn triangles<S: Simd>(&self, block: &Block, limit: f32) -> u32 {
        let zero = S::V8::splat(0.0);
        let (mut near, mut far) = ([zero; 3], [zero; 3]);
        let (down, up) = (S::V8::splat(-ROUNDING), S::V8::splat(ROUNDING));
        for axis in 0..3 {
            let [a, b, c] = &block.corners[axis];
            let (a, b, c) = (S::V8::load(a), S::V8::load(b), S::V8::load(c));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let (low, high) = (low.abs().mul_add(down, low), high.abs().mul_add(up, high));
            (near[axis], far[axis]) = if self.is_backward[axis] { (high, low) } else { (low, high) };
        }
        self.between(near, far, limit).0.bits() & block.lanes
    }
}

/// Least and largest components of directions without small ones, which count as running the way of the others; none
/// where these run both ways.
#[cold]
#[inline(never)]
fn clamp(mut low: [f32; 3], mut high: [f32; 3], smallest: f32) -> Option<([f32; 3], [f32; 3])> {
    for (low, high) in low.iter_mut().zip(&mut high) {
        if *low > -smallest {
            (*low, *high) = (low.max(smallest), high.max(smallest));
        } else if *high < smallest {
            (*low, *high) = (low.min(-smallest), high.min(-smallest));
        } else {
            return None;
        }
    }
    Some((low, high))
}

impl Enter for Beam {
    #[inline(always)]
    fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        let zero = S::V8::splat(0.0);
        let (mut near, mut far) = ([zero; 3], [zero; 3]);
        for axis in 0..3 {
            let side = usize::from(self.is_backward[axis]);
            near[axis] = S::V8::load(&node.bounds[2 * axis + side]);
            far[axis] = S::V8::load(&node.bounds[2 * axis + 1 - side]);
        }
        self.between(near, far, limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::trace::bvh::node::Child;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::Portable;
    use crate::trace::bvh::tree::Tree;

    /// As of single rays: the box around a point of a ray that makes up a beam is entered, in the tree and as that
    /// around a triangle, whatever lies far away.
    #[test]
    fn no_point_of_a_beam_is_lost() {
        let (mut random, mut beams) = (Random::new(32), 0);
        for round in 0..240_000 {
            let Some((ray, bounds)) = random.ray_and_point(0.0) else { continue };
            let (mut node, mut block) = (Node::empty(), Block::EMPTY);
            node.set(0, &bounds, Child::leaf(0, 1));
            block.push([bounds.min, bounds.max, bounds.min], 0, 0);
            if round % 2 == 0 {
                let far = Vec3::splat(1e9);
                node.set(1, &Aabb { min: far, max: far }, Child::leaf(1, 1));
            }
            let mut packet = Packet::NONE;
            (0..Packet::RAYS).for_each(|lane| packet.set(lane, &ray));
            let Some(beam) = Beam::new::<Portable, 1>(&[&packet], Tree::new(vec![node]).bounds(), WIDE) else {
                continue;
            };
            beams += 1;
            let (entered, _) = beam.enter::<Portable>(&node, beam.limit);
            assert!(entered.bits() & 1 == 1, "{ray:?} misses {bounds:?}");
            let met = beam.triangles::<Portable>(&block, beam.limit);
            assert!(met & 1 == 1, "{ray:?} misses the triangle in {bounds:?}");
        }
        assert!(beams > 100_000, "{beams}");
    }
}
