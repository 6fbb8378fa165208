//! An octree: space halved along all three axes at once, again and again (Glassner 1984, *Space subdivision for fast
//! ray tracing*).
//!
//! An item lies in every octant that its box touches. A cell is split while it has more than [`LEAF`] items and
//! splitting tells them apart. A ray passes an octant's planes in the order of their t: each plane cuts the range of t
//! in two, first across x, then y, then z, and the pieces that are left are the children that it passes, near ones
//! first (the parametric way of Revelles, Ureña, Lastra 2000, *An efficient parametric algorithm for octree traversal*,
//! but for its table of next children: that is made for one t a plane, and here a plane has two, between which the ray
//! is on both sides).
//!
//! The whole is a cube, so some planes lie beyond the reach that the ray's pad counts with. Their own rounding is
//! larger, but items are farther from them than that.

use super::items::Input;
use super::ray::{IndexRay, TInterval};
use super::{Index, Options, share};
use crate::math::{Aabb, DVec3};

/// Most items that are not told apart.
const LEAF: usize = 6;
/// Levels of cells. A leaf is then 2^-20 of the whole.
const DEEPEST: u32 = 20;
/// References that eight children may have for each of their parent's: beyond, the parent stays a leaf.
const MOST_OF_CHILDREN: usize = 3;
/// References for each item that splitting may add in all; every cell has its share. Where boxes overlap, each level
/// would add more than the one before.
const MAX_REFERENCES: usize = 12;

/// The index.
pub(super) struct Octree {
    min: DVec3,
    /// Half the side of the whole.
    half: f64,
    /// The root first; eight children lie side by side, x counts fastest.
    nodes: Vec<Node>,
    items: Vec<u32>,
}

#[derive(Clone, Copy)]
struct Node {
    /// The first child, or the first item.
    first: u32,
    /// Items of a leaf, or [`INNER`].
    count: u32,
}

/// The count of a node with children.
const INNER: u32 = u32::MAX;

/// A cell by its middle and half its side.
#[derive(Clone, Copy)]
struct Cell {
    middle: DVec3,
    half: f64,
}

impl Cell {
    fn child(self, octant: usize) -> Self {
        let half = self.half * 0.5;
        let side = |axis: usize| if octant >> axis & 1 == 0 { -half } else { half };
        Self { middle: self.middle + DVec3::new(side(0), side(1), side(2)), half }
    }
}

impl Index for Octree {
    const REPEATS: bool = true;

    fn build(input: &Input<'_>, _: &Options) -> Self {
        let bounds = input.bounds();
        let mut tree = Self { min: DVec3::ZERO, half: 0.0, nodes: Vec::new(), items: Vec::new() };
        if !bounds.is_empty() {
            tree.min = bounds.min.as_dvec3();
            tree.half = (bounds.max.as_dvec3() - tree.min).max_element() * 0.5;
            tree.nodes.push(Node { first: 0, count: 0 });
            let room = MAX_REFERENCES * input.boxes.len();
            tree.split(0, input.boxes, input.all(), tree.root(), 0, room);
        }
        tree
    }

    fn visit(&self, ray: &IndexRay, limit: f64, each: &mut impl FnMut(u32) -> f64) {
        if let Some(&node) = self.nodes.first() {
            let root = self.root();
            let range = ray.within(root.middle - root.half, root.middle + root.half, limit);
            if !range.is_empty() {
                self.enter(node, root, ray, range, limit, each);
            }
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.items[..])
    }
}

impl Octree {
    fn root(&self) -> Cell {
        Cell { middle: self.min + self.half, half: self.half }
    }

    /// Gives `node` children, or makes it a leaf; there is room for so many references more.
    fn split(&mut self, node: usize, boxes: &[Aabb], items: Vec<u32>, cell: Cell, depth: u32, room: usize) {
        let most = (MOST_OF_CHILDREN * items.len()).min(items.len() + room);
        let children = (items.len() > LEAF && depth < DEEPEST).then(|| deal(boxes, &items, cell, most)).flatten();
        let Some(children) = children else {
            self.nodes[node] = Node { first: self.items.len() as u32, count: items.len() as u32 };
            self.items.extend(items);
            return;
        };
        let references = children.iter().map(Vec::len).sum::<usize>();
        let left = room - (references - items.len());
        drop(items);
        let first = self.nodes.len();
        self.nodes[node] = Node { first: first as u32, count: INNER };
        self.nodes.resize(first + 8, Node { first: 0, count: 0 });
        for (octant, items) in children.into_iter().enumerate() {
            if !items.is_empty() {
                let room = share(left, items.len(), references);
                self.split(first + octant, boxes, items, cell.child(octant), depth + 1, room);
            }
        }
    }

    /// Visits what the ray meets within a range of t, and gives the new limit.
    fn enter(
        &self,
        node: Node,
        cell: Cell,
        ray: &IndexRay,
        range: TInterval,
        mut limit: f64,
        each: &mut impl FnMut(u32) -> f64,
    ) -> f64 {
        if node.count != INNER {
            for &item in &self.items[node.first as usize..][..node.count as usize] {
                limit = each(item);
            }
            return limit;
        }
        let sides = |axis: usize, range: TInterval| {
            let (near, far) = ray.split(axis, cell.middle[axis], range.until(limit));
            let first = usize::from(ray.backwards[axis]);
            [(first, near), (1 - first, far)]
        };
        // The pieces of the range, by child, in the order in which they begin.
        let mut pieces = [(0, range); 8];
        let mut count = 0;
        for (x, range) in sides(0, range) {
            if range.is_empty() {
                continue;
            }
            for (y, range) in sides(1, range) {
                if range.is_empty() {
                    continue;
                }
                for (z, range) in sides(2, range) {
                    let octant = x | y << 1 | z << 2;
                    if !range.is_empty() && self.nodes[node.first as usize + octant].count > 0 {
                        pieces[count] = (octant, range);
                        count += 1;
                    }
                }
            }
        }
        for &(octant, range) in &pieces[..count] {
            if range.from <= limit {
                let child = self.nodes[node.first as usize + octant];
                limit = self.enter(child, cell.child(octant), ray, range, limit, each);
            }
        }
        limit
    }
}

/// The items of each octant; None where these would be more than `most` in all.
fn deal(boxes: &[Aabb], items: &[u32], cell: Cell, most: usize) -> Option<[Vec<u32>; 8]> {
    let middle = cell.middle;
    // On each axis, whether a box reaches below and above the middle; one within the plane is above.
    let touched = |item: u32| {
        let bounds = &boxes[item as usize];
        let below = bounds.min.as_dvec3().cmplt(middle).bitmask() as usize;
        let above = !below & 7 | bounds.max.as_dvec3().cmpgt(middle).bitmask() as usize;
        (0..8usize).filter(move |octant| (octant & above | !octant & below) & 7 == 7)
    };
    let mut counts = [0; 8];
    for &item in items {
        for octant in touched(item) {
            counts[octant] += 1;
        }
    }
    if counts.iter().sum::<usize>() > most {
        return None;
    }
    let mut children = counts.map(Vec::with_capacity);
    for &item in items {
        for octant in touched(item) {
            children[octant].push(item);
        }
    }
    Some(children)
}
