//! Where in memory children are, so that they can be fetched before they are needed.

use crate::trace::bvh::levels::triangles::TriangleTree;
use crate::trace::bvh::node::{Child, Node};
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::tree::Tree;

/// Of children, by their [kind](Child::kind): where the first is, and how far apart they are.
pub(in crate::trace::bvh) struct Addresses {
    first: [*const u8; 3],
    stride: [usize; 3],
}

impl Addresses {
    pub fn new<S: Simd>(tree: &Tree, leaves: *const u8, stride: usize) -> Self {
        let nodes = S::address(tree.nodes(), 0);
        // Whoever has arrived has no next. An address outside of what is there would be looked up in vain, which holds
        // up all that follows.
        Self { first: [nodes, leaves, nodes], stride: [size_of::<Node>(), stride, 0] }
    }

    pub fn of_triangles<S: Simd>(triangles: &TriangleTree) -> Self {
        let leaves = triangles.leaves();
        Self::new::<S>(triangles.tree(), leaves.address::<S>(0), leaves.bytes() / leaves.len().max(1))
    }

    #[inline(always)]
    pub fn of(&self, child: Child) -> *const u8 {
        let kind = child.kind() % 3;
        self.first[kind].wrapping_add(self.stride[kind] * child.first() as usize)
    }
}
