//! Everything in one coordinate system: that of the world, or that of an object which is placed in it.

use super::filter::Filter;
use super::preset::Options;
use super::query::Query;
use super::shapes::ShapeTree;
use super::simd::Simd;
use super::slab::SlabRay;
use super::triangles::TriangleTree;
use super::walk::{self, Stack, Visit};
use crate::math::{Aabb, Affine3};
use crate::ray::Ray;
use crate::trace::Part;
use crate::trace::nearest::Nearest;

/// Everything in one coordinate system.
pub(super) struct Level {
    pub triangles: TriangleTree,
    pub shapes: ShapeTree,
}

/// How the ray came to a level: in the world, or through a placement.
#[derive(Clone, Copy)]
pub(super) struct Through<'a> {
    pub instance: u32,
    pub to_world: &'a Affine3,
}

/// Blur of a ray in an object's coordinates: rounding it moves it by as much again as the slab test itself may err.
pub(super) const PLACED: f32 = 4.0;

impl Level {
    /// Of a tree over the triangles of `parts`; that over their shapes, of which there are few, is built.
    pub fn new(triangles: TriangleTree, parts: &[Part], options: &Options<'_>) -> Self {
        Self { triangles, shapes: ShapeTree::build(parts, options) }
    }

    pub fn bounds(&self) -> Aabb {
        self.triangles.tree().bounds().union(self.shapes.tree().bounds())
    }

    /// Offers what `ray` hits in this level placed by `through`; `local` is the same ray in this level's coordinates,
    /// rounded.
    #[inline(always)]
    pub fn trace_placed<S: Simd, Q: Query>(
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
                |leaf| {
                    self.triangles.offer_leaf::<S>(leaf, ray, &filter, through, nearest);
                    Visit::after::<Q>(nearest)
                },
            );
        }
        self.trace_shapes::<S, Q>(local, Some(through), PLACED, stack, nearest);
    }

    #[inline(always)]
    pub fn trace_shapes<S: Simd, Q: Query>(
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
                |leaf| {
                    self.shapes.offer_leaf::<Q>(leaf, local, through, nearest);
                    Visit::after::<Q>(nearest)
                },
            );
        }
    }
}
