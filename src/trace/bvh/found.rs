//! What a single ray has hit so far among triangles: for the most part only noted.
//!
//! The reject test ([`super::filter`]) knows bounds on t. Where they leave no doubt that a triangle is hit, and is the
//! nearest, its number will do; t, u and v are computed once, of what remains in the end. Where they leave doubt,
//! [`triangle::intersect`](crate::shape::triangle::intersect) decides at once.

use super::block::{Block, LANES};
use super::filter::Candidates;
use super::query::Query;
use super::triangles::TriangleTree;
use crate::ray::Ray;
use crate::trace::nearest::Nearest;

/// No triangle is noted.
pub(super) const NONE: u32 = u32::MAX;

/// The state of one ray.
pub(super) struct Found {
    /// No hit beyond this is wanted; rounded up.
    pub limit: f32,
    /// A hit nearer than this is the nearest for sure.
    sure: f32,
    /// Found without doubt, but not computed yet: block and lane.
    pub noted: u32,
    /// What was computed, if `noted` is [`NONE`].
    pub nearest: Nearest,
}

impl Found {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let nearest = Nearest::new(ray);
        Self { limit: nearest.limit(), sure: ray.tmax, noted: NONE, nearest }
    }

    /// Whether there is any hit.
    #[inline(always)]
    pub fn is_hit(&self) -> bool {
        self.noted != NONE || self.nearest.hit().is_some()
    }

    /// Takes the candidates of block `index`; all of them in the world.
    #[inline(always)]
    pub fn offer<Q: Query>(
        &mut self,
        tree: &TriangleTree,
        index: u32,
        block: &Block,
        candidates: &Candidates,
        ray: &Ray,
    ) {
        let mut open = candidates.lanes;
        while open != 0 {
            let lane = open.trailing_zeros() as usize % LANES;
            open &= open - 1;
            let (low, high) = (candidates.low[lane], candidates.high[lane]);
            if candidates.sure >> lane & 1 != 0 {
                if ray.tmin <= low && high <= self.sure {
                    self.noted = LANES as u32 * index + lane as u32;
                    (self.sure, self.limit) = (low, high);
                    if Q::ANY {
                        return;
                    }
                    continue;
                }
                if low > self.limit {
                    continue;
                }
            }
            self.decide(tree, block, lane, ray);
        }
    }

    #[cold]
    #[inline(never)]
    fn decide(&mut self, tree: &TriangleTree, block: &Block, lane: usize, ray: &Ray) {
        self.compute(tree, ray);
        tree.offer(block, lane, ray, None, &mut self.nearest);
        self.limit = self.nearest.limit();
        if let Some(hit) = self.nearest.hit() {
            self.sure = hit.t.next_down();
        }
    }

    /// Computes what is noted.
    pub fn compute(&mut self, tree: &TriangleTree, ray: &Ray) {
        let id = std::mem::replace(&mut self.noted, NONE);
        if id != NONE {
            // It is nearer than whatever was computed before.
            self.nearest = Nearest::new(ray);
            tree.offer_one(id, ray, &mut self.nearest);
            debug_assert!(self.nearest.hit().is_some(), "what is noted is hit without doubt");
        }
    }
}
