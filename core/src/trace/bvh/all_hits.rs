//! All hits of a ray, in one traversal.
//!
//! Every candidate is decided in f64, or exactly, and gathered; which of the triangles that touch at an edge or a
//! corner is crossed, [`Crossings`] says when all are there.

use super::Bvh;
use super::block::LANES;
use super::levels::Level;
use super::levels::place::Place;
use super::levels::placements::walk_over;
use super::levels::triangles::TriangleTree;
use super::node::Child;
use super::query::Closest;
use super::reject::Blur;
use super::reject::filter::Filter;
use super::reject::slab::SlabRay;
use super::simd::Simd;
use super::simd::isa::{self, Kernel};
use super::walk::{self, Visit};
use crate::ray::{Hit, Ray};
use crate::shape::crossing;
use crate::shape::triangle::Placed;
use crate::trace::crossings::Crossings;
use crate::trace::leaf::InstanceTransform;

impl Bvh {
    /// All hits of `ray` that are not behind its origin, with `tmin <= t <= tmax`, into `hits`, which is cleared first:
    /// ordered by t (in f64, before it is rounded), then by id.
    ///
    /// Each crossing counts once. A closed mesh is hit an even number of times from outside and an odd number from
    /// inside, also by a ray through its edges and corners. There the lowest id among the triangles that touch stands
    /// for each crossing, of those that are crossed in the same sense (inwards, or outwards). A ray that only touches
    /// an edge or a corner counts as two crossings, in and out, or as none: as if it were moved aside by next to
    /// nothing in x, and if that leaves it there in y, then z. So a ray may have a closest hit and no crossing. Closed
    /// shapes are crossed twice, also where the ray is a tangent.
    ///
    /// Triangles that coincide count each. The ends of the range are held against every triangle's own t, rounded to
    /// f32: parity is that of the range where no edge lies within that rounding of its ends.
    pub fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        hits.clear();
        if ray.is_valid() {
            let mut gathered = Gathered::default();
            isa::dispatch(self.isa, Gather { bvh: self, ray, gathered: &mut gathered });
            gathered.finish(hits);
        }
    }
}

/// What was found.
#[derive(Default)]
struct Gathered {
    triangles: Crossings,
    /// With t in f64.
    shapes: Vec<(f64, Hit)>,
}

impl Gathered {
    /// All in order.
    fn finish(mut self, hits: &mut Vec<Hit>) {
        let mut all: Vec<(f64, Hit)> = self.triangles.finish().iter().map(|hit| (hit.t, hit.rounded())).collect();
        // After that: a sphere is hit twice under one id.
        all.append(&mut self.shapes);
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id().cmp(&b.1.id())));
        hits.extend(all.iter().map(|(_, hit)| *hit));
    }
}

/// The traversal, for one instruction set at a time.
struct Gather<'a> {
    bvh: &'a Bvh,
    ray: &'a Ray,
    gathered: &'a mut Gathered,
}

impl Kernel for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, ray, gathered } = self;
        bvh.fixed.gather::<S>(ray, None, gathered);
        bvh.unbounded.gather(ray, &mut gathered.shapes);
        let limit = limit(ray);
        if !bvh.moving.is_empty() {
            bvh.moving.walk::<S, Closest>(
                &bvh.objects,
                ray,
                limit,
                #[inline(always)]
                |object, place| {
                    object.gather::<S>(ray, Some(place), gathered);
                    Visit::Until(limit)
                },
            );
        }
        if bvh.placements.is_empty() {
            return;
        }
        walk_over::<S, Closest>(
            bvh.placements.tree(),
            ray,
            bvh.placements.spread(),
            limit,
            #[inline(always)]
            |number| {
                let place = bvh.placements.at(number);
                let object = &bvh.objects[place.object as usize];
                object.gather::<S>(ray, Some(place), gathered);
                Visit::Until(limit)
            },
        );
    }
}

/// One step on: t is rounded to f32 before it is held against tmax.
fn limit(ray: &Ray) -> f32 {
    ray.tmax.next_up()
}

impl Level {
    /// What `ray`, in the world, hits in this level, which may be placed.
    #[inline(always)]
    fn gather<S: Simd>(&self, ray: &Ray, place: Option<&Place>, gathered: &mut Gathered) {
        let through = place.map(Place::through);
        let limit = limit(ray);
        if !self.triangles.tree().is_empty() {
            let (local, blur) = Place::local_or::<S>(place, ray);
            let slab = SlabRay::new::<S>(&local, self.triangles.tree().reach(), blur);
            let filter = Filter::new(&local, blur);
            walk::single::<S, Closest>(
                self.triangles.tree(),
                &slab,
                limit,
                #[inline(always)]
                |leaf| {
                    self.triangles.gather_leaf::<S>(leaf, ray, &filter, through, gathered);
                    Visit::Until(limit)
                },
            );
        }
        // The rounding of the ray is part of what shapes are asked.
        let local = place.map_or(*ray, |place| place.object_ray(ray));
        if !self.shapes.tree().is_empty() && local.is_valid() {
            let slab = SlabRay::new::<S>(&local, self.shapes.tree().reach(), Blur::NONE);
            walk::single::<S, Closest>(
                self.shapes.tree(),
                &slab,
                limit,
                #[inline(always)]
                |leaf| {
                    self.shapes.gather_leaf(leaf, &local, through, &mut gathered.shapes);
                    Visit::Until(limit)
                },
            );
        }
    }
}

impl TriangleTree {
    #[inline(always)]
    fn gather_leaf<S: Simd>(
        &self,
        leaf: Child,
        ray: &Ray,
        filter: &Filter,
        through: Option<InstanceTransform<'_>>,
        gathered: &mut Gathered,
    ) {
        for index in leaf.blocks() {
            let mut scratch = None;
            let block = self.block::<S>(index, &mut scratch);
            let mut open = filter.candidates::<S, true>(block, limit(ray)).lanes;
            while open != 0 {
                let lane = open.trailing_zeros() as usize % LANES;
                open &= open - 1;
                let corners = block.triangle(lane);
                let part = self.part(block.part[lane]);
                let (found, instance) = match through {
                    None => (crossing::crossing(ray, &corners), part.instance),
                    Some(InstanceTransform { instance, to_world }) => {
                        (crossing::crossing(ray, &Placed { corners, to_world }), instance)
                    }
                };
                if let Some(found) = found {
                    let corners = corners.map(|corner| corner.as_dvec3());
                    gathered.triangles.take(&corners, found, (block.primitive[lane], part.geometry, instance));
                }
            }
        }
    }
}
