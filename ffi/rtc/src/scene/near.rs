//! Boxes of all primitives, for point queries.
//!
//! A query shows the caller each primitive near a point, triangles too. The tree of triangles knows triangles, but not quads, nor what stands
//! beside them; scenes that are asked for points are few, and get one more tree over all boxes then.

use twincast::math::{Aabb, Vec3};
use twincast::trace::bvh::{BoxTree, Options, Search};

use super::committed::{Body, Committed, Item};
use crate::geometry::Surface;

/// Boxes of all primitives.
pub struct Near {
    tree: BoxTree,
    items: Vec<Item>,
}

impl Near {
    pub fn new(committed: &Committed) -> Self {
        let (mut items, mut boxes) = (Vec::new(), Vec::new());
        for (id, record) in committed.records.iter().enumerate() {
            let Some(record) = record else { continue };
            let mut add = |primitive: usize, bounds: Aabb| {
                items.push(Item { geometry: id as u32, primitive: primitive as u32 });
                boxes.push(bounds);
            };
            match &record.body {
                Body::Surface(surface) => primitives(surface, &mut add),
                Body::Linear(linear) => {
                    for i in 0..linear.count() {
                        let steps = (0..linear.step_count()).map(|step| linear.bounds_at(i, step));
                        add(i, steps.fold(Aabb::EMPTY, Aabb::union));
                    }
                }
                Body::User(user) => {
                    for i in 0..user.boxes[0].len() {
                        add(i, user.boxes.iter().map(|step| step[i]).fold(Aabb::EMPTY, Aabb::union));
                    }
                }
                Body::Instances(instances) => {
                    for (i, instance) in instances.iter().enumerate() {
                        add(i, super::boxes::instance_bounds(instance).0);
                    }
                }
            }
        }
        Self { tree: BoxTree::build(&boxes, Options::default()), items }
    }

    /// Names primitives near a point, up to the radius that the visitor returns last.
    pub fn visit(&self, point: Vec3, radius: f32, visitor: &mut dyn FnMut(Item) -> Search) {
        self.tree.visit_near(point, radius, &mut |i| visitor(self.items[i as usize]));
    }
}

/// The box of each primitive, which may be several triangles in a row.
fn primitives(surface: &Surface, add: &mut impl FnMut(usize, Aabb)) {
    let of = |triangle: usize| {
        let steps = (0..surface.steps.len()).map(|step| surface.bounds_at(triangle, step));
        steps.fold(Aabb::EMPTY, Aabb::union)
    };
    let mut open: Option<(u32, Aabb)> = None;
    for triangle in 0..surface.triangles.len() {
        let (primitive, bounds) = (surface.primitive(triangle as u32), of(triangle));
        open = match open {
            Some((last, all)) if last == primitive => Some((last, all.union(bounds))),
            before => {
                if let Some((last, all)) = before {
                    add(last as usize, all);
                }
                Some((primitive, bounds))
            }
        };
    }
    if let Some((last, all)) = open {
        add(last as usize, all);
    }
}
