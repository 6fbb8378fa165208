//! A ray of a flight, and the one step at a time that it takes.

use std::hint::select_unpredictable;
use std::ops::{Deref, DerefMut};

use bytemuck::{Pod, Zeroable};

use super::target::TraversalTarget;
use crate::ray::Ray;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::Block;
use crate::trace::bvh::build::MAX_DEPTH;
use crate::trace::bvh::hits::found::Found;
use crate::trace::bvh::hits::listed::Listed;
use crate::trace::bvh::levels::placements::FIXED;
use crate::trace::bvh::node::{Child, Node, WIDTH};
use crate::trace::bvh::query::Query;
use crate::trace::bvh::reject::ready::ReadyRay;
use crate::trace::bvh::reject::woop::Sides;
use crate::trace::bvh::simd::{Mask, Simd};

/// Places on a stack: every level of a tree leaves at most seven siblings waiting; an object's tree stands upon that of
/// the placements, and each has [`Child::NONE`] at its bottom.
const STACK: usize = 512;

const _: () = assert!(2 * MAX_DEPTH * (WIDTH - 1) + 3 < STACK);

/// Where a ray is: at the fixed triangles, among the placements, or (2 and more) in an object's tree.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct TreeId(pub u32);

impl TreeId {
    pub const FIXED: Self = Self(0);
    /// Among the placements; and whoever comes through them arrives from here.
    pub const UPPER: Self = Self(1);

    #[inline(always)]
    pub fn object(index: u32) -> Self {
        Self(index + 2)
    }

    #[inline(always)]
    pub fn is_object(self) -> bool {
        self.0 >= 2
    }
}

/// A ray that sets out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    /// Which of the rays it is.
    pub ray: usize,
    /// The placement that it is in, or [`FIXED`].
    pub place: u32,
    pub tree_id: TreeId,
}

/// A ray on its way. What steps need is in as few cache lines as may be.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub(super) struct RayState {
    /// The ray where it set out, in the world mostly, and in the object where it is.
    ready: [ReadyRay; 2],
    /// Children on the stack.
    len: usize,
    /// Which of the rays it is.
    pub ray: usize,
    pub tree_id: TreeId,
    /// The placement that the ray is in, or [`FIXED`].
    place: u32,
    pub found: Found,
    /// Children waiting to be visited. Of two that a node leaves waiting the nearer is on top; of more nobody says
    /// which. Above the top is room for what is stored beside.
    stack: AlignedStack<Child>,
    /// Where the ray enters each: the bits of an f32, of which the lowest three are not part of it. Not told where
    /// order does not matter.
    near: AlignedStack<u32>,
    /// For queries that leave doubts to the caller.
    pub listed: Listed,
}

/// As many lines from one state to the next let those that steps need fall into different sets of a cache of 64 sets:
/// four of 32 states in one at most.
#[cfg(target_pointer_width = "64")]
const _: () = assert!(size_of::<RayState>() == 78 * 64);

/// A stack that begins with a cache line: what most rays have waiting, and what is stored above it, is in that one.
#[repr(align(64))]
#[derive(Clone, Copy)]
struct AlignedStack<T>([T; STACK + WIDTH]);

impl<T> Deref for AlignedStack<T> {
    type Target = [T; STACK + WIDTH];

    #[inline(always)]
    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl<T> DerefMut for AlignedStack<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl RayState {
    pub const NONE: Self = Self {
        ready: [ReadyRay::NONE; 2],
        found: Found::NONE,
        listed: Listed::NONE,
        ray: 0,
        len: 1,
        tree_id: TreeId::UPPER,
        place: FIXED,
        stack: AlignedStack([Child::NONE; STACK + WIDTH]),
        near: AlignedStack([0; STACK + WIDTH]),
    };

    /// Sets out with a ray of its own, for the root of the tree in which it starts; from the fixed triangles, where
    /// there are placements, then for theirs. What it reaches next: that root.
    #[inline(always)]
    pub fn start<Q: Query, G: TraversalTarget>(
        &mut self,
        Start { ray, place, tree_id }: Start,
        ready: &ReadyRay,
    ) -> Child {
        self.ready[0] = *ready;
        self.found.start(ready.end());
        if Q::LISTS {
            self.listed.start();
        }
        (self.ray, self.len) = (ray, 1);
        if G::HAS_PLACES {
            (self.place, self.tree_id) = (place, tree_id);
        }
        if G::HAS_PLACEMENTS && tree_id == TreeId::FIXED {
            // Near entries of 0: they stay whatever the ray hits.
            (self.near[1], self.stack[1]) = (0, Child::ROOT);
            (self.near[2], self.stack[2]) = (0, Child::NONE);
            self.len = 3;
        }
        Child::ROOT
    }

    /// The ray in the coordinates of the tree where it is.
    #[inline(always)]
    fn ready<G: TraversalTarget>(&self) -> &ReadyRay {
        &self.ready[usize::from(G::HAS_PLACEMENTS && self.tree_id.is_object())]
    }

    /// One node. What it reaches next, as of all steps.
    #[inline(always)]
    pub fn enter<S: Simd, Q: Query, G: TraversalTarget>(&mut self, node: &Node) -> Child {
        let (mask, near) = self.ready::<G>().slab().enter::<S>(node, self.found.limit);
        let len = self.len % STACK;
        let top = self.stack[len.wrapping_sub(1) % STACK];
        let (nears, stack) = (self.near[len..].first_chunk_mut(), self.stack[len..].first_chunk_mut());
        let (Some(nears), Some(stack)) = (nears, stack) else { return Child::NONE };
        if !Q::IN_ORDER {
            self.len = len + S::named_first(mask, &node.child, stack);
            return self.pop();
        }
        let (nearest, others) = S::nearest_apart(near, mask, &node.child, nears, stack);
        let is_none = mask.bits() == 0;
        self.len = len + others - usize::from(is_none);
        select_unpredictable(is_none, top, nearest)
    }

    /// What it sees of a block: what is to be told of that to [`Self::hit`], and which triangles it may pass within.
    #[inline(always)]
    pub fn look<S: Simd, G: TraversalTarget>(&self, block: &Block) -> (Sides<S::V8>, u32) {
        G::look::<S>(&self.ready::<G>().filter(), block)
    }

    /// One block of a leaf, all at once: looks at it, and takes what it hits.
    #[inline(always)]
    pub fn visit<S: Simd, Q: Query, G: TraversalTarget>(
        &mut self,
        leaf: Child,
        bvh: &Bvh,
        target: &G,
        rays: &[Ray],
    ) -> Child {
        let mut scratch = None;
        let block = target.block::<S>(self.tree_id, leaf.first(), &mut scratch);
        let (sides, passed) = self.look::<S, G>(block);
        let next = self.pass(leaf);
        let hit = if passed == 0 { None } else { self.hit::<S, Q, G>(leaf, block, &sides, passed, bvh, target, rays) };
        hit.unwrap_or(next)
    }

    /// Past this block of a leaf: on to the next one, or to what is on the stack; without a branch.
    #[inline(always)]
    pub fn pass(&mut self, leaf: Child) -> Child {
        let is_more = leaf.count() > 1;
        self.len -= usize::from(!is_more);
        select_unpredictable(is_more, leaf.rest(), self.stack[self.len % STACK])
    }

    /// What it hits of a block that it has looked at, and passed; what it reaches next, if that is another child now.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "what it has seen, and where")]
    pub fn hit<S: Simd, Q: Query, G: TraversalTarget>(
        &mut self,
        leaf: Child,
        block: &Block,
        sides: &Sides<S::V8>,
        passed: u32,
        bvh: &Bvh,
        target: &G,
        rays: &[Ray],
    ) -> Option<Child> {
        let (index, limit) = (leaf.first(), self.found.limit);
        let candidates = G::meet::<S>(&self.ready::<G>().filter(), block, sides, passed, limit);
        if candidates.lanes == 0 {
            return None;
        }
        let place = if G::HAS_PLACES { self.place } else { FIXED };
        let number = self.ray;
        Q::take(
            &mut self.found,
            &mut self.listed,
            bvh,
            place,
            index,
            block,
            &candidates,
            &rays[number],
            #[inline(always)]
            |lane| target.decide(number, block, lane),
        );
        if Q::ANY && self.found.is_hit() || Q::DOUBTS && self.listed.is_in_doubt() {
            self.tree_id = TreeId::UPPER;
            return Some(Child::NONE);
        }
        (self.found.limit < limit).then(
            #[inline(always)]
            || {
                // What it has come to may be beyond the limit, too, if it is from the stack, above whose top it is
                // still.
                self.len += usize::from(leaf.count() == 1);
                self.shorten::<S>();
                self.pass(leaf)
            },
        )
    }

    /// Into the placement that a leaf of the upper tree is.
    #[inline(always)]
    pub fn descend<S: Simd>(&mut self, leaf: Child, bvh: &Bvh, rays: &[Ray]) -> Child {
        let number = leaf.first();
        let (place, triangles) = bvh.object_at(number);
        if triangles.tree().is_empty() {
            return self.pop();
        }
        let (local, blur) = place.local::<S>(&rays[self.ray]);
        self.descend_ready(number, place.object, &ReadyRay::new::<S>(&local, triangles.tree().reach(), blur))
    }

    /// Into a placement of an object that has triangles, for which the ray was made ready.
    #[inline(always)]
    pub fn descend_ready(&mut self, number: u32, object: u32, ready: &ReadyRay) -> Child {
        self.ready[1] = *ready;
        let top = self.len % STACK;
        (self.near[top], self.stack[top]) = (0, Child::NONE);
        self.len = top + 1;
        (self.place, self.tree_id) = (number, TreeId::object(object));
        Child::ROOT
    }

    /// Out of it again.
    #[inline(always)]
    pub fn leave(&mut self) -> Child {
        self.tree_id = TreeId::UPPER;
        self.pop()
    }

    /// Goes on to what is on top; at last to [`Child::NONE`].
    #[inline(always)]
    fn pop(&mut self) -> Child {
        self.len -= 1;
        self.stack[self.len % STACK]
    }

    /// Leaves out what is beyond the limit: eight at a time, which are most often all there are, so that nobody has to
    /// guess how many.
    #[inline(always)]
    fn shorten<S: Simd>(&mut self) {
        let (len, mut kept) = (self.len % STACK, 1);
        for first in (1..len).step_by(WIDTH) {
            let (nears, children) = (self.near[first..].first_chunk(), self.stack[first..].first_chunk());
            let (Some(&nears), Some(&children)) = (nears, children) else { break };
            let (near, stack) = (self.near[kept..].first_chunk_mut(), self.stack[kept..].first_chunk_mut());
            let (Some(near), Some(stack)) = (near, stack) else { break };
            kept += S::within(self.found.limit, (&nears, &children), len - first, near, stack);
        }
        self.len = kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::bvh::random::entries_beyond_a_limit_go;
    use crate::trace::bvh::simd::isa::{Kernel, dispatch};

    struct Shorten<'a>(&'a mut RayState);

    impl Kernel for Shorten<'_> {
        type Output = ();

        #[inline(always)]
        fn run<S: Simd>(self) {
            self.0.shorten::<S>();
        }
    }

    /// What is beyond the limit goes, all else stays in its order, however much is on the stack.
    #[test]
    fn what_is_beyond_the_limit_goes() {
        let lens = [1, 2, 8, 9, 10, 17, 26, 100, STACK - 1];
        entries_beyond_a_limit_go(lens, |isa, entries, limit| {
            let mut state = RayState { len: entries.len() + 1, ..RayState::NONE };
            state.found.limit = limit;
            for (i, &(near, child)) in entries.iter().enumerate() {
                (state.near[i + 1], state.stack[i + 1]) = (near, child);
            }
            dispatch(isa, Shorten(&mut state));
            assert_eq!(state.stack[0], Child::NONE);
            state.near.0.into_iter().zip(state.stack.0).take(state.len).skip(1).collect()
        });
    }
}
