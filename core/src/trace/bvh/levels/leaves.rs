//! What leaves of triangles hold: blocks of corners, or numbers of triangles whose corners are fetched from the mesh.

use rayon::prelude::*;

use super::numbers::{Blocks, NONE, Numbers, numbered};
use crate::math::{Aabb, is_traceable};
use crate::memory::Array;
use crate::memory::room;
use crate::trace::bvh::block::{Block, LANES, Lane};
use crate::trace::bvh::build::Record;
use crate::trace::bvh::meshes::Meshes;
use crate::trace::bvh::node::{Child, Node, WIDTH};
use crate::trace::bvh::simd::{Portable, Simd};
use crate::trace::bvh::tree::Tree;

/// The blocks of a tree of triangles.
pub(in crate::trace::bvh) enum Leaves {
    /// 45 bytes a triangle where blocks are full.
    Blocks(Array<Block>),
    /// 4 bytes a triangle, but to reach a corner takes two steps through memory.
    Numbers(Numbers),
}

/// Nodes that are gone through by one thread.
const CHUNK: usize = 64;

impl Leaves {
    /// Makes the blocks of `tree`, whose leaves name ranges of `items`, triangles of `meshes`, and lets these name
    /// ranges of blocks instead.
    pub fn new(tree: &mut Tree, items: &[Record], meshes: Meshes, compact: bool) -> Self {
        if compact {
            let block =
                |items: &[Record]| numbered(items.iter().map(|item| meshes.number(item.part(), item.primitive())));
            return Self::of_numbers(blocks(tree, items, block), meshes);
        }
        Self::of_blocks(blocks(tree, items, |items| {
            let mut block = Block::EMPTY;
            for item in items {
                let (part, primitive) = (item.part(), item.primitive());
                block.push(meshes.of_part(part).corners(primitive), part, primitive);
            }
            block
        }))
    }

    /// Blocks that leaves name already.
    pub fn of_blocks(blocks: impl Into<Array<Block>>) -> Self {
        Self::Blocks(blocks.into())
    }

    /// Blocks of numbers of `meshes`' triangles.
    pub fn of_numbers(blocks: impl Into<Array<[u32; LANES]>>, meshes: Meshes) -> Self {
        Self::Numbers(Numbers::new(blocks, meshes))
    }

    /// Block `index`, of those that the leaves name; `scratch` is where it may be put together.
    #[inline(always)]
    pub fn block<'a, S: Simd>(&'a self, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        match self {
            Self::Blocks(blocks) => &blocks[index as usize],
            Self::Numbers(numbers) => numbers.put_together::<S>(index, scratch),
        }
    }

    /// The box around a block's triangles.
    #[inline]
    pub fn bounds(&self, index: u32) -> Aabb {
        match self {
            Self::Blocks(blocks) => blocks[index as usize].bounds(),
            Self::Numbers(numbers) => numbers.bounds(index),
        }
    }

    /// How many blocks there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Blocks(blocks) => blocks.len(),
            Self::Numbers(numbers) => numbers.blocks().len(),
        }
    }

    /// The blocks as they lie in memory.
    pub fn as_bytes(&self) -> &[u8] {
        match self {
            Self::Blocks(blocks) => bytemuck::cast_slice(blocks),
            Self::Numbers(numbers) => bytemuck::cast_slice(numbers.blocks()),
        }
    }

    /// The numbers of a block's triangles, and how many there are; none where it is not a block of triangles of
    /// `meshes` as it would be made.
    pub fn numbers(&self, index: u32, meshes: &Meshes) -> Option<([u32; LANES], usize)> {
        let (numbers, is_sound) = match self {
            Self::Blocks(blocks) => {
                let block = blocks.get(index as usize)?;
                let (mut numbers, mut again) = ([NONE; LANES], Block::EMPTY);
                for lane in block.used() {
                    numbers[lane] = meshes.checked_number(block.part[lane], block.primitive[lane])?;
                    meshes.push(&mut again, numbers[lane]);
                }
                (numbers, bytemuck::bytes_of(&again) == bytemuck::bytes_of(block))
            }
            Self::Numbers(own) => {
                let (numbers, most) = (*own.blocks().get(index as usize)?, meshes.triangle_count());
                (numbers, numbers.iter().all(|&number| number == NONE || (number as usize) < most))
            }
        };
        let count = numbers.iter().filter(|&&number| number != NONE).count();
        // The used lanes come first.
        let is_sound = is_sound && count > 0 && numbers[..count].iter().all(|&n| n != NONE);
        is_sound.then_some((numbers, count))
    }

    /// Takes the corners of `meshes`, whose triangles are the same. Whether all of them can still be hit.
    pub fn refit(&mut self, meshes: &Meshes) -> bool {
        let is_sound = |block: &Block| block.used().flat_map(|lane| block.triangle(lane)).all(is_traceable);
        match self {
            Self::Blocks(blocks) => blocks
                .make_mut()
                .par_iter_mut()
                .with_min_len(room::few::<Block>())
                .map(|block| {
                    let old = std::mem::replace(block, Block::EMPTY);
                    for lane in old.used() {
                        let (part, primitive) = (old.part[lane], old.primitive[lane]);
                        block.push(meshes.of_part(part).corners(primitive), part, primitive);
                    }
                    is_sound(block)
                })
                .reduce(|| true, |a, b| a && b),
            Self::Numbers(numbers) => {
                numbers.set_meshes(meshes.clone());
                let count = numbers.blocks().len() as u32;
                (0..count)
                    .into_par_iter()
                    .with_min_len(room::few::<Block>())
                    .all(|index| is_sound(numbers.put_together::<Portable>(index, &mut None)))
            }
        }
    }

    /// Takes the triangles of those parts that are gone out of some blocks; how many these were. None where the tree
    /// does not hold its triangles itself.
    pub fn take_out(&mut self, is_gone: &[bool], blocks: &[u32]) -> Option<usize> {
        let Self::Blocks(own) = self else { return None };
        let (own, mut count) = (own.make_mut(), 0);
        for &index in blocks {
            let block = &mut own[index as usize];
            let gone = block.used().filter(|&lane| is_gone[block.part[lane] as usize]);
            let lanes = gone.fold(0, |lanes, lane| lanes | 1 << lane);
            block.lanes &= !lanes;
            count += lanes.count_ones() as usize;
        }
        Some(count)
    }

    /// Where in memory a block is.
    #[inline(always)]
    pub fn address<S: Simd>(&self, index: u32) -> *const u8 {
        match self {
            Self::Blocks(blocks) => blocks.address::<S>(index),
            Self::Numbers(numbers) => numbers.address::<S>(index),
        }
    }

    /// Triangle `id`: lane `id % 8` of block `id / 8`; `scratch` is where a block may be put together that has this one
    /// alone.
    #[inline(always)]
    pub fn lane<'a>(&'a self, id: u32, scratch: &'a mut Option<Block>) -> Lane<'a> {
        let (index, lane) = ((id / LANES as u32) as usize, id as usize % LANES);
        match self {
            Self::Blocks(blocks) => Lane { block: &blocks[index], lane },
            Self::Numbers(numbers) => numbers.lane(index, lane, scratch),
        }
    }

    /// Memory it holds, in bytes, without the meshes.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Blocks(blocks) => size_of_val(&blocks[..]),
            Self::Numbers(numbers) => size_of_val(numbers.blocks()),
        }
    }
}

/// One block for each eight items of a leaf.
fn blocks<T: Send>(tree: &mut Tree, items: &[Record], block: impl Fn(&[Record]) -> T + Sync) -> Vec<T> {
    let of_node = |node: &Node| node.items.iter().map(|&items| usize::from(items).div_ceil(LANES)).sum::<usize>();
    let chunks = tree.nodes_mut().par_chunks_mut(CHUNK);
    let counted = chunks.map(|nodes| (nodes.iter().map(of_node).sum(), nodes)).collect();
    room::fill(counted, |nodes, room| {
        for node in nodes {
            for slot in (0..WIDTH).filter(|&slot| node.items[slot] > 0) {
                let child = &mut node.child[slot];
                let items = &items[child.first() as usize..][..usize::from(node.items[slot])];
                *child = Child::leaf((room.first + room.len()) as u32, child.count());
                items.chunks(LANES).for_each(|items| room.push(block(items)));
            }
        }
    })
}
