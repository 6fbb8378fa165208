//! What rays travel through: the triangles of the world alone, or these and placed objects.
//!
//! Rounds are compiled once for each, so that scenes without placements pay nothing for them.

use super::traveller::Space;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::Block;
use crate::trace::bvh::filter::{Candidates, Filter};
use crate::trace::bvh::leaves::Blocks;
use crate::trace::bvh::node::{Child, Node, Tree};
use crate::trace::bvh::query::Verdict;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::triangles::TriangleTree;

/// What rays travel through.
pub(super) trait Ground {
    const HAS_PLACEMENTS: bool;
    /// The triangles of a block that a ray may hit.
    fn candidates<S: Simd>(filter: &Filter, block: &Block, limit: f32) -> Candidates;
    /// Whether a ray, by its number, hits a triangle about which the candidates leave a doubt.
    fn decide(&self, _ray: usize, _block: &Block, _lane: usize) -> Verdict {
        Verdict::Doubt
    }
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
    fn candidates<S: Simd>(filter: &Filter, block: &Block, limit: f32) -> Candidates {
        // The bounds of a ray in the world cost less, and are tighter.
        filter.candidates::<S, false>(block, limit)
    }
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

/// The triangles of the world, rounded from others, as rays may be; and who knows the others.
pub(super) struct Rounded<'a> {
    pub triangles: &'a TriangleTree,
    pub decide: Decide<'a>,
}

/// Says whether a ray, by its number, hits a triangle, by its geometry and its primitive.
pub(in crate::trace) type Decide<'a> = &'a dyn Fn(usize, u32, u32) -> Verdict;

impl Ground for Rounded<'_> {
    const HAS_PLACEMENTS: bool = false;

    #[inline(always)]
    fn candidates<S: Simd>(filter: &Filter, block: &Block, limit: f32) -> Candidates {
        filter.rounded_candidates::<S>(block, limit)
    }
    #[cold]
    #[inline(never)]
    fn decide(&self, ray: usize, block: &Block, lane: usize) -> Verdict {
        let geometry = self.triangles.part(block.part[lane]).geometry;
        (self.decide)(ray, geometry, block.primitive[lane])
    }
    #[inline(always)]
    fn node(&self, _: Space, child: Child) -> &Node {
        self.triangles.tree().node(child)
    }
    #[inline(always)]
    fn block<'a>(&'a self, _: Space, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        self.triangles.block(index, scratch)
    }
    #[inline(always)]
    fn node_address<S: Simd>(&self, _: Space, next: Child) -> *const u8 {
        S::address(self.triangles.tree().nodes(), next.node())
    }
    #[inline(always)]
    fn leaf_address<S: Simd>(&self, _: Space, next: Child) -> *const u8 {
        self.triangles.leaves().address::<S>(next.first())
    }
}

/// The triangles of the world and of objects in their places: what each space has, in one table, since rays of a list are in
/// different ones, and nobody can predict which.
pub(super) struct Placed<'a>(Vec<Region<'a>>);

/// What a space has.
struct Region<'a> {
    nodes: &'a [Node],
    triangles: &'a TriangleTree,
    /// Where in memory leaves' first blocks or placements are, and how far apart.
    leaves: *const u8,
    stride: usize,
}

impl<'a> Placed<'a> {
    pub fn new<S: Simd>(bvh: &'a Bvh) -> Self {
        let fixed = Region::new::<S>(&bvh.fixed.triangles);
        let places = bvh.placements.places();
        let upper = Region {
            nodes: bvh.placements.tree().nodes(),
            triangles: &bvh.fixed.triangles,
            leaves: S::address(places, 0),
            stride: size_of_val(places) / places.len().max(1),
        };
        let objects = bvh.objects.iter().map(|level| Region::new::<S>(&level.triangles));
        Self([fixed, upper].into_iter().chain(objects).collect())
    }
}

impl<'a> Region<'a> {
    fn new<S: Simd>(triangles: &'a TriangleTree) -> Self {
        let leaves = triangles.leaves();
        let stride = leaves.bytes() / leaves.len().max(1);
        Self { nodes: triangles.tree().nodes(), triangles, leaves: leaves.address::<S>(0), stride }
    }
}

impl Ground for Placed<'_> {
    const HAS_PLACEMENTS: bool = true;

    #[inline(always)]
    fn candidates<S: Simd>(filter: &Filter, block: &Block, limit: f32) -> Candidates {
        filter.candidates::<S, true>(block, limit)
    }
    #[inline(always)]
    fn node(&self, space: Space, child: Child) -> &Node {
        &self.0[space.0 as usize].nodes[child.node() as usize]
    }
    #[inline(always)]
    fn block<'a>(&'a self, space: Space, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        self.0[space.0 as usize].triangles.block(index, scratch)
    }
    #[inline(always)]
    fn node_address<S: Simd>(&self, space: Space, next: Child) -> *const u8 {
        S::address(self.0[space.0 as usize].nodes, next.node())
    }
    #[inline(always)]
    fn leaf_address<S: Simd>(&self, space: Space, next: Child) -> *const u8 {
        let region = &self.0[space.0 as usize];
        region.leaves.wrapping_add(region.stride * next.first() as usize)
    }
}
