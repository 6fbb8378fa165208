//! From a list of boxes to a tree: binned surface area heuristic (Wald 2007, *On fast construction of SAH-based bounding
//! volume hierarchies*), eight children at a time (Wald, Benthin, Boulos 2008, *Getting rid of packets*).
//!
//! A node starts as one range of items; the child with the largest surface is split in two until there are eight or none is
//! worth it. Leaves are charged by blocks, ceil(n / block), so that they fill. A binary tree collapsed afterwards, the
//! simpler alternative, writes every box twice and chooses worse.
//!
//! Large ranges are built in parallel; the tree is the same for any number of threads, because every decision depends on its
//! range alone and nodes are joined in order.

use rayon::prelude::*;

use super::node::{Node, Tree, WIDTH};
use crate::math::{Aabb, Vec3};

/// Levels a tree can have: the stack of a walk is made for it.
pub(super) const MAX_DEPTH: usize = 40;

/// From this level on ranges are cut into eighths: 12 more levels hold 2^36 items.
const CUT_DEPTH: usize = MAX_DEPTH - 12;

/// Bins an axis is divided into.
const BINS: usize = 16;

/// Cost of visiting a node, in tests of a block.
const NODE_COST: f32 = 1.0;

/// Most items in a leaf, in blocks.
const MAX_LEAF_BLOCKS: usize = 4;

/// Ranges of at least this many items are worth a task of their own.
const PARALLEL: usize = 4096;

/// Something with a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    /// Not empty, finite.
    pub bounds: Aabb,
    /// Index of the part it belongs to.
    pub part: u32,
    /// Index in the part.
    pub primitive: u32,
}

/// Reorders `items` so that every leaf is a range of them, and returns the tree whose leaves name these ranges.
/// `block` is how many items are tested together.
///
/// # Panics
/// With more than 2^32 - 1 items.
pub(super) fn build(items: &mut [Item], block: usize) -> Tree {
    assert!(u32::try_from(items.len()).is_ok(), "more primitives than 32-bit indices can name");
    let mut nodes = Vec::new();
    if !items.is_empty() {
        let range = Range::new(items, 0);
        Builder { block }.node(items, range, 0, &mut nodes);
    }
    Tree::new(nodes)
}

/// A range of items, and what a split needs to know of it.
#[derive(Clone, Copy, Debug)]
struct Range {
    first: usize,
    len: usize,
    bounds: Aabb,
    centres: Aabb,
    is_leaf: bool,
}

impl Range {
    /// `items` are those of the range, the first of which has the index `first`.
    fn new(items: &[Item], first: usize) -> Self {
        let empty = (Aabb::EMPTY, Aabb::EMPTY);
        let (bounds, centres) = items
            .iter()
            .fold(empty, |(bounds, centres), item| (bounds.union(item.bounds), centres.include(item.bounds.centre())));
        Self { first, len: items.len(), bounds, centres, is_leaf: false }
    }
}

/// One of the planes between the bins of an axis.
#[derive(Clone, Copy, Debug)]
struct Split {
    axis: usize,
    /// Items in bins below this go left.
    bin: usize,
    cost: f32,
}

struct Builder {
    block: usize,
}

impl Builder {
    /// Appends the node over `range`, then its subtrees; `items` are those of the range.
    fn node(&self, items: &mut [Item], range: Range, depth: usize, nodes: &mut Vec<Node>) {
        let children = self.children(items, range, depth);
        let this = nodes.len();
        nodes.push(Node::empty());
        let mut rest = items;
        let mut subtrees = Vec::new();
        for (slot, child) in children.iter().enumerate() {
            let (own, others) = rest.split_at_mut(child.len);
            rest = others;
            if child.is_leaf {
                nodes[this].set(slot, &child.bounds, child.first as u32, child.len as u8);
            } else {
                subtrees.push((slot, child, own));
            }
        }
        if range.len < PARALLEL {
            for (slot, child, items) in subtrees {
                let index = nodes.len() as u32;
                nodes[this].set(slot, &child.bounds, index, 0);
                self.node(items, *child, depth + 1, nodes);
            }
            return;
        }
        let built: Vec<_> = subtrees
            .into_par_iter()
            .map(|(slot, child, items)| {
                let mut nodes = Vec::new();
                self.node(items, *child, depth + 1, &mut nodes);
                (slot, child, nodes)
            })
            .collect();
        for (slot, child, mut subtree) in built {
            let base = nodes.len() as u32;
            nodes[this].set(slot, &child.bounds, base, 0);
            for node in &mut subtree {
                for i in (0..WIDTH).filter(|&i| node.count[i] == 0) {
                    node.index[i] += base;
                }
            }
            nodes.append(&mut subtree);
        }
    }

    /// Divides a range into up to eight, in the order of the items.
    fn children(&self, items: &mut [Item], range: Range, depth: usize) -> Vec<Range> {
        let base = range.first;
        let mut children = Vec::with_capacity(WIDTH);
        children.push(range);
        while children.len() < WIDTH {
            let open = children.iter().enumerate().filter(|(_, child)| !child.is_leaf);
            // By area; among equal areas by size, so that coincident items are divided evenly.
            let area = |range: &Range| if depth < CUT_DEPTH { range.bounds.half_area() } else { 0.0 };
            let widest = open.max_by(|(_, a), (_, b)| area(a).total_cmp(&area(b)).then(a.len.cmp(&b.len)));
            let Some((slot, &child)) = widest else { break };
            let own = &mut items[child.first - base..child.first - base + child.len];
            match self.split(own, &child, depth) {
                Some(left_len) => {
                    let (left, right) = own.split_at(left_len);
                    children[slot] = Range::new(left, child.first);
                    children.insert(slot + 1, Range::new(right, child.first + left_len));
                }
                None => children[slot].is_leaf = true,
            }
        }
        // A child that would only be a node around one leaf becomes that leaf.
        for child in children.iter_mut().filter(|child| !child.is_leaf && child.len <= MAX_LEAF_BLOCKS * self.block) {
            let own = &mut items[child.first - base..child.first - base + child.len];
            child.is_leaf = self.split(own, child, depth + 1).is_none();
        }
        children
    }

    /// Partitions the items and returns how many went left; None where a leaf is the better choice.
    fn split(&self, items: &mut [Item], range: &Range, depth: usize) -> Option<usize> {
        if range.len <= self.block {
            return None;
        }
        let fits_leaf = range.len <= MAX_LEAF_BLOCKS * self.block;
        let best = if depth < CUT_DEPTH { self.best_split(items, range) } else { None };
        let Some(best) = best else {
            return if fits_leaf { None } else { Some(range.len / 2) };
        };
        let leaf_cost = self.blocks(range.len) * range.bounds.half_area();
        if fits_leaf && leaf_cost <= best.cost + NODE_COST * range.bounds.half_area() {
            return None;
        }
        let bins = Bins::new(&range.centres, best.axis);
        Some(partition(items, |item| bins.of(item) < best.bin))
    }

    /// The cheapest plane that leaves something on both sides; None where all centres coincide.
    fn best_split(&self, items: &[Item], range: &Range) -> Option<Split> {
        let mut best: Option<Split> = None;
        for axis in (0..3).filter(|&axis| range.centres.max[axis] > range.centres.min[axis]) {
            let bins = Bins::new(&range.centres, axis);
            let mut bounds = [Aabb::EMPTY; BINS];
            let mut counts = [0usize; BINS];
            for item in items {
                let bin = bins.of(item);
                bounds[bin] = bounds[bin].union(item.bounds);
                counts[bin] += 1;
            }
            let mut right_cost = [0.0; BINS];
            let (mut right, mut count) = (Aabb::EMPTY, 0);
            for bin in (1..BINS).rev() {
                right = right.union(bounds[bin]);
                count += counts[bin];
                right_cost[bin] = right.half_area() * self.blocks(count);
            }
            let (mut left, mut count) = (Aabb::EMPTY, 0);
            for bin in 1..BINS {
                left = left.union(bounds[bin - 1]);
                count += counts[bin - 1];
                let cost = left.half_area() * self.blocks(count) + right_cost[bin];
                let divides = count > 0 && count < items.len();
                if divides && best.is_none_or(|best| cost < best.cost) {
                    best = Some(Split { axis, bin, cost });
                }
            }
        }
        best
    }

    /// Blocks that hold `count` items.
    fn blocks(&self, count: usize) -> f32 {
        count.div_ceil(self.block) as f32
    }
}

/// The bins of one axis.
#[derive(Clone, Copy, Debug)]
struct Bins {
    axis: usize,
    origin: f32,
    scale: f32,
}

impl Bins {
    fn new(centres: &Aabb, axis: usize) -> Self {
        let origin = centres.min[axis];
        Self { axis, origin, scale: BINS as f32 / (centres.max[axis] - origin) }
    }

    /// The cast saturates, and makes NaN (an infinite scale times zero) bin 0.
    #[inline]
    fn of(&self, item: &Item) -> usize {
        let centre: Vec3 = item.bounds.centre();
        (((centre[self.axis] - self.origin) * self.scale) as usize).min(BINS - 1)
    }
}

/// Moves the items for which `left` holds to the front, and returns how many they are.
fn partition(items: &mut [Item], left: impl Fn(&Item) -> bool) -> usize {
    let (mut i, mut end) = (0, items.len());
    while i < end {
        if left(&items[i]) {
            i += 1;
        } else {
            end -= 1;
            items.swap(i, end);
        }
    }
    i
}
