//! The tree: nodes of eight boxes, laid out component by component for eight-wide arithmetic.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::build::{NODE_COST, Record};
use crate::math::{Aabb, Vec3};
use crate::memory::Array;

/// Children of a node.
pub(super) const WIDTH: usize = 8;

/// Marks a child slot without a child; its box is empty, so that no ray enters it.
pub(super) const NO_CHILD: u8 = u8::MAX;

/// Eight children: 256 bytes, four cache lines.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Node {
    /// Of each child: min x, y, z, max x, y, z.
    pub bounds: [[f32; WIDTH]; 6],
    /// Of an inner child its node; of a leaf its first item.
    pub index: [u32; WIDTH],
    /// 0 for an inner child, [`NO_CHILD`] for none, else the leaf's number of items.
    pub count: [u8; WIDTH],
    /// What fills the fourth line: zeros, so that a node is its bytes.
    pub unused: [u8; 24],
}

/// What a slot of a node names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Child {
    None,
    /// A node, by its index.
    Node(u32),
    /// So many items from the first on.
    Leaf {
        first: u32,
        count: u8,
    },
}

impl Node {
    /// A node without children.
    pub fn empty() -> Self {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self { bounds: [low, low, low, high, high, high], index: [0; WIDTH], count: [NO_CHILD; WIDTH], unused: [0; 24] }
    }

    /// Fills one slot.
    pub fn set(&mut self, slot: usize, bounds: &Aabb, index: u32, count: u8) {
        for axis in 0..3 {
            self.bounds[axis][slot] = bounds.min[axis];
            self.bounds[axis + 3][slot] = bounds.max[axis];
        }
        self.index[slot] = index;
        self.count[slot] = count;
    }

    /// What a slot names.
    pub fn child(&self, slot: usize) -> Child {
        match (self.index[slot], self.count[slot]) {
            (index, 0) => Child::Node(index),
            (_, NO_CHILD) => Child::None,
            (first, count) => Child::Leaf { first, count },
        }
    }

    /// The box around all children.
    pub fn bounds(&self) -> Aabb {
        (0..WIDTH).map(|slot| self.child_bounds(slot)).fold(Aabb::EMPTY, Aabb::union)
    }

    /// The box of one slot.
    pub fn child_bounds(&self, slot: usize) -> Aabb {
        let corner = |first: usize| {
            Vec3::new(self.bounds[first][slot], self.bounds[first + 1][slot], self.bounds[first + 2][slot])
        };
        Aabb { min: corner(0), max: corner(3) }
    }
}

/// A tree over items of any kind; leaves name ranges of them.
#[derive(Debug)]
pub(super) struct Tree {
    /// The root is the first; empty for no items.
    nodes: Array<Node>,
    bounds: Aabb,
}

impl Tree {
    /// Of nodes of which the first is the root.
    pub fn new(nodes: impl Into<Array<Node>>) -> Self {
        let nodes = nodes.into();
        let bounds = nodes.first().map_or(Aabb::EMPTY, Node::bounds);
        Self { nodes, bounds }
    }

    /// All of them; the root is the first.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// One node.
    #[inline(always)]
    pub fn node(&self, index: u32) -> &Node {
        &self.nodes[index as usize]
    }

    /// Whether there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The box around everything.
    #[inline]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The largest coordinate's magnitude on each axis: what the rounding of slab tests is relative to.
    #[inline]
    pub fn reach(&self) -> Vec3 {
        self.bounds.min.abs().max(self.bounds.max.abs())
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..])
    }

    /// The surface area heuristic's cost, in half areas times tests: each node counts [`NODE_COST`], a leaf what `leaf` says of its
    /// `(first, count)`.
    pub fn cost(&self, leaf: impl Fn(u32, u8) -> f64) -> f64 {
        let root = f64::from(NODE_COST) * f64::from(self.bounds.half_area());
        self.nodes.iter().fold(root, |sum, node| {
            let slots = (0..WIDTH).filter(|&slot| node.count[slot] != NO_CHILD);
            let cost = slots.map(|slot| {
                let tests =
                    if node.count[slot] == 0 { f64::from(NODE_COST) } else { leaf(node.index[slot], node.count[slot]) };
                tests * f64::from(node.child_bounds(slot).half_area())
            });
            sum + cost.sum::<f64>()
        })
    }

    /// This tree, whose leaves name one of `items` each, with nodes in their place: the item's primitive is the node's index.
    pub fn over(self, items: &[Record], below: &mut Vec<Node>) -> Self {
        let mut nodes = self.nodes.into_vec();
        let base = nodes.len() as u32;
        for node in &mut nodes {
            for slot in 0..WIDTH {
                if node.count[slot] == 1 {
                    node.index[slot] = base + items[node.index[slot] as usize].primitive();
                    node.count[slot] = 0;
                }
            }
        }
        nodes.append(below);
        Self { nodes: nodes.into(), bounds: self.bounds }
    }

    /// Computes all boxes again, from those of the leaves' `(first, count)`.
    pub fn refit(&mut self, leaf: impl Fn(u32, u8) -> Aabb + Sync) {
        let nodes = self.nodes.make_mut();
        nodes.par_iter_mut().for_each(|node| {
            for slot in 0..WIDTH {
                let (first, count) = (node.index[slot], node.count[slot]);
                if count != 0 && count != NO_CHILD {
                    node.set(slot, &leaf(first, count), first, count);
                }
            }
        });
        // Children come after their parents.
        for index in (0..nodes.len()).rev() {
            let (above, below) = nodes.split_at_mut(index + 1);
            let node = &mut above[index];
            for slot in 0..WIDTH {
                if node.count[slot] == 0 {
                    let child = node.index[slot];
                    node.set(slot, &below[child as usize - index - 1].bounds(), child, 0);
                }
            }
        }
        self.bounds = self.nodes.first().map_or(Aabb::EMPTY, Node::bounds);
    }

    /// All nodes, so that leaves can be renamed.
    pub fn nodes_mut(&mut self) -> &mut [Node] {
        self.nodes.make_mut()
    }
}
