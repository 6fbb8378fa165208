//! A kd-tree: a BSP tree of planes across the axes (Wald, Havran 2006, *On building fast kd-trees for ray tracing, and
//! on doing that in O(N log N)*).
//!
//! `build` has where the planes are. An item lies in every cell that its box, cut off at the cell, reaches.
//!
//! A ray carries its range of t from cell to cell and visits the near child first; a far child that begins behind the
//! nearest hit is left out.

mod build;

use super::items::Input;
use super::ray::IndexRay;
use super::{Cell, Index, Options};
use crate::math::{Aabb, DVec3, Vec3};

/// Levels of planes at most, whatever the depth by number of items.
const STACK: usize = 80;

/// The index.
pub(super) struct KdTree {
    bounds: Aabb,
    tree: Tree,
}

/// Nodes and what is in their leaves.
#[derive(Default)]
struct Tree {
    /// The root first; a node's lower child follows it.
    nodes: Vec<Node>,
    items: Vec<u32>,
}

/// 8 bytes.
#[derive(Clone, Copy)]
struct Node {
    /// The plane's coordinate; of a leaf, the bits of its first item's number.
    plane: f32,
    /// Below, in two bits, the axis, or [`LEAF`]. Above, the upper child; of a leaf, how many items it has.
    link: u32,
}

const LEAF: u32 = 3;

impl Index for KdTree {
    const REPEATS: bool = true;

    fn build(input: &Input<'_>, _: &Options) -> Self {
        let bounds = input.bounds();
        Self { bounds, tree: build::tree(input, bounds) }
    }

    fn visit(&self, ray: &IndexRay, mut limit: f64, each: &mut impl FnMut(u32) -> f64) {
        if self.bounds.is_empty() {
            return;
        }
        let mut range = ray.within_box(&self.bounds, limit);
        if range.is_empty() {
            return;
        }
        let (mut stack, mut waiting) = ([(0, range); STACK], 0);
        let mut at = 0;
        loop {
            let node = self.tree.nodes[at as usize];
            let axis = node.link & 3;
            if axis != LEAF {
                let (near, far) = ray.split(axis as usize, node.plane.into(), range);
                let (below, above) = (at + 1, node.link >> 2);
                let (first, second) = if ray.backwards[axis as usize] { (above, below) } else { (below, above) };
                if near.is_empty() {
                    (at, range) = (second, far);
                } else {
                    if !far.is_empty() {
                        stack[waiting] = (second, far);
                        waiting += 1;
                    }
                    (at, range) = (first, near);
                }
                if !range.is_empty() {
                    continue;
                }
            } else {
                for &item in self.tree.leaf(node) {
                    limit = each(item);
                }
            }
            loop {
                if waiting == 0 {
                    return;
                }
                waiting -= 1;
                (at, range) = stack[waiting];
                if range.from <= limit {
                    range = range.until(limit);
                    break;
                }
            }
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.tree.nodes[..]) + size_of_val(&self.tree.items[..])
    }

    fn locate(&self, point: Vec3) -> Option<Cell> {
        let mut cell = Cell::within(&self.bounds, point)?;
        let mut at = 0;
        loop {
            let node = self.tree.nodes[at];
            let axis = (node.link & 3) as usize;
            if axis == LEAF as usize {
                cell.number = at as u32;
                cell.items.extend(self.tree.leaf(node));
                return Some(cell);
            }
            let (normal, plane) = (DVec3::AXES[axis], f64::from(node.plane));
            let is_above = point[axis] >= node.plane;
            at = if is_above { (node.link >> 2) as usize } else { at + 1 };
            cell.sides.push(if is_above { (-normal, -plane) } else { (normal, plane) });
        }
    }
}

impl Tree {
    /// The items of a leaf.
    fn leaf(&self, node: Node) -> &[u32] {
        &self.items[node.plane.to_bits() as usize..][..(node.link >> 2) as usize]
    }
}
