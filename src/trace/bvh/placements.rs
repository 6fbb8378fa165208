//! The upper level: a tree over placed objects.

use std::ops::Range;

use super::build::{self, Record};
use super::node::{Child, Tree};
use super::preset::Options;
use crate::math::{Aabb, Vec3};
use crate::trace::Placement;

/// All placements, in the order of the tree's leaves.
pub(super) struct PlacementTree {
    tree: Tree,
    placements: Vec<Placement>,
}

impl PlacementTree {
    /// `objects` are the bounds of the objects in their own coordinates.
    pub fn build(placements: &[Placement], objects: &[Aabb], options: &Options<'_>) -> Self {
        let item = |(i, placement): (usize, &Placement)| {
            let bounds = placement.bounds(objects[placement.object as usize]);
            (!bounds.is_empty()).then_some(Record::new(&bounds, 0, i as u32))
        };
        let mut items: Vec<Record> = placements.iter().enumerate().filter_map(item).collect();
        let tree = build::build(&mut items, 1, Child::MOST, options);
        Self { tree, placements: items.iter().map(|item| placements[item.primitive() as usize].clone()).collect() }
    }

    pub fn is_empty(&self) -> bool {
        self.placements.is_empty()
    }

    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// As [`Tree::reach`].
    pub fn reach(&self) -> Vec3 {
        self.tree.reach()
    }

    /// The placements of a leaf.
    #[inline]
    pub fn leaf(&self, items: Range<u32>) -> &[Placement] {
        &self.placements[items.start as usize..items.end as usize]
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + size_of_val(&self.placements[..])
    }
}
