//! A tree over boxes of which the caller knows what is in them, and which may move.
//!
//! What moves has two trees of the same shape: with the boxes where they are at time 0, and at time 1. A ray finds a node's boxes between the two, at its own time
//! (Glassner 1988, *Spacetime ray tracing for animation*): boxes around whole ways would all be entered where things move by more than their size.
//!
//! The builder and the walk know no primitive; here they are lent to callers whose primitives the library does not have
//! (Embree's user geometry, instances of other scenes, curves). The caller is told which boxes a ray enters, or are near a point, by their place among
//! the leaves: what it keeps in that order is together in memory where it is together in space.

use std::fmt;
use std::marker::PhantomData;

use super::alone::Search;
use super::build::preset::Options;
use super::build::{self, Record};
use super::near::ball::Ball;
use super::node::{Child, Node};
use super::overlap::visit_overlapping;
use super::query::{Closest, Occluded, Query};
use super::reject::Blur;
use super::reject::slab::SlabRay;
use super::simd::isa::{self, Kernel, Present};
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
    pub const MOST: usize = Child::NAMES;

    /// Over `boxes`; those that are empty or not finite are left out. And of which box each name is, by its index.
    ///
    /// # Panics
    /// With more than [`BoxTree::MOST`] boxes, and where this processor does not have `options.isa`.
    pub fn build(boxes: &[Aabb], options: Options<'_>) -> (Self, Vec<u32>) {
        let kept = boxes.iter().enumerate().filter(|(_, bounds)| bounds.is_bounded());
        Self::over(kept.map(|(i, bounds)| Record::new(bounds, 0, i as u32)).collect(), Child::MOST, &options)
    }

    /// Over boxes that move, from where the first of each pair is at time 0 to where the second is at time 1, in straight lines. Rays before and after that
    /// find them where they are then. Left out is what is empty or not finite at either time.
    ///
    /// # Panics
    /// As [`BoxTree::build`] does.
    pub fn moving(boxes: &[[Aabb; 2]], options: Options<'_>) -> (Self, Vec<u32>) {
        Self::of_moving(boxes, Child::MOST, &options)
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

    /// Names boxes that `ray` enters at its time, or nearly, up to the t that `visitor` returns last (at first the ray's tmax), near ones
    /// mostly first, until it has seen enough. The search takes each box that the ray enters; it may take others.
    pub fn visit(&self, ray: &Ray, visitor: &mut dyn FnMut(u32) -> Search) {
        self.visit_as::<Closest>(ray, visitor);
    }

    /// The same for a visitor to whom it does not matter which are near.
    pub fn visit_any(&self, ray: &Ray, visitor: &mut dyn FnMut(u32) -> Search) {
        self.visit_as::<Occluded>(ray, visitor);
    }

    fn visit_as<Q: Query>(&self, ray: &Ray, visitor: &mut dyn FnMut(u32) -> Search) {
        if !self.tree.is_empty() && ray.is_valid() {
            isa::dispatch(self.isa, VisitBoxes { boxes: self, ray, visitor, query: PhantomData::<Q> });
        }
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

    /// Names boxes that have a point in common with `bounds`, and some that are only near it: in the same leaves, or by a millionth of coordinates. What moves is
    /// at time 0.
    pub fn visit_overlapping(&self, bounds: &Aabb, visitor: &mut dyn FnMut(u32)) {
        visit_overlapping(&self.tree, self.isa, bounds, visitor);
    }

    /// Names boxes whose distance from `point` is at most the radius that `visitor` returns last (at first `radius`), near
    /// ones mostly first, until it has seen enough; and some that are farther, in the same leaves or by a millionth of
    /// coordinates. What moves is at time 0.
    pub fn visit_near(&self, point: Vec3, radius: f32, visitor: &mut dyn FnMut(u32) -> Search) {
        if !self.tree.is_empty() && point.is_finite() {
            isa::dispatch(self.isa, NearBoxes { tree: &self.tree, point, radius, visitor });
        }
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

struct NearBoxes<'a, 'v> {
    tree: &'a Tree,
    point: Vec3,
    radius: f32,
    visitor: &'a mut (dyn FnMut(u32) -> Search + 'v),
}

impl Kernel for NearBoxes<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, point, mut radius, visitor } = self;
        Ball { point }.walk::<S>(
            tree,
            radius,
            #[inline(always)]
            |leaf| {
                for item in leaf.blocks() {
                    match visitor(item) {
                        Search::Continue(wanted) => radius = wanted,
                        Search::Break(()) => return None,
                    }
                }
                Some(radius)
            },
        );
    }
}

struct VisitBoxes<'a, 'v, Q> {
    boxes: &'a BoxTree,
    ray: &'a Ray,
    visitor: &'a mut (dyn FnMut(u32) -> Search + 'v),
    query: PhantomData<Q>,
}

impl<Q: Query> Kernel for VisitBoxes<'_, '_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { boxes, ray, visitor, .. } = self;
        boxes.walk::<S, Q>(
            ray,
            Blur::NONE,
            ray.tmax.next_up(),
            #[inline(always)]
            |item| match visitor(item) {
                Search::Continue(t) => Visit::Until(t),
                Search::Break(()) => Visit::Stop,
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    /// Every box in which a ray is at its own time is named, and few of the others, however far they move.
    #[test]
    fn what_moves_is_found_where_it_is() {
        let mut random = Random::new(62, 0);
        for far in [0.0, 0.01, 1.0, 100.0, 1e6] {
            let mut boxes: Vec<[Aabb; 2]> = Vec::new();
            for i in 0..3000 {
                let centre = random.vector() * 10.0;
                // All one way, or each its own.
                let way = if i % 2 == 0 { Vec3::new(1.0, 0.5, -0.25) } else { random.vector() };
                let sizes = [0, 1].map(|_| Vec3::splat(random.unit()) * 0.1);
                let centres = [centre, centre + way * far];
                boxes.push([0, 1].map(|k| Aabb { min: centres[k] - sizes[k], max: centres[k] + sizes[k] }));
            }
            boxes[7][1] = Aabb::EMPTY;
            // Some stand still, and some are flat.
            boxes.iter_mut().skip(10).step_by(9).for_each(|ends| ends[1] = ends[0]);
            boxes.iter_mut().skip(10).step_by(4).flatten().for_each(|bounds| bounds.max.y = bounds.min.y);
            let (tree, order) = BoxTree::moving(&boxes, Options::default());
            let mut named = 0;
            let rays = 2000;
            for k in 0..rays {
                let time = [random.unit(), 0.0, 1.0, random.unit()][k % 4];
                // Through the middle of one of them, or through a corner.
                let [start, end] = boxes[random.below(3000) as usize];
                let point = |bounds: &Aabb| if k % 2 == 0 { bounds.min.midpoint(bounds.max) } else { bounds.max };
                let (a, b) = (point(&start), point(&end));
                let target = if b.is_finite() { a.lerp(b, time) } else { a };
                let direction = random.direction();
                let ray = Ray { time, ..Ray::new(target - direction * (random.unit() * 20.0), direction) };
                let mut seen = vec![false; boxes.len()];
                tree.visit(&ray, &mut |i| {
                    seen[order[i as usize] as usize] = true;
                    Search::Continue(f32::INFINITY)
                });
                assert!(!seen[7], "it is nowhere at the end");
                named += seen.iter().filter(|seen| **seen).count();
                for (i, [start, end]) in boxes.iter().enumerate().filter(|(i, _)| *i != 7) {
                    assert!(seen[i] || !is_entered(&ray, start, end), "far {far}, box {i}, ray {ray:?}");
                }
            }
            assert!(named < 60 * rays, "far {far}: {named} of {rays} rays");
        }
    }

    /// In f64.
    fn is_entered(ray: &Ray, start: &Aabb, end: &Aabb) -> bool {
        let time = f64::from(ray.time);
        let between = |a: Vec3, b: Vec3| a.as_dvec3() * (1.0 - time) + b.as_dvec3() * time;
        let (min, max) = (between(start.min, end.min), between(start.max, end.max));
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (mut near, mut far) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let (a, b) = ((min[axis] - o[axis]) / d[axis], (max[axis] - o[axis]) / d[axis]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        near <= far
    }
}
