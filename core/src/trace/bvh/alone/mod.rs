//! One ray at a time among the triangles of the world, for callers who cannot wait for a second one, and for so few
//! rays that they make no flight ([`some`]).
//!
//! An interface that hands over single rays (Embree's C functions) can have neither flights nor bundles, and wants the
//! triangle's normal with the hit. So the ray walks by itself ([`super::walk`]), what it hits is noted and computed at
//! the end ([`found`]), and the normal comes from the block that is in the cache anyway; to fetch corners from the mesh
//! afterwards, the simpler way, costs two more steps through memory. A call takes as long as some hundred instructions
//! more or less, so the ray is read where the caller has it ([`row`]), and what is found is written where it is wanted.
//!
//! Callers with rules of their own about what counts (masks, filters) are shown each triangle that is hit.
//!
//! A caller's single ray is asked of the fixed triangles only: shapes and placements are those of
//! [`Tracer`](crate::Tracer), whose many rays go on from place to place.

pub(super) mod candidates;
mod found;
mod row;
mod some;

use std::ops::ControlFlow;

use super::Bvh;
use super::block::{Block, LANES};
use super::hits::coplanar::Spot;
use super::hits::found::{Found, NONE};
use super::levels::placements::FIXED;
use super::levels::triangles::TriangleTree;
use super::query::{Closest, Occluded, Query};
use super::reject::Blur;
use super::reject::filter::{Candidates, Filter};
use super::reject::ready::ReadyRay;
use super::reject::slab::{SlabRay, most_t};
use super::simd::Simd;
use super::simd::isa::{self, Kernel};
use super::walk::{self, Entered, Visit};
use crate::ray::{Hit, Ray};
use crate::shape::triangle;
pub use found::TriangleFound;
pub use row::SingleRay;
pub use some::Travel;

/// What was decided at once of a ray of which there was doubt, if [`Noted`] says that anything was; room for it is made
/// where it is first needed, for few rays need it.
pub(super) type Doubted = Option<Found>;

/// Whether a search goes on, and up to which t, or which radius; whoever wants what lies at t itself gives
/// `t.next_up()`.
pub type VisitFlow = ControlFlow<(), f32>;

impl Bvh {
    /// The nearest [fixed](crate::World::fixed) triangle that `ray` hits, into `found`. Whether there is one. What is
    /// placed by transforms, and what is no triangle, is not asked: [`Tracer::closest`](crate::Tracer::closest) asks
    /// everything.
    pub fn closest_triangle(&self, ray: &SingleRay, found: &mut TriangleFound) -> bool {
        self.has_fixed() && isa::dispatch(self.isa, Alone { bvh: self, ray, found })
    }

    /// Whether `ray` hits any fixed triangle, as [`Bvh::closest_triangle`] has it:
    /// [`Tracer::occluded`](crate::Tracer::occluded) asks everything.
    pub fn occludes(&self, ray: &SingleRay) -> bool {
        self.has_fixed() && isa::dispatch(self.isa, AnyAlone { bvh: self, ray })
    }

    /// Whether there are fixed triangles.
    #[inline(always)]
    pub(super) fn has_fixed(&self) -> bool {
        !self.fixed.triangles.tree().is_empty()
    }

    /// Shows `visitor` fixed triangles, as [`Bvh::closest_triangle`] has them, that `ray` hits, up to the t that it
    /// returns last (at first the ray's tmax), until it has seen enough. The order is not that of t; in the high preset
    /// a triangle may come several times.
    pub fn visit_triangles(&self, ray: &Ray, visitor: &mut dyn FnMut(&TriangleFound) -> VisitFlow) {
        if self.has_fixed() && ray.is_valid() {
            isa::dispatch(self.isa, VisitAll { bvh: self, ray, visitor });
        }
    }

    /// [`Self::closest_triangle`] of a ray that is ready: `ray` is the same.
    #[inline(always)]
    pub(super) fn closest_ready<S: Simd>(
        &self,
        ray: &SingleRay,
        ready: &ReadyRay,
        doubted: &mut Doubted,
        found: &mut TriangleFound,
    ) -> bool {
        let noted = self.walk_ready::<S, Closest>(ray, ready, doubted);
        noted.compute::<S>(self, ray, doubted, found)
    }

    /// [`Self::occludes`], likewise.
    #[inline(always)]
    pub(super) fn occluded_ready<S: Simd>(&self, ray: &SingleRay, ready: &ReadyRay, doubted: &mut Doubted) -> bool {
        self.walk_ready::<S, Occluded>(ray, ready, doubted).is_hit(doubted)
    }

    /// As [`Self::walk_alone`], of a ray that is ready.
    #[inline(always)]
    fn walk_ready<S: Simd, Q: Query>(&self, ray: &SingleRay, ready: &ReadyRay, doubted: &mut Doubted) -> Noted {
        let mut noted = Noted::nothing(ray);
        self.walk_through::<S, Q, false>(
            FIXED,
            &self.fixed.triangles,
            &ready.slab(),
            #[inline(always)]
            || ready.filter(),
            ray,
            &mut noted,
            doubted,
        );
        noted
    }

    /// Walks, and notes what is hit; what was in doubt is in `doubted`. None for a ray that is not valid.
    #[inline(always)]
    fn walk_alone<S: Simd, Q: Query>(&self, ray: &SingleRay, doubted: &mut Doubted) -> Option<Noted> {
        let (slab, rest) = ray.ready::<S, false>(self.fixed.triangles.tree().reach_row(), Blur::NONE)?;
        let mut noted = Noted::nothing(ray);
        self.walk_through::<S, Q, false>(
            FIXED,
            &self.fixed.triangles,
            &slab,
            #[inline(always)]
            || rest.filter(),
            ray,
            &mut noted,
            doubted,
        );
        Some(noted)
    }

    /// The same through the triangles at `place`: `slab` is the ray ready for the tree's nodes, `filter` makes it ready
    /// for triangles, `ray` is in the world. It is the ray that is meant if it is not `BLURRED`.
    #[expect(clippy::too_many_arguments, reason = "a place, a ray, and what it has found")]
    #[inline(always)]
    fn walk_through<S: Simd, Q: Query, const BLURRED: bool>(
        &self,
        place: u32,
        triangles: &TriangleTree,
        slab: &SlabRay,
        filter: impl FnOnce() -> Filter,
        ray: &SingleRay,
        noted: &mut Noted,
        doubted: &mut Doubted,
    ) {
        let tree = triangles.tree();
        let root = Entered::root::<S>(tree, slab, noted.limit);
        let filter = filter();
        walk::from_root::<S, Q>(
            tree,
            slab,
            noted.limit,
            &root,
            #[inline(always)]
            |leaf| {
                for index in leaf.blocks() {
                    let mut scratch = None;
                    let block = triangles.block::<S>(index, &mut scratch);
                    // The black box keeps the filter in memory, as it does the slabs of a single ray where nodes are
                    // entered (`walk::Enter`): without it the compiler spreads each number over a vector before the
                    // walk, and spills them.
                    let candidates = std::hint::black_box(&filter).candidates::<S, BLURRED>(block, noted.limit);
                    if candidates.lanes != 0 && noted.offer::<Q>(self, doubted, place, index, block, &candidates, ray) {
                        return Visit::Stop;
                    }
                }
                Visit::Until(noted.limit)
            },
        );
    }
}

/// What a ray has hit so far, as [`Found`] is, which is asked only where there is doubt: kept in registers.
#[derive(Clone, Copy)]
pub(super) struct Noted {
    /// A hit nearer than this is the nearest for sure.
    pub sure: f32,
    /// No hit beyond this is wanted; rounded up.
    pub limit: f32,
    /// Found without doubt, but not computed yet: block and lane.
    pub id: u32,
    /// Where that triangle is: the number of a placement, or [`FIXED`].
    pub place: u32,
    /// Whether anything was decided at once.
    pub is_doubted: bool,
}

impl Noted {
    /// Nothing yet.
    #[inline(always)]
    pub fn nothing(ray: &SingleRay) -> Self {
        let limit = most_t(ray.tmax);
        // What lies so far that t overflows is in doubt, whose decision is that it is not hit.
        Self { sure: ray.tmax.min(f32::MAX), limit, id: NONE, place: FIXED, is_doubted: false }
    }

    /// Whether there is any hit.
    #[inline(always)]
    pub fn is_hit(&self, doubted: &Doubted) -> bool {
        self.id != NONE || self.is_doubted && doubted.as_ref().is_some_and(Found::is_hit)
    }

    /// The hit, of a fixed triangle, into `found`. Whether there is any.
    #[inline(always)]
    fn compute<S: Simd>(&self, bvh: &Bvh, ray: &SingleRay, doubted: &Doubted, found: &mut TriangleFound) -> bool {
        if self.id != NONE {
            *found = bvh.sure_triangle::<S>(ray, self.id);
            return true;
        }
        let doubted = if self.is_doubted { doubted.as_ref() } else { None };
        let computed = doubted.and_then(|doubted| bvh.computed_triangle(doubted));
        computed.is_some_and(|computed| {
            *found = computed;
            true
        })
    }

    /// Takes the candidates of block `index` of the triangles at `place`. Whether that is enough.
    #[expect(clippy::too_many_arguments, reason = "in registers")]
    #[inline(always)]
    fn offer<Q: Query>(
        &mut self,
        bvh: &Bvh,
        doubted: &mut Doubted,
        place: u32,
        index: u32,
        block: &Block,
        candidates: &Candidates,
        ray: &SingleRay,
    ) -> bool {
        let mut open = candidates.lanes;
        while open != 0 {
            let lane = open.trailing_zeros() as usize % LANES;
            open &= open - 1;
            let (low, high) = (candidates.low[lane], candidates.high[lane]);
            if candidates.sure >> lane & 1 != 0 {
                if ray.begin() <= low && high <= self.sure {
                    (self.sure, self.limit) = (low, high);
                    (self.id, self.place) = (LANES as u32 * index + lane as u32, place);
                    if Q::ANY {
                        return true;
                    }
                    continue;
                }
                if low > self.limit {
                    continue;
                }
                let (noted, id) = (self.id, LANES as u32 * index + lane as u32);
                if let Some(first) = bvh.first_of_plane(Spot { place: self.place, id: noted }, Spot { place, id }) {
                    (self.place, self.id) = (first.place, first.id);
                    continue;
                }
            }
            *self = self.decide(bvh, doubted, place, index, block, lane, ray);
            if Q::ANY && self.is_hit(doubted) {
                return true;
            }
        }
        false
    }

    /// Decides whether the ray hits one triangle of a block. By value, so that it need not lie in memory before.
    #[cold]
    #[inline(never)]
    #[expect(clippy::too_many_arguments, reason = "in registers")]
    fn decide(
        self,
        bvh: &Bvh,
        doubted: &mut Doubted,
        place: u32,
        index: u32,
        block: &Block,
        lane: usize,
        ray: &SingleRay,
    ) -> Self {
        let found = doubted.get_or_insert(Found::NONE);
        if !self.is_doubted {
            found.start([self.sure, self.limit]);
        }
        found.resume([self.sure, self.limit], self.id, self.place);
        found.decide(bvh, place, index, block, lane, &ray.ray());
        let [sure, limit] = found.range();
        Self { sure, limit, id: NONE, place, is_doubted: true }
    }
}

struct Alone<'a> {
    bvh: &'a Bvh,
    ray: &'a SingleRay,
    found: &'a mut TriangleFound,
}

impl Kernel for Alone<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { bvh, ray, found } = self;
        let mut doubted = None;
        let Some(noted) = bvh.walk_alone::<S, Closest>(ray, &mut doubted) else { return false };
        noted.compute::<S>(bvh, ray, &doubted, found)
    }
}

struct AnyAlone<'a> {
    bvh: &'a Bvh,
    ray: &'a SingleRay,
}

impl Kernel for AnyAlone<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { bvh, ray } = self;
        let mut doubted = None;
        let noted = bvh.walk_alone::<S, Occluded>(ray, &mut doubted);
        noted.is_some_and(|noted| noted.is_hit(&doubted))
    }
}

struct VisitAll<'a, 'v> {
    bvh: &'a Bvh,
    ray: &'a Ray,
    visitor: &'a mut (dyn FnMut(&TriangleFound) -> VisitFlow + 'v),
}

impl Kernel for VisitAll<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, ray, visitor } = self;
        let triangles = &bvh.fixed.triangles;
        candidates::walk::<S>(
            triangles,
            ray,
            Blur::NONE,
            #[inline(always)]
            |filter, block, limit| filter.candidates::<S, false>(block, limit),
            #[inline(always)]
            |block, lane, limit| {
                let corners = block.triangle(lane);
                let Some(found) = triangle::intersect(ray, &corners) else { return Some(limit) };
                let part = triangles.part(block.part[lane]);
                let hit = Hit {
                    t: found.t as f32,
                    u: found.u as f32,
                    v: found.v as f32,
                    primitive: block.primitive[lane],
                    geometry: part.geometry,
                    instance: part.instance,
                };
                match visitor(&TriangleFound::new(hit, corners)) {
                    VisitFlow::Continue(t) => Some(t),
                    VisitFlow::Break(()) => None,
                }
            },
        );
    }
}
