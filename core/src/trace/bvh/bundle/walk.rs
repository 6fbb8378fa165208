//! A bundle among the triangles of a tree: at leaves that more than a few rays enter it meets all triangles at once
//! ([`Meeting`]), at others its rays are tested one by one ([`super::single`]).

use std::marker::PhantomData;

use super::found::{BundleFound, DONE};
use super::meeting::Meeting;
use super::pencil::Pencil;
use super::rays::{Bundle, SLACK, TINY};
use super::rows;
use super::way::{Entry, Goal, Way};
use crate::math::Vec3;
use crate::ray::Ray;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::hits::coplanar::Spot;
use crate::trace::bvh::levels::placements::FIXED;
use crate::trace::bvh::levels::triangles::TriangleTree;
use crate::trace::bvh::node::Child;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::simd::{PerRay, RAYS, Simd};
use crate::trace::bvh::tree::Tree;

/// Rays that are held against a block of eight triangles one by one; of more, each group is held against each triangle.
const FEW: u32 = 8;

/// [`FEW`] in a tree that reaches that far. [`Edges`](super::edges::Edges) must not overflow; where they might, every
/// ray is by itself.
#[inline(always)]
pub(super) fn few<P: Pencil>(bundle: &Bundle, reach: Vec3) -> u32 {
    if bundle.may_overflow::<P>(reach) { RAYS as u32 } else { FEW }
}

/// A bundle on its way through a tree of triangles.
pub(super) struct Walk<'a, Q, P> {
    pub bvh: &'a Bvh,
    /// Of the triangles.
    pub place: u32,
    pub tree: &'a TriangleTree,
    /// In the world.
    pub rays: &'a [Ray; RAYS],
    /// In the tree's coordinates.
    pub bundle: &'a Bundle,
    pub found: &'a mut BundleFound,
    /// As [`few`] says.
    pub few: u32,
    pub query: PhantomData<(Q, P)>,
}

impl<Q, P> Goal for Walk<'_, Q, P> {
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

impl<Q: Query, P: Pencil> Walk<'_, Q, P> {
    #[inline(always)]
    pub fn run<S: Simd>(mut self, stack: &mut [Entry], mut way: Way<'_, P>, rays: u64) {
        debug_assert!(!P::IS_PARALLEL || self.place == FIXED, "parallel rays go through placed objects one by one");
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
        let (mut changed, rows) = (false, rows::rows(leaf.rays));
        for index in leaf.child.blocks() {
            changed |= S::apart(Meeting { walk: self, index, rows, most });
        }
        changed
    }

    /// Of rays from `ray` on, a bit each, that hit triangle `id` for sure: those whose noted triangle is seen to lie in
    /// one plane with it, so that nothing is left to be decided. Noted is then whichever counts.
    #[cold]
    #[inline(never)]
    pub(super) fn settle(&mut self, id: u32, ray: usize, mut sure: u32) -> u32 {
        let Self { bvh, place, found, .. } = self;
        let (other, mut settled, mut last) = (Spot { place: *place, id }, 0, None);
        while sure != 0 {
            let lane = sure.trailing_zeros();
            let ray = (ray + lane as usize) % RAYS;
            sure &= sure - 1;
            let noted = Spot { place: found.place[ray], id: found.noted[ray] };
            // Neighbours mostly hit the same two.
            let first = match last {
                Some((same, first)) if same == noted => first,
                _ => bvh.first_of_plane(noted, other),
            };
            last = Some((noted, first));
            if let Some(first) = first {
                (found.place[ray], found.noted[ray]) = (first.place, first.id);
                settled |= 1 << lane;
            }
        }
        settled
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
        let start = bundle.start_of::<P>(ray);
        found.sure.0[ray] = (hit.t.next_down() * depth + start) * (1.0 - SLACK) - TINY;
        found.limit.0[ray] = (found.nearest[ray].limit() * depth + start) * (1.0 + SLACK) + TINY;
        found.nearest[ray].limit() < before
    }
}
