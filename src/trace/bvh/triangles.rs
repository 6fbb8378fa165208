//! Leaves of triangles: blocks of four, rejected together ([`Filter`], [`Edges`]), decided one by one.

use super::block::{Block, LANES};
use super::build;
use super::filter::Filter;
use super::leaves::Leaves;
use super::node::Tree;
use super::preset::{Options, Preset};
use super::quad::{Quad, Verdict};
use super::simd::{Doubles, Simd};
use super::{PartId, Through};
use crate::ray::{Hit, Ray};
use crate::shape::triangle::{self, Placed};
use crate::trace::Part;
use crate::trace::nearest::Nearest;

/// All triangles of a level.
pub(super) struct TriangleTree {
    tree: Tree,
    leaves: Leaves,
    parts: Vec<PartId>,
}

impl TriangleTree {
    /// Over the traceable triangles of `parts`.
    pub fn build(parts: &[Part], options: &Options<'_>) -> Self {
        let mut items = build::triangle_items(parts);
        let mut tree = build::build(&mut items, LANES as u32, options);
        let leaves = Leaves::new(&mut tree, &items, parts, options.preset == Preset::Compact);
        let parts = parts.iter().map(|part| PartId { geometry: part.geometry, instance: part.instance }).collect();
        Self { tree, leaves, parts }
    }

    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Block `index`, of those that the leaves name; `scratch` is where it may be put together.
    #[inline(always)]
    pub fn block<'a>(&'a self, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        self.leaves.block(index, scratch)
    }

    /// Has a block loaded that will be needed soon.
    #[inline(always)]
    pub fn prefetch<S: Simd>(&self, index: u32) {
        self.leaves.prefetch::<S>(index);
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + self.leaves.bytes() + size_of_val(&self.parts[..])
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
            let mut scratch = None;
            let block = self.block(index, &mut scratch);
            let mut open = filter.candidates::<S>(block, nearest.limit());
            if open == 0 {
                continue;
            }
            if through.is_none() {
                open &= self.offer_block::<S>(block, open, ray, nearest);
            }
            while open != 0 {
                let lane = open.trailing_zeros() as usize % LANES;
                open &= open - 1;
                self.offer(block, lane, ray, through, nearest);
            }
        }
    }

    /// Offers what `ray` hits for sure of the triangles of a block that are bits of `candidates`. Bits are set in the
    /// result for those that remain to be decided.
    #[inline(always)]
    fn offer_block<S: Simd>(&self, block: &Block, candidates: u32, ray: &Ray, nearest: &mut Nearest) -> u32 {
        let splat = |x: f32| S::D4::splat(f64::from(x));
        let (o, d) = (ray.origin, ray.direction);
        let origin = [splat(o.x), splat(o.y), splat(o.z)];
        let quad = Quad::new::<S>(origin, [splat(d.x), splat(d.y), splat(d.z)], &block.corners);
        let Verdict { hit, open } = quad.verdict();
        let mut hit = hit & candidates;
        if hit != 0 {
            let numbers = quad.numbers::<S>();
            while hit != 0 {
                let lane = hit.trailing_zeros() as usize % LANES;
                hit &= hit - 1;
                let (t, u, v) = (numbers.t32[lane], numbers.u[lane], numbers.v[lane]);
                if ray.tmin <= t && t <= ray.tmax && t.is_finite() {
                    let PartId { geometry, instance } = self.parts[block.part[lane] as usize];
                    let primitive = block.primitive[lane];
                    nearest.offer(numbers.t[lane], Hit { t, u, v, primitive, geometry, instance });
                }
            }
        }
        open
    }

    /// Offers what `ray` hits of one triangle: lane `id % 4` of block `id / 4`.
    #[inline]
    pub fn offer_one(&self, id: u32, ray: &Ray, nearest: &mut Nearest) {
        let mut scratch = None;
        self.offer(self.block(id / LANES as u32, &mut scratch), id as usize % LANES, ray, None, nearest);
    }

    /// The corners of a triangle, numbered as in [`Self::offer_one`], one after the other.
    #[inline(always)]
    pub fn corners(&self, id: u32) -> [f32; 9] {
        let mut scratch = None;
        let (block, lane) = (self.block(id / LANES as u32, &mut scratch), id as usize % LANES);
        let mut corners = [0.0; 9];
        for (corner, component) in corners.iter_mut().zip(&block.corners) {
            *corner = component[lane];
        }
        corners
    }

    /// A hit with a triangle, numbered as in [`Self::offer_one`].
    #[inline(always)]
    pub fn hit(&self, id: u32, t: f32, u: f32, v: f32) -> Hit {
        let (part, primitive) = self.leaves.number(id);
        let PartId { geometry, instance } = self.parts[part as usize];
        Hit { t, u, v, primitive, geometry, instance }
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
