//! The upper level: a tree over placed objects that stand still.

use super::build::{self, Record};
use super::level::Level;
use super::node::Tree;
use super::place::{Blur, Place};
use super::preset::Options;
use super::query::Query;
use super::simd::Simd;
use super::slab::SlabRay;
use super::walk::{self, Stack, Visit};
use crate::math::{Aabb, Vec3};
use crate::ray::Ray;
use crate::trace::Placement;

/// All that stand still, in the order of the tree's leaves.
pub(super) struct PlacementTree {
    tree: Tree,
    places: Vec<Place>,
    has_triangles: bool,
    has_shapes: bool,
}

/// A tree over those placements that `is_wanted`, and which each of them is, in the order of its leaves: one a leaf, for to enter an
/// object costs many times what the test of its box does.
pub(super) fn tree_over(
    placements: &[Placement],
    is_wanted: impl Fn(&Placement) -> bool,
    objects: &[Level],
    options: &Options<'_>,
) -> (Tree, Vec<usize>) {
    let bounds: Vec<Aabb> = objects.iter().map(Level::bounds).collect();
    let item = |(i, placement): (usize, &Placement)| {
        let bounds = placement.bounds(bounds[placement.object as usize]);
        (!bounds.is_empty()).then_some(Record::new(&bounds, 0, i as u32))
    };
    let wanted = placements.iter().enumerate().filter(|(_, placement)| is_wanted(placement));
    let mut items: Vec<Record> = wanted.filter_map(item).collect();
    let tree = build::build(&mut items, 1, 1, options);
    (tree, items.iter().map(|item| item.primitive() as usize).collect())
}

/// Calls `enter` with the number of every placement whose box the ray enters; it says how far the ray still looks.
#[inline(always)]
pub(super) fn walk_over<S: Simd, Q: Query>(
    tree: &Tree,
    ray: &Ray,
    limit: f32,
    stack: &mut Stack,
    mut enter: impl FnMut(u32) -> Visit,
) {
    let slab = SlabRay::new::<S>(ray, tree.reach(), Blur::NONE);
    walk::single::<S, Q>(
        stack,
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
pub(super) const FIXED: u32 = u32::MAX;

impl PlacementTree {
    /// Takes those that stand still. `objects` are what is placed.
    pub fn build(placements: &[Placement], objects: &[Level], options: &Options<'_>) -> Self {
        let (tree, order) = tree_over(placements, |placement| placement.motion.is_none(), objects, options);
        let place = |i: usize| {
            let placement = placements[i].clone();
            let reach = objects[placement.object as usize].triangles.tree().reach();
            Place::new(placement, reach)
        };
        let places: Vec<Place> = order.into_iter().map(place).collect();
        let any = |test: fn(&Level) -> bool| places.iter().any(|place| test(&objects[place.placement.object as usize]));
        let has_triangles = any(|level| !level.triangles.tree().is_empty());
        let has_shapes = any(|level| !level.shapes.tree().is_empty());
        Self { tree, places, has_triangles, has_shapes }
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
