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
#[derive(Clone, Copy)]
pub(super) struct Found {
    /// No hit beyond this is wanted; rounded up.
    pub limit: f32,
    /// A hit nearer than this is the nearest for sure.
    sure: f32,
    /// Found without doubt, but not computed yet: block and lane.
    pub noted: u32,
    /// Whether anything was computed.
    is_computed: bool,
    /// That, if `noted` is [`NONE`].
    nearest: Nearest,
}

impl Found {
    /// Nothing.
    pub const NONE: Self = Self { limit: 0.0, sure: 0.0, noted: NONE, is_computed: false, nearest: Nearest::NONE };

    /// Nothing yet, up to the ray's tmax, and that rounded up.
    #[inline(always)]
    pub fn start(&mut self, [tmax, limit]: [f32; 2]) {
        (self.sure, self.limit, self.noted, self.is_computed) = (tmax, limit, NONE, false);
    }

    /// Whether a hit is noted, but not computed.
    #[inline(always)]
    pub fn is_noted(&self) -> bool {
        self.noted != NONE
    }

    /// Whether there is any hit.
    #[inline(always)]
    pub fn is_hit(&self) -> bool {
        self.noted != NONE || self.is_computed && self.nearest.hit().is_some()
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
        let mut nearest = self.nearest(tree, ray);
        tree.offer(block, lane, ray, None, &mut nearest);
        self.limit = nearest.limit();
        if let Some(hit) = nearest.hit() {
            self.sure = hit.t.next_down();
        }
        (self.nearest, self.is_computed, self.noted) = (nearest, true, NONE);
    }

    /// The nearest of all, computed.
    pub fn nearest(&self, tree: &TriangleTree, ray: &Ray) -> Nearest {
        let mut nearest = Nearest::new(ray);
        if self.noted != NONE {
            // It is nearer than whatever was computed before.
            tree.offer_one(self.noted, ray, &mut nearest);
            debug_assert!(nearest.hit().is_some(), "what is noted is hit without doubt");
        } else if self.is_computed {
            nearest = self.nearest;
        }
        nearest
    }
}
