//! Several rays in flight: each takes one step in turn, so that the processor works on one while another waits.
//!
//! A single ray's walk ([`super::walk`]) is bound by latency, not by work: each step needs the node that the one before
//! has chosen, and how many children are entered is anyone's guess, so every other node is mispredicted. Here a round
//! gives every ray of the flight one step. Steps of different rays do not depend on each other, and a step at a
//! node has no branch: all eight children are sorted by a network, and stored behind each other; those that are not entered
//! end beyond the top of the stack. Rays at leaves are put on a list of their own for the same reason. What a ray
//! reaches next is fetched while the others take their turn.
//!
//! Only when a hit shortens the ray is its stack gone through; so what is on it is always to be visited.

use std::hint::select_unpredictable;

use super::build::MAX_DEPTH;
use super::found::Found;
use super::leaves::{Blocks, Leaves};
use super::node::{Child, Node, Tree, WIDTH};
use super::query::Query;
use super::simd::{Mask, Simd};
use super::slab::{self, ReadyRay};
use super::triangles::TriangleTree;
use crate::math::Vec3;
use crate::ray::Ray;

/// Rays in flight.
const RAYS: usize = 32;

/// Places on a stack: every level of the tree leaves at most seven siblings waiting, and at the bottom is [`Child::NONE`].
const STACK: usize = 256;

const _: () = assert!(MAX_DEPTH * (WIDTH - 1) < STACK);

/// A ray on its way.
#[repr(align(64))]
#[derive(Clone, Copy)]
struct Traveller {
    ready: ReadyRay,
    found: Found,
    /// Which of the rays it is.
    ray: usize,
    /// Children on the stack.
    len: usize,
    next: Child,
    /// Children waiting to be visited, the nearest on top; above the top is room for what is not entered.
    stack: [Child; STACK + WIDTH],
    /// Where the ray enters each: the bits of an f32, of which the lowest three are not part of it.
    near: [u32; STACK + WIDTH],
}

impl Traveller {
    const NONE: Self = Self {
        ready: ReadyRay::NONE,
        found: Found::NONE,
        ray: 0,
        len: 1,
        next: Child::NONE,
        stack: [Child::NONE; STACK + WIDTH],
        near: [0; STACK + WIDTH],
    };

    /// At the root, with a ray of its own.
    #[inline(always)]
    fn start(&mut self, ray: usize, waiting: &Waiting<'_>) {
        self.ready = waiting.ready[ray % 8];
        self.found.start(self.ready.end());
        (self.ray, self.len, self.next) = (ray, 1, Child::ROOT);
    }

    /// One node.
    #[inline(always)]
    fn enter<S: Simd>(&mut self, node: &Node) {
        let (mask, near) = self.ready.slab().enter::<S>(node, self.found.limit);
        let len = self.len % STACK;
        let (nears, stack) = (self.near[len..].first_chunk_mut(), self.stack[len..].first_chunk_mut());
        if let (Some(nears), Some(stack)) = (nears, stack) {
            S::far_to_near(near, mask, &node.child, nears, stack);
        }
        self.len = len + mask.bits().count_ones() as usize;
        self.pop();
    }

    /// One block of a leaf.
    #[inline(always)]
    fn visit<S: Simd, Q: Query>(&mut self, tree: &TriangleTree, leaves: &(impl Blocks + ?Sized), rays: &[Ray]) {
        let (index, limit) = (self.next.first(), self.found.limit);
        let mut scratch = None;
        let block = leaves.block(index, &mut scratch);
        let candidates = self.ready.filter().candidates::<S>(block, limit);
        if candidates.lanes != 0 {
            self.found.offer::<Q>(tree, index, block, &candidates, &rays[self.ray]);
            if Q::ANY && self.found.is_hit() {
                self.next = Child::NONE;
                return;
            }
            if self.found.limit < limit {
                self.shorten();
            }
        }
        // On to the next block, or to what is on the stack; without a branch.
        let is_more = self.next.count() > 1;
        self.len -= usize::from(!is_more);
        self.next = select_unpredictable(is_more, self.next.rest(), self.stack[self.len % STACK]);
    }

    /// Goes on to the nearest; at last to [`Child::NONE`].
    #[inline(always)]
    fn pop(&mut self) {
        self.len -= 1;
        self.next = self.stack[self.len % STACK];
    }

    /// Leaves out what is beyond the limit.
    #[inline(always)]
    fn shorten(&mut self) {
        let mut kept = 1;
        for i in 1..self.len % STACK {
            (self.near[kept], self.stack[kept]) = (self.near[i], self.stack[i]);
            kept += usize::from(f32::from_bits(self.near[i] & !7) <= self.found.limit);
        }
        self.len = kept;
    }
}

/// Room for a flight.
pub(super) struct Flight([Traveller; RAYS]);

impl Flight {
    pub fn new() -> Self {
        Self([Traveller::NONE; RAYS])
    }

    #[inline(always)]
    fn at(&mut self, k: u8) -> &mut Traveller {
        &mut self.0[usize::from(k) % RAYS]
    }
}

/// Numbers of slots.
#[derive(Clone, Copy)]
struct List {
    slots: [u8; RAYS],
    len: usize,
}

impl List {
    const EMPTY: Self = Self { slots: [0; RAYS], len: 0 };

    #[inline(always)]
    fn push(&mut self, slot: u8) {
        self.slots[self.len % RAYS] = slot;
        self.len += 1;
    }

    #[inline(always)]
    fn iter(&self) -> impl Iterator<Item = u8> {
        self.slots[..self.len.min(RAYS)].iter().copied()
    }
}

/// Rays yet to set out, made ready eight at a time.
struct Waiting<'a> {
    rays: &'a [Ray],
    reach: Vec3,
    ready: [ReadyRay; 8],
    valid: u32,
    next: usize,
}

impl<'a> Waiting<'a> {
    fn new(rays: &'a [Ray], reach: Vec3) -> Self {
        Self { rays, reach, ready: [ReadyRay::NONE; 8], valid: 0, next: 0 }
    }

    /// The number of the next valid ray.
    #[inline(always)]
    fn next<S: Simd>(&mut self) -> Option<usize> {
        while self.next < self.rays.len() {
            let index = self.next;
            if index.is_multiple_of(8) {
                match self.rays[index..].first_chunk() {
                    Some(eight) => (self.ready, self.valid) = slab::ready::<S>(eight, self.reach),
                    None => {
                        let some = &self.rays[index..];
                        let mut eight = [some[0]; 8];
                        eight[..some.len()].copy_from_slice(some);
                        (self.ready, self.valid) = slab::ready::<S>(&eight, self.reach);
                    }
                }
            }
            self.next += 1;
            if self.valid >> (index % 8) & 1 != 0 {
                return Some(index);
            }
        }
        None
    }
}

/// Answers all rays: `done` is told of each valid one what it has found.
#[inline(always)]
pub(super) fn trace<S: Simd, Q: Query>(
    flight: &mut Flight,
    tree: &TriangleTree,
    rays: &[Ray],
    mut done: impl FnMut(usize, &Found),
) {
    if tree.tree().is_empty() {
        rays.iter().enumerate().filter(|(_, ray)| ray.is_valid()).for_each(|(i, _)| done(i, &Found::NONE));
        return;
    }
    match tree.leaves() {
        Leaves::Blocks(blocks) => run::<S, Q>(flight, tree, &blocks[..], rays, done),
        Leaves::Numbers(numbers) => run::<S, Q>(flight, tree, numbers, rays, done),
    }
}

/// Has what will be needed soon loaded; without a branch, which nobody could predict.
#[inline(always)]
fn prefetch<S: Simd>(next: Child, nodes: &Tree, leaves: &(impl Blocks + ?Sized)) {
    let (node, block) = (S::address(nodes.nodes(), next.node()), leaves.address::<S>(next.first()));
    S::prefetch(select_unpredictable(next.is_leaf(), block, node));
}

#[inline(always)]
fn run<S: Simd, Q: Query>(
    flight: &mut Flight,
    tree: &TriangleTree,
    leaves: &(impl Blocks + ?Sized),
    rays: &[Ray],
    mut done: impl FnMut(usize, &Found),
) {
    let nodes = tree.tree();
    let mut waiting = Waiting::new(rays, nodes.reach());
    // Those at nodes, those at leaves, and those that have arrived.
    let mut lists = [List::EMPTY; 3];
    for k in 0..RAYS {
        let Some(ray) = waiting.next::<S>() else { break };
        flight.at(k as u8).start(ray, &waiting);
        lists[0].push(k as u8);
    }
    while lists[0].len + lists[1].len + lists[2].len > 0 {
        let [mut at_nodes, at_leaves, arrived] = std::mem::replace(&mut lists, [List::EMPTY; 3]);
        for k in arrived.iter() {
            let traveller = flight.at(k);
            done(traveller.ray, &traveller.found);
            if let Some(ray) = waiting.next::<S>() {
                traveller.start(ray, &waiting);
                at_nodes.push(k);
            }
        }
        for k in at_nodes.iter() {
            let traveller = flight.at(k);
            traveller.enter::<S>(nodes.node(traveller.next));
            prefetch::<S>(traveller.next, nodes, leaves);
            lists[traveller.next.kind()].push(k);
        }
        for k in at_leaves.iter() {
            let traveller = flight.at(k);
            traveller.visit::<S, Q>(tree, leaves, rays);
            prefetch::<S>(traveller.next, nodes, leaves);
            lists[traveller.next.kind()].push(k);
        }
    }
}
