//! A bundle on its way through a tree: boxes for all rays, triangles for groups of them, or for few rays one by one.

use std::marker::PhantomData;

use super::found::{DONE, Found};
use crate::math::Vec3;
use crate::ray::Ray;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::LANES;
use crate::trace::bvh::bundle::{Boxes, Bundle, BundleSlab, PerRay, RAYS, SLACK, TINY, axes};
use crate::trace::bvh::edges::Edges;
use crate::trace::bvh::footprint::Footprints;
use crate::trace::bvh::isa::Kernel;
use crate::trace::bvh::node::{Child, Tree, WIDTH};
use crate::trace::bvh::placements::FIXED;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::rows;
use crate::trace::bvh::simd::{Array, Group, Mask, Simd, Vector};
use crate::trace::bvh::triangles::TriangleTree;

/// Rays that are held against a block of eight triangles one by one; of more, each group is held against each triangle.
const FEW: u32 = 8;

/// Rays of which each is held against the eight boxes of a node by itself.
const ONE_BY_ONE: usize = 3;

/// [`FEW`] in a tree that reaches that far. [`Edges`] must not overflow; where they might, every ray is by itself.
#[inline(always)]
pub(super) fn few(bundle: &Bundle, reach: Vec3) -> u32 {
    if bundle.may_overflow(reach) { RAYS as u32 } else { FEW }
}

/// A child to be visited.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    /// Where the bundle enters it, at the earliest.
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

/// Children that wait to be visited, the nearest on top, and the bundle's way to them.
pub(super) struct Way<'a> {
    pub bundle: &'a Bundle,
    pub slab: BundleSlab,
    /// A bit for every ray that matters.
    pub wanted: u64,
    /// The largest limit of all rays.
    most: f32,
}

impl<'a> Way<'a> {
    /// Of the first `count` rays of the bundle.
    #[inline(always)]
    pub fn new(bundle: &'a Bundle, slab: BundleSlab, count: usize) -> Self {
        let wanted = !0 >> (RAYS - count.clamp(1, RAYS));
        Self { bundle, slab, wanted, most: 0.0 }
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
            let boxes = self.slab.boxes::<S>(node, self.bundle.first);
            let (mask, near, known) = if next.rays.count_ones() as usize <= ONE_BY_ONE {
                let (mask, near, rays) = self.enter_one_by_one::<S>(goal.limit(), &boxes, next.rays);
                (mask, near, Some(rays))
            } else {
                let (mask, near) = self.slab.enter::<S>(&boxes, self.most);
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
        let [p, q] = &self.bundle.reciprocal;
        let [px, qx, zx] = &boxes.near;
        let [py, qy, zy] = &boxes.far;
        let (mut all, mut near) = (splat(0.0).less(splat(0.0)), splat(f32::INFINITY));
        let mut entering = OneByOne { ray: [0; ONE_BY_ONE], children: [0; ONE_BY_ONE] };
        // Where they are fewer, the bundle's first ray is asked in vain.
        for k in 0..ONE_BY_ONE {
            let ray = rays.trailing_zeros() as usize % RAYS;
            entering.ray[k] = rays & rays.wrapping_neg();
            rays &= rays.wrapping_sub(1);
            let (p, q) = (splat(p.0[ray]), splat(q.0[ray]));
            let first = S::V8::load(px).mul(p).max(S::V8::load(qx).mul(q)).max(S::V8::load(zx));
            let last = S::V8::load(py).mul(p).min(S::V8::load(qy).mul(q));
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
        let [p, q] = &self.bundle.reciprocal;
        let mut entering = 0;
        for group in 0..RAYS / S::Wide::LANES {
            let (p, q, limit) = (S::Wide::at(p, group), S::Wide::at(q, group), S::Wide::at(limit, group));
            let first = near[0].mul(p).max(near[1].mul(q)).max(near[2]);
            let last = far[0].mul(p).min(far[1].mul(q)).min(far[2].min(limit));
            entering |= u64::from(first.at_most(last).bits()) << (S::Wide::LANES * group);
        }
        entering & rays
    }
}

/// A bundle on its way through a tree of triangles.
pub(super) struct Walk<'a, Q> {
    pub bvh: &'a Bvh,
    /// Of the triangles.
    pub place: u32,
    pub tree: &'a TriangleTree,
    /// In the world.
    pub rays: &'a [Ray; RAYS],
    /// In the tree's coordinates.
    pub bundle: &'a Bundle,
    pub found: &'a mut Found,
    /// As [`few`] says.
    pub few: u32,
    pub query: PhantomData<Q>,
}

impl<Q> Goal for Walk<'_, Q> {
    #[inline(always)]
    fn tree(&self) -> &Tree {
        self.tree.tree()
    }
    #[inline(always)]
    fn limit(&self) -> &PerRay {
        &self.found.limit
    }
    #[inline(always)]
    fn prefetch<S: Simd>(&self, leaf: Child) {
        self.tree.prefetch::<S>(leaf.first());
    }
}

impl<Q: Query> Walk<'_, Q> {
    #[inline(always)]
    pub fn run<S: Simd>(mut self, stack: &mut [Entry], mut way: Way<'_>, rays: u64) {
        self.found.enter(self.bundle, way.wanted);
        way.measure::<S>(&self.found.limit);
        stack[0] = Entry::root(rays & way.wanted);
        let mut len = 1;
        while let Some(leaf) = way.next_leaf::<S>(&self, stack, &mut len) {
            if self.visit::<S>(leaf, way.most) {
                way.measure::<S>(&self.found.limit);
            }
        }
    }

    /// Tests the blocks of a leaf; true where a limit has changed.
    #[inline(always)]
    fn visit<S: Simd>(&mut self, leaf: Entry, most: f32) -> bool {
        if leaf.rays.count_ones() <= self.few {
            return self.visit_one_by_one::<S>(leaf);
        }
        let mut changed = false;
        let rows = rows::rows(leaf.rays);
        for index in leaf.child.blocks() {
            changed |= S::apart(Meeting { walk: self, index, rows, most });
        }
        changed
    }

    /// A bit for each ray of a group, in a turned bundle, that starts beyond the triangle's plane.
    #[inline(always)]
    fn behind_starts<S: Simd>(&self, edges: &Edges, lane: usize, group: usize) -> u32 {
        let splat = S::Wide::splat;
        let [p, q, along] = axes(self.bundle.axis);
        let direction = &self.bundle.direction;
        // The bundle's direction is the given one, turned round.
        let x = splat(edges.corner[0][lane]).add(S::Wide::at(&direction[p], group));
        let y = splat(edges.corner[1][lane]).add(S::Wide::at(&direction[q], group));
        let z = S::Wide::at(&direction[along], group).mul_add(splat(self.bundle.forward), splat(edges.corner[2][lane]));
        let n = normal::<S>(edges, 3, lane);
        let side = x.mul(n[0]).add(y.mul(n[1])).add(z.mul(n[2]));
        let size = x.abs().add(y.abs()).add(z.abs());
        let steep = n[0].abs().add(n[1].abs()).add(n[2].abs());
        let error = size.mul_add(splat(edges.normal_error[lane]), steep.mul(splat(edges.corner_error[lane])));
        // A length of a ray may leave f32 where those of the bundle do not: then nothing is known.
        error.add(splat(TINY)).less(side).and(side.less(splat(f32::INFINITY))).bits()
    }

    /// What the bounds leave open.
    #[cold]
    #[inline(never)]
    pub(super) fn decide(&mut self, ray: usize, id: u32) -> bool {
        let Self { bvh, rays, bundle, found, .. } = self;
        if Q::ANY && found.limit.0[ray] < 0.0 {
            return false;
        }
        found.compute(bvh, rays, ray);
        let before = found.nearest[ray].limit();
        let (tree, through) = bvh.triangles_at(self.place);
        tree.offer_one(id, &rays[ray], through, &mut found.nearest[ray]);
        let Some(hit) = found.nearest[ray].hit() else { return false };
        if Q::ANY {
            (found.sure.0[ray], found.limit.0[ray]) = (DONE, DONE);
            return true;
        }
        let depth = bundle.depth.0[ray];
        found.sure.0[ray] = hit.t.next_down() * depth * (1.0 - SLACK) - TINY;
        found.limit.0[ray] = found.nearest[ray].limit() * depth * (1.0 + SLACK) + TINY;
        found.nearest[ray].limit() < before
    }
}

/// A block of triangles and rows of a bundle's rays, of which more than a few enter its leaf.
struct Meeting<'a, 'b, Q> {
    walk: &'a mut Walk<'b, Q>,
    index: u32,
    rows: u32,
    most: f32,
}

impl<Q: Query> Kernel for Meeting<'_, '_, Q> {
    /// Whether a limit has changed.
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { walk, index, rows, most } = self;
        let mut scratch = None;
        let tree = walk.tree;
        let block = tree.block(index, &mut scratch);
        let bundle = walk.bundle;
        let Some((lanes, edges)) = Edges::new::<S>(block, bundle, most) else { return false };
        let seen = Footprints::new::<S>(&block.corners, bundle);
        let rows = u64::from(rows & 0xff) * 0x0101_0101_0101_0101;
        let pairs = seen.pairs::<S>(&bundle.rows) & rows & rows::rays(lanes);
        let vague = pairs & rows::rays(edges.is_vague);
        let mut changed = walk.sure::<S>(&edges, LANES as u32 * index, pairs & !vague);
        if vague != 0 {
            changed |= walk.vague::<S>(&edges, LANES as u32 * index, vague);
        }
        changed
    }
}

/// Pairs of eight triangles and eight rows: of triangles and groups.
#[inline(always)]
const fn groups<S: Simd>(pairs: u64) -> u64 {
    if S::Wide::LANES == 16 { (pairs | pairs >> 1) & 0x5555_5555_5555_5555 } else { pairs }
}

impl<Q: Query> Walk<'_, Q> {
    /// Groups of rays against triangles whose front all rays see. A bit for each pair: a byte a triangle, in it a bit for each row.
    #[inline(always)]
    fn sure<S: Simd>(&mut self, edges: &Edges, first_id: u32, pairs: u64) -> bool {
        let splat = S::Wide::splat;
        let first_t = splat(self.bundle.first);
        let mut pairs = groups::<S>(pairs);
        let (mut doubts, mut count) = ([0u32; 64], 0);
        let zero = splat(0.0);
        let mut any = zero.less(zero);
        let place = splat(f32::from_bits(self.place));
        while pairs != 0 {
            let pair = pairs.trailing_zeros();
            pairs &= pairs - 1;
            let (lane, group) = (pair as usize / 8 % LANES, pair as usize % 8 / (S::Wide::LANES / 8));
            let p = S::Wide::at(&self.bundle.slope[0], group);
            let q = S::Wide::at(&self.bundle.slope[1], group);
            let u = along(&normal::<S>(edges, 0, lane), p, q);
            let v = along(&normal::<S>(edges, 1, lane), p, q);
            let w = along(&normal::<S>(edges, 2, lane), p, q);
            let bound = splat(edges.edge_error[lane]);
            let least = u.min(v).min(w);
            let inside = zero.sub(bound).at_most(least);
            let inverse = splat(1.0).div(along(&normal::<S>(edges, 3, lane), p, q));
            let low = splat(edges.near_height[lane]).mul(inverse);
            let high = splat(edges.far_height[lane]).mul(inverse);
            let limit = S::Wide::at(&self.found.limit, group);
            let before = S::Wide::at(&self.found.sure, group);
            let in_range = high.less(before).and(S::Wide::at(&self.bundle.begin, group).less(low));
            let sure = bound.less(least).and(in_range);
            let outside = limit.less(low).or(high.less(first_t));
            let open = inside.without(sure).without(outside).bits();
            let (low, high) = if Q::ANY { (splat(DONE), splat(DONE)) } else { (low, high) };
            high.put_where(sure, &mut self.found.limit.0, group);
            low.put_where(sure, &mut self.found.sure.0, group);
            if !Q::ANY {
                let id = splat(f32::from_bits(first_id + lane as u32));
                id.put_where(sure, bytemuck::cast_mut(&mut self.found.noted), group);
            }
            // What is fixed comes first, when nothing else is noted yet.
            if !Q::ANY && self.place != FIXED {
                place.put_where(sure, bytemuck::cast_mut(&mut self.found.place), group);
            }
            any = any.or(sure);
            doubts[count % 64] = pair << 16 | open;
            count += usize::from(open != 0);
        }
        let mut changed = any.bits() != 0;
        for doubt in &doubts[..count] {
            let pair = doubt >> 16;
            let (lane, group) = (pair as usize / 8 % LANES, pair as usize % 8 / (S::Wide::LANES / 8));
            let mut open = doubt & 0xffff;
            if self.bundle.is_turned {
                open &= !self.behind_starts::<S>(edges, lane, group);
            }
            changed |= self.decide_all::<S>(group, open, first_id + lane as u32);
        }
        changed
    }

    /// The same for triangles of which rays may see either side: where signs agree, it is left to be decided.
    #[inline(always)]
    fn vague<S: Simd>(&mut self, edges: &Edges, first_id: u32, pairs: u64) -> bool {
        let mut pairs = groups::<S>(pairs);
        let mut changed = false;
        while pairs != 0 {
            let pair = pairs.trailing_zeros();
            pairs &= pairs - 1;
            let (lane, group) = (pair as usize / 8 % LANES, pair as usize % 8 / (S::Wide::LANES / 8));
            let p = S::Wide::at(&self.bundle.slope[0], group);
            let q = S::Wide::at(&self.bundle.slope[1], group);
            let u = along(&normal::<S>(edges, 0, lane), p, q);
            let v = along(&normal::<S>(edges, 1, lane), p, q);
            let w = along(&normal::<S>(edges, 2, lane), p, q);
            let bound = S::Wide::splat(edges.edge_error[lane]);
            let below = S::Wide::splat(-edges.edge_error[lane]);
            let open = below.at_most(u.min(v).min(w)).bits() | u.max(v).max(w).at_most(bound).bits();
            changed |= self.decide_all::<S>(group, open, first_id + lane as u32);
        }
        changed
    }

    #[inline(always)]
    fn decide_all<S: Simd>(&mut self, group: usize, mut open: u32, id: u32) -> bool {
        let mut changed = false;
        while open != 0 {
            let i = open.trailing_zeros() as usize;
            open &= open - 1;
            changed |= self.decide(group * S::Wide::LANES + i, id);
        }
        changed
    }
}

/// Normal k of one triangle, for each ray.
#[inline(always)]
fn normal<S: Simd>(edges: &Edges, k: usize, lane: usize) -> [S::Wide; 3] {
    let [x, y, z] = &edges.normals[k];
    [S::Wide::splat(x[lane]), S::Wide::splat(y[lane]), S::Wide::splat(z[lane])]
}

/// The scalar product with (p, q, 1).
#[inline(always)]
fn along<V: Vector>(n: &[V; 3], p: V, q: V) -> V {
    p.mul_add(n[0], q.mul_add(n[1], n[2]))
}
