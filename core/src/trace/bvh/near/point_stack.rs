//! The children that wait while a point goes on to another.
//!
//! As of the rays in a [flight](crate::trace::bvh::flight), whose stack is among what else they carry: with one type
//! for both, rays took 1 to 5 % longer. Nothing here takes a branch that depends on how many are entered, for which is
//! anyone's guess. Only when a limit shrinks is what waits gone through; so what waits is always to be visited.

use std::hint::select_unpredictable;

use crate::trace::bvh::build::MAX_DEPTH;
use crate::trace::bvh::node::{Child, WIDTH};
use crate::trace::bvh::simd::{Mask, Simd, Vector};

/// Every level of a tree leaves at most seven siblings waiting, above [`Child::NONE`] at the bottom.
const MAX: usize = (MAX_DEPTH * (WIDTH - 1) + 2).next_power_of_two();

/// A stack of children.
#[derive(Clone, Copy)]
pub(super) struct PointStack {
    len: usize,
    /// [`Child::NONE`] at the bottom. Of two that a node leaves waiting the nearer is on top; of more nobody says
    /// which. Above the top is room for what is stored beside.
    children: [Child; MAX + WIDTH],
    /// The squared distance of each: the bits of an f32, of which the lowest three are not part of it.
    near: [u32; MAX + WIDTH],
}

impl PointStack {
    /// Of a point at the end of its way.
    pub const EMPTY: Self = Self { len: 1, children: [Child::NONE; MAX + WIDTH], near: [0; MAX + WIDTH] };

    /// Nobody is waiting any more: what comes next is [`Child::NONE`].
    #[inline(always)]
    pub fn clear(&mut self) {
        self.len = 1;
    }

    /// Goes on to the nearest of the children that the mask names, or to what is on top where it names none; the others
    /// wait.
    #[inline(always)]
    pub fn enter<S: Simd>(&mut self, near: S::V8, mask: <S::V8 as Vector>::Mask, children: &[Child; WIDTH]) -> Child {
        let len = self.len % MAX;
        let top = self.children[len.wrapping_sub(1) % MAX];
        let (nears, stack) = (self.near[len..].first_chunk_mut(), self.children[len..].first_chunk_mut());
        let (Some(nears), Some(stack)) = (nears, stack) else { return Child::NONE };
        let (nearest, others) = S::nearest_apart(near, mask, children, nears, stack);
        let is_none = mask.bits() == 0;
        self.len = len + others - usize::from(is_none);
        select_unpredictable(is_none, top, nearest)
    }

    /// Past this block of a leaf: on to the next one, or to what is on top.
    #[inline(always)]
    pub fn pass(&mut self, leaf: Child) -> Child {
        let is_more = leaf.count() > 1;
        self.len -= usize::from(!is_more);
        select_unpredictable(is_more, leaf.rest(), self.children[self.len % MAX])
    }

    /// What is beyond the limit, a squared distance, waits no more. Past a block of a leaf, again: where [`Self::pass`]
    /// has led may be beyond it, too.
    #[inline(always)]
    pub fn pass_within<S: Simd>(&mut self, leaf: Child, limit_squared: f32) -> Child {
        // What it came to from the stack is above the top still.
        self.len += usize::from(leaf.count() == 1);
        self.shorten::<S>(limit_squared);
        self.pass(leaf)
    }

    /// Leaves out what is beyond the limit: eight at a time, which are most often all there are, so that nobody has to
    /// guess how many.
    #[inline(always)]
    fn shorten<S: Simd>(&mut self, limit_squared: f32) {
        let (len, mut kept) = (self.len % MAX, 1);
        for first in (1..len).step_by(WIDTH) {
            let (nears, children) = (self.near[first..].first_chunk(), self.children[first..].first_chunk());
            let (Some(&nears), Some(&children)) = (nears, children) else { break };
            let (near, stack) = (self.near[kept..].first_chunk_mut(), self.children[kept..].first_chunk_mut());
            let (Some(near), Some(stack)) = (near, stack) else { break };
            kept += S::within(limit_squared, (&nears, &children), len - first, near, stack);
        }
        self.len = kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::bvh::random::entries_beyond_a_limit_go;
    use crate::trace::bvh::simd::isa::{Kernel, dispatch};

    struct Shorten<'a>(&'a mut PointStack, f32);

    impl Kernel for Shorten<'_> {
        type Output = ();

        #[inline(always)]
        fn run<S: Simd>(self) {
            self.0.shorten::<S>(self.1);
        }
    }

    /// What is beyond the limit goes, all else stays in its order, however much there is.
    #[test]
    fn what_is_beyond_the_limit_goes() {
        let lens = [1, 2, 8, 9, 10, 17, 26, 100, MAX - 1];
        entries_beyond_a_limit_go(lens, |isa, entries, limit| {
            let mut waiting = PointStack { len: entries.len() + 1, ..PointStack::EMPTY };
            for (i, &(near, child)) in entries.iter().enumerate() {
                (waiting.near[i + 1], waiting.children[i + 1]) = (near, child);
            }
            dispatch(isa, Shorten(&mut waiting, limit));
            assert_eq!(waiting.children[0], Child::NONE);
            waiting.near.into_iter().zip(waiting.children).take(waiting.len).skip(1).collect()
        });
    }
}
