//! Leaves of triangles: blocks of four, rejected together ([`Filter`], [`Edges`]), decided one by one.

use rayon::prelude::*;

use super::block::{Block, LANES};
use super::build::{self, Record};
use super::filter::Filter;
use super::isa::Isa;
use super::node::Tree;
use super::simd::Simd;
use super::{PartId, Through};
use crate::math::{Aabb, is_traceable};
use crate::ray::{Hit, Ray};
use crate::shape::triangle::{self, Placed};
use crate::trace::nearest::Nearest;
use crate::trace::{Part, Primitives};

/// All triangles of a level.
pub(super) struct TriangleTree {
    tree: Tree,
    blocks: Vec<Block>,
    parts: Vec<PartId>,
}

impl TriangleTree {
    /// Over the traceable triangles of `parts`.
    pub fn build(parts: &[Part], isa: Isa) -> Self {
        let mut items = Vec::with_capacity(parts.iter().map(|part| part.primitives.len()).sum());
        for (p, part) in parts.iter().enumerate() {
            let Primitives::Triangles { positions, triangles } = &part.primitives else { continue };
            items.par_extend(triangles.par_iter().enumerate().map(|(i, corners)| {
                let corners = corners.map(|i| positions[i as usize]);
                if corners.iter().all(|&corner| is_traceable(corner)) {
                    Record::new(&Aabb::around(corners), p as u32, i as u32)
                } else {
                    Record::NOTHING
                }
            }));
        }
        if items.par_iter().any(Record::is_nothing) {
            items.retain(|item| !item.is_nothing());
        }
        let mut tree = build::build(&mut items, LANES as u32, isa);
        let mut blocks = Vec::with_capacity(items.len() / 3);
        tree.rename_leaves(|first, count| {
            let leaf = &items[first as usize..first as usize + count as usize];
            let first_block = blocks.len() as u32;
            blocks.extend(leaf.chunks(LANES).map(|items| Block::new(parts, items)));
            (first_block, leaf.len().div_ceil(LANES) as u8)
        });
        let parts = parts.iter().map(|part| PartId { geometry: part.geometry, instance: part.instance }).collect();
        Self { tree, blocks, parts }
    }

    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Block `index`, of those that the leaves name.
    #[inline(always)]
    pub fn block(&self, index: u32) -> &Block {
        &self.blocks[index as usize]
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + size_of_val(&self.blocks[..]) + size_of_val(&self.parts[..])
    }

    /// Offers what `ray` (in the world) hits in a leaf; `filter` is of the ray in this level's coordinates.
    #[inline(always)]
    pub fn offer_leaf<S: Simd>(
        &self,
        first: u32,
        count: u8,
        ray: &Ray,
        filter: &Filter,
        through: Option<Through<'_>>,
        nearest: &mut Nearest,
    ) {
        for index in first..first + u32::from(count) {
            let block = self.block(index);
            let mut candidates = filter.candidates::<S>(block);
            while candidates != 0 {
                let lane = candidates.trailing_zeros() as usize;
                candidates &= candidates - 1;
                self.offer(block, lane, ray, through, nearest);
            }
        }
    }

    /// Offers what `ray` hits of one triangle: lane `id % 4` of block `id / 4`.
    #[inline]
    pub fn offer_one(&self, id: u32, ray: &Ray, nearest: &mut Nearest) {
        self.offer(self.block(id / LANES as u32), id as usize % LANES, ray, None, nearest);
    }

    /// The corners of a triangle, numbered as in [`Self::offer_one`], one after the other.
    #[inline(always)]
    pub fn corners(&self, id: u32) -> [f32; 9] {
        let (block, lane) = (self.block(id / LANES as u32), id as usize % LANES);
        let mut corners = [0.0; 9];
        for (corner, component) in corners.iter_mut().zip(&block.corners) {
            *corner = component[lane];
        }
        corners
    }

    /// A hit with a triangle, numbered as in [`Self::offer_one`].
    #[inline(always)]
    pub fn hit(&self, id: u32, t: f32, u: f32, v: f32) -> Hit {
        let (block, lane) = (self.block(id / LANES as u32), id as usize % LANES);
        let PartId { geometry, instance } = self.parts[block.part[lane] as usize];
        Hit { t, u, v, primitive: block.primitive[lane], geometry, instance }
    }

    #[inline]
    fn offer(&self, block: &Block, lane: usize, ray: &Ray, through: Option<Through<'_>>, nearest: &mut Nearest) {
        let corners = block.triangle(lane);
        let part = self.parts[block.part[lane] as usize];
        let (hit, instance) = match through {
            None => (triangle::intersect(ray, &corners), part.instance),
            Some(Through { instance, to_world }) => (triangle::intersect(ray, &Placed { corners, to_world }), instance),
        };
        if let Some(hit) = hit {
            let (primitive, geometry) = (block.primitive[lane], part.geometry);
            let (t, u, v) = (hit.t as f32, hit.u as f32, hit.v as f32);
            nearest.offer(hit.t, Hit { t, u, v, primitive, geometry, instance });
        }
    }
}
