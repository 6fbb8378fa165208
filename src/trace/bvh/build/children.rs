//! One range divided into the children of a node: the child with the largest surface is split in two, until there are
//! eight or none is worth it.

use super::split::{Range, Rule, Split};
use crate::trace::bvh::node::WIDTH;

/// Cost of visiting a node, in tests of a block. Measured: from 1 to 4 rates hardly differ, bytes do.
pub(in crate::trace::bvh) const NODE_COST: f32 = 1.0;

/// How ranges are divided: by one thread or by several.
pub(super) trait Splitter {
    /// The best way to divide `range`.
    fn find(&mut self, range: &Range) -> Split;
    /// Does it.
    fn apply(&mut self, range: &Range, split: &Split) -> [Range; 2];
}

/// A child of the node that is made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Child {
    pub range: Range,
    area: f32,
    /// The best way to divide it, once known.
    pub split: Option<Split>,
    pub is_leaf: bool,
}

impl Child {
    const NONE: Self = Self { range: Range::EMPTY, area: 0.0, split: None, is_leaf: true };

    #[inline(always)]
    fn new(range: Range, rule: &Rule) -> Self {
        Self { range, area: range.half_area(), split: None, is_leaf: range.len <= rule.block }
    }
}

/// The children of one node.
pub(super) struct Children {
    list: [Child; WIDTH],
    len: usize,
}

impl Children {
    /// Of `range`, for which `split` may be known already.
    #[inline(always)]
    pub fn new(range: Range, split: Option<Split>, rule: &Rule, splitter: &mut impl Splitter) -> Self {
        let mut children = Self { list: [Child::NONE; WIDTH], len: 1 };
        children.list[0] = Child { split, ..Child::new(range, rule) };
        while children.len < WIDTH {
            let Some(widest) = children.widest() else { break };
            let child = &mut children.list[widest];
            let split = child.split.unwrap_or_else(
                #[inline(always)]
                || splitter.find(&child.range),
            );
            if is_leaf_better(child, &split, rule, 0.0) {
                child.is_leaf = true;
                continue;
            }
            let [left, right] = splitter.apply(&child.range, &split);
            *child = Child::new(left, rule);
            children.list[children.len] = Child::new(right, rule);
            children.len += 1;
        }
        // What is left open becomes a node of its own, unless that costs more than a leaf.
        for child in &mut children.list[..children.len] {
            if !child.is_leaf && child.range.len <= rule.leaf {
                let split = child.split.unwrap_or_else(
                    #[inline(always)]
                    || splitter.find(&child.range),
                );
                child.is_leaf = is_leaf_better(child, &split, rule, NODE_COST);
                child.split = Some(split);
            }
        }
        children
    }

    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (usize, &Child)> {
        self.list[..self.len].iter().enumerate()
    }

    /// The open child with the largest surface; among equals the one with most items, so that coincident items are
    /// divided evenly.
    #[inline(always)]
    fn widest(&self) -> Option<usize> {
        let mut best: Option<usize> = None;
        for (i, child) in self.list[..self.len].iter().enumerate().filter(|(_, child)| !child.is_leaf) {
            let wider = |other: &Child| {
                child.area > other.area || child.area == other.area && child.range.len > other.range.len
            };
            if best.is_none_or(|best| wider(&self.list[best])) {
                best = Some(i);
            }
        }
        best
    }
}

/// Whether a leaf costs less than the two sides and `extra`, in tests of a block.
#[inline(always)]
fn is_leaf_better(child: &Child, split: &Split, rule: &Rule, extra: f32) -> bool {
    let len = child.range.len;
    // Written so that what is no number, for boxes too large to be measured, is divided.
    len <= rule.leaf && rule.blocks(len as usize) * child.area <= split.cost + extra * child.area
}
