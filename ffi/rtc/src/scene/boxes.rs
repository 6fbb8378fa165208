//! Boxes of what is no triangle that stands still: at all times, and at both ends of time.

use twincast::math::{Aabb, Vec3};
use twincast::trace::Part;

use super::committed::{Body, Instance, Item, Record};

/// Boxes of the second tree, and what is in them; and those of everything at both ends of time.
#[derive(Default)]
pub struct Boxes {
    pub items: Vec<Item>,
    pub boxes: Vec<Aabb>,
    ends: Option<[Aabb; 2]>,
}

impl Boxes {
    /// The boxes around everything at both ends of time.
    pub fn ends(&self) -> [Aabb; 2] {
        self.ends.unwrap_or([Aabb::EMPTY; 2])
    }

    /// Adds to what is around everything.
    fn surround(&mut self, [start, end]: [Aabb; 2]) {
        let [a, b] = self.ends();
        self.ends = Some([a.union(start), b.union(end)]);
    }

    /// Adds a primitive by its boxes at each time step; one that is nowhere is left out.
    fn add(&mut self, item: Item, steps: impl Iterator<Item = Aabb> + Clone) {
        if steps.clone().any(|bounds| !(bounds.min.cmple(bounds.max).all())) {
            return;
        }
        self.surround(linear(steps.clone()));
        self.items.push(item);
        self.boxes.push(steps.fold(Aabb::EMPTY, Aabb::union));
    }
}

/// Two boxes between which those of all steps are, if the steps are as far apart in time.
fn linear(steps: impl Iterator<Item = Aabb> + Clone) -> [Aabb; 2] {
    let count = steps.clone().count();
    let (Some(mut first), Some(mut last)) = (steps.clone().next(), steps.clone().last()) else {
        return [Aabb::EMPTY; 2];
    };
    let (a, b) = (first, last);
    for (i, step) in steps.enumerate().skip(1).take(count.saturating_sub(2)) {
        let at = i as f32 / (count - 1) as f32;
        let below = (step.min - a.min.lerp(b.min, at)).min(Vec3::ZERO);
        let above = (step.max - a.max.lerp(b.max, at)).max(Vec3::ZERO);
        first = Aabb { min: first.min.min(a.min + below), max: first.max.max(a.max + above) };
        last = Aabb { min: last.min.min(b.min + below), max: last.max.max(b.max + above) };
    }
    [first, last]
}

/// Boxes of everything that is not solid; and around all.
pub fn other_boxes(records: &[Option<Record>], parts: &[Part]) -> Boxes {
    let mut boxes = Boxes::default();
    parts.iter().for_each(|part| boxes.surround([part.bounds(); 2]));
    for (id, record) in records.iter().enumerate() {
        let Some(record) = record else { continue };
        let item = |primitive: usize| Item { geometry: id as u32, primitive: primitive as u32 };
        match &record.body {
            Body::Surface(surface) if surface.is_still() => {}
            Body::Surface(surface) => {
                for i in 0..surface.triangles.len() {
                    boxes.add(item(i), (0..surface.steps.len()).map(|step| surface.bounds_at(i, step)));
                }
            }
            Body::Linear(linear) => {
                for i in 0..linear.count() {
                    boxes.add(item(i), (0..linear.step_count()).map(|step| linear.bounds_at(i, step)));
                }
            }
            Body::User(user) => {
                for i in 0..user.boxes[0].len() {
                    boxes.add(item(i), user.boxes.iter().map(|step| step[i]));
                }
            }
            Body::Instances(instances) => {
                for (i, instance) in instances.iter().enumerate() {
                    let (whole, ends) = instance_bounds(instance);
                    if whole.min.cmple(whole.max).all() {
                        boxes.surround(ends);
                        boxes.items.push(item(i));
                        boxes.boxes.push(whole);
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
    if !all.min.cmple(all.max).all() {
        return (Aabb::EMPTY, [Aabb::EMPTY; 2]);
    }
    let reach = all.min.abs().max(all.max.abs()).element_sum();
    let (places, stray) = motion.places(reach);
    let last = (places.len() - 1).max(1) as f32;
    let placed = places.iter().enumerate().map(|(i, place)| {
        let at = i as f32 / last;
        // What is inside moves as well, somewhere between its boxes.
        let (min, max) = (start.min.lerp(end.min, at), start.max.lerp(end.max, at));
        let inside = if places.len() == 1 { all } else { Aabb { min, max } };
        let corner = |k: usize| {
            let pick = |bit: usize, axis: usize| if k >> bit & 1 == 0 { inside.min[axis] } else { inside.max[axis] };
            place.transform_point3(Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2)))
        };
        let bounds = Aabb::around((0..8).map(corner));
        // The rounding of the transform, here and when rays are taken through its inverse.
        let slack = Vec3::splat(stray) + (bounds.min.abs().max(bounds.max.abs()) + Vec3::splat(reach * 1e-7)) * 1e-6;
        Aabb { min: bounds.min - slack, max: bounds.max + slack }
    });
    let ends = linear(placed.clone());
    // Products of two motions are not straight: the whole is of both boxes everywhere.
    (placed.fold(ends[0].union(ends[1]), Aabb::union), ends)
}
