//! From what is described to what rays are traced in.

use std::sync::Arc;

use twincast_core::World;
use twincast_core::math::{Aabb, Vec3};
use twincast_core::trace::bvh::{BoxTree, Bvh, Options, Preset};
use twincast_core::trace::{Part, Primitives};

use super::boxes::other_boxes;
use super::committed::{Body, Committed, Heeded, Instance, Record};
use super::progress::Progress;
use super::{Scene, State};
use crate::abi::{RTCBounds, RTCBoundsFunctionArguments, RTCProgressMonitorFunction, quality, scene_flag};
use crate::device::Callback;
use crate::failure::{Failure, Result};
use crate::geometry::{self, Geometry, Kind, Linear, Motion, Surface, TimeSteps};

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

/// Makes it.
pub fn commit(scene: &Scene, plan: &Plan) -> Result<Committed> {
    let progress = Progress::new(plan.progress);
    progress.at(0.0)?;
    let mut records: Vec<Option<Record>> = Vec::with_capacity(plan.geometries.len());
    for geometry in &plan.geometries {
        records.push(match geometry {
            Some(geometry) => record(geometry)?,
            None => None,
        });
    }
    let heeded = heeded(&records);
    let of_queries = plan.flags & scene_flag::FILTER_IN_ARGUMENTS != 0;
    let has_filters = heeded.intersect_filter || heeded.occluded_filter || of_queries;
    let (parts, is_plain) = solid_parts(&records);
    let boxes = scene.device.install(|| other_boxes(&records, &parts))?;
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
        let others = (!boxes.boxes.is_empty()).then(|| BoxTree::moving(&boxes.boxes, options));
        (solid, others)
    })?;
    let bounds = boxes.ends();
    let bytes = solid.as_ref().map_or(0, Bvh::bytes) + others.as_ref().map_or(0, BoxTree::bytes);
    let committed = Committed {
        device: Arc::clone(&scene.device),
        records,
        solid,
        is_plain,
        repeats: preset == Preset::High,
        others,
        items: boxes.items,
        heeded,
        bounds,
        excludes_start: plan.flags & scene_flag::ROBUST == 0,
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
fn user_geometry(geometry: &Geometry, state: &geometry::State) -> TimeSteps<Vec<Aabb>> {
    let function = state.functions.bounds;
    let bounds_of = |primitive: u32, time_step: u32| {
        let mut bounds = RTCBounds { lower: [f32::INFINITY; 3], upper: [f32::NEG_INFINITY; 3], ..RTCBounds::default() };
        if let Some(function) = function {
            let user = geometry.user();
            let arguments = RTCBoundsFunctionArguments { user, primitive, time_step, bounds: &raw mut bounds };
            // SAFETY: the caller promised a function of this type; the arguments live until it returns.
            unsafe { function(&raw const arguments) };
        }
        Aabb { min: Vec3::from(bounds.lower), max: Vec3::from(bounds.upper) }
    };
    let boxes = (0..state.steps() as u32).map(|step| (0..state.primitive_count).map(|i| bounds_of(i, step)).collect());
    TimeSteps::new(boxes.collect(), state.time_range)
}

fn instances(kind: Kind, state: &geometry::State) -> Result<Vec<Instance>> {
    if kind == Kind::Instance {
        let scene = state.scenes.first().ok_or_else(|| Failure::operation("an instance without a scene"))?;
        return Ok(vec![Instance::new(Arc::clone(scene), Motion::of(kind, state, &state.placed, 0)?)]);
    }
    let count = state.transform_buffers.first().and_then(Option::as_ref).map_or(0, |view| view.count());
    let place = |i: usize| {
        let scene = match &state.index {
            Some(index) => index.words::<1>(i).map_or(usize::MAX, |[scene]| scene as usize),
            None => 0,
        };
        let scene = state.scenes.get(scene).ok_or_else(|| Failure::operation("an instance without a scene"))?;
        Ok(Instance::new(Arc::clone(scene), Motion::of(kind, state, &state.placed, i)?))
    };
    (0..count).map(place).collect()
}

fn heeded(records: &[Option<Record>]) -> Heeded {
    let mut masks = records.iter().flatten().map(|record| record.mask);
    let first = masks.next();
    let functions = || records.iter().flatten().map(|record| &record.functions);
    let intersect_filter = functions().any(|functions| functions.intersect_filter.is_some());
    let occluded_filter = functions().any(|functions| functions.occluded_filter.is_some());
    Heeded { mask: first.filter(|&first| masks.all(|mask| mask == first)), intersect_filter, occluded_filter }
}

/// Surfaces that stand still, and whether each of their triangles is a primitive.
fn solid_parts(records: &[Option<Record>]) -> (Vec<Part>, bool) {
    let mut is_plain = true;
    let mut parts = Vec::new();
    for (id, record) in records.iter().enumerate() {
        if let Some(Record { body: Body::Surface(surface), .. }) = record
            && surface.steps.is_still()
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
