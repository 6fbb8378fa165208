//! What leaves of triangles hold: blocks of corners, or numbers of triangles whose corners are fetched from the mesh.

use std::sync::Arc;

use rayon::prelude::*;

use super::block::{Block, LANES};
use super::build::{Record, morton};
use super::memory;
use super::node::{NO_CHILD, Node, Tree, WIDTH};
use crate::math::Vec3;
use crate::trace::{Part, Primitives};

/// The blocks of a tree of triangles.
pub(super) enum Leaves {
    /// 45 bytes a triangle where blocks are full.
    Blocks(Vec<Block>),
    /// 4 bytes a triangle, but to reach a corner takes two steps through memory.
    Numbers(Numbers),
}

/// Blocks of triangle numbers.
pub(super) struct Numbers {
    blocks: Vec<[u32; LANES]>,
    meshes: Vec<Mesh>,
}

/// Fills a block's lanes that have no triangle.
const NONE: u32 = u32::MAX;

/// A mesh, shared with the scene.
struct Mesh {
    /// Number of its first triangle.
    first: u32,
    part: u32,
    positions: Arc<Vec<Vec3>>,
    triangles: Arc<Vec<[u32; 3]>>,
}

/// Nodes that are gone through by one thread.
const CHUNK: usize = 512;

impl Leaves {
    /// Makes the blocks of `tree`, whose leaves name ranges of `items`, and lets these name ranges of blocks instead.
    pub fn new(tree: &mut Tree, items: &[Record], parts: &[Part], compact: bool) -> Self {
        if compact {
            let meshes = Numbers::meshes(parts);
            let firsts = Numbers::firsts(&meshes, parts.len());
            let block = |items: &[Record]| {
                let mut block = [NONE; LANES];
                for (number, item) in block.iter_mut().zip(items) {
                    *number = firsts[item.part() as usize] + item.primitive();
                }
                block
            };
            return Self::Numbers(Numbers { blocks: blocks(tree, items, block), meshes });
        }
        Self::Blocks(blocks(tree, items, |items| {
            let mut block = Block::EMPTY;
            for item in items {
                let Primitives::Triangles { positions, triangles } = &parts[item.part() as usize].primitives else {
                    unreachable!("items of a triangle tree come from meshes")
                };
                block.push(corners(positions, &triangles[item.primitive() as usize]), item.part(), item.primitive());
            }
            block
        }))
    }

    /// Blocks of four triangles each that follow one another along a curve.
    pub fn along_curve(parts: &[Part]) -> Self {
        let numbers = Numbers { blocks: Vec::new(), meshes: Numbers::meshes(parts) };
        let sorted = morton::sorted(parts, &Numbers::firsts(&numbers.meshes, parts.len()));
        let chunks = sorted.chunks(CHUNK * LANES).map(|chunk| (chunk.len().div_ceil(LANES), chunk)).collect();
        Self::Blocks(memory::fill(chunks, |chunk, room| {
            for four in chunk.chunks(LANES) {
                let mut block = Block::EMPTY;
                for item in four {
                    let (mesh, primitive) = numbers.find(item.number);
                    block.push(corners(&mesh.positions, &mesh.triangles[primitive as usize]), mesh.part, primitive);
                }
                room.push(block);
            }
        }))
    }

    /// One item for each block, numbered in order.
    pub fn items(&self) -> Vec<Record> {
        let count = match self {
            Self::Blocks(blocks) => blocks.len(),
            Self::Numbers(numbers) => numbers.blocks.len(),
        };
        let item = |index: usize| Record::new(&self.block(index as u32, &mut None).bounds(), 0, index as u32);
        let mut items = memory::with_capacity(count);
        items.par_extend((0..count).into_par_iter().map(item));
        items
    }

    /// Block `index`, of those that the leaves name; `scratch` is where it may be put together.
    #[inline(always)]
    pub fn block<'a>(&'a self, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        match self {
            Self::Blocks(blocks) => &blocks[index as usize],
            Self::Numbers(numbers) => scratch.insert(numbers.block(index)),
        }
    }

    /// Part and index in it of a triangle: lane `id % 4` of block `id / 4`.
    #[inline(always)]
    pub fn number(&self, id: u32) -> (u32, u32) {
        let (block, lane) = ((id / LANES as u32) as usize, id as usize % LANES);
        match self {
            Self::Blocks(blocks) => (blocks[block].part[lane], blocks[block].primitive[lane]),
            Self::Numbers(numbers) => {
                let (mesh, primitive) = numbers.find(numbers.blocks[block][lane]);
                (mesh.part, primitive)
            }
        }
    }

    /// Memory it holds, in bytes, without the meshes.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Blocks(blocks) => size_of_val(&blocks[..]),
            Self::Numbers(numbers) => size_of_val(&numbers.blocks[..]) + size_of_val(&numbers.meshes[..]),
        }
    }
}

/// One block for each four items of a leaf.
fn blocks<T: Send>(tree: &mut Tree, items: &[Record], block: impl Fn(&[Record]) -> T + Sync) -> Vec<T> {
    let count = |count: u8| if count == NO_CHILD { 0 } else { usize::from(count).div_ceil(LANES) };
    let of_node = |node: &Node| node.count.map(count).iter().sum::<usize>();
    let chunks = tree.nodes_mut().par_chunks_mut(CHUNK);
    let counted = chunks.map(|nodes| (nodes.iter().map(of_node).sum(), nodes)).collect();
    memory::fill(counted, |nodes, room| {
        for node in nodes {
            for slot in 0..WIDTH {
                let len = count(node.count[slot]);
                if len > 0 {
                    let first = node.index[slot] as usize;
                    node.index[slot] = (room.first + room.len()) as u32;
                    items[first..first + usize::from(node.count[slot])]
                        .chunks(LANES)
                        .for_each(|items| room.push(block(items)));
                    node.count[slot] = len as u8;
                }
            }
        }
    })
}

#[inline(always)]
fn corners(positions: &[Vec3], triangle: &[u32; 3]) -> [Vec3; 3] {
    triangle.map(
        #[inline(always)]
        |corner| positions[corner as usize],
    )
}

impl Numbers {
    /// The meshes among `parts`.
    fn meshes(parts: &[Part]) -> Vec<Mesh> {
        let mut first = 0;
        let mesh = |(part, description): (usize, &Part)| {
            let Primitives::Triangles { positions, triangles } = &description.primitives else { return None };
            let (positions, triangles) = (Arc::clone(positions), Arc::clone(triangles));
            let mesh = Mesh { first, part: part as u32, positions, triangles };
            first += mesh.triangles.len() as u32;
            Some(mesh)
        };
        parts.iter().enumerate().filter_map(mesh).collect()
    }

    /// Of each part the number of its first triangle.
    fn firsts(meshes: &[Mesh], parts: usize) -> Vec<u32> {
        let mut firsts = vec![0; parts];
        for mesh in meshes {
            firsts[mesh.part as usize] = mesh.first;
        }
        firsts
    }

    /// The mesh of a triangle, and the triangle's index in it.
    #[inline(always)]
    fn find(&self, number: u32) -> (&Mesh, u32) {
        let mesh = match &self.meshes[..] {
            [mesh] => mesh,
            meshes => &meshes[meshes.partition_point(|mesh| mesh.first <= number) - 1],
        };
        (mesh, number - mesh.first)
    }

    #[inline]
    fn block(&self, index: u32) -> Block {
        let mut block = Block::EMPTY;
        for &number in self.blocks[index as usize].iter().filter(|&&number| number != NONE) {
            let (mesh, primitive) = self.find(number);
            block.push(corners(&mesh.positions, &mesh.triangles[primitive as usize]), mesh.part, primitive);
        }
        block
    }
}
