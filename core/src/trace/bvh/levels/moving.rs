//! Objects that move: a tree of their own, over boxes that are where they are at the ray's time.
//!
//! A ray comes here by itself, after everything that stands still, and each object that it enters is put where it
//! stands at that time. So bundles and flights, in which rays of many times would have to part, know of no time, and
//! scenes without motion pay nothing for it.

use rayon::prelude::*;

use super::Level;
use super::place::Place;
use super::placements::{spread_over, strayed};
use super::support::Outlines;
use crate::math::{Aabb, Vec3};
use crate::ray::Ray;
use crate::trace::Placement;
use crate::trace::bvh::boxes::BoxTree;
use crate::trace::bvh::build::preset::Options;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::reject::Blur;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::walk::Visit;
use crate::trace::spread::Spread;

/// Everything that moves.
pub(in crate::trace::bvh) struct MovingTree {
    boxes: BoxTree,
    /// In the order of the tree's leaves.
    placements: Vec<Placement>,
    spread: Spread,
}

impl MovingTree {
    /// Takes those that move. `objects` are what is placed.
    pub fn build(placements: &[Placement], objects: &[Level], options: &Options<'_>) -> Self {
        let moving: Vec<&Placement> = placements.iter().filter(|placement| placement.motion.is_some()).collect();
        let outlines = Outlines::new(objects, options.isa.demand(), moving.iter().copied());
        // Nothing is left out because f32 does not hold where it is; what is empty stays so.
        let held = |v: Vec3| v.clamp(Vec3::MIN, Vec3::MAX);
        let held = |bounds: Aabb| Aabb { min: held(bounds.min), max: held(bounds.max) };
        let boxes: Vec<[Aabb; 2]> = moving.par_iter().map(|placement| outlines.ends(placement).map(held)).collect();
        // One a leaf, for to enter an object costs many times what the test of its box does.
        let (boxes, order) = BoxTree::of_moving(&boxes, 1, options);
        let placements: Vec<Placement> = order.into_iter().map(|i| moving[i as usize].clone()).collect();
        Self { boxes, spread: spread_over(&placements, objects), placements }
    }

    pub fn is_empty(&self) -> bool {
        self.placements.is_empty()
    }

    /// Whose leaves name them.
    pub fn boxes(&self) -> &BoxTree {
        &self.boxes
    }

    /// How far a ray strays from where it is in the world, as [`spread_over`] says.
    #[inline(always)]
    pub fn strayed(&self, ray: &Ray) -> Blur {
        strayed(ray, &self.spread)
    }

    /// The placement with that number, at time 0.
    pub fn at(&self, number: u32) -> &Placement {
        &self.placements[number as usize]
    }

    /// Calls `enter` with every object that the ray may meet, where it stands at that time; it gives how far the ray
    /// still looks.
    #[inline(always)]
    pub fn walk<S: Simd, Q: Query>(
        &self,
        objects: &[Level],
        ray: &Ray,
        limit: f32,
        mut enter: impl FnMut(&Level, &Place) -> Visit,
    ) {
        self.boxes.walk::<S, Q>(
            ray,
            self.strayed(ray),
            limit,
            #[inline(always)]
            |number| {
                let placement = self.at(number).at(ray.moment());
                let level = &objects[placement.object as usize];
                enter(level, &Place::new(&placement, level.triangles.tree().reach()))
            },
        );
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        self.boxes.bytes() + size_of_val(&self.placements[..])
    }
}
