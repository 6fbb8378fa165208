//! A bundle among placed objects: it goes through the tree of placements as through any other, and from each of them on
//! in the object's coordinates, one with a common direction ray by ray.

use super::pencil::Pencil;
use super::range::RayIntervals;
use super::rays::Bundle;
use super::way::{Entry, Goal, Way};
use crate::trace::bvh::Bvh;
use crate::trace::bvh::levels::placements::{FIXED, PlacementTree};
use crate::trace::bvh::node::Child;
use crate::trace::bvh::simd::{PerRay, Simd};
use crate::trace::bvh::tree::Tree;

/// The placements, as what a bundle looks for.
struct Places<'a> {
    placements: &'a PlacementTree,
    limit: PerRay,
}

impl Goal for Places<'_> {
    #[inline(always)]
    fn tree(&self) -> &Tree {
        self.placements.tree()
    }
    #[inline(always)]
    fn limit(&self) -> &PerRay {
        &self.limit
    }
    #[inline(always)]
    fn prefetch<S: Simd>(&self, leaf: Child) {
        S::prefetch(S::address(self.placements.places(), leaf.first()));
    }
}

/// The way of a bundle from place to place: first to the fixed triangles, then to placements in the order in which it
/// enters their boxes, as long as these are near enough.
pub(super) struct Tour<'a, P> {
    places: Places<'a>,
    /// None where there are no placements.
    way: Option<Way<'a, P>>,
    stack: &'a mut [Entry],
    len: usize,
    visits_fixed: bool,
}

impl<'a, P: Pencil> Tour<'a, P> {
    /// None where the bundle is too steep for one of the trees.
    #[inline(always)]
    pub fn new(bvh: &'a Bvh, bundle: &'a Bundle, count: usize, stack: &'a mut [Entry]) -> Option<Self> {
        let (fixed, placements) = (bvh.fixed.triangles.tree(), &bvh.placements);
        let visits_fixed = !fixed.is_empty();
        if visits_fixed && P::slab(bundle, fixed.reach()).is_none() {
            return None;
        }
        let way = if placements.has_triangles() {
            Some(Way::new(bundle, P::slab(bundle, placements.reach())?, count))
        } else {
            None
        };
        stack[0] = Entry::root(way.as_ref().map_or(0, |way| way.wanted));
        Some(Self { places: Places { placements, limit: PerRay::ZERO }, way, stack, len: 1, visits_fixed })
    }

    /// Whether there are places besides what is fixed.
    #[inline(always)]
    pub fn has_placements(&self) -> bool {
        self.way.is_some()
    }

    /// The next place, a bit for every ray that may go there, and where the first of them enters its box.
    #[inline(always)]
    pub fn next<S: Simd>(&mut self, range: &RayIntervals) -> Option<(u32, u64, f32)> {
        if std::mem::take(&mut self.visits_fixed) {
            return Some((FIXED, !0, 0.0));
        }
        let way = self.way.as_mut()?;
        way.bundle.limit_of::<S, P>(range, &mut self.places.limit);
        way.measure::<S>(&self.places.limit);
        let leaf = way.next_leaf::<S>(&self.places, self.stack, &mut self.len)?;
        Some((leaf.child.first(), leaf.rays, leaf.near))
    }
}
