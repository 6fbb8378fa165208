//! Children that wait to be visited while a ray walks through a tree.
//!
//! The room for them lies in the frame of who walks: a walk that starts within another's leaf has room of its own,
//! nobody clears it, and nobody lends it. Room that is cleared, the safe alternative, costs as much as a few nodes, and
//! has to be lent for that.
#![allow(unsafe_code)] // Room that is not cleared is read where it was written.

use std::mem::MaybeUninit;

use crate::trace::bvh::build::MAX_DEPTH;
use crate::trace::bvh::node::{Child, WIDTH};

/// What waits to be visited: a child, and what is known of it.
pub(in crate::trace::bvh) trait Waits: Copy {
    /// Where it is entered.
    fn near(&self) -> f32;
}

/// A child to be visited.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// Where the ray enters it.
    pub near: f32,
    pub child: Child,
}

impl Waits for Entry {
    #[inline(always)]
    fn near(&self) -> f32 {
        self.near
    }
}

/// Every level of the tree leaves at most seven siblings waiting.
const ENTRIES: usize = MAX_DEPTH * (WIDTH - 1) + 1;

/// Room for children waiting.
pub(in crate::trace::bvh) struct Room<E>([MaybeUninit<E>; ENTRIES]);

impl<E: Waits> Room<E> {
    /// Nothing is written, nothing can be read.
    #[inline(always)]
    pub const fn new() -> Self {
        Self([MaybeUninit::uninit(); ENTRIES])
    }
}

/// Children waiting, the one to be visited next on top. Apart from its room, so that the compiler keeps their number in
/// a register.
pub(in crate::trace::bvh) struct Stack<'a, E> {
    room: &'a mut Room<E>,
    /// As many entries of the room are written, from the first on; never more than there are.
    len: usize,
}

impl<'a, E: Waits> Stack<'a, E> {
    /// Of none.
    #[inline(always)]
    pub fn new(room: &'a mut Room<E>) -> Self {
        Self { room, len: 0 }
    }

    /// How many are waiting.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// One more, on top.
    ///
    /// # Panics
    /// If the tree is deeper than any is built.
    #[inline(always)]
    pub fn push(&mut self, entry: E) {
        self.room.0[self.len].write(entry);
        self.len += 1;
    }

    /// One more, on top of those that were `base`, but below those since then that are nearer.
    ///
    /// # Panics
    /// As [`Self::push`].
    #[inline(always)]
    pub fn insert(&mut self, base: usize, entry: E) {
        let Room(room) = self.room;
        let mut at = self.len;
        while at > base {
            // SAFETY: `at` is at most `len`, below which all is written.
            let below = unsafe { room[at - 1].assume_init() };
            if below.near() >= entry.near() {
                break;
            }
            room[at].write(below);
            at -= 1;
        }
        room[at].write(entry);
        self.len += 1;
    }

    /// Takes the one on top.
    #[inline(always)]
    pub fn pop(&mut self) -> Option<E> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: it was below `len`, which is never more than there are, and below which all is written.
        Some(unsafe { self.room.0.get_unchecked(self.len).assume_init() })
    }
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::{ENTRIES, Entry, Room, Stack};
    use crate::trace::bvh::node::Child;

    fn at(near: f32, number: u32) -> Entry {
        Entry { near, child: Child::leaf(number, 1) }
    }

    /// Where the entries are entered, and their numbers, from the top.
    fn drain(stack: &mut Stack<'_, Entry>) -> Vec<(f32, u32)> {
        std::iter::from_fn(|| stack.pop()).map(|Entry { near, child }| (near, child.first())).collect()
    }

    #[test]
    fn what_was_pushed_last_comes_first() {
        let mut room = Room::new();
        let mut stack = Stack::new(&mut room);
        (0..3).for_each(|number| stack.push(at([3.0, 1.0, 2.0][number as usize], number)));
        assert_eq!(drain(&mut stack), [(2.0, 2), (1.0, 1), (3.0, 0)]);
        assert!(stack.pop().is_none());
    }

    /// Nearer ones above those that are farther; of equal ones the last is on top.
    #[test]
    fn what_is_inserted_lies_in_order_above_what_was_there() {
        for order in 0..256_u32 {
            let values = [0, 1, 2, 3].map(|k| (order >> (2 * k) & 3) as f32);
            let mut room = Room::new();
            let mut stack = Stack::new(&mut room);
            stack.push(at(-1.0, 9));
            let base = stack.len();
            let pairs = [(values[0], 0), (values[1], 1), (values[2], 2), (values[3], 3)];
            pairs.iter().for_each(|&(near, number)| stack.insert(base, at(near, number)));
            let mut sorted: Vec<(f32, u32)> = pairs.into_iter().rev().collect();
            sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
            sorted.push((-1.0, 9));
            assert_eq!(drain(&mut stack), sorted, "{values:?}");
        }
    }

    /// What [`Stack::pop`] relies on, for each way to put an entry there: on top, and below all or none of those that
    /// are.
    #[test]
    fn there_is_no_more_room_than_a_tree_needs() {
        let ways: [fn(&mut Stack<'_, Entry>); 3] = [
            |stack| stack.push(at(0.0, 0)),
            |stack| stack.insert(0, at(stack.len() as f32, 0)),
            |stack| stack.insert(stack.len(), at(0.0, 0)),
        ];
        for way in ways {
            let mut room = Room::new();
            let mut stack = Stack::new(&mut room);
            (0..ENTRIES).for_each(|_| way(&mut stack));
            assert!(catch_unwind(AssertUnwindSafe(|| way(&mut stack))).is_err());
            assert_eq!(drain(&mut stack).len(), ENTRIES);
        }
    }
}
