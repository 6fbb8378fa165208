//! One ray from the root to the leaves, by itself: among shapes, for all hits, and among triangles where it is alone ([`super::alone`]).
//! Other rays among triangles travel in bundles ([`super::tile`]) or flights ([`super::flight`]).
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

/// Where children are entered: within one cache line, for it is stored whole and loaded one by one.
#[repr(align(32))]
struct Near([f32; WIDTH]);

/// Room for children waiting to be visited. Made once a batch, since filling it costs as much as a few nodes.
pub(super) struct Stack([Entry; STACK]);

impl Stack {
    pub const fn new() -> Self {
        Self([Entry::ROOT; STACK])
    }

    /// Puts an entry on top of `len` others, but below those since `base` that are nearer.
    #[inline(always)]
    fn insert(&mut self, base: usize, len: usize, entry: Entry) {
        let mut at = len;
        while at > base && self.0[at - 1].near < entry.near {
            self.0[at] = self.0[at - 1];
            at -= 1;
        }
        self.0[at] = entry;
    }

    /// Pushes all children that are entered but the nearest, which it returns; at least one is. Mostly one or two are: each number has its own branch, which
    /// is predicted better than the length of a loop.
    #[inline(always)]
    fn open<Q: Query>(
        &mut self,
        len: &mut usize,
        node: &Node,
        &Entered { children, near: Near(ref near) }: &Entered,
    ) -> Entry {
        let (first, rest) = lowest(children);
        let mut next = Entry::child(node, near, first);
        if rest == 0 {
            return next;
        }
        let (second, mut rest) = lowest(rest);
        let mut other = Entry::child(node, near, second);
        if other.near < next.near {
            std::mem::swap(&mut next, &mut other);
        }
        let base = *len;
        self.0[*len] = other;
        *len += 1;
        while rest != 0 {
            let (slot, others) = lowest(rest);
            rest = others;
            let mut other = Entry::child(node, near, slot);
            if other.near < next.near {
                std::mem::swap(&mut next, &mut other);
            }
            if Q::ANY {
                self.0[*len] = other
            } else {
                self.insert(base, *len, other)
            }
            *len += 1;
        }
        next
    }
}

/// One stack for the placements, one for what is below them.
pub(super) struct Stacks {
    pub upper: Stack,
    pub level: Stack,
}

impl Stacks {
    pub const fn new() -> Self {
        Self { upper: Stack::new(), level: Stack::new() }
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
    /// Of these children, a bit each, those that are worth a visit: what enters all of them together may ask each more closely.
    #[inline(always)]
    fn select<S: Simd>(&self, _node: &Node, children: u32) -> u32 {
        children
    }
}

impl Enter for SlabRay {
    #[inline(always)]
    fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        // One ray comes to so few nodes that its numbers are better loaded at each than spread over vectors before the first, of which no registers
        // could hold so many: the black box keeps the compiler from that.
        SlabRay::enter::<S>(std::hint::black_box(self), node, limit)
    }
}

/// What a ray enters of a node: a bit for each child, and where.
pub(super) struct Entered {
    children: u32,
    near: Near,
}

impl Entered {
    #[inline(always)]
    fn new<S: Simd>(ray: &impl Enter, node: &Node, limit: f32) -> Self {
        let (mask, near) = ray.enter::<S>(node, limit);
        Self { children: ray.select::<S>(node, mask.bits()), near: Near(near.to_array()) }
    }

    /// Of a tree's root, of which there is one.
    #[inline(always)]
    pub fn root<S: Simd>(tree: &Tree, ray: &impl Enter, limit: f32) -> Self {
        Self::new::<S>(ray, tree.node(Child::ROOT), limit)
    }
}

/// Visits the leaves that `ray` enters before `limit`; near ones first, if that matters to the query.
#[inline(always)]
pub(super) fn single<S: Simd, Q: Query>(
    stack: &mut Stack,
    tree: &Tree,
    ray: &impl Enter,
    limit: f32,
    leaf: impl FnMut(Child) -> Visit,
) {
    let root = Entered::root::<S>(tree, ray, limit);
    from_root::<S, Q>(stack, tree, ray, limit, &root, leaf);
}

/// The same of a ray of which it is known what it enters of the root.
#[inline(always)]
pub(super) fn from_root<S: Simd, Q: Query>(
    stack: &mut Stack,
    tree: &Tree,
    ray: &impl Enter,
    mut limit: f32,
    root: &Entered,
    mut leaf: impl FnMut(Child) -> Visit,
) {
    if root.children == 0 {
        return;
    }
    // Children on the stack, the nearest on top.
    let mut len = 0;
    let mut next = stack.open::<Q>(&mut len, tree.node(Child::ROOT), root);
    loop {
        // Down to a leaf.
        while !next.child.is_leaf() {
            let node = tree.node(next.child);
            let entered = Entered::new::<S>(ray, node, limit);
            if entered.children == 0 {
                break;
            }
            next = stack.open::<Q>(&mut len, node, &entered);
        }
        if next.child.is_leaf() {
            match leaf(next.child) {
                Visit::Until(t) => limit = t,
                Visit::Stop => return,
            }
        }
        next = loop {
            if len == 0 {
                return;
            }
            len -= 1;
            let entry = stack.0[len];
            if entry.near <= limit {
                break entry;
            }
        };
    }
}

/// The lowest bit's place, and the other bits.
#[inline(always)]
fn lowest(mask: u32) -> (usize, u32) {
    (mask.trailing_zeros() as usize % WIDTH, mask & (mask - 1))
}
