//! One ray at a time among the triangles of the world, for callers who cannot wait for a second one.
//!
//! An interface that hands over single rays (Embree's C functions) can have neither flights nor bundles, and wants the
//! triangle's corners with the hit, from which it computes a normal. So the ray walks by itself ([`super::walk`]), what it
//! hits is noted ([`super::found`]) and computed at the end, and the corners come from the block that is in the cache
//! anyway; to fetch them from the mesh afterwards, the simpler way, costs two more steps through memory.
//!
//! Callers with rules of their own about what counts (masks, filters) are shown each triangle that is hit.
//!
//! Only the fixed triangles are asked: shapes and placements are those of [`Tracer`](crate::Tracer).

use std::ops::ControlFlow;

use super::Bvh;
use super::block::LANES;
use super::candidates;
use super::filter::Filter;
use super::flight::{self, Flight};
use super::found::Found;
use super::isa::{self, Kernel};
use super::noted::Rays;
use super::place::Blur;
use super::placements::FIXED;
use super::query::{Closest, Occluded, Query};
use super::simd::Simd;
use super::slab::SlabRay;
use super::walk::{self, Stack, Visit, with_stack};
use crate::math::Vec3;
use crate::ray::{Hit, Ray};
use crate::shape::triangle;

/// A triangle that is hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleFound {
    /// Where.
    pub hit: Hit,
    /// Its corners.
    pub corners: [Vec3; 3],
}

/// Whether a search goes on, up to some t.
pub type Search = ControlFlow<(), f32>;

/// Rays that travel together at most.
const TOGETHER: usize = 16;

impl Bvh {
    /// The nearest fixed triangle that `ray` hits.
    pub fn closest_triangle(&self, ray: &Ray) -> Option<TriangleFound> {
        if self.fixed.triangles.tree().is_empty() || !ray.is_valid() {
            return None;
        }
        with_stack(|stack| isa::dispatch(self.isa, Alone { bvh: self, ray, stack }))
    }

    /// Whether `ray` hits any fixed triangle.
    pub fn occludes(&self, ray: &Ray) -> bool {
        if self.fixed.triangles.tree().is_empty() || !ray.is_valid() {
            return false;
        }
        with_stack(|stack| isa::dispatch(self.isa, AnyAlone { bvh: self, ray, stack }))
    }

    /// [`Bvh::closest_triangle`] of each ray, into `found` of the same length; some of them at a time.
    ///
    /// # Panics
    /// Unless there is one answer a ray.
    pub fn closest_triangles(&self, rays: &[Ray], found: &mut [Option<TriangleFound>]) {
        assert_eq!(rays.len(), found.len(), "one answer a ray");
        found.fill(None);
        if self.fixed.triangles.tree().is_empty() {
            return;
        }
        self.with_flight(|flight| {
            for (rays, found) in rays.chunks(TOGETHER).zip(found.chunks_mut(TOGETHER)) {
                isa::dispatch(self.isa, Together { bvh: self, rays, found, flight });
            }
        });
    }

    /// Shows `visitor` fixed triangles that `ray` hits, up to the t that it returns last (at first the ray's tmax), until it
    /// has seen enough. The order is not that of t; in the high preset a triangle may come several times.
    pub fn visit_triangles(&self, ray: &Ray, visitor: &mut dyn FnMut(&TriangleFound) -> Search) {
        if !self.fixed.triangles.tree().is_empty() && ray.is_valid() {
            with_stack(|stack| isa::dispatch(self.isa, VisitAll { bvh: self, ray, stack, visitor }));
        }
    }

    /// What was noted for up to four rays, computed; those that are missing are the first.
    #[inline(always)]
    fn noted_triangles<S: Simd>(&self, rays: [&Ray; 4], ids: [u32; 4]) -> [TriangleFound; 4] {
        let tree = &self.fixed.triangles;
        let (_, hits) = tree.hits::<S>(&Rays::new::<S>(rays), ids);
        let mut found = hits.map(|hit| TriangleFound { hit, corners: [Vec3::ZERO; 3] });
        for (found, id) in found.iter_mut().zip(ids) {
            found.corners = self.corners(id);
        }
        found
    }

    /// The corners of a fixed triangle: lane `id % 8` of block `id / 8`.
    #[inline(always)]
    fn corners(&self, id: u32) -> [Vec3; 3] {
        let mut scratch = None;
        let lane = self.fixed.triangles.leaves().lane(id, &mut scratch);
        lane.block.triangle(lane.lane % LANES)
    }

    /// What was in doubt, and computed at once.
    #[inline(always)]
    fn computed_triangle(&self, found: &Found) -> Option<TriangleFound> {
        found.computed().map(|(hit, id)| TriangleFound { hit, corners: self.corners(id) })
    }

    /// Walks, and notes what is hit.
    #[inline(always)]
    fn walk_alone<S: Simd, Q: Query>(&self, ray: &Ray, stack: &mut Stack) -> Found {
        let triangles = &self.fixed.triangles;
        let tree = triangles.tree();
        let slab = SlabRay::new(ray, tree.reach(), Blur::NONE);
        let filter = Filter::new(ray, Blur::NONE);
        let limit = ray.tmax.next_up();
        let mut found = Found::NONE;
        found.start([ray.tmax, limit]);
        walk::single::<S, Q>(
            stack,
            tree,
            &slab,
            limit,
            #[inline(always)]
            |leaf| {
                for index in leaf.blocks() {
                    let mut scratch = None;
                    let block = triangles.block(index, &mut scratch);
                    let candidates = filter.candidates::<S, false>(block, found.limit);
                    if candidates.lanes != 0 {
                        found.offer::<Q>(self, FIXED, index, block, &candidates, ray);
                        if Q::ANY && found.is_hit() {
                            return Visit::Stop;
                        }
                    }
                }
                Visit::Until(found.limit)
            },
        );
        found
    }
}

struct Alone<'a> {
    bvh: &'a Bvh,
    ray: &'a Ray,
    stack: &'a mut Stack,
}

impl Kernel for Alone<'_> {
    type Output = Option<TriangleFound>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self { bvh, ray, stack } = self;
        let found = bvh.walk_alone::<S, Closest>(ray, stack);
        if found.is_noted() {
            let (_, [hit, ..]) = bvh.fixed.triangles.hits::<S>(&Rays::new::<S>([ray; 4]), [found.noted; 4]);
            return Some(TriangleFound { hit, corners: bvh.corners(found.noted) });
        }
        bvh.computed_triangle(&found)
    }
}

struct AnyAlone<'a> {
    bvh: &'a Bvh,
    ray: &'a Ray,
    stack: &'a mut Stack,
}

impl Kernel for AnyAlone<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        self.bvh.walk_alone::<S, Occluded>(self.ray, self.stack).is_hit()
    }
}

struct Together<'a> {
    bvh: &'a Bvh,
    rays: &'a [Ray],
    found: &'a mut [Option<TriangleFound>],
    flight: &'a mut Flight,
}

impl Kernel for Together<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, rays, found, flight } = self;
        let mut noted = [(0, 0); TOGETHER];
        let mut count = 0;
        // Ids of placed objects' triangles are not those of fixed ones.
        debug_assert!(bvh.placements.is_empty(), "a flight goes through placements as well");
        flight::trace::<S, Closest>(
            flight,
            bvh,
            rays,
            #[inline(always)]
            |i, state| {
                if state.is_noted() {
                    noted[count % TOGETHER] = (i, state.noted);
                    count += 1;
                } else {
                    found[i] = bvh.computed_triangle(state);
                }
            },
        );
        for four in noted[..count].chunks(4) {
            let at = |k: usize| four.get(k).copied().unwrap_or(four[0]);
            let [a, b, c, d] = [at(0), at(1), at(2), at(3)];
            let each = [&rays[a.0], &rays[b.0], &rays[c.0], &rays[d.0]];
            let triangles = bvh.noted_triangles::<S>(each, [a.1, b.1, c.1, d.1]);
            for (&(ray, _), triangle) in four.iter().zip(triangles) {
                found[ray] = Some(triangle);
            }
        }
    }
}

struct VisitAll<'a, 'v> {
    bvh: &'a Bvh,
    ray: &'a Ray,
    stack: &'a mut Stack,
    visitor: &'a mut (dyn FnMut(&TriangleFound) -> Search + 'v),
}

impl Kernel for VisitAll<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, ray, stack, visitor } = self;
        let triangles = &bvh.fixed.triangles;
        candidates::walk::<S>(
            triangles,
            ray,
            Blur::NONE,
            stack,
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
                match visitor(&TriangleFound { hit, corners }) {
                    Search::Continue(t) => Some(t),
                    Search::Break(()) => None,
                }
            },
        );
    }
}
