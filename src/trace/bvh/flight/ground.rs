//! What rays travel through: the triangles of the world alone, or these and placed objects.
//!
//! Rounds are compiled once for each, so that scenes without placements pay nothing for them.

use super::traveller::Space;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::Block;
use crate::trace::bvh::leaves::Blocks;
use crate::trace::bvh::node::{Child, Node, Tree};
use crate::trace::bvh::simd::Simd;

/// What rays travel through.
pub(super) trait Ground {
    const HAS_PLACEMENTS: bool;
    fn node(&self, space: Space, child: Child) -> &Node;
    /// A leaf's block; `scratch` is where it may be put together.
    fn block<'a>(&'a self, space: Space, index: u32, scratch: &'a mut Option<Block>) -> &'a Block;
    /// Where in memory a node is.
    fn node_address<S: Simd>(&self, space: Space, next: Child) -> *const u8;
    /// Where in memory a leaf's first block is, or a placement.
    fn leaf_address<S: Simd>(&self, space: Space, next: Child) -> *const u8;
}

/// The triangles of the world, and nothing else.
pub(super) struct Plain<'a, L: ?Sized> {
    pub tree: &'a Tree,
    pub leaves: &'a L,
}

impl<L: Blocks + ?Sized> Ground for Plain<'_, L> {
    const HAS_PLACEMENTS: bool = false;

    #[inline(always)]
    fn node(&self, _: Space, child: Child) -> &Node {
        self.tree.node(child)
    }
    #[inline(always)]
    fn block<'a>(&'a self, _: Space, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        self.leaves.block(index, scratch)
    }
    #[inline(always)]
    fn node_address<S: Simd>(&self, _: Space, next: Child) -> *const u8 {
        S::address(self.tree.nodes(), next.node())
    }
    #[inline(always)]
    fn leaf_address<S: Simd>(&self, _: Space, next: Child) -> *const u8 {
        self.leaves.address::<S>(next.first())
    }
}

/// The triangles of the world and of objects in their places.
pub(super) struct Placed<'a> {
    pub bvh: &'a Bvh,
}

impl Placed<'_> {
    #[inline(always)]
    fn tree(&self, space: Space) -> &Tree {
        match space {
            Space::FIXED => self.bvh.fixed.triangles.tree(),
            Space::UPPER => self.bvh.placements.tree(),
            Space(object) => self.bvh.objects[object as usize - 2].triangles.tree(),
        }
    }
}

impl Ground for Placed<'_> {
    const HAS_PLACEMENTS: bool = true;

    #[inline(always)]
    fn node(&self, space: Space, child: Child) -> &Node {
        self.tree(space).node(child)
    }
    #[inline(always)]
    fn block<'a>(&'a self, space: Space, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        let level = if space == Space::FIXED { &self.bvh.fixed } else { &self.bvh.objects[space.0 as usize - 2] };
        level.triangles.block(index, scratch)
    }
    #[inline(always)]
    fn node_address<S: Simd>(&self, space: Space, next: Child) -> *const u8 {
        S::address(self.tree(space).nodes(), next.node())
    }
    #[inline(always)]
    fn leaf_address<S: Simd>(&self, space: Space, next: Child) -> *const u8 {
        match space {
            Space::FIXED => self.bvh.fixed.triangles.leaves().address::<S>(next.first()),
            Space::UPPER => S::address(self.bvh.placements.places(), next.first()),
            Space(object) => self.bvh.objects[object as usize - 2].triangles.leaves().address::<S>(next.first()),
        }
    }
}
