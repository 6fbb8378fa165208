//! The classic accelerators, one file each, behind one tracer.
//!
//! | file | idea |
//! | --- | --- |
//! | `groups` | a flat list of bounding volumes, one a group (Clark 1976, *Hierarchical geometric models for visible surface algorithms*) |
//! | `binary` | a binary BVH by the surface area heuristic, the yardstick of the others (Goldsmith, Salmon 1987; Wald 2007) |
//! | `grid` | a uniform grid with nested grids (Amanatides, Woo 1987, *A fast voxel traversal algorithm for ray tracing*) |
//! | `octree` | an octree (Glassner 1984, *Space subdivision for fast ray tracing*) |
//! | `kd` | a kd-tree: planes across the axes, by the surface area heuristic (Wald, Havran 2006, *On building fast kd-trees*) |
//! | `bsp` | a BSP tree: planes of the scene's own polygons (Ize, Wald, Parker 2008, *Ray tracing with the BSP tree*) |
//!
//! An accelerator is an `Index` over boxes that knows no primitive: it says which items a ray may hit, near ones first.
//! One tracer, `Accelerated`, does the rest with any of them: an index over what is fixed, one over each object, one
//! over the places where objects stand. Primitives are tested by the very code of brute force, so hits are the same to
//! the bit as long as no index loses an item; `ray` has the bounds on rounding by which none does. A tracer for each
//! accelerator, the alternative, would have its own leaves, levels and proofs, six times.
//!
//! The native [`Bvh`](super::bvh) is no `Index`: what makes it fast (eight boxes, bundles, blocks of triangles) is what
//! the trait hides.

mod binary;
mod bsp;
mod cell;
mod grid;
mod groups;
mod items;
mod kd;
mod kind;
mod octree;
mod placed;
mod ray;

use std::time::Duration;

use super::nearest::Nearest;
use super::spread::Spread;
use super::unbounded::Unbounded;
use super::{Batch, Part, Tracer, World};
use crate::math::{Aabb, DVec3, Vec3};
use crate::ray::{Hit, Ray};
use items::{Boxes, Input, Items, reach};
use placed::{Placed, stray_of_shapes};
use ray::{IndexRay, limit};

use super::leaf::InstanceTransform;
pub use super::leaf::Methods;
pub use crate::scene::{Accel, Resolution};
pub use cell::Cell;
pub use kind::{Accelerator, Built};

/// What an accelerator may be told.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Cells of the grid; none to have the number follow from that of the primitives.
    pub grid: Option<Resolution>,
    /// How long the BSP tree may be divided; 10 seconds where none is given. It does not change hits.
    pub bsp_time: Option<Duration>,
    /// How triangles and spheres are met. Only the exact methods give the hits of brute force.
    pub methods: Methods,
}

impl Options {
    /// Whether an accelerator of these gives the hits of brute force to the bit.
    pub fn are_exact_for(&self, accel: Accel) -> bool {
        !accel.has_methods() || self.methods == Methods::default()
    }
}

/// Which of many boxes a ray may pass.
trait Index: Sized + Send + Sync {
    /// Whether a ray may meet an item more than once.
    const REPEATS: bool;

    /// Over all items.
    fn build(input: &Input<'_>, options: &Options) -> Self;

    /// Calls `each` with every item whose box the ray enters before the limit, near ones first where that is known.
    /// `each` gives the new limit, and infinity below zero to stop; of the leaf that the ray is in, the rest may come
    /// yet.
    fn visit(&self, ray: &IndexRay, limit: f64, each: &mut impl FnMut(u32) -> f64);

    /// Memory it holds, in bytes.
    fn bytes(&self) -> usize;

    /// What there is to say about how it was built.
    fn note(&self) -> Option<String> {
        None
    }

    /// The cell that holds a point, by an index that divides space.
    fn locate(&self, _point: Vec3) -> Option<Cell> {
        None
    }
}

/// What a part gets of the room that there is for references, by how many of all references are its own.
fn share(room: usize, own: usize, all: usize) -> usize {
    (room as u128 * own as u128 / all.max(1) as u128) as usize
}

/// A tracer over indices of one kind.
struct Accelerated<I> {
    fixed: Level<I>,
    objects: Vec<Level<I>>,
    placements: I,
    placed: Vec<Placed>,
    /// Of everything placed.
    placed_bounds: Aabb,
    spread: Spread,
    unbounded: Unbounded,
}

/// The items of one coordinate system and their index.
struct Level<I> {
    items: Items,
    bounds: Aabb,
    index: I,
}

/// Where a hit was found: in which placement, if any, and which item it was.
#[derive(Clone, Copy, Debug)]
struct Place {
    placed: Option<u32>,
    item: u32,
}

impl<I: Index> Accelerated<I> {
    /// Builds the indices.
    fn build(world: &World, options: &Options) -> Self {
        let level = |parts: &std::ops::Range<usize>| Level::<I>::build(&world.parts[parts.clone()], options);
        let fixed = level(&world.fixed);
        let objects: Vec<Level<I>> = world.objects.iter().map(level).collect();
        let (mut placed, mut boxes, mut spread) = (Vec::new(), Vec::new(), Spread::NONE);
        for placement in &world.placements {
            let object = &objects[placement.object as usize];
            let bounds = placement.bounds(object.bounds);
            if !bounds.is_empty() {
                let new = Placed::new(placement);
                if object.items.has_shapes() {
                    spread = spread.include(placement, &object.bounds);
                }
                placed.push(new);
                boxes.push(bounds);
            }
        }
        let boxes = Boxes::single(boxes);
        Self {
            fixed,
            objects,
            placements: I::build(&boxes.input(), options),
            placed,
            placed_bounds: boxes.bounds(),
            spread,
            unbounded: Unbounded::new(world),
        }
    }

    /// Memory it holds, in bytes.
    fn bytes(&self) -> usize {
        let levels = self.objects.iter().chain([&self.fixed]);
        let levels = levels.map(|level| level.items.bytes() + level.index.bytes());
        levels.sum::<usize>() + self.placements.bytes() + size_of_val(&self.placed[..])
    }

    /// What its indices have to say.
    fn notes(&self) -> Vec<String> {
        let levels = self.objects.iter().chain([&self.fixed]);
        levels.filter_map(|level| level.index.note()).chain(self.placements.note()).collect()
    }

    /// The nearest hit; if `any`, the first one found, and the place where it was.
    fn trace(&self, ray: &Ray, any: bool) -> (Nearest, Option<Place>) {
        let (mut nearest, mut place) = (Nearest::new(ray), None);
        if !ray.is_valid() {
            return (nearest, None);
        }
        self.unbounded.offer(ray, &mut nearest);
        let is_done = |nearest: &Nearest| any && nearest.hit().is_some();
        if is_done(&nearest) {
            return (nearest, None);
        }
        self.fixed.trace(ray, any, &mut nearest, |item| place = Some(Place { placed: None, item }));
        if is_done(&nearest) || self.placed.is_empty() {
            return (nearest, place);
        }
        let index_ray = IndexRay::of_world(ray, reach(&self.placed_bounds), self.spread.of(ray));
        self.placements.visit(&index_ray, limit(&nearest), &mut |placed| {
            if is_done(&nearest) {
                return f64::NEG_INFINITY;
            }
            let found = |item| place = Some(Place { placed: Some(placed), item });
            let placed = self.placed[placed as usize].at(ray.moment());
            let object = &self.objects[placed.placement.object as usize];
            object.trace_placed(ray, &placed, any, &mut nearest, found);
            if is_done(&nearest) { f64::NEG_INFINITY } else { limit(&nearest) }
        });
        (nearest, place)
    }

    /// Whether the ray hits what was hit at a place before.
    fn hits_again(&self, ray: &Ray, place: Place) -> bool {
        let mut nearest = Nearest::new(ray);
        match place.placed {
            None => self.fixed.items.offer(place.item, ray, ray, None, &mut nearest),
            Some(placed) => {
                let placement = self.placed[placed as usize].placement.at(ray.moment());
                let through = InstanceTransform { instance: placement.instance, to_world: &placement.to_world };
                let items = &self.objects[placement.object as usize].items;
                items.offer(place.item, ray, &placement.object_ray(ray), Some(through), &mut nearest);
            }
        }
        nearest.hit().is_some()
    }
}

impl<I: Index> Level<I> {
    fn build(parts: &[Part], options: &Options) -> Self {
        let (items, boxes) = Items::new(parts, options.methods);
        let index = I::build(&items.input(&boxes), options);
        Self { bounds: boxes.bounds(), items, index }
    }

    /// Offers what a ray of the world hits; calls `found` with items that give a better hit.
    fn trace(&self, ray: &Ray, any: bool, nearest: &mut Nearest, found: impl FnMut(u32)) {
        if self.bounds.is_empty() {
            return;
        }
        let reach = reach(&self.bounds);
        let has_shapes = self.items.has_shapes();
        let stray = if has_shapes { stray_of_shapes(ray, reach) } else { DVec3::ZERO };
        self.visit(&IndexRay::of_world(ray, reach, stray), ray, ray, None, any, nearest, found);
    }

    /// The same through a placement.
    fn trace_placed(&self, ray: &Ray, placed: &Placed, any: bool, nearest: &mut Nearest, found: impl FnMut(u32)) {
        let Placed { placement, .. } = placed;
        let index_ray = placed.index_ray(ray, &self.bounds, self.items.has_shapes());
        let through = InstanceTransform { instance: placement.instance, to_world: &placement.to_world };
        self.visit(&index_ray, ray, &placement.object_ray(ray), Some(through), any, nearest, found);
    }

    #[expect(clippy::too_many_arguments, reason = "what a leaf needs")]
    #[inline]
    fn visit(
        &self,
        index_ray: &IndexRay,
        ray: &Ray,
        local: &Ray,
        through: Option<InstanceTransform<'_>>,
        any: bool,
        nearest: &mut Nearest,
        mut found: impl FnMut(u32),
    ) {
        let (mut mailbox, mut is_done) = (Mailbox::new(), false);
        self.index.visit(index_ray, limit(nearest), &mut |item| {
            if is_done {
                return f64::NEG_INFINITY;
            }
            if !(I::REPEATS && mailbox.has(item)) {
                let before = nearest.t();
                self.items.offer(item, ray, local, through, nearest);
                if any && nearest.t() < before {
                    found(item);
                    is_done = true;
                    return f64::NEG_INFINITY;
                }
            }
            limit(nearest)
        });
    }
}

/// Some of the last items that a ray was tested against, of those with the same last four bits one, for indices that
/// hold an item in many cells (Shevtsov, Soupikov, Kapustin 2007, *Ray-triangle intersection algorithm for modern CPU
/// architectures*: the inverse mailbox). A number in each item, the older way, would be written by all threads. What is
/// forgotten is tested again, which changes nothing.
struct Mailbox([u32; 16]);

impl Mailbox {
    fn new() -> Self {
        Self([u32::MAX; 16])
    }

    /// Whether it was noted, and notes it.
    #[inline]
    fn has(&mut self, item: u32) -> bool {
        let slot = &mut self.0[item as usize % 16];
        std::mem::replace(slot, item) == item
    }
}

impl<I: Index> Tracer for Accelerated<I> {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.trace(ray, false).0.hit()
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.trace(ray, true).0.hit().is_some()
    }

    /// Asks what hid the ray before first: shadows are larger than pixels (Haines, Greenberg 1986, *The light buffer*).
    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool], _batch: Batch) {
        assert_eq!(rays.len(), occluded.len(), "one answer a ray");
        let mut last = None;
        for (ray, answer) in rays.iter().zip(occluded) {
            *answer = ray.is_valid() && last.is_some_and(|place| self.hits_again(ray, place));
            if !*answer {
                let (nearest, place) = self.trace(ray, true);
                *answer = nearest.hit().is_some();
                last = place;
            }
        }
    }
}

#[cfg(test)]
mod tests;
