//! Everything in one coordinate system: that of the world, or that of an object which is placed in it.

pub(super) mod clusters;
pub(super) mod farthest;
pub(super) mod leaves;
pub(super) mod moving;
pub(super) mod numbers;
pub(super) mod place;
pub(super) mod placements;
pub(super) mod shapes;
pub(super) mod support;
mod table;
pub(super) mod triangles;

use self::farthest::SupportStack;
use self::place::Place;
use self::shapes::ShapeTree;
use self::triangles::TriangleTree;
use super::build::preset::Options;
use super::query::Query;
use super::reject::Blur;
use super::reject::filter::Filter;
use super::reject::slab::SlabRay;
use super::simd::Simd;
use super::simd::isa::{self, Kernel, Present};
use super::walk::{self, Visit};
use crate::math::{Aabb, Vec3};
use crate::ray::Ray;
use crate::trace::Part;
use crate::trace::leaf::InstanceTransform;
use crate::trace::nearest::Nearest;

/// Everything in one coordinate system.
pub(super) struct Level {
    pub triangles: TriangleTree,
    pub shapes: ShapeTree,
}

/// [`Level::farthest`].
struct Farthest<'a> {
    level: &'a Level,
    ways: &'a [Vec3],
    visits: usize,
    values: &'a mut [f64],
}

impl Kernel for Farthest<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { level, ways, visits, values } = self;
        level.search::<S>(ways, visits, values);
    }
}

impl Level {
    /// Of a tree over the triangles of `parts`; that over their shapes, of which there are few, is built.
    pub fn new(triangles: TriangleTree, parts: &[Part], options: &Options<'_>) -> Self {
        Self { triangles, shapes: ShapeTree::build(parts, options) }
    }

    pub fn bounds(&self) -> Aabb {
        self.triangles.tree().bounds().union(self.shapes.tree().bounds())
    }

    /// At least the scalar product of each of `ways` with any of its points, as
    /// [`Tree::farthest`](super::tree::Tree::farthest) finds it: best in an order in which neighbours differ little.
    pub fn farthest(&self, isa: Present, ways: &[Vec3], visits: usize, values: &mut [f64]) {
        isa::dispatch_narrow(isa, Farthest { level: self, ways, visits, values });
    }

    /// [`Self::farthest`].
    #[inline(always)]
    pub fn search<S: Simd>(&self, ways: &[Vec3], visits: usize, values: &mut [f64]) {
        let (mut waiting, mut first) = (SupportStack::new(), None);
        for (value, &way) in values.iter_mut().zip(ways) {
            let of_triangles = self.triangles.farthest::<S>(way, visits, &mut waiting, &mut first);
            *value = of_triangles.max(self.shapes.farthest::<S>(way, visits, &mut waiting));
        }
    }

    /// Offers the triangles that `ray`, in the world, hits in this level, which may be placed; all by itself.
    #[inline(always)]
    pub fn trace_triangles<S: Simd, Q: Query>(&self, ray: &Ray, place: Option<&Place>, nearest: &mut Nearest) {
        let tree = self.triangles.tree();
        let is_done = Q::ANY && nearest.hit().is_some();
        if is_done || tree.is_empty() {
            return;
        }
        let (local, blur) = Place::local_or::<S>(place, ray);
        let through = place.map(Place::through);
        let (slab, filter) = (SlabRay::new::<S>(&local, tree.reach(), blur), Filter::new(&local, blur));
        walk::single::<S, Q>(
            tree,
            &slab,
            nearest.limit(),
            #[inline(always)]
            |leaf| {
                self.triangles.offer_leaf::<S>(leaf, ray, &filter, through, nearest);
                Visit::after::<Q>(nearest)
            },
        );
    }

    /// Shapes of an object in its place, for a ray of the world.
    #[inline(always)]
    pub fn trace_placed_shapes<S: Simd, Q: Query>(&self, ray: &Ray, place: &Place, nearest: &mut Nearest) {
        let local = place.object_ray(ray);
        if local.is_valid() {
            self.trace_shapes::<S, Q>(ray, &local, Some(place.through()), nearest);
        }
    }

    /// Offers the shapes that `ray`, in the world, hits in this level, as `local`: the ray in this level's coordinates,
    /// whose rounding is part of it.
    #[inline(always)]
    pub fn trace_shapes<S: Simd, Q: Query>(
        &self,
        ray: &Ray,
        local: &Ray,
        through: Option<InstanceTransform<'_>>,
        nearest: &mut Nearest,
    ) {
        let is_done = Q::ANY && nearest.hit().is_some();
        if !is_done && !self.shapes.tree().is_empty() {
            let slab = SlabRay::new::<S>(local, self.shapes.tree().reach(), Blur::NONE);
            walk::single::<S, Q>(
                self.shapes.tree(),
                &slab,
                nearest.limit(),
                #[inline(always)]
                |leaf| {
                    self.shapes.offer_leaf::<Q>(leaf, ray, local, through, nearest);
                    Visit::after::<Q>(nearest)
                },
            );
        }
    }
}
