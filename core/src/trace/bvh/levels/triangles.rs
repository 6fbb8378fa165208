//! Leaves of triangles: blocks of eight, rejected together ([`Filter`]), decided one by one.

use std::sync::Arc;

use super::clusters;
use super::farthest::SupportStack;
use super::leaves::Leaves;
use crate::math::{Aabb, Vec3};
use crate::ray::{Hit, Ray};
use crate::shape::triangle::Placed;
use crate::trace::bvh::PartId;
use crate::trace::bvh::block::{Block, LANES, Lane};
use crate::trace::bvh::build::preset::{Options, Preset};
use crate::trace::bvh::build::{self, spatial};
use crate::trace::bvh::meshes::Meshes;
use crate::trace::bvh::node::Child;
use crate::trace::bvh::reject::filter::Filter;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::tree::Tree;
use crate::trace::leaf::{Id, InstanceTransform, offer_triangle};
use crate::trace::nearest::Nearest;
use crate::trace::{Part, Primitives};

/// All triangles of a level.
pub(in crate::trace::bvh) struct TriangleTree {
    tree: Tree,
    leaves: Leaves,
    parts: Vec<PartId>,
    /// Of each part its triangles, if it is a mesh; shared with the scene.
    topology: Vec<Option<Triangles>>,
    /// Triangles that can be hit; of a tree in which some are several times, and from which some were taken out, no
    /// more than these.
    count: usize,
}

type Triangles = Arc<Vec<[u32; 3]>>;

fn ids(part: &Part) -> PartId {
    PartId { geometry: part.geometry, instance: part.instance }
}

fn triangles(part: &Part) -> Option<Triangles> {
    match &part.primitives {
        Primitives::Triangles { triangles, .. } => Some(Arc::clone(triangles)),
        Primitives::Shapes(_) => None,
    }
}

impl TriangleTree {
    /// Over the traceable triangles of `parts`, while so many `others` of its size are built.
    pub fn build(parts: &[Part], options: &Options<'_>, others: usize) -> Self {
        let (tree, leaves, count) = match options.preset {
            Preset::Fast | Preset::FastCompact => clusters::build(parts, options),
            Preset::Default | Preset::High | Preset::Compact => {
                let meshes = Meshes::new(parts);
                let mut items = build::triangle_items(&meshes);
                let count = items.len();
                if options.preset == Preset::High {
                    items = spatial::pieces(items, &meshes, options.isa.demand());
                }
                let mut tree = build::build_beside(others, &mut items, LANES as u32, Child::MAX, options);
                let leaves = Leaves::new(&mut tree, &items, meshes, options.preset.is_compact());
                (tree, leaves, count)
            }
        };
        Self::new(parts, tree, leaves, count)
    }

    /// A tree over `count` triangles, all that can be hit of `parts`.
    pub fn new(parts: &[Part], tree: Tree, leaves: Leaves, count: usize) -> Self {
        Self {
            tree,
            leaves,
            parts: parts.iter().map(ids).collect(),
            topology: parts.iter().map(triangles).collect(),
            count,
        }
    }

    /// Moves all triangles to where they are in `parts`.
    ///
    /// # Errors
    /// Where there are others than those it was built for, in words.
    pub fn refit(&mut self, parts: &[Part]) -> Result<(), &'static str> {
        let is_same = |(part, old): (&Part, &Option<Triangles>)| match (triangles(part), old) {
            (Some(new), Some(old)) => Arc::ptr_eq(&new, old) || new == *old,
            (new, old) => new.is_none() && old.is_none(),
        };
        if parts.len() != self.topology.len() || !parts.iter().zip(&self.topology).all(is_same) {
            return Err("other triangles");
        }
        let meshes = Meshes::new(parts);
        if !self.leaves.refit(&meshes) || meshes.traceable_count() != self.count {
            return Err("other triangles that can be hit");
        }
        let leaves = &self.leaves;
        self.tree.refit(|blocks| blocks.map(|index| leaves.bounds(index)).fold(Aabb::EMPTY, Aabb::union));
        self.parts = parts.iter().map(ids).collect();
        // Equal, but those of the scene, so that none are kept for this alone.
        self.topology = parts.iter().map(triangles).collect();
        Ok(())
    }

    /// Takes the triangles of geometries out of these blocks, which are all that have any. Whether it could.
    pub fn take_out(&mut self, is_gone: impl Fn(u32) -> bool, blocks: &[u32]) -> bool {
        let is_gone: Vec<bool> = self.parts.iter().map(|part| is_gone(part.geometry)).collect();
        let count = self.leaves.take_out(&is_gone, blocks);
        // In the high preset one may be in several leaves.
        self.count = self.count.saturating_sub(count.unwrap_or(0));
        count.is_some()
    }

    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// As [`Tree::farthest`], of the triangles themselves.
    #[inline(always)]
    pub fn farthest<S: Simd>(
        &self,
        way: Vec3,
        visits: usize,
        waiting: &mut SupportStack,
        first: &mut Option<Child>,
    ) -> f64 {
        self.tree.farthest::<S>(
            way,
            visits,
            waiting,
            first,
            #[inline(always)]
            |leaf| {
                let mut farthest = f32::NEG_INFINITY;
                for index in leaf.blocks() {
                    farthest = farthest.max(self.leaves.block::<S>(index, &mut None).farthest::<S>(way));
                }
                farthest
            },
        )
    }

    /// How large they are, about: the area that their box shows to one side, over their number.
    pub fn grain(&self) -> f32 {
        if self.count == 0 { 0.0 } else { self.tree.bounds().half_area() / (3.0 * self.count as f32) }
    }

    /// Triangles that can be hit.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Block `index`, of those that the leaves name; `scratch` is where it may be put together.
    #[inline(always)]
    pub fn block<'a, S: Simd>(&'a self, index: u32, scratch: &'a mut Option<Block>) -> &'a Block {
        self.leaves.block::<S>(index, scratch)
    }

    /// The ids of a part, as blocks number them.
    #[inline(always)]
    pub fn part(&self, part: u32) -> PartId {
        self.parts[part as usize]
    }

    /// Has a block loaded that will be needed soon.
    #[inline(always)]
    pub fn prefetch<S: Simd>(&self, index: u32) {
        S::prefetch(self.leaves.address::<S>(index));
    }

    pub fn leaves(&self) -> &Leaves {
        &self.leaves
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + self.leaves.bytes() + size_of_val(&self.parts[..])
    }

    /// Offers what `ray`, in the world, hits in a leaf, which may be placed; `filter` is of the ray in this level's
    /// coordinates.
    #[inline(always)]
    pub fn offer_leaf<S: Simd>(
        &self,
        leaf: Child,
        ray: &Ray,
        filter: &Filter,
        through: Option<InstanceTransform<'_>>,
        nearest: &mut Nearest,
    ) {
        for index in leaf.blocks() {
            let mut scratch = None;
            let block = self.block::<S>(index, &mut scratch);
            let mut open = filter.candidates::<S, true>(block, nearest.limit()).lanes;
            while open != 0 {
                let lane = open.trailing_zeros() as usize % LANES;
                open &= open - 1;
                self.offer(block, lane, ray, through, nearest);
            }
        }
    }

    /// Offers what `ray` hits of one triangle, which may be placed: lane `id % 8` of block `id / 8`.
    #[inline]
    pub fn offer_one(&self, id: u32, ray: &Ray, through: Option<InstanceTransform<'_>>, nearest: &mut Nearest) {
        let mut scratch = None;
        let Lane { block, lane } = self.leaves.lane(id, &mut scratch);
        self.offer(block, lane, ray, through, nearest);
    }

    /// A hit with one of its triangles.
    #[inline(always)]
    pub fn hit(&self, triangle: &Lane<'_>, t: f32, u: f32, v: f32) -> Hit {
        let (part, primitive) = triangle.number();
        let PartId { geometry, instance } = self.parts[part as usize];
        Hit { t, u, v, primitive, geometry, instance }
    }

    /// Offers lane `lane` of a block, which may be placed, as [`Self::offer_one`] does.
    #[inline]
    pub fn offer(
        &self,
        block: &Block,
        lane: usize,
        ray: &Ray,
        through: Option<InstanceTransform<'_>>,
        nearest: &mut Nearest,
    ) {
        let corners = block.triangle(lane);
        let part = self.parts[block.part[lane] as usize];
        let id = Id { instance: part.instance, geometry: part.geometry, primitive: block.primitive[lane] };
        match through {
            None => offer_triangle(nearest, ray, &corners, id),
            Some(InstanceTransform { instance, to_world }) => {
                offer_triangle(nearest, ray, &Placed { corners, to_world }, Id { instance, ..id });
            }
        }
    }
}
