//! The fast preset: clusters of triangles along a curve, a node each, and a tree above them. See [`morton`].

use rayon::prelude::*;

use super::block::{Block, LANES};
use super::build::{self, Record, morton};
use super::leaves::Leaves;
use super::meshes::Meshes;
use super::node::{Child, Node, Tree, WIDTH};
use super::preset::Options;
use super::room;
use crate::trace::Part;

/// Clusters that are made by one thread.
const CHUNK: usize = 256;

/// The tree over the traceable triangles of `parts`, its leaves, and how many triangles these are.
pub(super) fn build(parts: &[Part], options: &Options<'_>) -> (Tree, Leaves, usize) {
    let meshes = Meshes::new(parts);
    let sorted = morton::sorted(&meshes);
    let lengths = morton::clusters(&sorted, WIDTH * LANES);
    let mut rest = &sorted[..];
    let mut chunks = Vec::with_capacity(lengths.len() / CHUNK + 1);
    for lengths in lengths.chunks(CHUNK) {
        let (own, others) = rest.split_at(lengths.iter().sum());
        rest = others;
        chunks.push((lengths.iter().map(|len| len.div_ceil(LANES)).sum(), (lengths, own)));
    }
    let counts: Vec<usize> = chunks.iter().map(|(count, _)| *count).collect();
    let blocks = room::fill(chunks, |(lengths, mut rest), room| {
        options.report(rest.len());
        for &len in lengths {
            let (own, others) = rest.split_at(len);
            rest = others;
            for four in own.chunks(LANES) {
                let mut block = Block::EMPTY;
                four.iter().for_each(|item| meshes.push(&mut block, item.number));
                room.push(block);
            }
        }
    });
    let count = sorted.len();
    drop(sorted);

    let mut first = 0;
    let chunks = lengths.chunks(CHUNK).zip(counts).map(|(lengths, count)| {
        first += count;
        (lengths.len(), (lengths, first - count))
    });
    let mut nodes = room::fill(chunks.collect(), |(lengths, mut first): (&[usize], usize), room| {
        for &len in lengths {
            let count = len.div_ceil(LANES);
            room.push(node(&blocks[first..first + count], first as u32));
            first += count;
        }
    });
    let item = |(index, node): (usize, &Node)| Record::new(&node.bounds(), 0, index as u32);
    let mut items = crate::memory::with_capacity(nodes.len());
    items.par_extend(nodes.par_iter().enumerate().map(item));
    let above = build::build(&mut items, 1, 1, &Options { progress: None, ..*options });
    (above.over(&items, &mut nodes), Leaves::of_blocks(blocks), count)
}

/// The node over up to eight blocks, the first of which has the index `first`.
fn node(blocks: &[Block], first: u32) -> Node {
    let mut node = Node::empty();
    for (slot, block) in blocks.iter().enumerate() {
        node.set(slot, &block.bounds(), Child::leaf(first + slot as u32, 1));
    }
    node
}
