//! A subtree by one thread, all of it compiled for one instruction set.

use super::CUT_DEPTH;
use super::bins::{self, Bins, Grid};
use super::children::{Children, Splitter};
use super::record::{Record, aabb};
use super::split::{Range, Rule, Split};
use super::sweep;
use crate::trace::bvh::isa::Kernel;
use crate::trace::bvh::node::{self, Node};
use crate::trace::bvh::simd::Simd;

/// A subtree to be built.
#[derive(Clone, Copy, Debug)]
pub(super) struct Task {
    pub range: Range,
    /// Levels above it.
    pub depth: u32,
    /// The best split of the range, where it is known.
    pub split: Option<Split>,
}

/// The node and slot that a task's root belongs to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parent {
    pub node: u32,
    pub slot: u32,
}

/// Builds the nodes over a task's items, the root first. Leaves name ranges of items by their index in the whole.
pub(super) struct SubtreeKernel<'a> {
    pub rule: &'a Rule,
    pub items: &'a mut [Record],
    pub task: Task,
}

impl Kernel for SubtreeKernel<'_> {
    type Output = Vec<Node>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Vec<Node> {
        let Self { rule, items, task } = self;
        let base = task.range.first;
        let mut nodes: Vec<Node> = Vec::with_capacity(items.len() / 16 + 1);
        let mut open = vec![(Parent { node: 0, slot: 0 }, task)];
        while let Some((parent, Task { range, depth, split })) = open.pop() {
            let index = nodes.len() as u32;
            if index > 0 {
                nodes[parent.node as usize].child[parent.slot as usize] = node::Child::inner(index);
            }
            let mut splitter =
                Local::<S> { rule, items, base, halve: depth >= CUT_DEPTH, isa: std::marker::PhantomData };
            let children = Children::new(range, split, rule, &mut splitter);
            emit(&children, rule, &mut nodes);
            // The first child last, so that it comes next and follows its parent in memory.
            for (slot, child) in children.iter().rev().filter(|(_, child)| !child.is_leaf) {
                let parent = Parent { node: index, slot: slot as u32 };
                open.push((parent, Task { range: child.range, depth: depth + 1, split: child.split }));
            }
        }
        nodes
    }
}

/// Appends the node of these children, without the indices of its inner ones.
#[inline(always)]
pub(super) fn emit(children: &Children, rule: &Rule, nodes: &mut Vec<Node>) {
    let mut node = Node::empty();
    for (slot, child) in children.iter() {
        let Range { first, len, .. } = child.range;
        // An inner child's node is not known yet.
        let mut below = node::Child::ROOT;
        if child.is_leaf {
            below = node::Child::leaf(first, len.div_ceil(rule.block));
            node.items[slot] = len as u8;
        }
        node.set(slot, &aabb(&child.range.bounds), below);
    }
    nodes.push(node);
}

/// Divides ranges of `items`, the first of which has the index `base`.
struct Local<'a, S> {
    rule: &'a Rule,
    items: &'a mut [Record],
    base: u32,
    /// Too deep for anything but halves.
    halve: bool,
    isa: std::marker::PhantomData<S>,
}

impl<S: Simd> Splitter for Local<'_, S> {
    #[inline(always)]
    fn find(&mut self, range: &Range) -> Split {
        if self.halve {
            return Split::HALF;
        }
        let items = &self.items[range.within(self.base)];
        let best = if items.len() <= sweep::MOST {
            sweep::best::<S>(items, self.rule)
        } else if items.len() < bins::LARGE {
            binned::<S, { bins::FEW }>(items, range, self.rule)
        } else {
            binned::<S, { bins::MANY }>(items, range, self.rule)
        };
        best.unwrap_or(Split::HALF)
    }

    #[inline(always)]
    fn apply(&mut self, range: &Range, split: &Split) -> [Range; 2] {
        let items = &mut self.items[range.within(self.base)];
        let sides = split.partition::<S>(items, range);
        if sides[0].len > 0 && sides[1].len > 0 { sides } else { Split::HALF.partition::<S>(items, range) }
    }
}

/// The best plane between `N` bins.
#[inline(always)]
pub(super) fn binned<S: Simd, const N: usize>(items: &[Record], range: &Range, rule: &Rule) -> Option<Split> {
    let grid = Grid::new::<N>(&range.centres);
    let mut bins = Bins::<N>::empty();
    if items.len() < 2 * SAMPLE {
        bins.add::<S>(items.iter(), &grid);
    } else {
        bins.add::<S>(sample(items), &grid);
    }
    bins.best::<S>(&grid, rule)
}

/// Items by which a large range is judged.
pub(super) const SAMPLE: usize = 1 << 11;

/// One item of each of [`SAMPLE`] equal stretches: not always the first, or a mesh of even rows would be judged by a few of its
/// columns.
#[inline(always)]
pub(super) fn sample(items: &[Record]) -> impl Iterator<Item = &Record> {
    let stride = items.len() / SAMPLE;
    (0..SAMPLE).map(
        #[inline(always)]
        move |i| {
            // Fibonacci hashing (Knuth, The art of computer programming 3, 6.4), scaled to the stride.
            let hash = (i as u32).wrapping_mul(0x9e37_79b9);
            &items[i * stride + ((u64::from(hash) * stride as u64) >> 32) as usize]
        },
    )
}
