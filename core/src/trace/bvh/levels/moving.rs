//! Objects that move: a tree of their own, over the boxes of all they pass through.
//!
//! A ray comes here by itself, after everything that stands still, and each object that it enters is put where it stands at that time. So
//! bundles and flights, in which rays of many times would have to part, know of no time, and scenes without motion pay nothing for it. Boxes that move
//! with the time of the ray (Embree's way, and that of Grünschloss, Stich, Nawaz, Keller 2011, *MSBVH*) would be entered less
//! often by rays among things that fly far; that would need a second kind of node.

use super::Level;
use super::place::Place;
use super::placements::{spread_over, tree_over, walk_over};
use crate::ray::Ray;
use crate::trace::Placement;
use crate::trace::bvh::build::preset::Options;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::tree::Tree;
use crate::trace::bvh::walk::Visit;
use crate::trace::spread::Spread;

/// Everything that moves.
pub(in crate::trace::bvh) struct MovingTree {
    tree: Tree,
    /// In the order of the tree's leaves.
    placements: Vec<Placement>,
    spread: Spread,
}

impl MovingTree {
    /// Takes those that move. `objects` are what is placed.
    pub fn build(placements: &[Placement], objects: &[Level], options: &Options<'_>) -> Self {
        let (tree, order) = tree_over(placements, |placement| placement.motion.is_some(), objects, options);
        let placements: Vec<Placement> = order.into_iter().map(|i| placements[i].clone()).collect();
        Self { tree, spread: spread_over(&placements, objects), placements }
    }

    pub fn is_empty(&self) -> bool {
        self.placements.is_empty()
    }

    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// As [`spread_over`] says.
    pub fn spread(&self) -> &Spread {
        &self.spread
    }

    /// The placement with that number, at time 0.
    pub fn at(&self, number: u32) -> &Placement {
        &self.placements[number as usize]
    }

    /// Calls `enter` with every object that the ray may meet, where it stands at that time; it gives how far the ray still looks.
    #[inline(always)]
    pub fn walk<S: Simd, Q: Query>(
        &self,
        objects: &[Level],
        ray: &Ray,
        limit: f32,
        mut enter: impl FnMut(&Level, &Place) -> Visit,
    ) {
        walk_over::<S, Q>(
            &self.tree,
            ray,
            &self.spread,
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
        self.tree.bytes() + size_of_val(&self.placements[..])
    }
}
