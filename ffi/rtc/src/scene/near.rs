//! Boxes of the primitives that point queries show, all but points and curves, where the trees of rays do not do.
//!
//! A query shows the caller each primitive near a point, triangles too. The trees of triangles know triangles, but not
//! quads, nor what stands beside them; scenes that are asked for points are few, and get one more tree over such boxes
//! then. It holds what moves by where it ever is; whether it is near at the time of the query is looked at before the
//! caller is shown it.

use twincast_core::math::{Aabb, Vec3};
use twincast_core::trace::bvh::{BoxTree, Options, VisitFlow};

use super::committed::{Body, Committed, Item};
use super::path;
use crate::geometry::{Surface, TimeSteps};

/// Boxes of primitives.
pub struct Near {
    tree: BoxTree,
    items: Vec<Item>,
    /// As many, where any moves: where those are that do.
    paths: Vec<Option<TimeSteps<Aabb>>>,
}

/// Whether what moves is as near as that at a time; maybe where rounding decides.
fn is_near(path: &TimeSteps<Aabb>, point: Vec3, radius: f32, time: f32) -> bool {
    if !path.is_at(time) {
        return false;
    }
    let Aabb { min, max } = path::at(path, path.range(), time);
    let slack = 8.0 * f32::EPSILON * (min.abs().max(max.abs()).max(point.abs()).max_element() + radius);
    // Not by "farther than": what is not a number is shown.
    let is_farther = (min - point).max(point - max).max(Vec3::ZERO).length() > radius + slack;
    !is_farther
}

impl Near {
    pub fn new(committed: &Committed) -> Self {
        let (mut items, mut boxes, mut paths): (Vec<Item>, Vec<Aabb>, Vec<Option<TimeSteps<Aabb>>>) =
            Default::default();
        for (id, record) in committed.records.iter().enumerate() {
            let Some(record) = record else { continue };
            let mut add = |primitive: usize, steps: &[Aabb], range: (f32, f32)| {
                // Rays pass through what is nowhere at some step, too.
                if steps.iter().any(Aabb::is_empty) {
                    return;
                }
                items.push(Item::new(id as u32, primitive as u32));
                boxes.push(steps.iter().copied().fold(Aabb::EMPTY, Aabb::union));
                paths.push((steps.len() > 1).then(|| TimeSteps::new(steps.into(), range)));
            };
            let mut steps = Vec::new();
            match &record.body {
                Body::Surface(surface) if surface.steps.is_still() && committed.names_triangles() => {}
                Body::Surface(surface) => primitives(surface, &mut add),
                // Points and curves are not shown: the interface's rule.
                Body::Linear(_) => {}
                Body::User(user) => {
                    for i in 0..user[0].len() {
                        steps.clear();
                        steps.extend(user.iter().map(|step| step[i]));
                        add(i, &steps, user.range());
                    }
                }
                Body::Instances(instances) => {
                    for (i, instance) in instances.iter().enumerate() {
                        // Where it is then is known when it is entered.
                        add(i, &[super::boxes::instance_bounds(instance).0], (0.0, 1.0));
                    }
                }
            }
        }
        let (tree, order) = BoxTree::build(&boxes, Options::default());
        let (items, paths) = order.iter().map(|&i| (items[i as usize], paths[i as usize].take())).unzip();
        Self { tree, items, paths }
    }

    /// Names primitives whose boxes overlap a box, and some that are only near it.
    pub fn overlapping(&self, bounds: &Aabb, visitor: &mut dyn FnMut(Item)) {
        self.tree.visit_overlapping(bounds, &mut |i| visitor(self.items[i as usize]));
    }

    /// Names primitives that are near a point at a time, or whenever, up to the radius that the visitor returns last.
    pub fn visit(&self, point: Vec3, mut radius: f32, time: Option<f32>, visitor: &mut dyn FnMut(Item) -> VisitFlow) {
        self.tree.visit_near(point, radius, &mut |i| {
            if let (Some(path), Some(time)) = (&self.paths[i as usize], time)
                && !is_near(path, point, radius, time)
            {
                return VisitFlow::Continue(radius);
            }
            let search = visitor(self.items[i as usize]);
            if let VisitFlow::Continue(reach) = search {
                radius = reach;
            }
            search
        });
    }
}

/// The boxes of each primitive, which may be several triangles in a row, at each step.
fn primitives(surface: &Surface, add: &mut impl FnMut(usize, &[Aabb], (f32, f32))) {
    let mut steps = vec![Aabb::EMPTY; surface.steps.len()];
    let count = surface.triangles.len();
    for triangle in 0..count {
        let primitive = surface.primitive(triangle as u32);
        for (step, bounds) in steps.iter_mut().enumerate() {
            *bounds = bounds.union(surface.bounds_at(triangle, step));
        }
        if triangle + 1 == count || surface.primitive(triangle as u32 + 1) != primitive {
            add(primitive as usize, &steps, surface.steps.range());
            steps.fill(Aabb::EMPTY);
        }
    }
}
