//! What rays travel through: the triangles of the world alone, these and placed objects, or placed objects alone.
//!
//! Rounds are compiled once for each, so that scenes without placements pay nothing for them.

use super::addresses::Addresses;
use super::ray_state::TreeId;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::Block;
use crate::trace::bvh::levels::numbers::{Blocks, Numbers};
use crate::trace::bvh::levels::triangles::TriangleTree;
use crate::trace::bvh::node::{Child, Node};
use crate::trace::bvh::query::Verdict;
use crate::trace::bvh::reject::filter::{Candidates, Filter};
use crate::trace::bvh::reject::woop::Sides;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::tree::Tree;

/// What rays travel through.
pub(super) trait TraversalTarget {
    /// Whether rays go on from the fixed triangles to placements, and into their objects.
    const HAS_PLACEMENTS: bool;
    /// Whether they may be in placed objects.
    const HAS_PLACES: bool = Self::HAS_PLACEMENTS;
    /// Whether blocks are put together when they are asked for, so that they had better be asked for once.
    const IS_PUT_TOGETHER: bool = false;
    /// Which triangles of a block a ray may pass within.
    fn look<S: Simd>(filter: &Filter, block: &Block) -> (Sides<S::V8>, u32);
    /// Which of these it may hit.
    fn meet<S: Simd>(filter: &Filter, block: &Block, sides: &Sides<S::V8>, passed: u32, limit: f32) -> Candidates;
    /// Whether a ray, by its number, hits a triangle about which the candidates leave a doubt.
    fn decide(&self, _ray: usize, _block: &Block, _lane: usize) -> Verdict {
        Verdict::Doubt
    }
    fn node(&self, tree_id: TreeId, child: Child) -> &Node;
    /// A leaf's block; `scratch` is where it may be put together.
    fn block<'a, S: Simd>(&'a self, tree_id: TreeId, index: u32, scratch: &'a mut Option<Block>) -> &'a Block;
    /// What corners are to be fetched ahead from ([`Blocks::far`]).
    #[inline(always)]
    fn far(&self) -> Option<&Numbers> {
        None
    }
    /// Where in memory a node is, or a leaf's first block, or a placement.
    fn address(&self, tree_id: TreeId, next: Child) -> *const u8;
}

/// The triangles of the world, and nothing else.
pub(super) struct Plain<'a, L: ?Sized> {
    tree: &'a Tree,
    leaves: &'a L,
    addresses: Addresses,
}

impl<'a, L: Blocks + ?Sized> Plain<'a, L> {
    /// `leaves` are those of the triangles.
    pub fn new<S: Simd>(triangles: &'a TriangleTree, leaves: &'a L) -> Self {
        Self { tree: triangles.tree(), leaves, addresses: Addresses::of_triangles::<S>(triangles) }
    }
}

impl<L: Blocks + ?Sized> TraversalTarget for Plain<'_, L> {
    const HAS_PLACEMENTS: bool = false;
    const IS_PUT_TOGETHER: bool = L::IS_PUT_TOGETHER;

    #[inline(always)]
    fn look<S: Simd>(filter: &Filter, block: &Block) -> (Sides<S::V8>, u32) {
        // The bounds of a ray in the world cost less, and are tighter.
        filter.look::<S, false>(block)
    }
    #[inline(always)]
    fn meet<S: Simd>(filter: &Filter, block: &Block, sides: &Sides<S::V8>, passed: u32, limit: f32) -> Candidates {
        filter.meet::<S, false, false>(block, sides, passed, limit)
    }
    #[inline(always)]
    fn node(&self, _: TreeId, child: Child) -> &Node {
        self.tree.node(child)
    }
    #[inline(always)]
    fn block<'a, S: Simd>(&'a self, _: TreeId, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        self.leaves.block::<S>(index, scratch)
    }
    #[inline(always)]
    fn far(&self) -> Option<&Numbers> {
        self.leaves.far()
    }
    #[inline(always)]
    fn address(&self, _: TreeId, next: Child) -> *const u8 {
        self.addresses.of(next)
    }
}

/// The triangles of the world, rounded from others, as rays may be; and who knows the others.
pub(super) struct Rounded<'a> {
    triangles: &'a TriangleTree,
    decide: Decide<'a>,
    addresses: Addresses,
}

impl<'a> Rounded<'a> {
    pub fn new<S: Simd>(triangles: &'a TriangleTree, decide: Decide<'a>) -> Self {
        Self { triangles, decide, addresses: Addresses::of_triangles::<S>(triangles) }
    }
}

/// Says whether a ray, by its number, hits a triangle, by its geometry and its primitive.
pub(in crate::trace) type Decide<'a> = &'a dyn Fn(usize, u32, u32) -> Verdict;

impl TraversalTarget for Rounded<'_> {
    const HAS_PLACEMENTS: bool = false;

    #[inline(always)]
    fn look<S: Simd>(filter: &Filter, block: &Block) -> (Sides<S::V8>, u32) {
        filter.look::<S, true>(block)
    }
    #[inline(always)]
    fn meet<S: Simd>(filter: &Filter, block: &Block, sides: &Sides<S::V8>, passed: u32, limit: f32) -> Candidates {
        filter.meet::<S, true, true>(block, sides, passed, limit)
    }
    #[cold]
    #[inline(never)]
    fn decide(&self, ray: usize, block: &Block, lane: usize) -> Verdict {
        let geometry = self.triangles.part(block.part[lane]).geometry;
        (self.decide)(ray, geometry, block.primitive[lane])
    }
    #[inline(always)]
    fn node(&self, _: TreeId, child: Child) -> &Node {
        self.triangles.tree().node(child)
    }
    #[inline(always)]
    fn block<'a, S: Simd>(&'a self, _: TreeId, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        self.triangles.block::<S>(index, scratch)
    }
    #[inline(always)]
    fn address(&self, _: TreeId, next: Child) -> *const u8 {
        self.addresses.of(next)
    }
}

/// The triangles of the world and of objects in their places: what each tree has, in one table, since rays of a round
/// are in different ones, and nobody can predict which.
pub(super) struct Placed<'a>(Vec<Region<'a>>);

/// What a tree has.
struct Region<'a> {
    nodes: &'a [Node],
    triangles: &'a TriangleTree,
    addresses: Addresses,
}

impl<'a> Placed<'a> {
    pub fn new<S: Simd>(bvh: &'a Bvh) -> Self {
        let (placements, places) = (bvh.placements.tree(), bvh.placements.places());
        let stride = size_of_val(places) / places.len().max(1);
        let upper = Region {
            nodes: placements.nodes(),
            triangles: &bvh.fixed.triangles,
            addresses: Addresses::new::<S>(placements, S::address(places, 0), stride),
        };
        let objects = bvh.objects.iter().map(|level| Region::new::<S>(&level.triangles));
        Self([Region::new::<S>(&bvh.fixed.triangles), upper].into_iter().chain(objects).collect())
    }
}

impl<'a> Region<'a> {
    fn new<S: Simd>(triangles: &'a TriangleTree) -> Self {
        Self { nodes: triangles.tree().nodes(), triangles, addresses: Addresses::of_triangles::<S>(triangles) }
    }
}

impl TraversalTarget for Placed<'_> {
    const HAS_PLACEMENTS: bool = true;

    #[inline(always)]
    fn look<S: Simd>(filter: &Filter, block: &Block) -> (Sides<S::V8>, u32) {
        filter.look::<S, true>(block)
    }
    #[inline(always)]
    fn meet<S: Simd>(filter: &Filter, block: &Block, sides: &Sides<S::V8>, passed: u32, limit: f32) -> Candidates {
        filter.meet::<S, true, false>(block, sides, passed, limit)
    }
    #[inline(always)]
    fn node(&self, tree_id: TreeId, child: Child) -> &Node {
        &self.0[tree_id.0 as usize].nodes[child.node() as usize]
    }
    #[inline(always)]
    fn block<'a, S: Simd>(&'a self, tree_id: TreeId, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        self.0[tree_id.0 as usize].triangles.block::<S>(index, scratch)
    }
    #[inline(always)]
    fn address(&self, tree_id: TreeId, next: Child) -> *const u8 {
        self.0[tree_id.0 as usize].addresses.of(next)
    }
}

/// Placed objects alone, for rays that are in one of them from the beginning.
pub(in crate::trace::bvh) struct Objects<'a>(Placed<'a>);

impl<'a> Objects<'a> {
    pub fn new<S: Simd>(bvh: &'a Bvh) -> Self {
        Self(Placed::new::<S>(bvh))
    }
}

impl TraversalTarget for Objects<'_> {
    const HAS_PLACEMENTS: bool = false;
    const HAS_PLACES: bool = true;

    #[inline(always)]
    fn look<S: Simd>(filter: &Filter, block: &Block) -> (Sides<S::V8>, u32) {
        Placed::look::<S>(filter, block)
    }
    #[inline(always)]
    fn meet<S: Simd>(filter: &Filter, block: &Block, sides: &Sides<S::V8>, passed: u32, limit: f32) -> Candidates {
        Placed::meet::<S>(filter, block, sides, passed, limit)
    }
    #[inline(always)]
    fn node(&self, tree_id: TreeId, child: Child) -> &Node {
        self.0.node(tree_id, child)
    }
    #[inline(always)]
    fn block<'a, S: Simd>(&'a self, tree_id: TreeId, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        self.0.block::<S>(tree_id, index, scratch)
    }
    #[inline(always)]
    fn address(&self, tree_id: TreeId, next: Child) -> *const u8 {
        self.0.address(tree_id, next)
    }
}
