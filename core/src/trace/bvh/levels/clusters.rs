//! The fast presets: clusters of triangles along a curve, a node each, and a tree above them. See [`morton`].

use rayon::prelude::*;

use super::leaves::Leaves;
use super::numbers::numbered;
use crate::memory::room;
use crate::trace::Part;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::build::preset::Options;
use crate::trace::bvh::build::{self, Record, morton};
use crate::trace::bvh::meshes::Meshes;
use crate::trace::bvh::node::{Child, Node, WIDTH};
use crate::trace::bvh::tree::Tree;
use morton::Coded;

/// Clusters that are made by one thread.
const CHUNK: usize = 256;

/// The tree over the traceable triangles of `parts`, its leaves, and how many triangles these are.
pub(super) fn build(parts: &[Part], options: &Options<'_>) -> (Tree, Leaves, usize) {
    let meshes = Meshes::new(parts);
    let sorted = morton::sorted(&meshes);
    let count = sorted.len();
    let lengths = morton::clusters(&sorted, WIDTH * LANES);
    let leaves = if options.preset.is_compact() {
        let block = |items: &[Coded]| numbered(items.iter().map(|item| item.number));
        Leaves::of_numbers(blocks(&sorted, &lengths, options, block), meshes)
    } else {
        Leaves::of_blocks(blocks(&sorted, &lengths, options, |items| {
            let mut block = Block::EMPTY;
            items.iter().for_each(|item| meshes.push(&mut block, item.number));
            block
        }))
    };
    drop(sorted);
    let nodes = nodes(&lengths, &leaves);
    let item = |(index, node): (usize, &Node)| Record::new(&node.bounds(), 0, index as u32);
    let mut items = crate::memory::with_capacity(nodes.len());
    items.par_extend(nodes.par_iter().with_min_len(room::few::<Record>()).enumerate().map(item));
    let above = build::build(&mut items, 1, 1, &Options { progress: None, ..*options });
    (above.over(nodes, |item| items[item as usize].primitive()), leaves, count)
}

/// The blocks of clusters of such lengths, each of up to eight items that follow one another.
fn blocks<T: Send>(
    sorted: &[Coded],
    lengths: &[usize],
    options: &Options<'_>,
    block: impl Fn(&[Coded]) -> T + Sync,
) -> Vec<T> {
    let mut rest = sorted;
    let chunks = lengths.chunks(CHUNK).map(|lengths| {
        let (own, others) = rest.split_at(lengths.iter().sum());
        rest = others;
        (count(lengths), (lengths, own))
    });
    room::fill(chunks.collect(), |(lengths, mut rest), room| {
        options.report(rest.len());
        for &len in lengths {
            let (own, others) = rest.split_at(len);
            rest = others;
            own.chunks(LANES).for_each(|items| room.push(block(items)));
        }
    })
}

/// How many blocks clusters of such lengths have.
fn count(lengths: &[usize]) -> usize {
    lengths.iter().map(|len| len.div_ceil(LANES)).sum()
}

/// A node for each cluster of such a length, over its blocks.
fn nodes(lengths: &[usize], leaves: &Leaves) -> Vec<Node> {
    let mut first = 0;
    let chunks = lengths.chunks(CHUNK).map(|lengths| {
        let own = first;
        first += count(lengths) as u32;
        (lengths.len(), (lengths, own))
    });
    room::fill(chunks.collect(), |(lengths, mut first), room| {
        for &len in lengths {
            let mut node = Node::empty();
            for slot in 0..len.div_ceil(LANES) {
                node.set(slot, &leaves.bounds(first), Child::leaf(first, 1));
                first += 1;
            }
            room.push(node);
        }
    })
}
