//! The native tracer: a bounding volume hierarchy with eight children a node.
//!
//! | file | idea |
//! | --- | --- |
//! | `node` | the tree: 256-byte nodes, eight boxes each, component by component (Wald, Benthin, Boulos 2008, *Getting rid of packets*) |
//! | `build` | binned surface area heuristic, the wide nodes emitted directly (Wald 2007, *On fast construction of SAH-based bounding volume hierarchies*) |
//! | `preset` | what a tree is built for: speed of building, of tracing, or memory |
//! | `clusters` | the fast preset: triangles along a curve |
//! | `refit` | the same tree for moved vertices |
//! | `slab` | boxes against a ray, padded so that rounding never loses a hit (Ize 2013, *Robust BVH ray traversal*) |
//! | `walk` | one ray, from the root to the leaves |
//! | `tile`, `bundle`, `edges` | 64 rays that start, or end, in one point, at once |
//! | `triangles`, `shapes`, `placements` | what leaves hold: triangles, shapes, placed objects |
//! | `all_hits` | all crossings of a ray, in order, each of them once |
//! | `closest_point` | the point of all triangles that is nearest to a given one |
//! | `leaves`, `meshes`, `memory` | where blocks are kept, or fetched from the mesh; large arrays |
//! | `block`, `filter` | four triangles together, and what a single ray rejects of them |
//! | `simd`, `isa` | the same code compiled twice, for AVX2 and for any processor |
//!
//! Three trees and not one with mixed leaves: each leaf loop knows its kind, and a scene without shapes or without
//! instances has none of the second and third.
//!
//! Boxes only ever reject what cannot be hit, and `shape::triangle::intersect` depends on
//! the ray and the corners alone, so the answer is the same for every order of traversal, packet width and
//! instruction set.

mod all_hits;
mod block;
mod build;
mod bundle;
mod closest_point;
mod clusters;
mod edges;
mod filter;
mod found;
mod isa;
mod leaves;
mod memory;
mod meshes;
mod node;
mod placements;
mod preset;
mod quad;
mod query;
mod refit;
mod shapes;
mod simd;
mod slab;
mod tile;
mod triangles;
mod walk;

pub use closest_point::ClosestPoint;
pub use isa::Isa;
pub use preset::{Options, Preset};

use std::ops::Range;

use super::nearest::Nearest;
use super::{Batch, Part, Tracer, World};
use crate::math::{Aabb, Affine3};
use crate::ray::{Hit, Ray};
use filter::Filter;
use found::{Found, NONE};
use placements::PlacementTree;
use quad::widen;
use query::{Closest, Occluded, Query, SOMETHING};
use shapes::ShapeTree;
use simd::Simd;
use slab::{SlabRay, SlabRays};
use triangles::TriangleTree;
use walk::{Stack, Visit};

/// The native tracer.
pub struct Bvh {
    fixed: Level,
    objects: Vec<Level>,
    placements: PlacementTree,
    preset: Preset,
    isa: Isa,
}

/// One stack for the placements, one for what is below them.
struct Stacks {
    upper: Stack,
    level: Stack,
}

/// Everything in one coordinate system.
struct Level {
    triangles: TriangleTree,
    shapes: ShapeTree,
}

/// A part's ids, as hits name them.
#[derive(Clone, Copy, Debug)]
struct PartId {
    geometry: u32,
    instance: u32,
}

/// How the ray came to a level: in the world, or through a placement.
#[derive(Clone, Copy)]
struct Through<'a> {
    instance: u32,
    to_world: &'a Affine3,
}

/// Blur of a ray in an object's coordinates: rounding it moves it by as much again as the slab test itself may err.
const PLACED: f32 = 4.0;

impl Bvh {
    /// Builds the trees on rayon's current thread pool. The result does not depend on the number of threads.
    pub fn build(world: &World) -> Self {
        Self::build_with(world, Options::default())
    }

    /// The same, as `options` tell; hits do not depend on them.
    ///
    /// # Panics
    /// Where this processor does not have `options.isa`.
    pub fn build_with(world: &World, options: Options<'_>) -> Self {
        let Options { preset, isa, .. } = options;
        assert!(isa.is_available(), "{isa:?} is not available on this processor");
        let level = |parts: &Range<usize>| Level::build(&world.parts[parts.clone()], &options);
        let objects: Vec<Level> = world.objects.iter().map(level).collect();
        let bounds: Vec<Aabb> = objects.iter().map(Level::bounds).collect();
        let placements = PlacementTree::build(&world.placements, &bounds, &options);
        Self { fixed: level(&world.fixed), objects, placements, preset, isa }
    }

    /// Memory the trees hold, in bytes.
    pub fn bytes(&self) -> usize {
        let level = |level: &Level| level.triangles.bytes() + level.shapes.bytes();
        level(&self.fixed) + self.objects.iter().map(level).sum::<usize>() + self.placements.bytes()
    }

    /// The surface area heuristic's estimate of what a ray costs that meets the scene's box, in tests of a block of
    /// four triangles: the sum over nodes of twice their area, and over leaves of their area times the blocks (or shapes) in them,
    /// divided by the area of the whole (Goldsmith, Salmon 1987, *Automatic creation of object hierarchies for ray
    /// tracing*; MacDonald, Booth 1990, *Heuristics for ray tracing using space subdivision*). A placed object costs as
    /// much as its own tree, by the area of its box in the world. 0 for an empty scene.
    pub fn sah_cost(&self) -> f64 {
        let of = |level: &Level| {
            let tests = |_: u32, count: u8| f64::from(count);
            level.triangles.tree().cost(tests) + level.shapes.tree().cost(tests)
        };
        let objects: Vec<f64> =
            self.objects.iter().map(|level| of(level) / area(level.bounds()).max(f64::MIN_POSITIVE)).collect();
        let placed = self.placements.tree().cost(|first, count| {
            let costs = self.placements.leaf(first, count).iter().map(|placement| objects[placement.object as usize]);
            costs.sum()
        });
        let whole = area(self.fixed.bounds().union(self.placements.tree().bounds()));
        if whole > 0.0 { (of(&self.fixed) + placed) / whole } else { 0.0 }
    }

    /// What it was built for.
    pub fn preset(&self) -> Preset {
        self.preset
    }

    /// The instruction set its kernels use.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Placed objects for one ray.
    #[inline(always)]
    fn enter_placements<S: Simd, Q: Query>(&self, ray: &Ray, stacks: &mut Stacks, nearest: &mut Nearest) {
        if self.placements.is_empty() || Q::ANY && nearest.hit().is_some() {
            return;
        }
        let slab = SlabRay::new(ray, self.placements.reach(), 1.0);
        let Stacks { upper, level: lower } = stacks;
        walk::single::<S, Q>(
            upper,
            self.placements.tree(),
            &slab,
            nearest.limit(),
            #[inline(always)]
            |first, count| {
                for placement in self.placements.leaf(first, count) {
                    let object_ray = placement.object_ray(ray);
                    if object_ray.is_valid() {
                        let through = Through { instance: placement.instance, to_world: &placement.to_world };
                        let level = &self.objects[placement.object as usize];
                        level.trace_placed::<S, Q>(ray, &object_ray, through, lower, nearest);
                    }
                }
                Visit::after::<Q>(nearest)
            },
        );
    }

    /// Many rays, one after the other; made ready, and their hits computed, several at a time.
    #[inline(always)]
    fn trace_rays<S: Simd, Q: Query>(&self, stacks: &mut Stacks, rays: &[Ray], answers: &mut [Q::Answer]) {
        let triangles = &self.fixed.triangles;
        let is_all = self.has_only_triangles();
        // Rays, and the triangles that they hit for sure.
        let (mut pending, mut ids, mut count) = ([0; 4], [NONE; 4], 0);
        for first in (0..rays.len()).step_by(8) {
            let some = &rays[first..rays.len().min(first + 8)];
            let mut eight = [some[0]; 8];
            eight[..some.len()].copy_from_slice(some);
            let slabs = SlabRays::new::<S>(&eight, triangles.tree().reach());
            for (i, ray) in some.iter().enumerate() {
                let answer = &mut answers[first + i];
                *answer = Q::MISS;
                let Some((slab, filter)) = slabs.get(i) else { continue };
                let mut found = self.fixed.find::<S, Q>(ray, &slab, &filter, &mut stacks.level);
                if found.noted != NONE && Q::ANY {
                    *answer = Q::answer(Some(SOMETHING));
                    continue;
                }
                if found.noted != NONE && is_all {
                    (pending[count % 4], ids[count % 4]) = (first + i, found.noted);
                    count += 1;
                    if count == 4 {
                        count = 0;
                        self.compute_noted::<S, Q>(&pending, &ids, rays, answers);
                    }
                    continue;
                }
                found.compute(triangles, ray);
                let mut nearest = found.nearest;
                if !(is_all || Q::ANY && nearest.hit().is_some()) {
                    self.fixed.trace_shapes::<S, Q>(ray, None, 1.0, &mut stacks.level, &mut nearest);
                    self.enter_placements::<S, Q>(ray, stacks, &mut nearest);
                }
                *answer = Q::answer(nearest.hit());
            }
        }
        if count > 0 {
            // The others are computed twice, or again.
            for i in count..4 {
                (pending[i], ids[i]) = (pending[0], ids[0]);
            }
            self.compute_noted::<S, Q>(&pending, &ids, rays, answers);
        }
    }

    /// The hits of four rays, by number, with the triangles that are noted.
    #[inline(always)]
    fn compute_noted<S: Simd, Q: Query>(
        &self,
        pending: &[usize; 4],
        ids: &[u32; 4],
        rays: &[Ray],
        answers: &mut [Q::Answer],
    ) {
        let [a, b, c, d] = pending.map(|i| &rays[i]);
        let (oa, ob, oc, od) = (a.origin, b.origin, c.origin, d.origin);
        let origin = [
            widen::<S>(&[oa.x, ob.x, oc.x, od.x]),
            widen::<S>(&[oa.y, ob.y, oc.y, od.y]),
            widen::<S>(&[oa.z, ob.z, oc.z, od.z]),
        ];
        let (da, db, dc, dd) = (a.direction, b.direction, c.direction, d.direction);
        let direction = [
            widen::<S>(&[da.x, db.x, dc.x, dd.x]),
            widen::<S>(&[da.y, db.y, dc.y, dd.y]),
            widen::<S>(&[da.z, db.z, dc.z, dd.z]),
        ];
        let (_, hits) = self.fixed.triangles.hits::<S>(origin, direction, *ids);
        for (i, hit) in pending.iter().zip(hits) {
            answers[*i] = Q::answer(Some(hit));
        }
    }

    /// Whether there are neither shapes nor placed objects.
    fn has_only_triangles(&self) -> bool {
        self.fixed.shapes.tree().is_empty() && self.placements.is_empty()
    }

    /// Many rays in bundles of 64 where they are bundles, else ray by ray.
    #[inline(always)]
    fn trace_bundles<S: Simd, Q: Query>(&self, stacks: &mut Stacks, rays: &[Ray], answers: &mut [Q::Answer]) {
        let mut scratch = tile::Scratch::new();
        let triangles = &self.fixed.triangles;
        let is_all = self.has_only_triangles();
        for (rays, answers) in rays.chunks(bundle::RAYS).zip(answers.chunks_mut(bundle::RAYS)) {
            let is_empty = triangles.tree().is_empty();
            let traced = if is_empty { 0 } else { tile::trace::<S, Q>(&mut scratch, triangles, rays, answers) };
            if !is_all {
                for (k, (ray, answer)) in rays.iter().zip(&mut *answers).enumerate() {
                    let mut nearest = Nearest::new(ray);
                    if traced >> k & 1 != 0 && Q::resume(&mut nearest, scratch.t[k], *answer) {
                        self.fixed.trace_shapes::<S, Q>(ray, None, 1.0, &mut stacks.level, &mut nearest);
                        self.enter_placements::<S, Q>(ray, stacks, &mut nearest);
                        *answer = Q::answer(nearest.hit());
                    }
                }
            }
            // The others, in runs.
            let mut rest = !traced & u64::MAX >> (bundle::RAYS - rays.len());
            while rest != 0 {
                let first = rest.trailing_zeros() as usize;
                let end = first + (rest >> first).trailing_ones() as usize;
                self.trace_rays::<S, Q>(stacks, &rays[first..end], &mut answers[first..end]);
                rest &= u64::MAX.checked_shl(end as u32).unwrap_or(0);
            }
        }
    }

    fn run_batch<Q: Query>(&self, rays: &[Ray], answers: &mut [Q::Answer], batch: Batch) {
        assert_eq!(rays.len(), answers.len(), "one answer a ray");
        isa::dispatch(self.isa, BatchKernel::<Q> { bvh: self, rays, answers, batch });
    }
}

/// A batch, for one instruction set at a time.
struct BatchKernel<'a, Q: Query> {
    bvh: &'a Bvh,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
    batch: Batch,
}

impl<Q: Query> isa::Kernel for BatchKernel<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, rays, answers, batch } = self;
        let mut stacks = Stacks { upper: Stack::new(), level: Stack::new() };
        if batch.coherent {
            bvh.trace_bundles::<S, Q>(&mut stacks, rays, answers);
        } else {
            bvh.trace_rays::<S, Q>(&mut stacks, rays, answers);
        }
    }
}

fn area(bounds: Aabb) -> f64 {
    f64::from(bounds.half_area())
}

impl Level {
    fn build(parts: &[Part], options: &Options<'_>) -> Self {
        Self { triangles: TriangleTree::build(parts, options), shapes: ShapeTree::build(parts, options) }
    }

    fn bounds(&self) -> Aabb {
        self.triangles.tree().bounds().union(self.shapes.tree().bounds())
    }

    /// What `ray` hits among the triangles of this level, which is in the world; `slab` and `filter` are the ray, made
    /// ready for them.
    #[inline(always)]
    fn find<S: Simd, Q: Query>(&self, ray: &Ray, slab: &SlabRay, filter: &Filter, stack: &mut Stack) -> Found {
        let mut found = Found::new(ray);
        if !self.triangles.tree().is_empty() {
            walk::single::<S, Q>(
                stack,
                self.triangles.tree(),
                slab,
                found.limit,
                #[inline(always)]
                |first, count| {
                    self.triangles.find_leaf::<S, Q>(first, count, ray, filter, &mut found);
                    if Q::ANY && found.is_hit() { Visit::Stop } else { Visit::Until(found.limit) }
                },
            );
        }
        found
    }

    /// Offers what `ray` hits in this level placed by `through`; `local` is the same ray in this level's coordinates,
    /// rounded.
    #[inline(always)]
    fn trace_placed<S: Simd, Q: Query>(
        &self,
        ray: &Ray,
        local: &Ray,
        through: Through<'_>,
        stack: &mut Stack,
        nearest: &mut Nearest,
    ) {
        if !self.triangles.tree().is_empty() {
            let slab = SlabRay::new(local, self.triangles.tree().reach(), PLACED);
            let filter = Filter::new(local, PLACED);
            walk::single::<S, Q>(
                stack,
                self.triangles.tree(),
                &slab,
                nearest.limit(),
                #[inline(always)]
                |first, count| {
                    self.triangles.offer_leaf::<S>(first, count, ray, &filter, through, nearest);
                    Visit::after::<Q>(nearest)
                },
            );
        }
        self.trace_shapes::<S, Q>(local, Some(through), PLACED, stack, nearest);
    }

    #[inline(always)]
    fn trace_shapes<S: Simd, Q: Query>(
        &self,
        local: &Ray,
        through: Option<Through<'_>>,
        blur: f32,
        stack: &mut Stack,
        nearest: &mut Nearest,
    ) {
        let is_done = Q::ANY && nearest.hit().is_some();
        if !is_done && !self.shapes.tree().is_empty() {
            let slab = SlabRay::new(local, self.shapes.tree().reach(), blur);
            walk::single::<S, Q>(
                stack,
                self.shapes.tree(),
                &slab,
                nearest.limit(),
                #[inline(always)]
                |first, count| {
                    self.shapes.offer_leaf(first, count, local, through, nearest);
                    Visit::after::<Q>(nearest)
                },
            );
        }
    }
}

impl Tracer for Bvh {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut answer = [None];
        self.run_batch::<Closest>(std::slice::from_ref(ray), &mut answer, Batch::default());
        answer[0]
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let mut answer = [false];
        self.run_batch::<Occluded>(std::slice::from_ref(ray), &mut answer, Batch::default());
        answer[0]
    }

    fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>], batch: Batch) {
        self.run_batch::<Closest>(rays, hits, batch);
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool], batch: Batch) {
        self.run_batch::<Occluded>(rays, occluded, batch);
    }
}
