//! A bundle of up to 64 rays against a tree at once: the fastest way for camera rays, and for shadow rays of a point
//! light.
//!
//! - **Nodes**: eight boxes are tested against the rectangle of all slopes, an interval test that rejects for all rays
//!   (Wald, Boulos, Shirley 2007, *Ray tracing deformable scenes using dynamic bounding volume hierarchies*). What
//!   remains is tested group by group, up to the first group of rays that hits: the groups before it take no part in
//!   that subtree.
//! - **Triangles**: with a common origin, the edge function of a ray is the scalar product of its direction with a normal
//!   that belongs to the edge. Four triangles are rejected at once by the rectangle of slopes; of the others each group
//!   of rays takes three scalar products.
//! - **Decisions**: edge functions and t' carry bounds on their rounding errors. Where these leave no doubt, a hit is only
//!   noted; where they do, it is decided by [`triangle::intersect`](crate::shape::triangle::intersect). In the end t, u
//!   and v of what was noted are computed four rays at a time ([`TriangleTree::hits`]), with the bits that a single ray would get.

use std::marker::PhantomData;

use super::block::LANES;
use super::build::MAX_DEPTH;
use super::bundle::{Boxes, Bundle, BundleSlab, Fit, PerRay, RAYS, SLACK, TINY, axes};
use super::edges::Edges;
use super::found::NONE;
use super::node::WIDTH;
use super::quad::widen;
use super::query::{Query, SOMETHING};
use super::simd::{Doubles, Group, Mask, Simd, Vector};
use super::triangles::TriangleTree;
use crate::math::Vec3;
use crate::ray::Ray;
use crate::trace::nearest::Nearest;

/// Fewer rays than this are better traced one by one.
const FEWEST: usize = 6;

/// A child to be visited.
#[derive(Clone, Copy, Default)]
struct Entry {
    /// Where the bundle enters it, at the earliest.
    near: f32,
    index: u32,
    count: u8,
    /// The first group with a ray that enters it.
    first: u8,
}

/// Working memory, made once a batch.
pub(super) struct Scratch {
    one: One,
    /// t of the closest hits of the last bundle.
    pub t: [f64; RAYS],
    /// Rays of one octant.
    part: [Ray; RAYS],
}

/// One bundle and its way.
struct One {
    stack: [Entry; MAX_DEPTH * 7 + 8],
    bundle: Bundle,
    found: Found,
}

/// What the rays of a bundle have hit so far.
struct Found {
    /// No hit beyond this t' is wanted; rounded up. Below every t' for a ray that is done.
    limit: PerRay,
    /// A hit nearer than this is the nearest for sure.
    sure: PerRay,
    /// What was found without doubt, but not computed yet: block and lane.
    noted: [u32; RAYS],
    /// What was computed: valid for the rays of the bit mask `computed`.
    nearest: [Nearest; RAYS],
    computed: u64,
}

/// A bundle on its way through a tree of triangles.
struct Walk<'a, Q, const AXIS: usize> {
    tree: &'a TriangleTree,
    rays: &'a [Ray; RAYS],
    bundle: &'a Bundle,
    found: &'a mut Found,
    groups: usize,
    /// The largest limit of all rays.
    most: f32,
    query: PhantomData<Q>,
}

impl Scratch {
    pub fn new() -> Self {
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        let found = Found {
            limit: PerRay::ZERO,
            sure: PerRay::ZERO,
            noted: [NONE; RAYS],
            nearest: [Nearest::new(&ray); RAYS],
            computed: 0,
        };
        let one = One { stack: [Entry::default(); MAX_DEPTH * 7 + 8], bundle: Bundle::new(), found };
        Self { one, t: [0.0; RAYS], part: [ray; RAYS] }
    }
}

/// Traces up to 64 rays that start in one point (or, for any hit, that end in one) through `tree`, into `answers` of the
/// same length and, for closest hits, `scratch.t`. A bit is set in the result for every ray that was traced; the others
/// have too little in common.
#[inline(always)]
pub(super) fn trace<S: Simd, Q: Query>(
    scratch: &mut Scratch,
    tree: &TriangleTree,
    rays: &[Ray],
    answers: &mut [Q::Answer],
) -> u64 {
    let Scratch { one, t, part } = scratch;
    if let (Ok(rays), Ok(answers)) = (<&[Ray; RAYS]>::try_from(rays), <&mut [Q::Answer; RAYS]>::try_from(&mut *answers))
    {
        match one.bundle.fill::<S, Q>(rays) {
            Fit::Whole => {
                let is_traced = one.trace::<S, Q>(tree, rays, RAYS, answers, t);
                return if is_traced { u64::MAX } else { 0 };
            }
            Fit::Parts => {}
            Fit::None => return 0,
        }
    }
    let mut octants = [0u64; 8];
    for (i, ray) in rays.iter().enumerate() {
        let d = ray.direction;
        let octant = usize::from(d.x < 0.0) | usize::from(d.y < 0.0) << 1 | usize::from(d.z < 0.0) << 2;
        octants[octant] |= u64::from(ray.is_valid()) << i;
    }
    let mut done = 0;
    for members in octants {
        if (members.count_ones() as usize) < FEWEST {
            continue;
        }
        let (mut index, mut rest, mut count) = ([0u8; RAYS], members, 0);
        while rest != 0 {
            index[count] = rest.trailing_zeros() as u8;
            part[count] = rays[usize::from(index[count])];
            rest &= rest - 1;
            count += 1;
        }
        // What fills the last group is traced, and forgotten.
        let last = part[count - 1];
        part[count..].fill(last);
        let (mut part_answers, mut part_t) = ([Q::MISS; RAYS], [0.0; RAYS]);
        if one.bundle.fill::<S, Q>(part) == Fit::Whole
            && one.trace::<S, Q>(tree, part, count, &mut part_answers, &mut part_t)
        {
            for (k, &i) in index[..count].iter().enumerate() {
                (answers[usize::from(i)], t[usize::from(i)]) = (part_answers[k], part_t[k]);
            }
            done |= members;
        }
    }
    done
}

impl One {
    /// Traces the bundle, which is made of `rays`; the first `count` of them matter. False, and nothing done, where it is
    /// too steep for the tree.
    #[inline(always)]
    fn trace<S: Simd, Q: Query>(
        &mut self,
        tree: &TriangleTree,
        rays: &[Ray; RAYS],
        count: usize,
        answers: &mut [Q::Answer; RAYS],
        t: &mut [f64; RAYS],
    ) -> bool {
        let Self { stack, bundle, found } = self;
        let Some(slab) = bundle.slab(tree.tree().reach()) else { return false };
        let groups = count.div_ceil(S::Wide::LANES);
        match bundle.axis {
            0 => Walk::<Q, 0>::new(tree, rays, bundle, found, groups).run::<S>(stack, &slab),
            1 => Walk::<Q, 1>::new(tree, rays, bundle, found, groups).run::<S>(stack, &slab),
            _ => Walk::<Q, 2>::new(tree, rays, bundle, found, groups).run::<S>(stack, &slab),
        }
        if Q::ANY {
            for (answer, limit) in answers.iter_mut().zip(&found.limit.0) {
                *answer = Q::answer((*limit < 0.0).then_some(SOMETHING));
            }
        } else {
            found.finish::<S, Q>(tree, bundle, count, answers, t);
        }
        true
    }
}

impl<'a, Q: Query, const AXIS: usize> Walk<'a, Q, AXIS> {
    #[inline(always)]
    fn new(
        tree: &'a TriangleTree,
        rays: &'a [Ray; RAYS],
        bundle: &'a Bundle,
        found: &'a mut Found,
        groups: usize,
    ) -> Self {
        (found.limit, found.sure, found.noted, found.computed) = (bundle.limit, bundle.end, [NONE; RAYS], 0);
        Self { tree, rays, bundle, found, groups, most: 0.0, query: PhantomData }
    }

    #[inline(always)]
    fn measure<S: Simd>(&mut self) {
        let mut most = S::Wide::at(&self.found.limit, 0);
        for group in 1..self.groups {
            most = most.max(S::Wide::at(&self.found.limit, group));
        }
        self.most = most.largest();
    }

    #[inline(always)]
    fn run<S: Simd>(mut self, stack: &mut [Entry], slab: &BundleSlab) {
        self.measure::<S>();
        let tree = self.tree.tree();
        let mut len = 0;
        let mut next = Entry::default();
        loop {
            if next.count == 0 {
                let node = tree.node(next.index);
                let (mut mask, near, boxes) = slab.enter::<S>(node, self.bundle.first, self.most);
                let base = len;
                while mask != 0 {
                    let slot = mask.trailing_zeros() as usize % WIDTH;
                    mask &= mask - 1;
                    let Some(first) = self.first_group::<S>(&boxes, slot, next.first) else { continue };
                    let child = Entry { near: near[slot], index: node.index[slot], count: node.count[slot], first };
                    let mut at = len;
                    while at > base && stack[at - 1].near < child.near {
                        stack[at] = stack[at - 1];
                        at -= 1;
                    }
                    stack[at] = child;
                    len += 1;
                    if child.count == 0 {
                        S::prefetch(tree.node(child.index));
                    } else {
                        self.tree.prefetch::<S>(child.index);
                    }
                }
            } else if self.visit::<S>(next) {
                self.measure::<S>();
            }
            next = loop {
                if len == 0 {
                    return;
                }
                len -= 1;
                if stack[len].near <= self.most {
                    break stack[len];
                }
            };
        }
    }

    /// The first group, from `from` on, with a ray that enters the box.
    #[inline(always)]
    fn first_group<S: Simd>(&self, boxes: &Boxes, slot: usize, from: u8) -> Option<u8> {
        let splat = S::Wide::splat;
        let near = [splat(boxes.near[0][slot]), splat(boxes.near[1][slot]), splat(boxes.near[2][slot])];
        let far = [splat(boxes.far[0][slot]), splat(boxes.far[1][slot]), splat(boxes.far[2][slot])];
        for group in usize::from(from)..self.groups {
            let p = S::Wide::at(&self.bundle.reciprocal[0], group);
            let q = S::Wide::at(&self.bundle.reciprocal[1], group);
            let first = near[0].mul(p).max(near[1].mul(q)).max(near[2]);
            let limit = S::Wide::at(&self.found.limit, group).min(far[2]);
            let last = far[0].mul(p).min(far[1].mul(q)).min(limit);
            if first.at_most(last).bits() != 0 {
                return Some(group as u8);
            }
        }
        None
    }

    /// Tests the blocks of a leaf; true where a limit has changed.
    #[inline(always)]
    fn visit<S: Simd>(&mut self, leaf: Entry) -> bool {
        let mut changed = false;
        for index in leaf.index..leaf.index + u32::from(leaf.count) {
            let mut scratch = None;
            let block = self.tree.block(index, &mut scratch);
            let (lanes, edges) = Edges::new::<S, AXIS>(&block.corners, self.bundle, self.most);
            let mut lanes = lanes & block.lanes;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize % LANES;
                lanes &= lanes - 1;
                changed |= self.triangle::<S>(LANES as u32 * index + lane as u32, &edges, lane, leaf.first);
            }
        }
        changed
    }

    /// One triangle against the groups from `first` on.
    #[inline(always)]
    fn triangle<S: Simd>(&mut self, id: u32, edges: &Edges, lane: usize, first: u8) -> bool {
        let splat = S::Wide::splat;
        let (nu, nv, nw) = (normal::<S>(edges, 0, lane), normal::<S>(edges, 1, lane), normal::<S>(edges, 2, lane));
        let bound = splat(edges.edge_error[lane]);
        let below = splat(-edges.edge_error[lane]);
        let is_vague = edges.is_vague >> lane & 1 != 0;
        let (mut changed, first_t) = (false, splat(self.bundle.first));
        for group in usize::from(first)..self.groups {
            let p = S::Wide::at(&self.bundle.slope[0], group);
            let q = S::Wide::at(&self.bundle.slope[1], group);
            let (u, v, w) = (along(&nu, p, q), along(&nv, p, q), along(&nw, p, q));
            let least = u.min(v).min(w);
            let inside = below.at_most(least);
            let mut open = inside.bits();
            if is_vague {
                // Where the bundle sees both sides, the signs must only agree.
                open |= u.max(v).max(w).at_most(bound).bits();
            } else if open != 0 {
                let inverse = splat(1.0).div(along(&normal::<S>(edges, 3, lane), p, q));
                let low = splat(edges.near_height[lane]).mul(inverse);
                let high = splat(edges.far_height[lane]).mul(inverse);
                let limit = S::Wide::at(&self.found.limit, group);
                let before = S::Wide::at(&self.found.sure, group);
                let in_range = high.less(before).and(S::Wide::at(&self.bundle.begin, group).less(low));
                let sure = bound.less(least).and(in_range);
                let outside = limit.less(low).or(high.less(first_t));
                open = inside.without(sure).without(outside).bits();
                if sure.bits() != 0 {
                    let (low, high) = if Q::ANY { (splat(DONE), splat(DONE)) } else { (low, high) };
                    S::Wide::select(sure, high, limit).put(&mut self.found.limit, group);
                    S::Wide::select(sure, low, before).put(&mut self.found.sure, group);
                    S::Wide::put_where(sure, id, &mut self.found.noted, group);
                    changed = true;
                }
                if open != 0 && self.bundle.is_turned {
                    open &= !self.behind_starts::<S>(edges, lane, group);
                }
            }
            while open != 0 {
                let i = open.trailing_zeros() as usize;
                open &= open - 1;
                changed |= self.decide(group * S::Wide::LANES + i, id);
            }
        }
        changed
    }

    /// A bit for each ray of a group, in a turned bundle, that starts beyond the triangle's plane.
    #[inline(always)]
    fn behind_starts<S: Simd>(&self, edges: &Edges, lane: usize, group: usize) -> u32 {
        let splat = S::Wide::splat;
        let [p, q, along] = axes(AXIS);
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
        error.add(splat(TINY)).less(side).bits()
    }

    /// What the bounds leave open.
    #[cold]
    #[inline(never)]
    fn decide(&mut self, ray: usize, id: u32) -> bool {
        let Self { tree, rays, bundle, found, .. } = self;
        if Q::ANY && found.limit.0[ray] < 0.0 {
            return false;
        }
        found.compute(tree, rays, ray);
        let before = found.nearest[ray].limit();
        tree.offer_one(id, &rays[ray], &mut found.nearest[ray]);
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

/// `sure` and `limit` of a ray that needs no more hits.
const DONE: f32 = f32::NEG_INFINITY;

impl Found {
    /// Makes `nearest` valid for a ray, from what is noted.
    fn compute(&mut self, tree: &TriangleTree, rays: &[Ray; RAYS], ray: usize) {
        let id = std::mem::replace(&mut self.noted[ray], NONE);
        // What is noted is nearer than whatever was computed before.
        if id != NONE || self.computed >> ray & 1 == 0 {
            self.nearest[ray] = Nearest::new(&rays[ray]);
            self.computed |= 1 << ray;
        }
        if id != NONE {
            tree.offer_one(id, &rays[ray], &mut self.nearest[ray]);
            debug_assert!(self.nearest[ray].hit().is_some(), "what is noted is hit without doubt");
        }
    }

    /// Computes what is noted, and answers for the first `count` rays.
    #[inline(always)]
    fn finish<S: Simd, Q: Query>(
        &mut self,
        tree: &TriangleTree,
        bundle: &Bundle,
        count: usize,
        answers: &mut [Q::Answer; RAYS],
        t: &mut [f64; RAYS],
    ) {
        for chunk in 0..count.div_ceil(4) {
            let chunk = chunk % (RAYS / 4);
            let ids: [u32; 4] = self.noted.as_chunks().0[chunk];
            let answers: &mut [Q::Answer; 4] = &mut answers.as_chunks_mut().0[chunk];
            let t: &mut [f64; 4] = &mut t.as_chunks_mut().0[chunk];
            // NONE is the largest number.
            let [a, b, c, d] = ids;
            let (some, all) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
            if all != NONE {
                answer_noted::<S, Q>(tree, bundle, chunk, ids, t, answers);
                continue;
            }
            if some != NONE {
                // Lanes without a triangle compute something harmless.
                let or_some = |id: u32| if id == NONE { some } else { id };
                let ids = [or_some(a), or_some(b), or_some(c), or_some(d)];
                answer_noted::<S, Q>(tree, bundle, chunk, ids, t, answers);
            }
            for lane in 0..4 {
                let ray = 4 * chunk + lane;
                if ids[lane] == NONE {
                    let is_hit = self.computed >> ray & 1 != 0;
                    answers[lane] = if is_hit { Q::answer(self.nearest[ray].hit()) } else { Q::MISS };
                    t[lane] = self.nearest[ray].t();
                }
            }
        }
    }
}

/// Answers for the four rays of a chunk, each of which hits a triangle for sure.
///
/// What remains of [`triangle::intersect`](crate::shape::triangle::intersect) is whether f64 is precise enough. It is: the
/// bounds on t' come from rounding in f32 and are half of t' apart at most. That of f64 is 2^29 times smaller, and 2^21
/// times is wanted; both count some 50 roundings of the same products.
#[inline(always)]
fn answer_noted<S: Simd, Q: Query>(
    tree: &TriangleTree,
    bundle: &Bundle,
    chunk: usize,
    ids: [u32; 4],
    t: &mut [f64; 4],
    answers: &mut [Q::Answer; 4],
) {
    let [x, y, z] = &bundle.direction;
    let lanes = |d: &PerRay| d.0.as_chunks().0[chunk];
    let direction = [widen::<S>(&lanes(x)), widen::<S>(&lanes(y)), widen::<S>(&lanes(z))];
    let [x, y, z] = bundle.origin;
    let origin = [S::D4::splat(x.into()), S::D4::splat(y.into()), S::D4::splat(z.into())];
    let (exact, hits) = tree.hits::<S>(origin, direction, ids);
    *t = exact;
    for (answer, hit) in answers.iter_mut().zip(hits) {
        *answer = Q::answer(Some(hit));
    }
}
