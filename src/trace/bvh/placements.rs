//! The upper level: a tree over placed objects.

use super::build::{self, Record};
use super::level::Level;
use super::node::Tree;
use super::place::Place;
use super::preset::Options;
use crate::math::{Aabb, Vec3};
use crate::trace::Placement;

/// All placements, in the order of the tree's leaves.
pub(super) struct PlacementTree {
    tree: Tree,
    places: Vec<Place>,
    has_triangles: bool,
    has_shapes: bool,
}

/// The place of what is not placed: the fixed triangles. No placement has this number, since a leaf could not name it.
pub(super) const FIXED: u32 = u32::MAX;

impl PlacementTree {
    /// `objects` are what is placed.
    pub fn build(placements: &[Placement], objects: &[Level], options: &Options<'_>) -> Self {
        let bounds: Vec<Aabb> = objects.iter().map(Level::bounds).collect();
        let item = |(i, placement): (usize, &Placement)| {
            let bounds = placement.bounds(bounds[placement.object as usize]);
            (!bounds.is_empty()).then_some(Record::new(&bounds, 0, i as u32))
        };
        let mut items: Vec<Record> = placements.iter().enumerate().filter_map(item).collect();
        // A leaf for each: to enter an object costs many times what the test of its box does.
        let tree = build::build(&mut items, 1, 1, options);
        let place = |item: &Record| {
            let placement = placements[item.primitive() as usize].clone();
            let reach = objects[placement.object as usize].triangles.tree().reach();
            Place::new(placement, reach)
        };
        let places: Vec<Place> = items.iter().map(place).collect();
        let any = |test: fn(&Level) -> bool| places.iter().any(|place| test(&objects[place.placement.object as usize]));
        let has_triangles = any(|level| !level.triangles.tree().is_empty());
        let has_shapes = any(|level| !level.shapes.tree().is_empty());
        Self { tree, places, has_triangles, has_shapes }
    }

    /// Whether nothing is placed.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
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
