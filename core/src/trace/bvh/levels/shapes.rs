//! Leaves of shapes that are not triangles.

use super::farthest::SupportStack;
use crate::math::Vec3;
use crate::ray::{Hit, Ray};
use crate::shape::Shape;
use crate::shape::distance::Distance;
use crate::trace::bvh::PartId;
use crate::trace::bvh::build::preset::Options;
use crate::trace::bvh::build::{self, Record};
use crate::trace::bvh::node::Child;
use crate::trace::bvh::query::{Query, SOMETHING};
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::tree::Tree;
use crate::trace::leaf::{Id, InstanceTransform, offer_crossing};
use crate::trace::nearest::Nearest;
use crate::trace::{Part, Primitives};

/// One shape and its ids.
struct Entry {
    shape: Shape,
    primitive: u32,
    part: PartId,
}

/// All shapes of a level.
pub(in crate::trace::bvh) struct ShapeTree {
    tree: Tree,
    entries: Vec<Entry>,
}

impl ShapeTree {
    /// Over the shapes of `parts` that can be hit.
    pub fn build(parts: &[Part], options: &Options<'_>) -> Self {
        let mut items = Vec::new();
        for (p, part) in parts.iter().enumerate() {
            let Primitives::Shapes(list) = &part.primitives else { continue };
            for (i, shape) in list.iter().enumerate() {
                let bounds = shape.bounds();
                if !bounds.is_empty() {
                    items.push(Record::new(&bounds, p as u32, i as u32));
                }
            }
        }
        let tree = build::build(&mut items, 1, Child::MAX, options);
        let entry = |item: &Record| {
            let part = &parts[item.part() as usize];
            let Primitives::Shapes(list) = &part.primitives else { unreachable!("items come from lists of shapes") };
            let ids = PartId { geometry: part.geometry, instance: part.instance };
            Entry { shape: list[item.primitive() as usize].clone(), primitive: item.primitive(), part: ids }
        };
        Self { tree, entries: items.iter().map(entry).collect() }
    }

    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// As [`Tree::farthest`], of the boxes around shapes.
    #[inline(always)]
    pub fn farthest<S: Simd>(&self, way: Vec3, visits: usize, waiting: &mut SupportStack) -> f64 {
        self.tree.farthest::<S>(way, visits, waiting, &mut None, |_| f32::INFINITY)
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + size_of_val(&self.entries[..])
    }

    #[inline]
    fn leaf(&self, leaf: Child) -> &[Entry] {
        let items = leaf.blocks();
        &self.entries[items.start as usize..items.end as usize]
    }

    /// Offers what `ray`, in the world, hits in a leaf; `local` is the ray in this level's coordinates.
    #[inline]
    pub fn offer_leaf<Q: Query>(
        &self,
        leaf: Child,
        ray: &Ray,
        local: &Ray,
        through: Option<InstanceTransform<'_>>,
        nearest: &mut Nearest,
    ) {
        for Entry { shape, primitive, part } in self.leaf(leaf) {
            let Some(t) = shape.crossings(local).next() else { continue };
            if Q::ANY {
                nearest.take(Distance::itself(t), SOMETHING);
                return;
            }
            let instance = through.map_or(part.instance, |through| through.instance);
            let id = Id { instance, geometry: part.geometry, primitive: *primitive };
            offer_crossing(nearest, ray, through.map(|_| local), shape, t, id);
        }
    }

    /// Adds everything that `local` (the ray in this level's coordinates) hits in a leaf, with t in f64.
    #[inline]
    pub fn gather_leaf(
        &self,
        leaf: Child,
        local: &Ray,
        through: Option<InstanceTransform<'_>>,
        hits: &mut Vec<(f64, Hit)>,
    ) {
        for Entry { shape, primitive, part } in self.leaf(leaf) {
            let instance = through.map_or(part.instance, |through| through.instance);
            let id = Id { instance, geometry: part.geometry, primitive: *primitive };
            hits.extend(shape.intersect_all(local).map(|hit| (hit.t, id.of_shape(&hit))));
        }
    }
}
