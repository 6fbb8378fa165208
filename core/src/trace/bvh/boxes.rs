//! A tree over boxes of which the caller knows what is in them, and which may move.
//!
//! What moves has two trees of the same shape: with the boxes where they are at time 0, and at time 1. A ray finds a
//! node's boxes between the two, at its own time (Glassner 1988, *Spacetime ray tracing for animation*): boxes around
//! whole ways would all be entered where things move by more than their size.
//!
//! The builder and the walk know no primitive; here they are lent to callers whose primitives the library does not have
//! (Embree's user geometry, instances of other scenes, curves), who ask in [`visits`](super::visits), and to what moves
//! in a scene. They are told which boxes a ray enters, or are near a point, by their place among the leaves: what is
//! kept in that order is together in memory where it is together in space.

use std::fmt;

use super::build::preset::Options;
use super::build::{self, Record};
use super::node::{Child, Node};
use super::query::Query;
use super::reject::Blur;
use super::reject::slab::SlabRay;
use super::simd::isa::Present;
use super::simd::{Simd, Vector};
use super::tree::Tree;
use super::walk::{self, Enter, Visit};
use crate::math::{Aabb, UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;

/// A tree over boxes.
pub struct BoxTree {
    /// Of what moves, at time 0.
    tree: Tree,
    /// The same nodes at time 1, where something moves.
    end: Option<Tree>,
    /// How many.
    count: usize,
    isa: Present,
}

impl fmt::Debug for BoxTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BoxTree").field("boxes", &self.count).field("bounds", &self.bounds()).finish_non_exhaustive()
    }
}

impl BoxTree {
    /// Boxes that leaves can name.
    pub const MAX: usize = Child::NAMES;

    /// Over `boxes`; those that are empty or not finite are left out. And of which box each name is, by its index.
    ///
    /// # Panics
    /// With more than [`BoxTree::MAX`] boxes, and where this processor does not have `options.isa`.
    pub fn build(boxes: &[Aabb], options: Options<'_>) -> (Self, Vec<u32>) {
        let kept = boxes.iter().enumerate().filter(|(_, bounds)| bounds.is_bounded());
        Self::over(kept.map(|(i, bounds)| Record::new(bounds, 0, i as u32)).collect(), Child::MAX, &options)
    }

    /// Over boxes that move, from where the first of each pair is at time 0 to where the second is at time 1, in
    /// straight lines. Rays before and after that find them where they are then. Left out is what is empty or not
    /// finite at either time.
    ///
    /// # Panics
    /// As [`BoxTree::build`] does.
    pub fn moving(boxes: &[[Aabb; 2]], options: Options<'_>) -> (Self, Vec<u32>) {
        Self::of_moving(boxes, Child::MAX, &options)
    }

    /// The same with no more than `most` boxes in a leaf.
    pub(super) fn of_moving(boxes: &[[Aabb; 2]], most: u32, options: &Options<'_>) -> (Self, Vec<u32>) {
        // What is near halfway is together.
        let between = |a: Vec3, b: Vec3| a * 0.5 + b * 0.5;
        let halfway = |[start, end]: &[Aabb; 2]| match start == end {
            true => *start,
            false => Aabb { min: between(start.min, end.min), max: between(start.max, end.max) },
        };
        let kept = boxes.iter().enumerate().filter(|(_, ends)| ends.iter().all(Aabb::is_bounded));
        let (mut still, order) =
            Self::over(kept.map(|(i, ends)| Record::new(&halfway(ends), 0, i as u32)).collect(), most, options);
        if boxes.iter().all(|[start, end]| start == end) {
            return (still, order);
        }
        let tree = &mut still.tree;
        let mut end = Tree::new(tree.nodes().to_vec());
        for (k, tree) in [tree, &mut end].into_iter().enumerate() {
            tree.refit(|leaf| {
                let boxes = leaf.map(|item| wider(&boxes[order[item as usize] as usize])[k]);
                boxes.fold(Aabb::EMPTY, Aabb::union)
            });
        }
        (Self { end: Some(end), ..still }, order)
    }

    fn over(mut items: Vec<Record>, most: u32, options: &Options<'_>) -> (Self, Vec<u32>) {
        let isa = options.isa.demand();
        let tree = build::build(&mut items, 1, most, options);
        (Self { tree, end: None, count: items.len(), isa }, items.iter().map(Record::primitive).collect())
    }

    /// The box around all of them, a millionth of its coordinates wider; at all times from 0 to 1.
    pub fn bounds(&self) -> Aabb {
        self.end.iter().fold(self.tree.bounds(), |bounds, end| bounds.union(end.bounds()))
    }

    /// Of what moves, at time 0.
    pub(super) fn tree(&self) -> &Tree {
        &self.tree
    }

    /// How many.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Whether any of them moves.
    pub(super) fn moves(&self) -> bool {
        self.end.is_some()
    }

    pub(super) fn isa(&self) -> Present {
        self.isa
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.tree.is_empty()
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        let trees = self.end.iter().chain([&self.tree]);
        trees.map(Tree::bytes).sum()
    }

    /// A ray made ready for the boxes, which may be off by `blur`.
    #[inline(always)]
    pub(super) fn slab<S: Simd>(&self, ray: &Ray, blur: Blur) -> SlabRay {
        let reach = self.end.iter().fold(self.tree.reach(), |reach, end| reach.max(end.reach()));
        SlabRay::new::<S>(ray, reach, blur)
    }

    /// The same at its time, where any of them moves.
    #[inline(always)]
    pub(super) fn at_its_time(&self, slab: SlabRay, ray: &Ray) -> Option<MovingRay<'_>> {
        // NaN stays NaN, with which every box is entered.
        let time = ray.time.clamp(0.0, 1.0);
        self.end.as_ref().map(|end| MovingRay { slab, start: self.tree.nodes(), end: end.nodes(), time })
    }

    /// Calls `visit` with each box that the ray enters, near ones mostly first; it says how far the ray still looks.
    #[inline(always)]
    pub(super) fn walk<S: Simd, Q: Query>(&self, ray: &Ray, blur: Blur, limit: f32, visit: impl FnMut(u32) -> Visit) {
        let slab = self.slab::<S>(ray, blur);
        match self.at_its_time(slab, ray) {
            None => self.walk_as::<S, Q>(&slab, limit, visit),
            Some(moving) => self.walk_as::<S, Q>(&moving, limit, visit),
        }
    }

    #[inline(always)]
    fn walk_as<S: Simd, Q: Query>(&self, ray: &impl Enter, limit: f32, mut visit: impl FnMut(u32) -> Visit) {
        let mut after = Visit::Until(limit);
        walk::single::<S, Q>(
            &self.tree,
            ray,
            limit,
            #[inline(always)]
            |leaf| {
                for item in leaf.blocks() {
                    after = visit(item);
                    if matches!(after, Visit::Stop) {
                        break;
                    }
                }
                after
            },
        );
    }
}

/// Both wider by what it rounds to go from one to the other: a product of either, a difference and a sum.
fn wider(ends: &[Aabb; 2]) -> [Aabb; 2] {
    let reach = |bounds: &Aabb| bounds.min.abs().max(bounds.max.abs());
    let slack = reach(&ends[0]).max(reach(&ends[1])) * (6.0 * UNIT_ROUNDOFF) + f32::MIN_POSITIVE;
    ends.map(|bounds| Aabb { min: bounds.min - slack, max: bounds.max + slack })
}

/// A ray among boxes that move.
pub(super) struct MovingRay<'a> {
    slab: SlabRay,
    start: &'a [Node],
    end: &'a [Node],
    /// From 0 to 1.
    time: f32,
}

impl Enter for MovingRay<'_> {
    #[inline(always)]
    fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        // Of nodes of the tree at the start, which alone are asked about.
        let index = (std::ptr::from_ref(node).addr() - self.start.as_ptr().addr()) / size_of::<Node>();
        let end = &self.end[index];
        let (early, late) = (S::V8::splat(1.0 - self.time), S::V8::splat(self.time));
        let row = |offset: u32| S::row(end, offset).mul_add(late, S::row(node, offset).mul(early));
        self.slab.enter_rows::<S>(limit, row)
    }

    /// Of a slot without a child nothing is known between infinity and infinity.
    #[inline(always)]
    fn select<S: Simd>(&self, node: &Node, children: u32) -> u32 {
        node.occupied() & children
    }
}
