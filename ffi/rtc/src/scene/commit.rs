//! From what is described to what rays are traced in.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use twincast::World;
use twincast::math::{Aabb, Vec3};
use twincast::trace::bvh::{BoxTree, Bvh, Options, Preset};
use twincast::trace::{Part, Primitives};

use super::committed::{Body, Committed, Heeded, Instance, Item, Record, UserGeometry};
use super::{Scene, State};
use crate::abi::{RTCBounds, RTCBoundsFunctionArguments, RTCProgressMonitorFunction, quality, scene_flag};
use crate::device::Callback;
use crate::failure::{Code, Failure, Result};
use crate::geometry::{self, Geometry, Kind, Linear, Motion, Surface};

/// What is to be made.
pub struct Plan {
    geometries: Vec<Option<Arc<Geometry>>>,
    flags: u32,
    quality: u32,
    progress: Callback<RTCProgressMonitorFunction>,
}

impl Plan {
    pub fn new(state: &State) -> Self {
        let State { geometries, flags, quality, progress, .. } = state;
        Self { geometries: geometries.clone(), flags: *flags, quality: *quality, progress: *progress }
    }

    fn preset(&self, has_filters: bool) -> Preset {
        match self.quality {
            _ if self.flags & scene_flag::COMPACT != 0 => Preset::Compact,
            quality::LOW => Preset::Fast,
            // A filter is to see each triangle once, and here some are in several leaves.
            quality::HIGH if !has_filters => Preset::High,
            _ => Preset::Default,
        }
    }
}

/// Boxes of the second tree, and what is in them; and those of everything at both ends of time.
#[derive(Default)]
struct Boxes {
    items: Vec<Item>,
    boxes: Vec<Aabb>,
    ends: Option<[Aabb; 2]>,
}

impl Boxes {
    /// Adds to what is around everything.
    fn surround(&mut self, [start, end]: [Aabb; 2]) {
        let [a, b] = self.ends.unwrap_or([Aabb::EMPTY; 2]);
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

/// Makes it.
pub fn commit(scene: &Scene, plan: &Plan) -> Result<Committed> {
    let progress = Progress::new(plan);
    progress.at(0.0)?;
    let mut records: Vec<Option<Record>> = Vec::with_capacity(plan.geometries.len());
    for geometry in &plan.geometries {
        records.push(match geometry {
            Some(geometry) => record(geometry)?,
            None => None,
        });
    }
    let heeded = heeded(&records, plan.flags);
    let has_filters = heeded.intersect_filter || heeded.occluded_filter || heeded.argument_filter;
    let (parts, is_plain) = solid_parts(&records);
    let boxes = other_boxes(&records, &parts);
    let count: usize = parts.iter().map(|part| part.primitives.len()).sum();
    if count + boxes.boxes.len() > BoxTree::MOST {
        return Err(Failure::operation("too many primitives in a scene"));
    }
    let expected = expected_bytes(count, boxes.boxes.len());
    scene.device.account(expected as isize, false)?;
    let progressed = |part: u64| progress.built(part, (count + boxes.boxes.len()).max(1) as u64);
    let preset = plan.preset(has_filters);
    let (solid, others) = scene.device.install(|| {
        let options = Options { preset, progress: Some(&progressed), ..Options::default() };
        let solid = (count > 0).then(|| Bvh::build_with(&world(parts), options));
        let others = (!boxes.boxes.is_empty()).then(|| BoxTree::build(&boxes.boxes, options));
        (solid, others)
    });
    let bytes = solid.as_ref().map_or(0, Bvh::bytes) + others.as_ref().map_or(0, BoxTree::bytes);
    let committed = Committed {
        records,
        solid,
        is_plain,
        others,
        items: boxes.items,
        heeded,
        bounds: boxes.ends.unwrap_or([Aabb::EMPTY; 2]),
        near: std::sync::OnceLock::new(),
        bytes,
    };
    // What was announced is corrected, so that takings and givings back add up.
    _ = scene.device.account(bytes as isize - expected as isize, true);
    progress.at(1.0).inspect_err(|_| _ = scene.device.account(-(bytes as isize), true))?;
    Ok(committed)
}

/// Memory for a tree, before it is made.
fn expected_bytes(triangles: usize, boxes: usize) -> usize {
    64 * triangles + 48 * boxes
}

/// The progress monitor, which may cancel.
struct Progress {
    monitor: Callback<RTCProgressMonitorFunction>,
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl Progress {
    fn new(plan: &Plan) -> Self {
        Self { monitor: plan.progress, done: AtomicU64::new(0), is_cancelled: AtomicBool::new(false) }
    }

    fn tell(&self, part: f64) {
        if let Some(function) = self.monitor.function {
            // SAFETY: the caller promised a function of this type that may be called with its pointer, from any thread.
            if !unsafe { function(self.monitor.user, part) } {
                self.is_cancelled.store(true, Ordering::Relaxed);
            }
        }
    }

    fn at(&self, part: f64) -> Result<()> {
        if !self.is_cancelled.load(Ordering::Relaxed) {
            self.tell(part);
        }
        if self.is_cancelled.load(Ordering::Relaxed) {
            let message = "progress monitor forced termination".into();
            return Err(Failure { code: Code::Cancelled, message });
        }
        Ok(())
    }

    /// So many more of all have found their place. The build goes on after a cancellation; what it makes is dropped.
    fn built(&self, more: u64, all: u64) {
        let done = self.done.fetch_add(more, Ordering::Relaxed) + more;
        if !self.is_cancelled.load(Ordering::Relaxed) {
            self.tell((done as f64 / all as f64).min(1.0));
        }
    }
}

/// A geometry as it is now; none for one that is disabled.
fn record(geometry: &Arc<Geometry>) -> Result<Option<Record>> {
    let state = geometry.state().clone();
    if !state.is_enabled {
        return Ok(None);
    }
    if !state.is_committed {
        return Err(Failure::operation("geometry got not committed"));
    }
    let body = match geometry.kind {
        Kind::Triangles | Kind::Quads | Kind::Grids => Body::Surface(Surface::new(geometry.kind, &state)?),
        Kind::Linear(shape) => Body::Linear(Linear::new(shape, &state)),
        Kind::User => Body::User(user_geometry(geometry, &state)),
        Kind::Instance | Kind::InstanceArray => Body::Instances(instances(geometry.kind, &state)?),
        Kind::Absent => return Ok(None),
    };
    Ok(Some(Record { geometry: Arc::clone(geometry), mask: state.mask, functions: state.functions, body }))
}

/// Asks the caller for the boxes.
fn user_geometry(geometry: &Geometry, state: &geometry::State) -> UserGeometry {
    let Callback { function, user } = state.functions.bounds;
    let bounds_of = |primitive: u32, time_step: u32| {
        let mut bounds = RTCBounds { lower: [f32::INFINITY; 3], upper: [f32::NEG_INFINITY; 3], ..RTCBounds::default() };
        if let Some(function) = function {
            // What was set with the function, unless the geometry has a pointer of its own.
            let own = geometry.user();
            let user = if own.is_null() { user } else { own };
            let arguments = RTCBoundsFunctionArguments { user, primitive, time_step, bounds: &raw mut bounds };
            // SAFETY: the caller promised a function of this type; the arguments live until it returns.
            unsafe { function(&raw const arguments) };
        }
        Aabb { min: Vec3::from(bounds.lower), max: Vec3::from(bounds.upper) }
    };
    let boxes = (0..state.steps() as u32).map(|step| (0..state.primitive_count).map(|i| bounds_of(i, step)).collect());
    UserGeometry { boxes: boxes.collect(), range: state.time_range }
}

fn instances(kind: Kind, state: &geometry::State) -> Result<Vec<Instance>> {
    if kind == Kind::Instance {
        let scene = state.scenes.first().ok_or_else(|| Failure::operation("an instance without a scene"))?;
        return Ok(vec![Instance::new(Arc::clone(scene), Motion::of(kind, state, 0)?)]);
    }
    let count = state.transform_buffers.first().and_then(Option::as_ref).map_or(0, |view| view.count);
    let place = |i: usize| {
        let scene = match &state.index {
            Some(index) => index.words::<1>(i).map_or(usize::MAX, |[scene]| scene as usize),
            None => 0,
        };
        let scene = state.scenes.get(scene).ok_or_else(|| Failure::operation("an instance without a scene"))?;
        Ok(Instance::new(Arc::clone(scene), Motion::of(kind, state, i)?))
    };
    (0..count).map(place).collect()
}

fn heeded(records: &[Option<Record>], flags: u32) -> Heeded {
    let mut masks = records.iter().flatten().map(|record| record.mask);
    let first = masks.next();
    let functions = || records.iter().flatten().map(|record| &record.functions);
    let intersect_filter = functions().any(|functions| functions.intersect_filter.is_some());
    let occluded_filter = functions().any(|functions| functions.occluded_filter.is_some());
    Heeded {
        mask: first.filter(|&first| masks.all(|mask| mask == first)),
        intersect_filter,
        occluded_filter,
        argument_filter: flags & scene_flag::FILTER_IN_ARGUMENTS != 0 || intersect_filter || occluded_filter,
    }
}

/// Surfaces that stand still, and whether each of their triangles is a primitive.
fn solid_parts(records: &[Option<Record>]) -> (Vec<Part>, bool) {
    let mut is_plain = true;
    let mut parts = Vec::new();
    for (id, record) in records.iter().enumerate() {
        if let Some(Record { body: Body::Surface(surface), .. }) = record
            && surface.is_still()
        {
            is_plain &= surface.is_plain();
            let (positions, triangles) = (Arc::clone(&surface.steps[0]), Arc::clone(&surface.triangles));
            let primitives = Primitives::Triangles { positions, triangles };
            parts.push(Part { geometry: id as u32, instance: 0, primitives });
        }
    }
    (parts, is_plain)
}

/// What stands still, in the caller's own coordinates.
fn world(parts: Vec<Part>) -> World {
    let mut world = World::default();
    world.fixed = 0..parts.len();
    world.parts = parts;
    world
}

/// Boxes of everything that is not solid; and around all.
fn other_boxes(records: &[Option<Record>], parts: &[Part]) -> Boxes {
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
