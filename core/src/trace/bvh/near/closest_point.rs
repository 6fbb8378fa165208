//! The point of a scene's triangles that is nearest to a given one.
//!
//! Boxes wait in one queue, those of all levels, and the nearest is opened next, until it is farther away than what was
//! found (Hjaltason, Samet 1999, *Distance browsing in spatial databases*). So no box is opened that need not be; a
//! stack, the simpler alternative, opens boxes that a nearer triangle elsewhere would have ruled out. Arithmetic is
//! scalar: this answers questions about meshes, one at a time, and draws no pictures.
//!
//! Boxes of a placed object are put around where they stand in the world, and its triangles are measured there, since
//! distances do not survive a transform that is not rigid.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::math::{Aabb, DVec3, Vec3, gamma64};
use crate::shape::closest::{TrianglePoint, closest_point};
use crate::shape::triangle::{Corners, Placed};
use crate::trace::Placement;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::levels::triangles::TriangleTree;
use crate::trace::bvh::node::Child;
use crate::trace::bvh::simd::Portable;
use crate::trace::bvh::tree::Tree;
use crate::trace::leaf::InstanceTransform;
use crate::trace::motion::bounds_placed;

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// Where it is, in world coordinates (recentred scene units).
    pub point: Vec3,
    /// How far from the point that was asked for, in the same units; at least 0.
    pub distance: f32,
    /// Weight of the triangle's second corner.
    pub u: f32,
    /// Weight of the triangle's third corner.
    pub v: f32,
    /// Index of the triangle in its mesh.
    pub primitive: u32,
    /// Index into [`Scene::geometries`](crate::Scene::geometries).
    pub geometry: u32,
    /// Index into [`Scene::instances`](crate::Scene::instances).
    pub instance: u32,
}

impl ClosestPoint {
    const fn id(&self) -> (u32, u32, u32) {
        (self.instance, self.geometry, self.primitive)
    }
}

impl Bvh {
    /// The point on any triangle that is nearest to `point`, which is in world coordinates, at a distance of at most
    /// `max_distance` (rounded to f32; may be infinite). Distances are computed in f64; at equal ones the lowest
    /// (instance, geometry, primitive) wins. Triangles without an area count too, unlike for rays.
    ///
    /// None where there is none as near, and for a point that is not finite or a `max_distance` that is negative or
    /// NaN. What moves is where it stands at time 0. Shapes are left out: a placed sphere may be an ellipsoid, whose
    /// nearest point has no closed form.
    pub fn closest_point(&self, point: Vec3, max_distance: f32) -> Option<ClosestPoint> {
        if !(point.is_finite() && max_distance >= 0.0) {
            return None;
        }
        let mut search = Search::new(self, point, max_distance);
        search.run();
        search.best.map(|(_, best)| best)
    }
}

/// Which tree a box is of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Level {
    Fixed,
    Placements,
    Moving,
    /// Of an object, by the index of its placement; those that move come after those that do not.
    Placed(u32),
}

/// A node or a leaf that is yet to be opened.
struct QueueEntry {
    /// The distance of its box, squared.
    near: f64,
    level: Level,
    child: Child,
}

/// The nearest is the greatest: [`BinaryHeap`] has that on top.
impl Ord for QueueEntry {
    fn cmp(&self, other: &Self) -> Ordering {
        other.near.total_cmp(&self.near)
    }
}

impl PartialOrd for QueueEntry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for QueueEntry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for QueueEntry {}

struct Search<'a> {
    bvh: &'a Bvh,
    point: DVec3,
    max_distance: f32,
    /// By how much the distance of a point on a triangle may fall short of that of the box around it, for its rounding.
    slack: f64,
    /// A box whose squared distance is larger has nothing to offer.
    limit: f64,
    /// The squared distance, before it is rounded, and the answer.
    best: Option<(f64, ClosestPoint)>,
    queue: BinaryHeap<QueueEntry>,
}

impl<'a> Search<'a> {
    fn new(bvh: &'a Bvh, point: Vec3, max_distance: f32) -> Self {
        let placed = bvh.placements.tree().bounds().union(bvh.moving.boxes().tree().bounds());
        let bounds = bvh.fixed.triangles.tree().bounds().union(placed);
        let reach = bounds.min.abs().max(bounds.max.abs()).as_dvec3() + point.as_dvec3().abs();
        let slack = if bounds.is_empty() { 0.0 } else { reach.element_sum() * gamma64(32) };
        let point = point.as_dvec3();
        let mut search = Self { bvh, point, max_distance, slack, limit: 0.0, best: None, queue: BinaryHeap::new() };
        search.narrow(f64::from(max_distance.next_up()));
        search
    }

    /// No distance above `distance` is wanted any more.
    fn narrow(&mut self, distance: f64) {
        let distance = distance + self.slack;
        // For the rounding of squares, and of roots.
        self.limit = distance * distance * (1.0 + gamma64(16));
    }

    fn run(&mut self) {
        self.push_root(Level::Fixed);
        self.push_root(Level::Placements);
        self.push_root(Level::Moving);
        while let Some(waiting) = self.queue.pop() {
            if waiting.near > self.limit {
                return;
            }
            match waiting {
                QueueEntry { level, child, .. } if !child.is_leaf() => self.push_children(level, child),
                QueueEntry { level: Level::Placements, child, .. } => {
                    child.blocks().for_each(|index| self.push_root(Level::Placed(index)));
                }
                QueueEntry { level: Level::Moving, child, .. } => {
                    let first = self.bvh.placements.len();
                    child.blocks().for_each(|index| self.push_root(Level::Placed(first + index)));
                }
                QueueEntry { level, child, .. } => self.offer_leaf(level, child),
            }
        }
    }

    /// The triangles of what is placed under this index among the leaves of the upper trees, and where they are.
    fn placed(&self, index: u32) -> (&'a TriangleTree, InstanceTransform<'a>) {
        let (object, through) = match index.checked_sub(self.bvh.placements.len()) {
            None => {
                let place = self.bvh.placements.at(index);
                (place.object, place.through())
            }
            Some(moving) => {
                let Placement { object, instance, to_world, .. } = self.bvh.moving.at(moving);
                (*object, InstanceTransform { instance: *instance, to_world })
            }
        };
        (&self.bvh.objects[object as usize].triangles, through)
    }

    fn triangles(&self, level: Level) -> Option<&'a TriangleTree> {
        match level {
            Level::Fixed => Some(&self.bvh.fixed.triangles),
            Level::Placements | Level::Moving => None,
            Level::Placed(index) => Some(self.placed(index).0),
        }
    }

    fn tree(&self, level: Level) -> &'a Tree {
        let upper = if level == Level::Moving { self.bvh.moving.boxes().tree() } else { self.bvh.placements.tree() };
        self.triangles(level).map_or(upper, TriangleTree::tree)
    }

    fn push_root(&mut self, level: Level) {
        let tree = self.tree(level);
        if !tree.is_empty() {
            self.push(level, tree.bounds(), Child::ROOT);
        }
    }

    fn push_children(&mut self, level: Level, parent: Child) {
        let node = self.tree(level).node(parent);
        for (slot, child) in node.children() {
            self.push(level, node.child_bounds(slot), child);
        }
    }

    fn push(&mut self, level: Level, bounds: Aabb, child: Child) {
        let bounds = match level {
            Level::Placed(index) => {
                let (_, InstanceTransform { to_world, .. }) = self.placed(index);
                // Where it stands at time 0, as its triangles are measured.
                bounds_placed(to_world, bounds, |rows| bounds.extents(rows))
            }
            Level::Fixed | Level::Placements | Level::Moving => bounds,
        };
        let outside = (bounds.min.as_dvec3() - self.point).max(self.point - bounds.max.as_dvec3()).max(DVec3::ZERO);
        let near = outside.length_squared();
        if near <= self.limit {
            self.queue.push(QueueEntry { near, level, child });
        }
    }

    fn offer_leaf(&mut self, level: Level, leaf: Child) {
        let Some(triangles) = self.triangles(level) else { return };
        for index in leaf.blocks() {
            let mut scratch = None;
            let block = triangles.block::<Portable>(index, &mut scratch);
            for lane in block.used() {
                let corners = block.triangle(lane);
                let part = triangles.part(block.part[lane]);
                let (corners, instance) = match level {
                    Level::Placed(index) => {
                        let (_, InstanceTransform { instance, to_world }) = self.placed(index);
                        (Placed { corners, to_world }.rounded(), instance)
                    }
                    Level::Fixed | Level::Placements | Level::Moving => (corners.rounded(), part.instance),
                };
                self.offer(closest_point(self.point, corners), (block.primitive[lane], part.geometry, instance));
            }
        }
    }

    fn offer(&mut self, found: TrianglePoint, (primitive, geometry, instance): (u32, u32, u32)) {
        let square = found.distance_squared;
        let distance = square.sqrt();
        let answer = ClosestPoint {
            point: (self.point + found.offset).as_vec3(),
            distance: distance as f32,
            u: found.u as f32,
            v: found.v as f32,
            primitive,
            geometry,
            instance,
        };
        let is_better =
            |(best, other): &(f64, ClosestPoint)| square < *best || square == *best && answer.id() < other.id();
        if answer.distance <= self.max_distance && self.best.as_ref().is_none_or(is_better) {
            self.best = Some((square, answer));
            self.narrow(distance);
        }
    }
}
