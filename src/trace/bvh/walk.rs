//! One ray from the root to the leaves, by itself: among shapes, for all hits, and among the triangles of a placed object where the
//! ray's bundle is none. Other rays among triangles travel in flights ([`super::flight`]).
//!
//! A walk knows no primitive. It hands each leaf to a closure, which says how far the ray still needs to look.

use std::cell::RefCell;

use super::build::MAX_DEPTH;
use super::node::{Child, Node, Tree, WIDTH};
use super::query::Query;
use super::simd::{Array, Mask, Simd, Vector};
use super::slab::SlabRay;
use crate::trace::nearest::Nearest;

/// What a leaf says to the walk.
#[derive(Clone, Copy, Debug)]
pub(super) enum Visit {
    /// Go on, up to this t.
    Until(f32),
    /// Enough.
    Stop,
}

impl Visit {
    /// After offers to `nearest`: an any-hit query stops at the first hit.
    #[inline(always)]
    pub fn after<Q: Query>(nearest: &Nearest) -> Self {
        if Q::ANY && nearest.hit().is_some() { Self::Stop } else { Self::Until(nearest.limit()) }
    }
}

/// A child to be visited.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Where the ray enters it.
    near: f32,
    child: Child,
}

impl Entry {
    #[inline(always)]
    fn child(node: &Node, near: &[f32; WIDTH], slot: usize) -> Self {
        Self { near: near[slot], child: node.child[slot] }
    }

    const ROOT: Self = Self { near: 0.0, child: Child::ROOT };
}

/// Every level of the tree leaves at most seven siblings waiting.
const STACK: usize = MAX_DEPTH * (WIDTH - 1) + 1;

/// Children waiting to be visited, the nearest on top. Made once a batch, since filling it costs as much as a few nodes.
pub(super) struct Stack {
    entries: [Entry; STACK],
    len: usize,
}

impl Stack {
    pub const fn new() -> Self {
        Self { entries: [Entry::ROOT; STACK], len: 0 }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<Entry> {
        self.len = self.len.checked_sub(1)?;
        Some(self.entries[self.len])
    }

    #[inline(always)]
    fn push(&mut self, entry: Entry) {
        self.entries[self.len] = entry;
        self.len += 1;
    }

    /// Pushes so that of what came since `base` the nearest ends on top.
    #[inline(always)]
    fn insert(&mut self, base: usize, entry: Entry) {
        let mut at = self.len;
        while at > base && self.entries[at - 1].near < entry.near {
            self.entries[at] = self.entries[at - 1];
            at -= 1;
        }
        self.entries[at] = entry;
        self.len += 1;
    }
}

thread_local! {
    /// Stacks that are not in use: who visits a leaf may cast rays of its own.
    #[expect(clippy::vec_box, reason = "boxes are moved in and out, stacks of some kilobytes are not")]
    static STACKS: RefCell<Vec<Box<Stack>>> = const { RefCell::new(Vec::new()) };
}

/// Lends a stack to `work`, for callers with a single ray.
#[inline]
pub(super) fn with_stack<R>(work: impl FnOnce(&mut Stack) -> R) -> R {
    let mut stack = STACKS.with_borrow_mut(Vec::pop).unwrap_or_else(|| Box::new(Stack::new()));
    let result = work(&mut stack);
    STACKS.with_borrow_mut(|stacks| stacks.push(stack));
    result
}

/// What walks: a ray, or several that go the same way.
pub(super) trait Enter {
    /// The children in which something may be hit up to `limit`; and where each is entered, not below 0.
    fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8);
}

impl Enter for SlabRay {
    #[inline(always)]
    fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        SlabRay::enter::<S>(self, node, limit)
    }
}

/// Visits the leaves that `ray` enters before `limit`; near ones first, if that matters to the query.
#[inline(always)]
pub(super) fn single<S: Simd, Q: Query>(
    stack: &mut Stack,
    tree: &Tree,
    ray: &impl Enter,
    mut limit: f32,
    mut leaf: impl FnMut(Child) -> Visit,
) {
    stack.len = 0;
    let mut next = Entry::ROOT;
    loop {
        // Down to a leaf. Mostly one or two children are entered: each number has its own branch, which is predicted
        // better than the length of a loop.
        while !next.child.is_leaf() {
            let node = tree.node(next.child);
            let (mask, near) = ray.enter::<S>(node, limit);
            let (mask, near) = (mask.bits(), near.to_array());
            if mask == 0 {
                break;
            }
            let (first, rest) = lowest(mask);
            next = Entry::child(node, &near, first);
            if rest == 0 {
                continue;
            }
            let (second, rest) = lowest(rest);
            let mut other = Entry::child(node, &near, second);
            if other.near < next.near {
                std::mem::swap(&mut next, &mut other);
            }
            let base = stack.len;
            stack.push(other);
            let mut rest = rest;
            while rest != 0 {
                let (slot, others) = lowest(rest);
                rest = others;
                let mut other = Entry::child(node, &near, slot);
                if other.near < next.near {
                    std::mem::swap(&mut next, &mut other);
                }
                if Q::ANY { stack.push(other) } else { stack.insert(base, other) }
            }
        }
        if next.child.is_leaf() {
            match leaf(next.child) {
                Visit::Until(t) => limit = t,
                Visit::Stop => return,
            }
        }
        next = loop {
            match stack.pop() {
                Some(entry) if entry.near <= limit => break entry,
                Some(_) => {}
                None => return,
            }
        };
    }
}

/// The lowest bit's place, and the other bits.
#[inline(always)]
fn lowest(mask: u32) -> (usize, u32) {
    (mask.trailing_zeros() as usize % WIDTH, mask & (mask - 1))
}
