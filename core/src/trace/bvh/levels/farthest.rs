//! What lies farthest one way: the search for it, from the root of a tree down to corners.

use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::build::MAX_DEPTH;
use crate::trace::bvh::node::{Child, Node, WIDTH};
use crate::trace::bvh::simd::{Array, Simd, Vector, everywhere};
use crate::trace::bvh::tree::Tree;

/// Children that wait while a tree is searched, and by how much each falls short, as [`Simd::nearest_apart`] tells it:
/// the lowest three bits mean nothing, and without them it is a little less. Unlike where
/// [points](crate::trace::bvh::near) wait, nobody goes through them when something farther is found: each is asked when
/// it is its turn, since a search wants to know of those it comes to by how much they fall short.
pub(in crate::trace::bvh) struct SupportStack {
    short: [u32; ENTRIES],
    child: [Child; ENTRIES],
    len: usize,
}

/// Every level leaves at most seven siblings waiting, and eight are written at a time.
const ENTRIES: usize = MAX_DEPTH * (WIDTH - 1) + WIDTH;

impl SupportStack {
    pub fn new() -> Self {
        Self { short: [0; ENTRIES], child: [Child::NONE; ENTRIES], len: 0 }
    }

    /// Room above the top, of which [`Self::push`] takes as much as it is told.
    #[inline(always)]
    fn above(&mut self) -> (&mut [u32; WIDTH], &mut [Child; WIDTH]) {
        let room = "trees are no deeper";
        let (short, child) = (&mut self.short[self.len..], &mut self.child[self.len..]);
        (short.first_chunk_mut().expect(room), child.first_chunk_mut().expect(room))
    }

    #[inline(always)]
    fn push(&mut self, count: usize) {
        self.len += count;
    }

    /// The next that falls less short than `least`.
    #[inline(always)]
    fn pop(&mut self, least: f32) -> Option<(f32, Child)> {
        while self.len > 0 {
            self.len -= 1;
            let short = short(self.short[self.len]);
            if short < least {
                return Some((short, self.child[self.len]));
            }
        }
        None
    }

    /// The least by which any falls short, or infinity.
    fn least(&self) -> f32 {
        self.short[..self.len].iter().map(|&key| short(key)).fold(f32::INFINITY, f32::min)
    }
}

#[inline(always)]
fn short(key: u32) -> f32 {
    f32::from_bits(key & !7)
}

impl Tree {
    /// At least the scalar product of `way` with any point of anything; infinite where f32 might overflow, or nothing
    /// may be visited. `of_leaf` is that of a leaf, as f32 rounds it, or infinite. Of each node the child is visited
    /// first that may reach farthest, until nothing reaches farther than what has been found and the 256th part of the
    /// width, or so many nodes and leaves have been visited. `first` is a leaf that is asked before all others, which
    /// is no visit, and then one of those that reach farthest: of ways that differ little, mostly the same. The bits
    /// are the same whatever the instruction set, since trees are made of them.
    #[inline(always)]
    pub fn farthest<S: Simd>(
        &self,
        way: Vec3,
        visits: usize,
        waiting: &mut SupportStack,
        first: &mut Option<Child>,
        of_leaf: impl Fn(Child) -> f32,
    ) -> f64 {
        if self.is_empty() {
            return f64::NEG_INFINITY;
        }
        let size = way.abs().dot(self.reach());
        if visits == 0 || size.is_nan() || size > f32::MAX / 4.0 {
            return f64::INFINITY;
        }
        let bounds = self.bounds();
        let upper = way.cmpge(Vec3::ZERO);
        let spare = way.abs().dot(bounds.size()) / 256.0;
        // The corner of the box around all that is farthest: everything is told by how much it falls short of that.
        // Not -0, which keys could not put in order.
        let most = Vec3::select(upper, bounds.max, bounds.min).dot(way) + 0.0;
        let row = |axis: u32| (2 * axis + u32::from(upper.test(axis as usize))) * Node::ROW;
        let rows = [row(0), row(1), row(2)];
        let [x, y, z] = everywhere::<S::V8>(way);
        let mut least = match *first {
            Some(leaf) => (most - (of_leaf(leaf) + spare)).max(0.0),
            None => f32::INFINITY,
        };
        waiting.len = 0;
        let mut next = Some((0.0, Child::ROOT));
        let mut left = visits;
        while let Some((short, child)) = next {
            if left == 0 {
                least = least.min(short).min(waiting.least());
                break;
            }
            left -= 1;
            if child.is_leaf() {
                let short = (most - (of_leaf(child) + spare)).max(short);
                if short < least {
                    (least, *first) = (short, Some(child));
                }
                next = waiting.pop(least);
                continue;
            }
            let node = self.node(child);
            let [bx, by, bz] = [S::row(node, rows[0]), S::row(node, rows[1]), S::row(node, rows[2])];
            // Not fused, which would round otherwise.
            let reach = x.mul(bx).add(y.mul(by)).add(z.mul(bz));
            // An empty slot falls infinitely short, or by what is not a number.
            let short = S::V8::splat(0.0).max(S::V8::splat(most).sub(reach));
            let mask = short.less(S::V8::splat(least));
            let nearest = S::V8::select(mask, short, S::V8::splat(f32::INFINITY)).smallest();
            let (other_short, other_child) = waiting.above();
            let (child, others) = S::nearest_apart(short, mask, &node.child, other_short, other_child);
            waiting.push(others);
            next = if nearest < least { Some((nearest, child)) } else { waiting.pop(least) };
        }
        // Three products and two sums of what is farthest, their difference from another such sum, what is spared, and
        // the other sum itself where they are held to differ by nothing: eight roundings, with as much again to spare;
        // and products that underflow.
        f64::from(most) - f64::from(least) + f64::from(16.0 * UNIT_ROUNDOFF * size + f32::MIN_POSITIVE)
    }
}

impl Block {
    /// The largest scalar product of `way` with a corner, as f32 rounds it.
    #[inline(always)]
    pub fn farthest<S: Simd>(&self, way: Vec3) -> f32 {
        let [x, y, z] = everywhere::<S::V8>(way);
        let [px, py, pz] = &self.corners;
        let mut most = S::V8::splat(f32::NEG_INFINITY);
        for k in 0..3 {
            let [bx, by, bz] = [S::V8::load(&px[k]), S::V8::load(&py[k]), S::V8::load(&pz[k])];
            // Not fused, as above.
            most = most.max(x.mul(bx).add(y.mul(by)).add(z.mul(bz)));
        }
        if self.lanes == (1 << LANES) - 1 {
            return most.largest();
        }
        let most = most.to_array();
        self.used().map(|lane| most[lane]).fold(f32::NEG_INFINITY, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_bits_of_keys_mean_nothing() {
        let mut waiting = SupportStack::new();
        let key = |short: f32, slot| short.to_bits() & !7 | slot;
        let (short, child) = waiting.above();
        short[..3].copy_from_slice(&[key(3.0, 7), key(1.0, 5), key(2.0, 6)]);
        child[..3].copy_from_slice(&[Child(3), Child(1), Child(2)]);
        waiting.push(3);
        assert_eq!(waiting.least(), 1.0);
        assert_eq!(waiting.pop(2.0_f32.next_up()), Some((2.0, Child(2))));
        assert_eq!(waiting.pop(1.0), None, "neither falls less short");
        assert_eq!(waiting.least(), f32::INFINITY, "nothing is left");
    }

    #[test]
    fn there_is_room_for_the_deepest_tree() {
        let mut waiting = SupportStack::new();
        for level in 0..MAX_DEPTH {
            let (short, child) = waiting.above();
            (*short, *child) = ([level as u32; WIDTH], [Child(level as u32); WIDTH]);
            waiting.push(WIDTH - 1);
        }
        _ = waiting.above();
        assert_eq!(waiting.pop(f32::INFINITY).map(|(_, child)| child), Some(Child(MAX_DEPTH as u32 - 1)));
    }
}
