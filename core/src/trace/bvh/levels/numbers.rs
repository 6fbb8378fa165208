//! Blocks that are there, or are put together from numbers of triangles, whose corners are fetched from the mesh, when
//! one is asked for.

use crate::math::{Aabb, Vec3};
use crate::memory::Array;
use crate::trace::bvh::block::{Block, LANES, Lane, rounded_up};
use crate::trace::bvh::meshes::{Mesh, Meshes};
use crate::trace::bvh::simd::isa::Kernel;
use crate::trace::bvh::simd::{Array as _, Simd, Vector};

/// Blocks by their numbers.
pub(in crate::trace::bvh) trait Blocks {
    /// Whether corners are fetched from the mesh when a block is asked for.
    const IS_PUT_TOGETHER: bool;
    /// Block `index`; `scratch` is where it may be put together.
    fn block<'a, S: Simd>(&'a self, index: u32, scratch: &'a mut Option<Block>) -> &'a Block;
    /// Where in memory it is.
    fn address<S: Simd>(&self, index: u32) -> *const u8;
    /// The numbers, where corners are fetched from so far that it helps to have them loaded before: first the triangles
    /// of a block, then their vertices.
    #[inline(always)]
    fn far(&self) -> Option<&Numbers> {
        None
    }
}

impl Blocks for [Block] {
    const IS_PUT_TOGETHER: bool = false;
    #[inline(always)]
    fn block<'a, S: Simd>(&'a self, index: u32, _: &'a mut Option<Block>) -> &'a Block {
        &self[index as usize]
    }
    #[inline(always)]
    fn address<S: Simd>(&self, index: u32) -> *const u8 {
        S::address(self, index)
    }
}

/// Blocks of triangle numbers.
pub(in crate::trace::bvh) struct Numbers {
    blocks: Array<[u32; LANES]>,
    meshes: Meshes,
    /// Whether the meshes are of [`FAR`] bytes or more.
    are_far: bool,
}

/// Fills a block's lanes that have no triangle.
pub(super) const NONE: u32 = u32::MAX;

/// Bytes of meshes from which on their corners are fetched ahead: on nefertiti (2 MB) that costs diffuse rays a tenth,
/// with 13 MB it gains as much, with 360 MB two thirds.
const FAR: usize = 8 << 20;

/// A block of the numbers of up to eight triangles.
#[inline(always)]
pub(super) fn numbered(triangles: impl Iterator<Item = u32>) -> [u32; LANES] {
    let mut block = [NONE; LANES];
    block.iter_mut().zip(triangles).for_each(|(number, triangle)| *number = triangle);
    block
}

impl Blocks for Numbers {
    const IS_PUT_TOGETHER: bool = true;
    #[inline(always)]
    fn block<'a, S: Simd>(&'a self, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        self.put_together::<S>(index, scratch)
    }
    #[inline(always)]
    fn address<S: Simd>(&self, index: u32) -> *const u8 {
        S::address(&self.blocks, index)
    }
    #[inline(always)]
    fn far(&self) -> Option<&Numbers> {
        self.are_far.then_some(self)
    }
}

/// A block is put together from the numbers of its triangles.
struct PutTogether<'a> {
    numbers: &'a Numbers,
    index: u32,
    /// Empty.
    block: &'a mut Block,
}

impl Kernel for PutTogether<'_> {
    type Output = ();

    /// In vectors: corners that are stored one by one keep whoever loads eight of them waiting.
    #[expect(clippy::needless_range_loop, reason = "iterators of vectors are not always taken apart")]
    #[inline(always)]
    fn run<S: Simd>(self) {
        const NOWHERE: &Vec3 = &Vec3::ZERO;
        let Self { numbers, index, block } = self;
        let mut triangles = [[NOWHERE; 3]; LANES];
        numbers.for_each(
            index,
            #[inline(always)]
            |lane, mesh, primitive| {
                let [a, b, c] = mesh.triangles[primitive as usize];
                let positions = &mesh.positions[..];
                triangles[lane] = [&positions[a as usize], &positions[b as usize], &positions[c as usize]];
                block.primitive[lane] = primitive;
                block.part[lane] = mesh.part;
                block.lanes |= 1 << lane;
            },
        );
        let corners = S::by_component(&triangles);
        let mut largest = S::V8::splat(0.0);
        for axis in 0..3 {
            let [a, b, c] = corners[axis];
            for edge in [b.sub(a), c.sub(b), a.sub(c)] {
                largest = largest.max(edge.abs());
            }
            for k in 0..3 {
                block.corners[axis][k] = corners[axis][k].to_array();
            }
        }
        block.size = rounded_up(largest.largest());
    }
}

impl Numbers {
    pub(super) fn new(blocks: impl Into<Array<[u32; LANES]>>, meshes: Meshes) -> Self {
        let are_far = meshes.bytes() >= FAR;
        Self { blocks: blocks.into(), meshes, are_far }
    }

    /// The numbers, block by block.
    #[inline(always)]
    pub(super) fn blocks(&self) -> &[[u32; LANES]] {
        &self.blocks
    }

    /// Takes the corners of `meshes`, whose triangles are the same.
    pub(super) fn set_meshes(&mut self, meshes: Meshes) {
        self.meshes = meshes;
    }

    /// Block `index`, by a function of its own: it is long, and kernels ask for blocks in many places.
    #[inline(always)]
    pub(super) fn put_together<'a, S: Simd>(&self, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        let block = scratch.insert(Block::EMPTY);
        S::apart_narrow(PutTogether { numbers: self, index, block });
        block
    }

    /// The box around a block's triangles.
    pub(super) fn bounds(&self, index: u32) -> Aabb {
        Aabb::around(self.of_block(index).flat_map(|number| {
            let (mesh, primitive) = self.meshes.find(number);
            mesh.corners(primitive)
        }))
    }

    /// Has loaded by which vertices a block's triangles are.
    #[inline(always)]
    pub fn prefetch_triangles<S: Simd>(&self, index: u32) {
        self.for_each(
            index,
            #[inline(always)]
            |_, mesh, primitive| S::prefetch_line(&mesh.triangles[primitive as usize]),
        );
    }

    /// Has these loaded.
    #[inline(always)]
    pub fn prefetch_vertices<S: Simd>(&self, index: u32) {
        self.for_each(
            index,
            #[inline(always)]
            |_, mesh, primitive| {
                let [a, b, c] = mesh.triangles[primitive as usize];
                S::prefetch_line(&mesh.positions[a as usize]);
                S::prefetch_line(&mesh.positions[b as usize]);
                S::prefetch_line(&mesh.positions[c as usize]);
            },
        );
    }

    /// Each triangle of a block, with its lane.
    #[inline(always)]
    fn for_each<'a>(&'a self, index: u32, mut visit: impl FnMut(usize, &'a Mesh, u32)) {
        let numbers = &self.blocks[index as usize];
        let (mut last, _) = self.meshes.find(numbers[0]);
        // The used lanes come first.
        for (lane, &number) in numbers.iter().enumerate().take_while(|(_, number)| **number != NONE) {
            let (mesh, primitive) = self.meshes.find_near(number, &mut last);
            visit(lane, mesh, primitive);
        }
    }

    /// The numbers in a block.
    #[inline(always)]
    fn of_block(&self, index: u32) -> impl Iterator<Item = u32> {
        self.blocks[index as usize].into_iter().filter(|&number| number != NONE)
    }

    /// Not inlined: where there are blocks, scratch would be cleared for nothing.
    #[inline(never)]
    pub(super) fn lane<'a>(&self, index: usize, lane: usize, scratch: &'a mut Option<Block>) -> Lane<'a> {
        let block = scratch.insert(Block::EMPTY);
        self.meshes.push(block, self.blocks[index][lane]);
        Lane { block, lane: 0 }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::isa::{Present, dispatch};
    use crate::trace::{Part, Primitives};

    struct Read<'a>(&'a Numbers, u32);

    impl Kernel for Read<'_> {
        type Output = Block;
        #[inline(always)]
        fn run<S: Simd>(self) -> Block {
            *self.0.put_together::<S>(self.1, &mut None)
        }
    }

    fn below(count: u32, random: &mut Random) -> u32 {
        ((random.unit() + 1.0) / 2.0 * count as f32) as u32
    }

    fn part(geometry: u32, random: &mut Random, vertices: usize, triangles: usize) -> Part {
        let positions: Vec<Vec3> = (0..vertices).map(|_| random.vec3()).collect();
        let triangles = (0..triangles).map(|_| std::array::from_fn(|_| below(vertices as u32, random))).collect();
        let positions = Arc::new(positions);
        Part { primitives: Primitives::Triangles { positions, triangles: Arc::new(triangles) }, geometry, instance: 0 }
    }

    #[test]
    fn blocks_are_put_together_as_they_would_be_made() {
        let mut random = Random::new(7);
        let parts = [part(0, &mut random, 3, 1), part(1, &mut random, 40, 60), part(2, &mut random, 9, 30)];
        let alone = Meshes::new(&parts[1..2]);
        // The last vertex is at the end of its array, and the mixed blocks are of three meshes.
        for (meshes, most) in [(alone, 60), (Meshes::new(&parts), 91)] {
            let mut blocks: Vec<[u32; LANES]> = vec![std::array::from_fn(|lane| most - 1 - lane as u32)];
            blocks.extend((0..300).map(|k| {
                let first = below(most - 8, &mut random);
                let number = |lane| if k % 3 == 0 { below(most, &mut random) } else { first + lane };
                numbered((0..1 + k % 8).map(number))
            }));
            let leaves = Numbers { blocks: blocks.clone().into(), meshes: meshes.clone(), are_far: false };
            for (index, numbers) in blocks.iter().enumerate() {
                let mut expected = Block::EMPTY;
                numbers.iter().filter(|&&n| n != NONE).for_each(|&number| meshes.push(&mut expected, number));
                for isa in Present::all() {
                    let block = dispatch(isa, Read(&leaves, index as u32));
                    assert_eq!(bytemuck::bytes_of(&block), bytemuck::bytes_of(&expected), "{isa:?}: {numbers:?}");
                }
            }
        }
    }
}
