//! A node above the subtrees: the child with the largest surface is divided, until there are eight or none is worth it.

use super::fill;
use super::split::{PrimitiveRange, Rule};
use super::top::Shared;
use crate::trace::bvh::node::{NODE_COST, Node, WIDTH};

/// A child of the node that is made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Child {
    pub range: PrimitiveRange,
    area: f32,
    pub is_leaf: bool,
}

impl Child {
    const NONE: Self = Self { range: PrimitiveRange::EMPTY, area: 0.0, is_leaf: true };

    fn new(range: PrimitiveRange, rule: &Rule) -> Self {
        Self { range, area: range.half_area(), is_leaf: range.len <= rule.block }
    }
}

/// The children of one node.
pub(super) struct Children {
    list: [Child; WIDTH],
    len: usize,
}

impl Children {
    /// Of `range`.
    pub fn new(range: PrimitiveRange, shared: &mut Shared<'_>) -> Self {
        let rule = shared.rule;
        let mut children = Self { list: [Child::NONE; WIDTH], len: 1 };
        children.list[0] = Child::new(range, rule);
        while children.len < WIDTH {
            let Some(widest) = children.widest() else { break };
            let child = &mut children.list[widest];
            let split = shared.find(&child.range);
            if rule.prefers_leaf(child.range.len, child.area, split.cost) {
                child.is_leaf = true;
                continue;
            }
            let [left, right] = shared.apply(&child.range, &split);
            *child = Child::new(left, rule);
            children.list[children.len] = Child::new(right, rule);
            children.len += 1;
        }
        // What is left open becomes a node of its own, unless that costs more than a leaf.
        for child in &mut children.list[..children.len] {
            if !child.is_leaf && child.range.len <= rule.leaf {
                let node = shared.find(&child.range).cost + NODE_COST * child.area;
                child.is_leaf = rule.prefers_leaf(child.range.len, child.area, node);
            }
        }
        children
    }

    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (usize, &Child)> {
        self.list[..self.len].iter().enumerate()
    }

    /// Their node, without the indices of its inner ones.
    pub fn node(&self, rule: &Rule) -> Node {
        let mut node = Node::empty();
        for (slot, child) in self.iter() {
            let PrimitiveRange { first, len, bounds, .. } = &child.range;
            fill(&mut node, slot, bounds, child.is_leaf.then_some((*first, *len)), rule);
        }
        node
    }

    /// The open child with the largest surface; among equals the one with most items, so that coincident items are
    /// divided evenly.
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
