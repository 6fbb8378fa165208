//! From what is described to what rays are traced in.

use std::sync::Arc;

use smallvec::{SmallVec, smallvec};
use twincast_core::math::{Aabb, Vec3};
use twincast_core::trace::bvh::{BoxTree, Options, Preset};

use super::boxes::other_boxes;
use super::committed::{Body, Committed, Heeded, Instance, Item, Placed, Record};
use super::progress::Progress;
use super::solid::{Making, Planner, Solid};
use super::{Scene, State};
use crate::abi::{RTCBounds, RTCBoundsFunctionArguments, RTCProgressMonitorFunction, quality, scene_flag};
use crate::device::Callback;
use crate::failure::{Failure, Result};
use crate::geometry::{self, Ball, Geometry, Kind, Linear, Motion, Shape, Surface, TimeSteps};

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

    /// Whether what did not change since the last commit is taken from there. Otherwise all buffers are read anew.
    pub fn is_dynamic(&self) -> bool {
        self.flags & scene_flag::DYNAMIC != 0
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

/// The geometries as they are now, by id; of `old` those that are the same.
fn records(geometries: &[Option<Arc<Geometry>>], mut old: Option<&mut Committed>) -> Result<Vec<Option<Box<Record>>>> {
    let each = geometries.iter().enumerate().map(|(id, geometry)| {
        let Some(geometry) = geometry else { return Ok(None) };
        let before = old.as_mut().and_then(|old| old.records.get_mut(id)?.take());
        match before.filter(|before| is_same(before, geometry)) {
            Some(mut same) => {
                same.is_new = false;
                Ok(Some(same))
            }
            None => Ok(record(geometry)?.map(Box::new)),
        }
    });
    each.collect()
}

/// Makes it. Of `old`, what was made last, that is taken which is the same.
pub fn commit(scene: &Scene, plan: &Plan, mut old: Option<&mut Committed>) -> Result<Committed> {
    let progress = Progress::new(plan.progress);
    progress.at(0.0)?;
    let records = records(&plan.geometries, old.as_deref_mut())?;
    let heeded = heeded(&records);
    let of_queries = plan.flags & scene_flag::FILTER_IN_ARGUMENTS != 0;
    let has_filters = heeded.intersect_filter || heeded.occluded_filter || of_queries;
    let preset = plan.preset(has_filters);
    let made_with = (plan.flags, preset);
    let trees = match &mut old {
        Some(old) if old.made_with == made_with => old.take_solids(),
        _ => Vec::new(),
    };
    let makings = Planner { records: &records, preset, is_dynamic: plan.is_dynamic() }.plan(trees);
    let mut boxes = scene.device.install(|| other_boxes(&records))?;
    let add = |(kept, count), (more, others)| (kept + more, count + others);
    let (kept, count) = makings.iter().map(Making::extent).fold((0, 0), add);
    if count + boxes.boxes.len() > BoxTree::MAX {
        return Err(Failure::operation("too many primitives in a scene"));
    }
    let expected = expected_bytes(count, boxes.boxes.len());
    scene.device.account(expected as isize, false)?;
    let progressed = |part: u64| progress.built(part, (count + boxes.boxes.len()).max(1) as u64);
    let made = scene.device.install(|| {
        let options = Options { preset, progress: Some(&progressed), ..Options::default() };
        let solids: Vec<Solid> = makings.into_iter().map(|making| making.make(&records, options)).collect();
        let others = (!boxes.boxes.is_empty()).then(|| BoxTree::moving(&boxes.boxes, options));
        (solids, others)
    });
    let (solids, others) = made.inspect_err(|_| _ = scene.device.account(-(expected as isize), true))?;
    solids.iter().for_each(|solid| boxes.surround([solid.bounds(); 2]));
    let (others, order) = others.unzip();
    let (items, placed) = in_order(&records, &boxes.items, &order.unwrap_or_default());
    let bytes = solids.iter().map(|solid| solid.bvh.bytes()).sum::<usize>() + others.as_ref().map_or(0, BoxTree::bytes);
    let repeats = solids.iter().any(|solid| solid.bvh.preset() == Preset::High);
    let mut solids = solids.into_iter();
    let committed = Committed {
        device: Arc::clone(&scene.device),
        is_plain: is_plain(&records),
        repeats,
        balls: balls(&records, &items),
        records,
        solid: solids.next(),
        smaller: solids.collect(),
        bounds: boxes.ends(),
        others,
        items,
        placed,
        heeded,
        made_with,
        excludes_start: plan.flags & scene_flag::ROBUST == 0,
        near: std::sync::OnceLock::new(),
        bytes,
    };
    // What was announced is corrected, so that takings and givings back add up. What was kept is the old scene's,
    // unless this one takes its place.
    let more = bytes as isize - kept as isize;
    _ = scene.device.account(more - expected as isize, true);
    progress.at(1.0).inspect_err(|_| _ = scene.device.account(-more, true))?;
    if let Some(old) = old {
        old.bytes -= kept;
    }
    Ok(committed)
}

/// Memory for a tree, before it is made.
fn expected_bytes(triangles: usize, boxes: usize) -> usize {
    64 * triangles + 48 * boxes
}

/// What is in each box of the second tree, and the instances among that, in the order in which it names them.
fn in_order(records: &[Option<Box<Record>>], items: &[Item], order: &[u32]) -> (Vec<Item>, Vec<Placed>) {
    let mut placed = Vec::new();
    let of_box = |&i: &u32| {
        let item = items[i as usize];
        let record = records[item.geometry as usize].as_deref();
        match record.and_then(|record| Placed::new(record, item)) {
            Some(place) => {
                placed.push(place);
                Item { placed: placed.len() as u32 - 1, ..item }
            }
            None => item,
        }
    };
    (order.iter().map(of_box).collect(), placed)
}

/// Of each item where it is, where all are points that stand still: that of its geometry would be anywhere in memory.
fn balls(records: &[Option<Box<Record>>], items: &[Item]) -> Vec<Ball> {
    let ball = |item: &Item| match &records[item.geometry as usize].as_deref()?.body {
        Body::Linear(linear) if linear.steps.is_still() && linear.shape != Shape::RoundCurve => {
            linear.steps[0].get(item.primitive as usize).copied()
        }
        _ => None,
    };
    items.iter().map(ball).collect::<Option<_>>().unwrap_or_default()
}

/// Whether what was read of a geometry's buffers is what would be read now. The caller's own boxes are asked for anew,
/// and instances are where their scenes are now.
fn is_same(before: &Record, geometry: &Arc<Geometry>) -> bool {
    let is_read = matches!(before.body, Body::Surface(_) | Body::Linear(_));
    let is_as_before = |state: &geometry::State| {
        state.is_committed && (state.version, state.buffers) == (before.version, before.buffers)
    };
    is_read && Arc::ptr_eq(&before.geometry, geometry) && is_as_before(&geometry.state())
}

/// A geometry as it is now; none for one that is disabled.
fn record(geometry: &Arc<Geometry>) -> Result<Option<Record>> {
    let state = geometry.state();
    if !state.is_enabled {
        return Ok(None);
    }
    if !state.is_committed {
        return Err(Failure::operation("geometry got not committed"));
    }
    let body = match geometry.kind {
        Kind::Triangles | Kind::Quads | Kind::Grids => Body::Surface(Surface::new(geometry.kind, &state)?),
        Kind::Linear(shape) => Body::Linear(Linear::new(shape, &state)),
        Kind::User => {
            // Not held while the caller's function runs, which may ask for the geometry.
            let own = state.clone();
            drop(state);
            let body = Body::User(user_geometry(geometry, &own));
            return Ok(Some(Record::new(geometry, &own, body)));
        }
        Kind::Instance | Kind::InstanceArray => Body::Instances(instances(geometry.kind, &state)?),
        Kind::Absent => return Ok(None),
    };
    Ok(Some(Record::new(geometry, &state, body)))
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

fn instances(kind: Kind, state: &geometry::State) -> Result<SmallVec<[Instance; 1]>> {
    if kind == Kind::Instance {
        let scene = state.scenes.first().ok_or_else(|| Failure::operation("an instance without a scene"))?;
        return Ok(smallvec![Instance::new(Arc::clone(scene), Motion::of(kind, state, &state.placed, 0)?)]);
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

fn heeded(records: &[Option<Box<Record>>]) -> Heeded {
    let mut masks = records.iter().flatten().map(|record| record.mask);
    let first = masks.next();
    let functions = || records.iter().flatten().map(|record| &record.functions);
    let intersect_filter = functions().any(|functions| functions.intersect_filter.is_some());
    let occluded_filter = functions().any(|functions| functions.occluded_filter.is_some());
    Heeded { mask: first.filter(|&first| masks.all(|mask| mask == first)), intersect_filter, occluded_filter }
}

/// Whether each triangle of surfaces that stand still is a primitive.
fn is_plain(records: &[Option<Box<Record>>]) -> bool {
    records.iter().flatten().all(|record| match &record.body {
        Body::Surface(surface) => surface.is_plain() || !surface.steps.is_still(),
        _ => true,
    })
}
