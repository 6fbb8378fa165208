//! A tree over boxes of which the caller knows what is in them.
//!
//! The builder and the walk know no primitive; here they are lent to callers whose primitives the library does not have
//! (Embree's user geometry, instances of other scenes, curves). The caller names a box by its index, and is told which
//! of them a ray enters, or are near a point.

use std::fmt;

use super::alone::Search;
use super::build::preset::Options;
use super::build::{self, Record};
use super::node::Child;
use super::query::Closest;
use super::reject::Blur;
use super::reject::slab::SlabRay;
use super::simd::Simd;
use super::simd::isa::{self, Kernel, Present};
use super::tree::Tree;
use super::walk::{self, Visit};
use crate::math::{Aabb, DVec3, Vec3};
use crate::ray::Ray;

/// A tree over boxes.
pub struct BoxTree {
    tree: Tree,
    /// Which box each item of a leaf is.
    items: Vec<u32>,
    isa: Present,
}

impl fmt::Debug for BoxTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BoxTree")
            .field("boxes", &self.items.len())
            .field("bounds", &self.bounds())
            .finish_non_exhaustive()
    }
}

impl BoxTree {
    /// Boxes that leaves can name.
    pub const MOST: usize = Child::NAMES;

    /// Over `boxes`; those that are empty or not finite are left out.
    ///
    /// # Panics
    /// With more than [`BoxTree::MOST`] boxes, and where this processor does not have `options.isa`.
    pub fn build(boxes: &[Aabb], options: Options<'_>) -> Self {
        let isa = options.isa.demand();
        let is_kept =
            |bounds: &Aabb| bounds.min.cmple(bounds.max).all() && bounds.min.is_finite() && bounds.max.is_finite();
        let kept = boxes.iter().enumerate().filter(|(_, bounds)| is_kept(bounds));
        let mut items: Vec<Record> = kept.map(|(i, bounds)| Record::new(bounds, 0, i as u32)).collect();
        let tree = build::build(&mut items, 1, Child::MOST, &options);
        Self { tree, items: items.iter().map(Record::primitive).collect(), isa }
    }

    /// The box around all of them, a millionth of its coordinates wider.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.tree.is_empty()
    }

    /// Memory it holds, in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + size_of_val(&self.items[..])
    }

    /// Names boxes that `ray` enters, or nearly, up to the t that `visitor` returns last (at first the ray's tmax), near ones
    /// mostly first, until it has seen enough. The search takes each box that the ray enters; it may take others.
    pub fn visit(&self, ray: &Ray, visitor: &mut dyn FnMut(u32) -> Search) {
        if !self.tree.is_empty() && ray.is_valid() {
            isa::dispatch(self.isa, VisitBoxes { boxes: self, ray, visitor });
        }
    }

    /// Names boxes whose distance from `point` is at most the radius that `visitor` returns last (at first `radius`), near
    /// ones mostly first, until it has seen enough; and some that are farther, in the same leaves or by a millionth of
    /// coordinates.
    pub fn visit_near(&self, point: Vec3, radius: f32, visitor: &mut dyn FnMut(u32) -> Search) {
        let mut radius = f64::from(radius);
        let mut open = vec![(0.0, Child::ROOT)];
        if self.tree.is_empty() || radius.is_nan() || !point.is_finite() {
            return;
        }
        while let Some((near, child)) = open.pop() {
            if near > radius {
                continue;
            }
            let node = self.tree.node(child);
            let mut inside: Vec<(f64, Child)> = node
                .children()
                .map(|(slot, child)| (distance(&node.child_bounds(slot), point), child))
                .filter(|&(near, _)| near <= radius)
                .collect();
            inside.sort_by(|a, b| b.0.total_cmp(&a.0));
            // Leaves at once, nearest first: a hit there may rule out the nodes.
            for &(near, leaf) in inside.iter().rev().filter(|(_, child)| child.is_leaf()) {
                if near > radius {
                    continue;
                }
                for item in leaf.blocks() {
                    match visitor(self.items[item as usize]) {
                        Search::Continue(limit) => radius = f64::from(limit),
                        Search::Break(()) => return,
                    }
                }
            }
            open.extend(inside.into_iter().filter(|(_, child)| !child.is_leaf()));
        }
    }
}

/// From a point to a box; 0 inside.
fn distance(bounds: &Aabb, point: Vec3) -> f64 {
    let point = point.as_dvec3();
    (bounds.min.as_dvec3() - point).max(point - bounds.max.as_dvec3()).max(DVec3::ZERO).length()
}

struct VisitBoxes<'a, 'v> {
    boxes: &'a BoxTree,
    ray: &'a Ray,
    visitor: &'a mut (dyn FnMut(u32) -> Search + 'v),
}

impl Kernel for VisitBoxes<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { boxes, ray, visitor } = self;
        let slab = SlabRay::new::<S>(ray, boxes.tree.reach(), Blur::NONE);
        let mut limit = ray.tmax.next_up();
        walk::single::<S, Closest>(
            &boxes.tree,
            &slab,
            limit,
            #[inline(always)]
            |leaf| {
                for item in leaf.blocks() {
                    match visitor(boxes.items[item as usize]) {
                        Search::Continue(t) => limit = t,
                        Search::Break(()) => return Visit::Stop,
                    }
                }
                Visit::Until(limit)
            },
        );
    }
}
