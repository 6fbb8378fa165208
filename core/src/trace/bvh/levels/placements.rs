//! The upper level: a tree over placed objects that stand still.

use rayon::prelude::*;

use super::Level;
use super::place::Place;
use super::support::Outlines;
use crate::math::Vec3;
use crate::ray::Ray;
use crate::trace::Placement;
use crate::trace::bvh::build::preset::Options;
use crate::trace::bvh::build::{self, Record};
use crate::trace::bvh::query::Query;
use crate::trace::bvh::reject::Blur;
use crate::trace::bvh::reject::slab::SlabRay;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::tree::Tree;
use crate::trace::bvh::walk::{self, Visit};
use crate::trace::spread::Spread;

/// All that stand still, in the order of the tree's leaves.
pub(in crate::trace::bvh) struct PlacementTree {
    tree: Tree,
    places: Vec<Place>,
    has_triangles: bool,
    has_shapes: bool,
    spread: Spread,
}

/// A tree over those that stand still, and which each of them is, in the order of its leaves: one a leaf, for to enter
/// an object costs many times what the test of its box does.
fn tree_over(placements: &[Placement], objects: &[Level], options: &Options<'_>) -> (Tree, Vec<usize>) {
    let stands = |placement: &Placement| placement.motion.is_none();
    let outlines = Outlines::new(objects, options.isa.demand(), placements.iter().filter(|it| stands(it)));
    let item = |(i, placement): (usize, &Placement)| {
        let bounds = outlines.around(placement);
        (!bounds.is_empty()).then_some(Record::new(&bounds, 0, i as u32))
    };
    let wanted = placements.par_iter().enumerate().filter(|(_, placement)| stands(placement));
    let mut items: Vec<Record> = wanted.filter_map(item).collect();
    let tree = build::build(&mut items, 1, 1, options);
    (tree, items.iter().map(|item| item.primitive() as usize).collect())
}

/// How far rays of placed shapes stray from where they are in the world.
pub(super) fn spread_over<'a>(placements: impl IntoIterator<Item = &'a Placement>, objects: &[Level]) -> Spread {
    placements.into_iter().fold(Spread::NONE, |spread, placement| {
        let shapes = objects[placement.object as usize].shapes.tree();
        if shapes.is_empty() { spread } else { spread.include(placement, &shapes.bounds()) }
    })
}

/// How far off a ray may be among the boxes of what is placed, which strays by `spread`.
#[inline(always)]
pub(super) fn strayed(ray: &Ray, spread: &Spread) -> Blur {
    // Rounded up.
    Blur { origin: (spread.of(ray).max_element() * 1.01) as f32, ..Blur::NONE }
}

/// A ray made ready for these boxes.
#[inline(always)]
pub(in crate::trace::bvh) fn among_boxes<S: Simd>(tree: &Tree, ray: &Ray, spread: &Spread) -> SlabRay {
    SlabRay::new::<S>(ray, tree.reach(), strayed(ray, spread))
}

/// Calls `enter` with the number of every placement whose box the ray enters, or may enter where it strays by `spread`;
/// it says how far the ray still looks.
#[inline(always)]
pub(in crate::trace::bvh) fn walk_over<S: Simd, Q: Query>(
    tree: &Tree,
    ray: &Ray,
    spread: &Spread,
    limit: f32,
    mut enter: impl FnMut(u32) -> Visit,
) {
    let slab = among_boxes::<S>(tree, ray, spread);
    walk::single::<S, Q>(
        tree,
        &slab,
        limit,
        #[inline(always)]
        |leaf| {
            let mut visit = Visit::Until(limit);
            for number in leaf.blocks() {
                visit = enter(number);
            }
            visit
        },
    );
}

/// The place of what is not placed: the fixed triangles. No placement has this number, since a leaf could not name it.
pub(in crate::trace::bvh) const FIXED: u32 = u32::MAX;

impl PlacementTree {
    /// Takes those that stand still. `objects` are what is placed.
    pub fn build(placements: &[Placement], objects: &[Level], options: &Options<'_>) -> Self {
        let (tree, order) = tree_over(placements, objects, options);
        let place = |&i: &usize| {
            let triangles = &objects[placements[i].object as usize].triangles;
            Place::new(&placements[i], triangles.tree().reach()).with_grain(triangles.grain())
        };
        let places: Vec<Place> = order.par_iter().map(place).collect();
        let any = |test: fn(&Level) -> bool| places.iter().any(|place| test(&objects[place.object as usize]));
        let has_triangles = any(|level| !level.triangles.tree().is_empty());
        let has_shapes = any(|level| !level.shapes.tree().is_empty());
        let spread = spread_over(order.iter().map(|&i| &placements[i]), objects);
        Self { tree, places, has_triangles, has_shapes, spread }
    }

    /// Whether nothing is placed.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// How many they are.
    pub fn len(&self) -> u32 {
        self.places.len() as u32
    }

    /// Whether some object that is placed has triangles.
    pub fn has_triangles(&self) -> bool {
        self.has_triangles
    }

    /// Whether some object that is placed has shapes.
    pub fn has_shapes(&self) -> bool {
        self.has_shapes
    }

    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// As [`spread_over`] says.
    pub fn spread(&self) -> &Spread {
        &self.spread
    }

    /// As [`Tree::reach`].
    pub fn reach(&self) -> Vec3 {
        self.tree.reach()
    }

    /// All of them, as leaves number them: a leaf holds one.
    #[inline(always)]
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// The placement with that number.
    #[inline(always)]
    pub fn at(&self, number: u32) -> &Place {
        &self.places[number as usize]
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + size_of_val(&self.places[..])
    }
}
