//! One ray from the root to the leaves, by itself: among shapes, for all hits, and among triangles where it is alone
//! ([`super::alone`]). Other rays among triangles travel in bundles ([`super::bundle`]), flights ([`super::flight`]) or
//! packets ([`super::packet`]), whose beam takes the same walk.
//!
//! A walk knows no primitive. It hands each leaf to a closure, which says how far the ray still needs to look.

pub(super) mod stack;

use self::stack::{Entry, Room, Stack};
use super::node::{Child, Node, WIDTH};
use super::query::Query;
use super::reject::slab::SlabRay;
use super::simd::{Array, Mask, Simd, Vector};
use super::tree::Tree;
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

/// Where children are entered: within one cache line, for it is stored whole and loaded one by one.
#[repr(align(32))]
pub(super) struct Near(pub [f32; WIDTH]);

/// What walks: a ray, or several that go the same way.
pub(super) trait Enter {
    /// The children in which something may be hit up to `limit`; and where each is entered, not below 0.
    fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8);
    /// Of these children, a bit each, those that are worth a visit: what enters all of them together may ask each more
    /// closely.
    #[inline(always)]
    fn select<S: Simd>(&self, _node: &Node, children: u32) -> u32 {
        children
    }
}

impl Enter for SlabRay {
    #[inline(always)]
    fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        // One ray comes to so few nodes that its numbers are better loaded at each than spread over vectors before the
        // first, of which no registers could hold so many: the black box keeps the compiler from that.
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

    #[inline(always)]
    fn entry(&self, node: &Node, slot: usize) -> Entry {
        Entry { near: self.near.0[slot], child: node.child[slot] }
    }

    /// The nearest of the children, of which there is at least one; all others go on the stack. Mostly one or two are
    /// entered: each number has its own branch, which is predicted better than the length of a loop.
    #[inline(always)]
    fn open<Q: Query>(&self, stack: &mut Stack<'_, Entry>, node: &Node) -> Entry {
        let (first, rest) = lowest(self.children);
        let mut next = self.entry(node, first);
        if rest == 0 {
            return next;
        }
        let (second, mut rest) = lowest(rest);
        let mut other = self.entry(node, second);
        if other.near < next.near {
            std::mem::swap(&mut next, &mut other);
        }
        let base = stack.len();
        stack.push(other);
        while rest != 0 {
            let (slot, others) = lowest(rest);
            rest = others;
            let mut other = self.entry(node, slot);
            if other.near < next.near {
                std::mem::swap(&mut next, &mut other);
            }
            if Q::ANY { stack.push(other) } else { stack.insert(base, other) }
        }
        next
    }

    /// Of a tree's root, of which there is one.
    #[inline(always)]
    pub fn root<S: Simd>(tree: &Tree, ray: &impl Enter, limit: f32) -> Self {
        Self::new::<S>(ray, tree.node(Child::ROOT), limit)
    }
}

/// Visits the leaves that `ray` enters before `limit`; near ones first, if that matters to the query.
#[inline(always)]
pub(super) fn single<S: Simd, Q: Query>(tree: &Tree, ray: &impl Enter, limit: f32, leaf: impl FnMut(Child) -> Visit) {
    let root = Entered::root::<S>(tree, ray, limit);
    from_root::<S, Q>(tree, ray, limit, &root, leaf);
}

/// The same of a ray of which it is known what it enters of the root.
#[inline(always)]
pub(super) fn from_root<S: Simd, Q: Query>(
    tree: &Tree,
    ray: &impl Enter,
    mut limit: f32,
    root: &Entered,
    mut leaf: impl FnMut(Child) -> Visit,
) {
    if root.children == 0 {
        return;
    }
    let mut room = Room::new();
    let mut stack = Stack::new(&mut room);
    let mut next = root.open::<Q>(&mut stack, tree.node(Child::ROOT));
    loop {
        // Down to a leaf.
        while !next.child.is_leaf() {
            let node = tree.node(next.child);
            let entered = Entered::new::<S>(ray, node, limit);
            if entered.children == 0 {
                break;
            }
            next = entered.open::<Q>(&mut stack, node);
        }
        if next.child.is_leaf() {
            match leaf(next.child) {
                Visit::Until(t) => limit = t,
                Visit::Stop => return,
            }
        }
        next = loop {
            let Some(entry) = stack.pop() else { return };
            if entry.near <= limit {
                break entry;
            }
        };
    }
}

/// The lowest bit's place, and the other bits.
#[inline(always)]
pub(super) fn lowest(mask: u32) -> (usize, u32) {
    (mask.trailing_zeros() as usize % WIDTH, mask & (mask - 1))
}
