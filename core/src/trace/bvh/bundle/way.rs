//! A bundle's way through a tree: each node's boxes against the rectangle of all slopes, and each box that this enters
//! against all rays.
//!
//! No branch says which rays enter a box: it is told of all 64, whoever matters. To stop at the first, or to ask rows
//! of rays before, took fewer instructions and more time (docs/PERFORMANCE.md).

use std::hint::select_unpredictable;
use std::marker::PhantomData;

use super::pencil::Pencil;
use super::rays::Bundle;
use super::slab::{Boxes, BundleSlab};
use crate::trace::bvh::node::{Child, WIDTH};
use crate::trace::bvh::simd::{Array, Group, Mask, PerRay, RAYS, Simd, Vector};
use crate::trace::bvh::tree::Tree;

/// Rays of which each is held against the eight boxes of a node by itself.
const ONE_BY_ONE: usize = 3;

/// A child to be visited.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    /// No ray enters it before that.
    pub near: f32,
    pub child: Child,
    /// A bit for every ray that may enter it.
    pub rays: u64,
}

impl Entry {
    /// The root of a tree, of interest to those rays.
    pub const fn root(rays: u64) -> Self {
        Self { near: 0.0, child: Child::ROOT, rays }
    }
}

/// What a bundle looks for in a tree: triangles, or placements.
pub(super) trait Goal {
    fn tree(&self) -> &Tree;
    /// The most t' that is wanted of each ray.
    fn limit(&self) -> &PerRay;
    /// Has a leaf's contents loaded that will be needed soon.
    fn prefetch<S: Simd>(&self, leaf: Child);
}

/// Children that wait to be visited, the nearest on top, and the bundle's way to them.
pub(super) struct Way<'a, P> {
    pub bundle: &'a Bundle,
    pub slab: BundleSlab,
    /// A bit for every ray that matters.
    pub wanted: u64,
    /// The largest limit of all rays.
    pub most: f32,
    pub pencil: PhantomData<P>,
}

impl<'a, P: Pencil> Way<'a, P> {
    /// Of the first `count` rays of the bundle.
    #[inline(always)]
    pub fn new(bundle: &'a Bundle, slab: BundleSlab, count: usize) -> Self {
        let wanted = !0 >> (RAYS - count.clamp(1, RAYS));
        Self { bundle, slab, wanted, most: 0.0, pencil: PhantomData }
    }

    #[inline(always)]
    pub fn measure<S: Simd>(&mut self, limit: &PerRay) {
        let mut most = S::Wide::at(limit, 0);
        for group in 1..RAYS / S::Wide::LANES {
            most = most.max(S::Wide::at(limit, group));
        }
        self.most = most.largest();
    }

    /// The next leaf of what waits on the stack.
    #[inline(always)]
    pub fn next_leaf<S: Simd>(&self, goal: &impl Goal, stack: &mut [Entry], len: &mut usize) -> Option<Entry> {
        let tree = goal.tree();
        loop {
            *len = len.checked_sub(1)?;
            let next = stack[*len];
            if next.near > self.most {
                continue;
            }
            if next.child.is_leaf() {
                return Some(next);
            }
            let node = tree.node(next.child);
            let boxes = self.slab.boxes::<S, P>(node, self.bundle.first);
            let (mask, near, known) = if next.rays.count_ones() as usize <= ONE_BY_ONE {
                let (mask, near, rays) = self.enter_one_by_one::<S>(goal.limit(), &boxes, next.rays);
                (mask, near, Some(rays))
            } else {
                let (mask, near) = self.slab.enter::<S, P>(&boxes, self.most);
                (mask, near, None)
            };
            let (mut nears, mut children) = ([0; WIDTH], [Child::NONE; WIDTH]);
            let count = S::far_to_near(near, mask, &node.child, &mut nears, &mut children);
            for k in 0..count {
                let (near, child) = (nears[k % WIDTH], children[k % WIDTH]);
                let slot = near as usize % WIDTH;
                let rays = match &known {
                    Some(known) => known.entering(slot),
                    None => self.entering::<S>(goal.limit(), &boxes, slot, next.rays),
                };
                stack[*len] = Entry { near: f32::from_bits(near & !7), child, rays };
                *len += usize::from(rays != 0);
                if child.is_leaf() {
                    goal.prefetch::<S>(child);
                } else {
                    S::prefetch(S::address(tree.nodes(), child.node()));
                }
            }
        }
    }

    /// The children that the rays enter, where each is entered at the earliest, and by which.
    #[inline(always)]
    fn enter_one_by_one<S: Simd>(
        &self,
        limit: &PerRay,
        boxes: &Boxes,
        mut rays: u64,
    ) -> (<S::V8 as Vector>::Mask, S::V8, OneByOne) {
        let splat = S::V8::splat;
        let [p, q] = &self.bundle.slabs;
        let [px, qx, zx] = &boxes.near;
        let [py, qy, zy] = &boxes.far;
        let (mut all, mut near) = (splat(0.0).less(splat(0.0)), splat(f32::INFINITY));
        let mut entering = OneByOne { ray: [0; ONE_BY_ONE], children: [0; ONE_BY_ONE] };
        // Where they are fewer, the first is asked again, and in vain.
        let first_ray = rays;
        for k in 0..ONE_BY_ONE {
            let ray = select_unpredictable(rays == 0, first_ray, rays).trailing_zeros() as usize % RAYS;
            entering.ray[k] = rays & rays.wrapping_neg();
            rays &= rays.wrapping_sub(1);
            let (p, q) = (splat(p.0[ray]), splat(q.0[ray]));
            let first = P::meet(S::V8::load(px), p).max(P::meet(S::V8::load(qx), q)).max(S::V8::load(zx));
            let last = P::meet(S::V8::load(py), p).min(P::meet(S::V8::load(qy), q));
            let last = last.min(S::V8::load(zy).min(splat(limit.0[ray])));
            let enter = first.at_most(last);
            (all, near) = (all.or(enter), near.min(first));
            entering.children[k] = enter.bits();
        }
        (all, near, entering)
    }

    /// Those of the rays that enter the box in that slot.
    #[inline(always)]
    fn entering<S: Simd>(&self, limit: &PerRay, boxes: &Boxes, slot: usize, rays: u64) -> u64 {
        let splat = S::Wide::splat;
        let near = [splat(boxes.near[0][slot]), splat(boxes.near[1][slot]), splat(boxes.near[2][slot])];
        let far = [splat(boxes.far[0][slot]), splat(boxes.far[1][slot]), splat(boxes.far[2][slot])];
        let [p, q] = &self.bundle.slabs;
        let mut entering = 0;
        for group in 0..RAYS / S::Wide::LANES {
            let (p, q, limit) = (S::Wide::at(p, group), S::Wide::at(q, group), S::Wide::at(limit, group));
            let first = P::meet(near[0], p).max(P::meet(near[1], q)).max(near[2]);
            let last = P::meet(far[0], p).min(P::meet(far[1], q)).min(far[2].min(limit));
            entering |= u64::from(first.at_most(last).bits()) << (S::Wide::LANES * group);
        }
        entering & rays
    }
}

/// Rays that were held against the boxes of a node one by one.
struct OneByOne {
    /// The bit of each; none where there are fewer.
    ray: [u64; ONE_BY_ONE],
    /// A bit for each child that it enters.
    children: [u32; ONE_BY_ONE],
}

impl OneByOne {
    /// Those that enter the child in that slot.
    #[inline(always)]
    fn entering(&self, slot: usize) -> u64 {
        let mut rays = 0;
        for (ray, children) in self.ray.iter().zip(&self.children) {
            rays |= ray & u64::from(children >> slot & 1).wrapping_neg();
        }
        rays
    }
}
