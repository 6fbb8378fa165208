//! Boxes of what is no triangle that stands still: at all times, and at both ends of time.

use twincast_core::math::{Aabb, Affine3, Vec3};

use super::committed::{Body, Instance, Item, Record};
use super::path;

/// Boxes of the second tree, each between two places, and what is in them; and those of everything at both ends of
/// time.
#[derive(Default)]
pub struct Boxes {
    pub items: Vec<Item>,
    pub boxes: Vec<[Aabb; 2]>,
    ends: Option<[Aabb; 2]>,
    /// Those of one primitive at each step.
    steps: Vec<Aabb>,
}

impl Boxes {
    /// The boxes around everything at both ends of time.
    pub fn ends(&self) -> [Aabb; 2] {
        self.ends.unwrap_or([Aabb::EMPTY; 2])
    }

    /// Adds to what is around everything.
    pub fn surround(&mut self, [start, end]: [Aabb; 2]) {
        let [a, b] = self.ends();
        self.ends = Some([a.union(start), b.union(end)]);
    }

    /// Adds a primitive by its boxes at each step of a range of time; one that is nowhere is left out.
    fn add(&mut self, item: Item, steps: impl Iterator<Item = Aabb>, range: (f32, f32)) {
        self.steps.clear();
        self.steps.extend(steps);
        if self.steps.iter().any(Aabb::is_empty) {
            return;
        }
        let ends = path::ends(&self.steps, range);
        self.surround(ends);
        let whole = self.steps.iter().copied().fold(Aabb::EMPTY, Aabb::union);
        self.put(item, whole, ends, range);
    }

    /// Adds what is within `whole` at all times of its range and, from time 0 to 1, between `ends`.
    fn put(&mut self, item: Item, whole: Aabb, ends: [Aabb; 2], (begin, end): (f32, f32)) {
        // What leads to and fro has ends that may be wider than the whole. In units of 2^-24 of the largest coordinate,
        // a position between two steps is off by 3, by 8 for where between them it is, by as many for when these are,
        // and the line and its distance from it by 8: less than 34 together.
        let reach = whole.min.abs().max(whole.max.abs()) * 2e-6;
        let ends = ends.map(|bounds| Aabb { min: bounds.min - reach, max: bounds.max + reach });
        let is_narrower = ends[0].half_area() + ends[1].half_area() < 1.9 * whole.half_area();
        let is_within = begin >= 0.0 && end <= 1.0;
        self.items.push(item);
        self.boxes.push(if is_within && is_narrower { ends } else { [whole; 2] });
    }
}

/// Boxes of everything that is not solid; and around all of that.
pub fn other_boxes(records: &[Option<Box<Record>>]) -> Boxes {
    let mut boxes = Boxes::default();
    for (id, record) in records.iter().enumerate() {
        let Some(record) = record else { continue };
        let item = |primitive: usize| Item::new(id as u32, primitive as u32);
        match &record.body {
            Body::Surface(surface) if surface.steps.is_still() => {}
            Body::Surface(surface) => {
                for i in 0..surface.triangles.len() {
                    let steps = (0..surface.steps.len()).map(|step| surface.bounds_at(i, step));
                    boxes.add(item(i), steps, surface.steps.range());
                }
            }
            Body::Linear(linear) => {
                for i in 0..linear.count() {
                    let steps = (0..linear.steps.len()).map(|step| linear.bounds_at(i, step));
                    boxes.add(item(i), steps, linear.steps.range());
                }
            }
            Body::User(user) => {
                for i in 0..user[0].len() {
                    boxes.add(item(i), user.iter().map(|step| step[i]), user.range());
                }
            }
            Body::Instances(instances) => {
                for (i, instance) in instances.iter().enumerate() {
                    let (whole, ends) = instance_bounds(instance);
                    if !whole.is_empty() {
                        boxes.surround(ends);
                        boxes.put(item(i), whole, ends, instance.motion.range());
                    }
                }
            }
        }
    }
    boxes
}

/// The box of an instance at all times, and those at both ends of time.
pub fn instance_bounds(instance: &Instance) -> (Aabb, [Aabb; 2]) {
    let Instance { scene, motion, .. } = instance;
    // SAFETY: the caller commits an instanced scene before the scene that it is in, not at the same time.
    let Some(committed) = (unsafe { scene.committed() }) else { return (Aabb::EMPTY, [Aabb::EMPTY; 2]) };
    let [start, end] = committed.bounds;
    let all = start.union(end);
    if all.is_empty() {
        return (Aabb::EMPTY, [Aabb::EMPTY; 2]);
    }
    let reach = all.min.abs().max(all.max.abs());
    if motion.is_still() {
        let place = motion.at(0.0);
        let ends = [start, end].map(|bounds| placed(&place, bounds, reach));
        return (ends[0].union(ends[1]), ends);
    }
    let (places, stray) = motion.places(reach.length());
    let mut knots = Vec::with_capacity(2 * places.len());
    for pair in places.windows(2) {
        let inside = [pair[0].0, pair[1].0].map(|time| path::between(start, end, time));
        let ends = product([&pair[0].1, &pair[1].1], inside, reach, stray);
        knots.extend([(pair[0].0, ends[0]), (pair[1].0, ends[1])]);
    }
    let whole = knots.iter().fold(Aabb::EMPTY, |whole, (_, bounds)| whole.union(*bounds));
    (whole, path::linear(knots.into_iter()))
}

/// Two boxes between which what is inside always is while it moves from the first of its boxes to the second and its
/// place from the first transform to the second, both in straight lines.
///
/// The product is quadratic in time, with the control boxes M0 B0, (M0 B1 + M1 B0) / 2 and M1 B1. It strays from the
/// line between the outer ones by 2 t (1 - t) of what the middle one does from their mean, so at most by half of that.
fn product([from, to]: [&Affine3; 2], [start, end]: [Aabb; 2], reach: Vec3, stray: f32) -> [Aabb; 2] {
    let [first, last] = [placed(from, start, reach), placed(to, end, reach)];
    let [a, b] = [placed(from, end, reach), placed(to, start, reach)];
    let below = (a.min + b.min - first.min - last.min).min(Vec3::ZERO) / 4.0 - Vec3::splat(stray);
    let above = (a.max + b.max - first.max - last.max).max(Vec3::ZERO) / 4.0 + Vec3::splat(stray);
    [first, last].map(|bounds| Aabb { min: bounds.min + below, max: bounds.max + above })
}

/// The box around a box in its place; what is inside goes no farther from the origin than `reach`.
fn placed(place: &Affine3, bounds: Aabb, reach: Vec3) -> Aabb {
    let around = Aabb::around(bounds.corners().map(|corner| place.transform_point3(corner)));
    let matrix = &place.matrix3;
    let terms = matrix.x_axis.abs() * reach.x + matrix.y_axis.abs() * reach.y + matrix.z_axis.abs() * reach.z;
    // The rounding of the transform, of what moves inside, and of rays that are taken through the inverse.
    let slack = (terms + place.translation.abs()) * 1e-6;
    Aabb { min: around.min - slack, max: around.max + slack }
}
