//! A tree of boxes over items of any kind: its nodes, and what is known of all of it.

use std::ops::Range;

use rayon::prelude::*;

use super::node::{Child, NODE_COST, Node, WIDTH};
use crate::math::{Aabb, Vec3};
use crate::memory::Array;
use crate::memory::room;

/// A tree over items of any kind; leaves name ranges of them.
#[derive(Debug)]
pub(super) struct Tree {
    /// The root is the first; empty for no items.
    nodes: Array<Node>,
    bounds: Aabb,
    /// [`Tree::reach`], as a vector is loaded.
    reach: [f32; 4],
}

impl Tree {
    /// Of nodes of which the first is the root.
    pub fn new(nodes: impl Into<Array<Node>>) -> Self {
        let nodes = nodes.into();
        let bounds = nodes.first().map_or(Aabb::EMPTY, Node::bounds);
        Self { nodes, bounds, reach: reach(bounds) }
    }

    /// All of them; the root is the first.
    #[inline(always)]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The node that a child is.
    #[inline(always)]
    pub fn node(&self, child: Child) -> &Node {
        &self.nodes[child.node() as usize]
    }

    /// Whether there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The box around everything, [`widened`](super::node::widened).
    #[inline]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The largest coordinate's magnitude on each axis. Zero for no items.
    #[inline]
    pub fn reach(&self) -> Vec3 {
        let [x, y, z, _] = self.reach;
        Vec3::new(x, y, z)
    }

    /// The same, and one number more, as a vector is loaded.
    #[inline(always)]
    pub fn reach_row(&self) -> &[f32; 4] {
        &self.reach
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..])
    }

    /// The surface area heuristic's cost, in half areas times tests: each node counts [`NODE_COST`], a leaf what `leaf`
    /// says of its blocks.
    pub fn cost(&self, leaf: impl Fn(Range<u32>) -> f64) -> f64 {
        let root = f64::from(NODE_COST) * f64::from(self.bounds.half_area());
        self.nodes.iter().fold(root, |sum, node| {
            let cost = node.children().map(|(slot, child)| {
                let tests = if child.is_leaf() { leaf(child.blocks()) } else { f64::from(NODE_COST) };
                tests * f64::from(node.child_bounds(slot).half_area())
            });
            sum + cost.sum::<f64>()
        })
    }

    /// This tree, whose leaves name one item each, with the nodes `below` in their place; `index_of(item)` is where in
    /// `below` an item's node is.
    pub fn over(self, below: Vec<Node>, index_of: impl Fn(u32) -> u32) -> Self {
        let mut above = self.nodes.into_vec();
        let base = above.len() as u32;
        for child in above.iter_mut().flat_map(|above| &mut above.child) {
            if child.is_leaf() && *child != Child::NONE {
                *child = Child::inner(base + index_of(child.first()));
            }
        }
        const CHUNK: usize = 1 << 12;
        let chunks = [&above[..]].into_iter().chain(below.chunks(CHUNK)).map(|nodes| (nodes.len(), nodes));
        let nodes = room::fill(chunks.collect(), |nodes, room| nodes.iter().for_each(|&node| room.push(node)));
        Self { nodes: nodes.into(), ..self }
    }

    /// Computes all boxes again, from those of the leaves' blocks.
    pub fn refit(&mut self, leaf: impl Fn(Range<u32>) -> Aabb + Sync) {
        let nodes = self.nodes.make_mut();
        nodes.par_iter_mut().with_min_len(room::few::<Node>()).for_each(|node| {
            for slot in 0..WIDTH {
                let child = node.child[slot];
                if child.is_leaf() && child != Child::NONE {
                    node.set(slot, &leaf(child.blocks()), child);
                }
            }
        });
        // Children come after their parents.
        for index in (0..nodes.len()).rev() {
            let (above, below) = nodes.split_at_mut(index + 1);
            let node = &mut above[index];
            for slot in 0..WIDTH {
                let child = node.child[slot];
                if !child.is_leaf() {
                    node.put(slot, &below[child.node() as usize - index - 1].bounds(), child);
                }
            }
        }
        self.bounds = self.nodes.first().map_or(Aabb::EMPTY, Node::bounds);
        self.reach = reach(self.bounds);
    }

    /// All nodes, so that leaves can be renamed.
    pub fn nodes_mut(&mut self) -> &mut [Node] {
        self.nodes.make_mut()
    }
}

/// The largest coordinate's magnitude on each axis; of no box zero, and not infinity.
fn reach(bounds: Aabb) -> [f32; 4] {
    if bounds.is_empty() {
        return [0.0; 4];
    }
    let Vec3 { x, y, z } = bounds.min.abs().max(bounds.max.abs());
    [x, y, z, 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_reaches_nowhere() {
        // Infinity would make rays that also go through another tree enter all of it.
        assert_eq!(Tree::new(Vec::new()).reach(), Vec3::ZERO);
    }
}
