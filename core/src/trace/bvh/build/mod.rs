//! From a list of boxes to a tree: binned surface area heuristic (Wald 2007, *On fast construction of SAH-based
//! bounding volume hierarchies*), and of the binary tree that comes of it nodes of eight children (Ylitie, Karras,
//! Laine 2017, *Efficient incoherent ray traversal on GPUs through compressed wide BVHs*).
//!
//! | file | idea |
//! | --- | --- |
//! | `record` | a box in one register, as [-min, max]; arithmetic with it, `simd/boxes` |
//! | `split` | a range of items, and how it is divided in two |
//! | `bins` | the best plane between bins, for large ranges |
//! | `sweep` | the best of all divisions, for small ones |
//! | `binary` | a subtree's items, divided again and again |
//! | `collapse` | which branches of that become nodes |
//! | `children` | a node above the subtrees |
//! | `subtree`, `top` | small ranges, large ones |
//! | `spatial/` | large triangles in several places: the high preset |
//! | `morton` | neighbours along a curve: the fast preset |
//!
//! Ranges of items are divided in two until they fill a block, and of the branches of that binary tree those become
//! nodes that make the wide one cheapest. Leaves are charged by blocks, ceil(n / block), so that they fill.
//!
//! That is done for subtrees, each by one thread unless there are few. Of a node above these the child with the largest
//! surface is divided until there are eight or none is worth it, and what is below each child is made beside the
//! others. There are few of these nodes, and nothing has to be kept of their binary tree. The tree is the same for any
//! number of threads and any instruction set: what a range becomes depends on what is in it and above it, chunks have a
//! fixed size, and no arithmetic is fused.

mod binary;
mod bins;
mod children;
mod collapse;
pub(super) mod morton;
pub(super) mod preset;
mod record;
pub(super) mod spatial;
mod split;
mod subtree;
mod sweep;
mod top;

use rayon::prelude::*;

use self::preset::{Options, Preset};
use super::node::{Child, Node};
use super::tree::Tree;
use crate::memory::room;
use children::Children;
pub(super) use record::{Record, triangle_items};
use split::{PrimitiveRange, Rule};
use subtree::Subtree;
use top::Shared;

/// Levels a tree can have: the stack of a walk is made for it.
pub(super) const MAX_DEPTH: usize = 36;

/// Ranges of at most this many items are subtrees.
const TASK: u32 = 1 << 14;

/// Where there are fewer subtrees for each thread than this, several threads make one.
const FEW: usize = 4;

/// Levels of nodes above subtrees: whatever is below these is one, of however many items. No mesh but one made for it
/// gets there.
const TOP_LEVELS: usize = 18;

/// Levels of all nodes. One more is left for what others put below a tree's leaves (`clusters`).
const LEVELS: usize = MAX_DEPTH - 1;

/// What is below [`TOP_LEVELS`] can be made in three times as many levels of a binary tree, by halves at least.
const _: () = assert!(Child::NAMES as u64 >> (3 * (LEVELS - TOP_LEVELS)) == 0);

/// A slot of a node.
#[derive(Clone, Copy)]
struct Slot {
    node: u32,
    slot: u32,
}

/// What a range became.
enum Built {
    /// A node, without the indices of its inner ones, and what is in those of its slots.
    Upper { node: Box<Node>, below: Vec<(usize, Built)> },
    /// The nodes over items from the first on, each before what is below it.
    Subtree { first: u32, nodes: Vec<Node> },
}

/// Reorders `items` so that every leaf is a range of them, and returns the tree whose leaves name these ranges.
/// `block`, a power of two, is how many items are tested together, `most` how many such blocks a leaf may hold, up to
/// [`Child::MAX`].
///
/// # Panics
/// With more than [`Child::NAMES`] items, and where this processor does not have `options.isa`.
pub(super) fn build(items: &mut [Record], block: u32, most: u32, options: &Options<'_>) -> Tree {
    build_beside(0, items, block, most, options)
}

/// The same while so many `others` of its size are built.
///
/// # Panics
/// As [`build`].
pub(super) fn build_beside(others: usize, items: &mut [Record], block: u32, most: u32, options: &Options<'_>) -> Tree {
    assert!(items.len() <= Child::NAMES, "more primitives than leaves can name");
    if items.is_empty() {
        return Tree::new(Vec::new());
    }
    let threads = rayon::current_num_threads();
    let is_small = threads > 1 && items.len().saturating_mul(1 + others) < threads * FEW * TASK as usize;
    let rule = Rule { block, leaf: block * most, samples: options.preset != Preset::High };
    let builder = Builder { rule: &rule, is_small, options };
    let whole = top::whole(items, options.isa.demand());
    Tree::new(in_order(builder.build(whole, items, 0)))
}

/// What all ranges are built with.
#[derive(Clone, Copy)]
struct Builder<'a> {
    rule: &'a Rule,
    /// Whether there are too few subtrees for each to be made by one thread.
    is_small: bool,
    options: &'a Options<'a>,
}

impl Builder<'_> {
    /// Of `items`, which are those of `range`, with so many levels above them.
    fn build(self, range: PrimitiveRange, items: &mut [Record], depth: usize) -> Built {
        let Self { rule, is_small, options } = self;
        let isa = options.isa.demand();
        if range.len <= TASK || depth == TOP_LEVELS {
            let subtree = Subtree { rule, items, range, levels: LEVELS - depth };
            let nodes = if is_small { subtree.nodes_by_all(isa) } else { subtree.nodes(isa) };
            options.report(range.len as usize);
            return Built::Subtree { first: range.first, nodes };
        }
        let children = Children::new(range, &mut Shared { rule, items, base: range.first, isa });
        let mut inner: Vec<(usize, PrimitiveRange)> =
            children.iter().filter(|(_, child)| !child.is_leaf).map(|(slot, child)| (slot, child.range)).collect();
        options.report((range.len - inner.iter().map(|(_, range)| range.len).sum::<u32>()) as usize);
        inner.sort_by_key(|(_, range)| range.first);
        // Between them are leaves.
        let own = top::parts(items, inner.iter().map(|(_, inner)| inner.within(range.first)));
        let below = inner.into_par_iter().zip(own).with_max_len(1);
        let below = below.map(|((slot, range), items)| (slot, self.build(range, items, depth + 1)));
        Built::Upper { node: Box::new(children.node(rule)), below: below.collect() }
    }
}

/// All nodes: the upper ones, each before what is below it, and then the subtrees in the order of their items.
fn in_order(built: Built) -> Vec<Node> {
    let (mut top, mut subtrees) = (Vec::new(), Vec::new());
    let mut open = vec![(None, built)];
    while let Some((parent, built)) = open.pop() {
        match built {
            Built::Subtree { first, nodes } => subtrees.push((parent, first, nodes)),
            Built::Upper { node, mut below } => {
                let index = top.len() as u32;
                point(&mut top, parent, index);
                top.push(*node);
                below.sort_by_key(|(slot, _)| std::cmp::Reverse(*slot));
                let slot = |slot| Some(Slot { node: index, slot: slot as u32 });
                open.extend(below.into_iter().map(|(at, built)| (slot(at), built)));
            }
        }
    }
    subtrees.sort_by_key(|(_, first, _)| *first);
    join(top, subtrees.into_iter().map(|(parent, _, nodes)| (parent, nodes)).collect())
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
    use crate::trace::bvh::node::widened;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::isa::Isa;

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

    /// The box around a subtree, which every box above it must equal, widened; marks its items.
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
            assert_eq!(node.child_bounds(slot), widened(&inside));
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
                build(&mut items, block, Child::MAX, &Options { progress: Some(&progress), ..Options::default() });
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

    /// Clusters, each half as large as the one before and beside it: the upper nodes, the binary trees below and the
    /// nodes chosen from these would all be deeper than they may.
    fn shrinking(clusters: u32, each: u32) -> Vec<Record> {
        let mut state = Random::new(3);
        let item = |i: u32| {
            let size = 0.5f32.powi((i / each) as i32);
            let corner = Vec3::splat(size) + state.vec3().abs() * size / 4.0;
            Record::new(&Aabb { min: corner, max: corner + Vec3::splat(size / 64.0) }, 7, i)
        };
        (0..clusters * each).map(item).collect()
    }

    #[test]
    fn no_tree_is_deeper_than_a_walk_allows() {
        for (clusters, each) in [(100, 500), (120, 4000)] {
            let mut items = shrinking(clusters, each);
            let tree = build(&mut items, 1, 1, &Options::default());
            let mut seen = vec![false; items.len()];
            check(&tree, &items, Child::ROOT, 1, &mut seen);
            assert!(seen.iter().all(|&seen| seen));
            let levels = levels(&tree, Child::ROOT);
            assert!((28..MAX_DEPTH).contains(&levels), "{clusters} of {each}: {levels} levels");
        }
    }

    /// With few subtrees for each thread, which are made in pieces, and with many.
    #[test]
    fn instruction_sets_and_threads_give_the_same_tree() {
        let cases = [items(60_000, 0.02), items(150_000, 0.02), items(20_000, 0.0), shrinking(100, 500)];
        let coincident: Vec<Record> = (0..20_000).map(|i| Record::new(&items(1, 1.0)[0].bounds(), 7, i)).collect();
        for case in cases.into_iter().chain([coincident]) {
            let build = |isa, threads, others| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
                let mut items = case.clone();
                let options = Options { isa, ..Options::default() };
                let tree = pool.install(|| build_beside(others, &mut items, 2, 2, &options));
                let numbers: Vec<u32> = items.iter().map(Record::primitive).collect();
                (format!("{tree:?}"), numbers)
            };
            let expected = build(Isa::Portable, 1, 0);
            for isa in Isa::available() {
                for (threads, others) in [(1, 0), (2, 0), (3, 0), (3, 1000)] {
                    let same = build(isa, threads, others) == expected;
                    assert!(same, "{isa:?}, {} items, {threads} threads, {others} beside", case.len());
                }
            }
        }
    }
}
