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
use super::found::Found;
use super::isa::{self, Kernel};
use super::place::Blur;
use super::placements::FIXED;
use super::query::{Closest, Occluded, Query};
use super::scratch::{Scratch, with_scratch};
use super::simd::{Mask, Simd, Vector};
use super::slab::{self, SlabRay};
use super::walk::{self, Stack, Visit, with_stack};
use crate::math::{Vec3, triangle_normal};
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

impl TriangleFound {
    /// The triangle's normal, not of unit length.
    #[inline(always)]
    pub fn normal(&self) -> Vec3 {
        triangle_normal(self.corners)
    }
}

/// Whether a search goes on, up to some t.
pub type Search = ControlFlow<(), f32>;

impl Bvh {
    /// The nearest fixed triangle that `ray` hits.
    pub fn closest_triangle(&self, ray: &Ray) -> Option<TriangleFound> {
        if self.fixed.triangles.tree().is_empty() {
            return None;
        }
        with_scratch(|scratch| isa::dispatch(self.isa, Alone { bvh: self, ray, scratch }))
    }

    /// Whether `ray` hits any fixed triangle.
    pub fn occludes(&self, ray: &Ray) -> bool {
        if self.fixed.triangles.tree().is_empty() {
            return false;
        }
        with_scratch(|scratch| isa::dispatch(self.isa, AnyAlone { bvh: self, ray, scratch }))
    }

    /// Shows `visitor` fixed triangles that `ray` hits, up to the t that it returns last (at first the ray's tmax), until it
    /// has seen enough. The order is not that of t; in the high preset a triangle may come several times.
    pub fn visit_triangles(&self, ray: &Ray, visitor: &mut dyn FnMut(&TriangleFound) -> Search) {
        if !self.fixed.triangles.tree().is_empty() && ray.is_valid() {
            with_stack(|stack| isa::dispatch(self.isa, VisitAll { bvh: self, ray, stack, visitor }));
        }
    }

    /// The corners of a fixed triangle: lane `id % 8` of block `id / 8`.
    #[inline(always)]
    fn corners(&self, id: u32) -> [Vec3; 3] {
        let mut scratch = None;
        let lane = self.fixed.triangles.leaves().lane(id, &mut scratch);
        lane.block.triangle(lane.lane % LANES)
    }

    /// What was noted for a ray, computed: alone that is done sooner than four at a time.
    #[inline(always)]
    fn sure_triangle(&self, ray: &Ray, id: u32) -> TriangleFound {
        let mut scratch = None;
        let triangle = self.fixed.triangles.leaves().lane(id, &mut scratch);
        let corners = triangle.block.triangle(triangle.lane % LANES);
        let sure = triangle::intersect_surely(ray, &corners);
        let hit = self.fixed.triangles.hit(&triangle, sure.t as f32, sure.u as f32, sure.v as f32);
        TriangleFound { hit, corners }
    }

    /// What was in doubt, and computed at once.
    #[inline(always)]
    pub(super) fn computed_triangle(&self, found: &Found) -> Option<TriangleFound> {
        found.computed().map(|(hit, id)| TriangleFound { hit, corners: self.corners(id) })
    }

    /// Walks, and notes what is hit; nothing for a ray that is not valid.
    #[inline(always)]
    fn walk_alone<S: Simd, Q: Query>(&self, ray: &Ray, scratch: &mut Scratch) {
        let Scratch { stack, found: [found, ..] } = scratch;
        let triangles = &self.fixed.triangles;
        let tree = triangles.tree();
        let limit = ray.tmax.next_up();
        found.start([ray.tmax, limit]);
        if !is_valid::<S>(ray) {
            return;
        }
        let slab = SlabRay::new::<S>(ray, tree.reach(), Blur::NONE);
        let filter = Filter::new(ray, Blur::NONE);
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
    }
}

/// [`Ray::is_valid`], by the ray's numbers as they lie in memory: they are loaded for the walk anyway.
#[inline(always)]
fn is_valid<S: Simd>(ray: &Ray) -> bool {
    let zero = S::V8::splat(0.0);
    // Of origin and direction: zero for finite numbers.
    let finite = slab::row::<S>(ray).mul(zero).at_most(zero).bits() & 0b11_1111;
    let largest = ray.direction.abs().max_element();
    finite == 0b11_1111 && largest >= f32::MIN_POSITIVE && ray.tmin >= 0.0 && ray.tmin <= ray.tmax
}

struct Alone<'a> {
    bvh: &'a Bvh,
    ray: &'a Ray,
    scratch: &'a mut Scratch,
}

impl Kernel for Alone<'_> {
    type Output = Option<TriangleFound>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self { bvh, ray, scratch } = self;
        bvh.walk_alone::<S, Closest>(ray, scratch);
        let [found, ..] = &scratch.found;
        if found.is_noted() {
            return Some(bvh.sure_triangle(ray, found.noted));
        }
        bvh.computed_triangle(found)
    }
}

struct AnyAlone<'a> {
    bvh: &'a Bvh,
    ray: &'a Ray,
    scratch: &'a mut Scratch,
}

impl Kernel for AnyAlone<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        self.bvh.walk_alone::<S, Occluded>(self.ray, self.scratch);
        self.scratch.found[0].is_hit()
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
