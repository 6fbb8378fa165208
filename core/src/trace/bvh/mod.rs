//! The native tracer: a bounding volume hierarchy with eight children a node.
//!
//! | of the tree | |
//! | --- | --- |
//! | `node`, `tree`, `block` | 256-byte nodes, eight boxes each, component by component (Wald, Benthin, Boulos 2008, *Getting rid of packets*); a tree of them; eight triangles together |
//! | `build/` | binned surface area heuristic (Wald 2007, *On fast construction of SAH-based bounding volume hierarchies*), and which branches become nodes; what a tree is built for (`preset`): speed of building, of tracing, or memory |
//! | `levels/` | what a world becomes: triangles and shapes of one coordinate system (`triangles`, `shapes`; `leaves`, of corners or of `numbers`; along a curve, `clusters`), placed objects (`place`, `placements`), those that move (`moving`), how far objects reach (`support`, `farthest`, `table`) |
//! | `meshes` | where corners are fetched from the mesh |
//! | `cache/` | a tree in a file, for the next time |
//! | `refit` | the same tree for moved vertices |
//!
//! | of rays and what they meet | |
//! | --- | --- |
//! | `simd/` | the same code compiled for AVX-512, for AVX2 and for any processor, and which of them runs (`isa`); a number for each ray of a bundle (`PerRay`), and a box as the builder has it (`boxes`) |
//! | `reject/` | what a ray cannot hit: boxes, padded so that rounding never loses a hit (Ize 2013, *Robust BVH ray traversal*), and triangles; by how much a ray may be off (`Blur`) |
//! | `hits/` | what it has hit: noted, listed, decided, computed |
//! | `query` | what is asked: the closest hit, or whether there is one; and all that a query of another kind has to say |
//!
//! | how rays travel | |
//! | --- | --- |
//! | `batch/` | many rays, as bundles, in flight or alone; what is computed of those that made no bundle (`arrivals`) |
//! | `bundle/` | 64 rays that start, or end, in one point, or run the same way, at once |
//! | `flight/` | single rays, several of them in turn; which of them take a step (`set`); where what they need next lies in memory (`addresses`) |
//! | `packet/` | eight or sixteen rays of a caller's that go the same way, at once |
//! | `alone/` | one ray at a time: a few of them, or one with the normal of what it hits, or with a visitor that says what counts |
//! | `walk/` | one ray by itself, from the root to the leaves, through any tree; what waits meanwhile (`stack`) |
//!
//! | other questions | |
//! | --- | --- |
//! | `all_hits` | all crossings of a ray, in order, each of them once |
//! | `near/` | the triangles that may be nearest to points, eight boxes and eight discs at a time; the nearest point of all triangles (`closest_point`) |
//! | `certain` | for scenes in f64, traced a little off: what is hit all the same, and what may be |
//! | `boxes`, `visits` | a tree over boxes, which may move; what callers ask of one over theirs |
//! | `steps` | what a ray cannot but look at, counted |
//!
//! Trees for triangles, shapes and placed objects, still and moving, and not one with mixed leaves: each leaf loop
//! knows its kind, and a scene without shapes or instances has none for them.
//!
//! Boxes only ever reject what cannot be hit, and `shape::triangle::intersect` depends on
//! the ray and the corners alone, so the answer is the same for every order of traversal, packet width and
//! instruction set.

mod all_hits;
mod alone;
mod batch;
mod block;
mod boxes;
mod build;
mod bundle;
mod cache;
mod certain;
mod flight;
mod hits;
mod levels;
mod meshes;
mod near;
mod node;
mod overlap;
mod packet;
mod query;
#[cfg(test)]
mod random;
mod refit;
mod reject;
mod removal;
mod simd;
mod steps;
mod tree;
mod visits;
mod walk;

pub use alone::{SingleRay, Travel, TriangleFound, VisitFlow};
#[doc(hidden)]
pub use batch::prepare_thread;
pub use boxes::BoxTree;
pub(super) use certain::{Certain, Wanted};
pub(super) use near::discs::Discs;
pub(super) use near::{NearestTriangle, Sought, Surveyor};
pub(super) use query::Verdict;
pub(super) use reject::Blur;

pub use build::preset::{Options, Preset};
pub use cache::{Cache, CacheReport, CacheUse};
pub use near::closest_point::ClosestPoint;
pub use packet::{Asked, Packet, PacketHits};
pub use simd::isa::Isa;
pub use steps::Steps;

use std::fmt;
use std::ops::Range;

use rayon::prelude::*;

use super::unbounded::Unbounded;
use super::{Batch, Part, Tracer, World};
use crate::math::Aabb;
use crate::ray::{Hit, Ray};
use levels::Level;
use levels::moving::MovingTree;
use levels::placements::PlacementTree;
use levels::triangles::TriangleTree;
use query::{Closest, Occluded};
use simd::isa::Present;

/// The native tracer.
pub struct Bvh {
    fixed: Level,
    objects: Vec<Level>,
    placements: PlacementTree,
    moving: MovingTree,
    unbounded: Unbounded,
    preset: Preset,
    isa: Present,
    travel: Travel,
}

impl fmt::Debug for Bvh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { preset, isa, .. } = self;
        let (objects, bytes) = (&self.objects.len(), &self.bytes());
        f.debug_struct("Bvh")
            .field("preset", preset)
            .field("isa", &isa.isa())
            .field("objects", objects)
            .field("bytes", bytes)
            .finish_non_exhaustive()
    }
}

/// Levels of at most this many primitives are built side by side.
const SMALL: usize = 1 << 16;

/// A part's ids, as hits name them.
#[derive(Clone, Copy, Debug)]
struct PartId {
    geometry: u32,
    instance: u32,
}

impl Bvh {
    /// Triangles that are tested together.
    pub const BLOCK: usize = block::LANES;

    /// What a node counts in [`Bvh::sah_cost`], in tests of a block.
    pub const NODE_COST: f64 = node::NODE_COST as f64;

    /// Builds the trees on rayon's current thread pool. The result does not depend on the number of threads.
    pub fn build(world: &World) -> Self {
        Self::build_with(world, Options::default())
    }

    /// The same, as `options` tell; hits do not depend on them.
    ///
    /// # Panics
    /// Where this processor does not have `options.isa`.
    pub fn build_with(world: &World, options: Options<'_>) -> Self {
        options.isa.demand();
        let build = |parts: &[Part], others| TriangleTree::build(parts, &options, others);
        let levels = levels(world);
        // Large ones one after the other, so that what is sorted for a tree is there once.
        let is_small = |parts: &[Part]| parts.iter().map(|part| part.primitives.len()).sum::<usize>() <= SMALL;
        let others = levels.iter().filter(|parts| is_small(parts)).count().saturating_sub(1);
        let small: Vec<_> = levels.par_iter().map(|parts| is_small(parts).then(|| build(parts, others))).collect();
        let triangles = small.into_iter().zip(&levels).map(|(built, parts)| built.unwrap_or_else(|| build(parts, 0)));
        Self::over(triangles.collect(), world, &options)
    }

    /// Of the trees over the triangles of each of [`levels`]; the others are built.
    fn over(triangles: Vec<TriangleTree>, world: &World, options: &Options<'_>) -> Self {
        let Options { preset, isa, .. } = *options;
        let isa = isa.demand();
        let parts = levels(world);
        assert_eq!(triangles.len(), parts.len(), "a tree a level");
        let level = |(triangles, parts)| Level::new(triangles, parts, options);
        let mut objects: Vec<Level> = triangles.into_par_iter().zip(parts).map(level).collect();
        let fixed = objects.remove(0);
        let placements = PlacementTree::build(&world.placements, &objects, options);
        let moving = MovingTree::build(&world.placements, &objects, options);
        Self {
            fixed,
            objects,
            placements,
            moving,
            unbounded: Unbounded::new(world),
            preset,
            isa,
            travel: Travel::default(),
        }
    }

    /// Memory the trees hold, in bytes.
    pub fn bytes(&self) -> usize {
        let level = |level: &Level| level.triangles.bytes() + level.shapes.bytes();
        level(&self.fixed)
            + self.objects.iter().map(level).sum::<usize>()
            + self.placements.bytes()
            + self.moving.bytes()
    }

    /// The surface area heuristic's estimate of what a ray costs that meets the scene's box, in tests of a block of
    /// [`Bvh::BLOCK`] triangles: the sum over nodes of [`Bvh::NODE_COST`] times their area, and over leaves of their
    /// area times the blocks (or shapes) in them, divided by the area of the whole (Goldsmith, Salmon 1987, *Automatic
    /// creation of object hierarchies for ray tracing*; MacDonald, Booth 1990, *Heuristics for ray tracing using space
    /// subdivision*). A placed object costs as much as its own tree, by the area of its box in the world; what moves
    /// counts where it is at time 0. 0 for an empty scene.
    pub fn sah_cost(&self) -> f64 {
        let of = |level: &Level| {
            let tests = |items: Range<u32>| items.len() as f64;
            level.triangles.tree().cost(tests) + level.shapes.tree().cost(tests)
        };
        let objects: Vec<f64> =
            self.objects.iter().map(|level| of(level) / area(level.bounds()).max(f64::MIN_POSITIVE)).collect();
        let placed = self.placements.tree().cost(|items| {
            let costs = items.map(|item| objects[self.placements.at(item).object as usize]);
            costs.sum()
        });
        let moving = self.moving.boxes().tree().cost(|items| {
            let costs = items.map(|item| objects[self.moving.at(item).object as usize]);
            costs.sum()
        });
        let placed_bounds = self.placements.tree().bounds().union(self.moving.boxes().tree().bounds());
        let whole = area(self.fixed.bounds().union(placed_bounds));
        if whole > 0.0 { (of(&self.fixed) + placed + moving) / whole } else { 0.0 }
    }

    /// What it was built for.
    pub fn preset(&self) -> Preset {
        self.preset
    }

    /// The most that its kernels may use of the processor's instructions.
    pub fn isa(&self) -> Isa {
        self.isa.isa()
    }
}

/// The parts of each level: the fixed ones, then those of each object.
fn levels(world: &World) -> Vec<&[Part]> {
    let ranges = std::iter::once(&world.fixed).chain(&world.objects);
    ranges.map(|parts| &world.parts[parts.clone()]).collect()
}

fn area(bounds: Aabb) -> f64 {
    f64::from(bounds.half_area())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DAffine3;
    use crate::scene::{Geometry, Group, Instance, Scene, terrain};

    /// Those that are built by themselves among those that are built side by side.
    #[test]
    fn each_object_has_its_own_tree() {
        let sides = [1, 200, 3, 190, 2];
        let scene = Scene {
            geometries: sides.map(|n| Geometry::Mesh(terrain(n))).into(),
            groups: (0..sides.len() as u32).map(|i| Group { name: String::new(), geometries: i..i + 1 }).collect(),
            instances: (0..sides.len() as u32)
                .map(|group| Instance {
                    name: String::new(),
                    group,
                    transform: DAffine3::IDENTITY,
                    transform_end: None,
                })
                .collect(),
            ..Scene::default()
        };
        let world = World::placed(&scene).expect("sound");
        let bvh = Bvh::build(&world);
        let counts: Vec<usize> = bvh.objects.iter().map(|object| object.triangles.count()).collect();
        assert_eq!(counts, sides.map(|n| 2 * (n * n) as usize));
        assert!(counts.iter().any(|&count| count > SMALL) && counts.iter().any(|&count| count < SMALL));
    }
}
