//! From a list of boxes to a tree: binned surface area heuristic (Wald 2007, *On fast construction of SAH-based bounding
//! volume hierarchies*), and of the binary tree that comes of it nodes of eight children (Ylitie, Karras, Laine 2017, *Efficient
//! incoherent ray traversal on GPUs through compressed wide BVHs*).
//!
//! | file | idea |
//! | --- | --- |
//! | `record`, `lanes` | a box in one register, as [-min, max] |
//! | `split` | a range of items, and how it is divided in two |
//! | `bins` | the best plane between bins, for large ranges |
//! | `sweep` | the best of all divisions, for small ones |
//! | `binary` | a subtree's items, divided again and again |
//! | `collapse` | which branches of that become nodes |
//! | `children` | a node above the subtrees |
//! | `subtree`, `top` | ranges divided by one thread, by all threads |
//! | `presplit` | large triangles in several places: the high preset |
//! | `morton` | neighbours along a curve: the fast preset |
//!
//! Ranges of items are divided in two until they fill a block, and of the branches of that binary tree those become nodes that make the
//! wide one cheapest. Leaves are charged by blocks, ceil(n / block), so that they fill.
//!
//! That is done for subtrees, each by one thread. The nodes above are made one after the other, each by all threads: the child with
//! the largest surface is divided until there are eight or none is worth it. There are few of these, and nothing has to be kept of their binary tree. The
//! tree is the same for any number of threads and any instruction set: what a range becomes depends on what is in it and above it,
//! chunks have a fixed size, and no arithmetic is fused.

mod binary;
mod bins;
mod children;
mod collapse;
pub(super) mod lanes;
pub(super) mod morton;
pub(super) mod presplit;
mod record;
mod split;
mod subtree;
mod sweep;
mod top;

use rayon::prelude::*;

use super::isa::{self, Isa};
use super::node::{Child, Node, Tree};
use super::preset::Options;
use super::room;
use children::Children;
pub(super) use record::{Record, triangle_items};
use split::{Range, Rule};
use subtree::SubtreeKernel;
use top::Shared;

/// Levels a tree can have: the stack of a walk is made for it.
pub(super) const MAX_DEPTH: usize = 36;

/// Ranges of at most this many items are tasks of one thread.
const TASK: u32 = 1 << 14;

/// Levels of nodes above tasks: whatever is below these is a task, of however many items. No mesh but one made for it gets there.
const TOP_LEVELS: usize = 18;

/// Levels of all nodes. One more is left for what others put below a tree's leaves (`clusters`).
const LEVELS: usize = MAX_DEPTH - 1;

/// What is below [`TOP_LEVELS`] can be made in three times as many levels of a binary tree, by halves at least.
const _: () = assert!(Child::NAMES as u64 >> (3 * (LEVELS - TOP_LEVELS)) == 0);

/// Cost of visiting a node, in tests of a block. Measured: with a half rates are the same and a triangle takes a byte more, with two rays are 1 to 4 % slower.
pub(super) const NODE_COST: f32 = 1.0;

/// A range that becomes a node and what is below it.
struct Task {
    range: Range,
    /// Levels above it.
    depth: usize,
}

/// A slot of a node.
#[derive(Clone, Copy)]
struct Slot {
    node: u32,
    slot: u32,
}

/// Reorders `items` so that every leaf is a range of them, and returns the tree whose leaves name these ranges.
/// `block`, a power of two, is how many items are tested together, `most` how many such blocks a leaf may hold, up to
/// [`Child::MOST`].
///
/// # Panics
/// With more than [`Child::NAMES`] items.
pub(super) fn build(items: &mut [Record], block: u32, most: u32, options: &Options<'_>) -> Tree {
    assert!(items.len() <= Child::NAMES, "more primitives than leaves can name");
    if items.is_empty() {
        return Tree::new(Vec::new());
    }
    let (rule, isa) = (Rule { block, leaf: block * most }, options.isa);
    let (top, tasks) = upper_nodes(items, &rule, isa);
    let in_top = items.len() - tasks.iter().map(|(_, task)| task.range.len as usize).sum::<usize>();
    let mut rest = items;
    let mut jobs = Vec::with_capacity(tasks.len());
    let mut first = 0;
    for (parent, task) in tasks {
        // Between them are leaves of the upper nodes.
        let (_, own) = rest.split_at_mut((task.range.first - first) as usize);
        let (own, others) = own.split_at_mut(task.range.len as usize);
        (rest, first) = (others, task.range.first + task.range.len);
        jobs.push((parent, task, own));
    }
    let built: Vec<(Option<Slot>, Vec<Node>)> = jobs
        .into_par_iter()
        .with_max_len(1)
        .map(|(parent, task, items)| {
            let count = items.len();
            let nodes = isa::dispatch(
                isa,
                SubtreeKernel { rule: &rule, items, range: task.range, levels: LEVELS - task.depth },
            );
            options.report(count);
            (parent, nodes)
        })
        .collect();
    options.report(in_top);
    Tree::new(join(top, built))
}

/// The nodes over everything of more than [`TASK`] items, down to [`TOP_LEVELS`], and the tasks below them, in the order of the items.
fn upper_nodes(items: &mut [Record], rule: &Rule, isa: Isa) -> (Vec<Node>, Vec<(Option<Slot>, Task)>) {
    let mut shared = Shared { rule, items, isa };
    let (mut nodes, mut tasks) = (Vec::new(), Vec::new());
    let mut open = vec![(None, Task { range: shared.whole(), depth: 0 })];
    while let Some((parent, task)) = open.pop() {
        if task.range.len <= TASK || task.depth == TOP_LEVELS {
            tasks.push((parent, task));
            continue;
        }
        let index = nodes.len() as u32;
        point(&mut nodes, parent, index);
        let children = Children::new(task.range, rule, &mut shared);
        nodes.push(children.node(rule));
        for (slot, child) in children.iter().rev().filter(|(_, child)| !child.is_leaf) {
            let parent = Slot { node: index, slot: slot as u32 };
            open.push((Some(parent), Task { range: child.range, depth: task.depth + 1 }));
        }
    }
    tasks.sort_by_key(|(_, task)| task.range.first);
    (nodes, tasks)
}

/// Puts the subtrees' nodes behind those above them.
fn join(mut top: Vec<Node>, subtrees: Vec<(Option<Slot>, Vec<Node>)>) -> Vec<Node> {
    let mut base = top.len();
    for (parent, subtree) in &subtrees {
        point(&mut top, *parent, base as u32);
        base += subtree.len();
    }
    let mut chunks = vec![(top.len(), (false, top))];
    chunks.extend(subtrees.into_iter().map(|(_, subtree)| (subtree.len(), (true, subtree))));
    room::fill(chunks, |(is_subtree, nodes): (bool, Vec<Node>), room| {
        let base = if is_subtree { room.first as u32 } else { 0 };
        for mut node in nodes {
            for child in node.child.iter_mut().filter(|child| !child.is_leaf()) {
                *child = Child::inner(base + child.node());
            }
            room.push(node);
        }
    })
}

/// Fills a slot: with a leaf over so many items from the first on, or with a node whose number is not known yet.
#[inline]
fn fill(node: &mut Node, slot: usize, bounds: &[f32; 8], leaf: Option<(u32, u32)>, rule: &Rule) {
    let mut child = Child::ROOT;
    if let Some((first, len)) = leaf {
        child = Child::leaf(first, len.div_ceil(rule.block));
        node.items[slot] = len as u8;
    }
    node.set(slot, &record::aabb(bounds), child);
}

/// Lets a child's slot name its node.
fn point(nodes: &mut [Node], slot: Option<Slot>, index: u32) {
    if let Some(Slot { node, slot }) = slot {
        nodes[node as usize].child[slot as usize] = Child::inner(index);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::*;
    use crate::math::{Aabb, Vec3};
    use crate::trace::bvh::random::Random;

    /// Boxes of a size, scattered by a linear congruence; numbered in order.
    fn items(count: u32, size: f32) -> Vec<Record> {
        let mut state = count;
        let mut unit = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut item = |i| {
            let min = Vec3::new(unit(), unit() - 0.5, unit() * 0.1);
            Record::new(&Aabb { min, max: min + Vec3::new(unit(), unit(), unit()) * size }, 7, i)
        };
        (0..count).map(&mut item).collect()
    }

    /// The box around a subtree, which every box above it must equal; marks its items.
    fn check(tree: &Tree, items: &[Record], node: Child, block: u32, seen: &mut [bool]) -> Aabb {
        let node = tree.node(node);
        let mut all = Aabb::EMPTY;
        for (slot, child) in node.children() {
            let inside = if !child.is_leaf() {
                check(tree, items, child, block, seen)
            } else {
                let len = usize::from(node.items[slot]);
                assert_eq!(child.count(), (len as u32).div_ceil(block));
                items[child.first() as usize..][..len].iter().fold(Aabb::EMPTY, |sum, item| {
                    assert_eq!(item.part(), 7);
                    assert!(!std::mem::replace(&mut seen[item.primitive() as usize], true), "in one leaf only");
                    sum.union(record::aabb(&item.0))
                })
            };
            assert_eq!(node.child_bounds(slot), inside);
            all = all.union(inside);
        }
        all
    }

    #[test]
    fn every_item_is_in_one_leaf_and_boxes_are_tight() {
        for (count, size, block) in
            [(1, 1.0, 4), (5, 1.0, 4), (33, 0.1, 1), (1000, 0.3, 4), (70_000, 0.01, 4), (200_000, 0.0, 1)]
        {
            let mut items = items(count, size);
            let reported = AtomicU64::new(0);
            let progress = |count| _ = reported.fetch_add(count, Ordering::Relaxed);
            let tree =
                build(&mut items, block, Child::MOST, &Options { progress: Some(&progress), ..Options::default() });
            assert_eq!(reported.into_inner(), u64::from(count));
            let mut seen = vec![false; items.len()];
            check(&tree, &items, Child::ROOT, block, &mut seen);
            assert!(seen.iter().all(|&seen| seen), "{count} items");
        }
    }

    fn levels(tree: &Tree, node: Child) -> usize {
        let inner = tree.node(node).children().filter(|(_, child)| !child.is_leaf());
        1 + inner.map(|(_, child)| levels(tree, child)).max().unwrap_or(0)
    }

    /// Clusters, each half as large as the one before and beside it: the upper nodes, the binary trees below and the nodes chosen from these would all be deeper
    /// than they may.
    #[test]
    fn no_tree_is_deeper_than_a_walk_allows() {
        for (clusters, each) in [(100, 500), (120, 4000)] {
            let mut state = Random::new(3);
            let item = |i: u32| {
                let size = 0.5f32.powi((i / each) as i32);
                let corner = Vec3::splat(size) + state.vec3().abs() * size / 4.0;
                Record::new(&Aabb { min: corner, max: corner + Vec3::splat(size / 64.0) }, 7, i)
            };
            let mut items: Vec<Record> = (0..clusters * each).map(item).collect();
            let tree = build(&mut items, 1, 1, &Options::default());
            let mut seen = vec![false; items.len()];
            check(&tree, &items, Child::ROOT, 1, &mut seen);
            assert!(seen.iter().all(|&seen| seen));
            let levels = levels(&tree, Child::ROOT);
            assert!((28..MAX_DEPTH).contains(&levels), "{clusters} of {each}: {levels} levels");
        }
    }

    #[test]
    fn instruction_sets_and_threads_give_the_same_tree() {
        let build = |isa, threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let mut items = items(60_000, 0.02);
            let tree = pool.install(|| build(&mut items, 4, Child::MOST, &Options { isa, ..Options::default() }));
            let numbers: Vec<u32> = items.iter().map(Record::primitive).collect();
            (format!("{tree:?}"), numbers)
        };
        let expected = build(Isa::Portable, 1);
        for threads in [1, 3] {
            assert!(build(Isa::detect(), threads) == expected);
        }
    }
}
