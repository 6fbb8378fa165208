//! One ray: the triangles, then everything else.

use twincast_core::math::{DAffine3, DVec3, Vec3, triangle_normal};
use twincast_core::trace::bvh::{Bvh, SingleRay, TriangleFound, VisitFlow};
use twincast_core::{Ray, TriangleMethod};

use super::offer::{Nearest, Target};
use super::{Query, round, user};
use crate::abi::{INVALID_ID, InstanceId, RTCRay};
use crate::geometry::{Ball, Named};
use crate::scene::{Body, Committed, Item, Placed, Record, Scene};

/// The ray as the native tracer knows it.
#[inline(always)]
pub fn native(ray: &RTCRay) -> Ray {
    let (origin, direction) = (Vec3::from(ray.org), Vec3::from(ray.dir));
    SingleRay { origin, tmin: ray.tnear, direction, time: ray.time, tmax: ray.tfar }.ray()
}

/// The same for triangles of a scene, which may not count where the ray begins.
#[inline(always)]
fn for_triangles(committed: &Committed, ray: &RTCRay) -> Ray {
    let tmin = if committed.excludes_start { after(ray.tnear) } else { ray.tnear };
    Ray { tmin, ..native(ray) }
}

/// The first number after where a ray begins; a normal one, since denormal ones may count as 0.
#[inline(always)]
pub fn after(tnear: f32) -> f32 {
    if tnear.abs() < f32::MIN_POSITIVE { f32::MIN_POSITIVE } else { tnear.next_up() }
}

/// What a ray with a mask can meet of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    Nothing,
    /// Everything, and no filter is run.
    Everything,
    /// What masks and filters let pass.
    Some,
}

/// What a ray with this mask meets.
#[inline(always)]
pub fn sight(committed: &Committed, query: &Query, mask: u32, any: bool) -> Sight {
    let heeded = &committed.heeded;
    let has_filter = if any { heeded.occluded_filter } else { heeded.intersect_filter };
    match heeded.mask {
        Some(own) if own & mask == 0 => Sight::Nothing,
        // A filter that comes with the query is run whether the scene was told to expect one or not, as in Embree by
        // single rays.
        Some(_) if !(has_filter || query.filter.is_some()) => Sight::Everything,
        _ => Sight::Some,
    }
}

/// The nearest hit, or any, of the target's ray; `ANY` as the target was made.
#[inline(always)]
pub fn cast_one<const ANY: bool>(committed: &Committed, query: &Query, target: &Target) {
    cast_after::<ANY>(committed, query, target, INVALID_ID);
}

/// The same where geometry `nearest` has been hit before: at the same distance the lower one is, here and below. The
/// one that has been hit now; [`INVALID_ID`] stands for none, before and after.
#[inline(always)]
fn cast_after<const ANY: bool>(committed: &Committed, query: &Query, target: &Target, mut nearest: u32) -> u32 {
    let sight = sight(committed, query, target.mask(), ANY);
    if sight == Sight::Nothing {
        return nearest;
    }
    let is_done = || ANY && target.tfar() < 0.0;
    if !committed.smaller.is_empty() {
        nearest = cast_smaller::<ANY>(committed, *query, *target, sight, nearest);
    }
    if let Some(solid) = committed.solid.as_ref().filter(|_| !is_done()) {
        nearest = cast_triangles::<ANY>(committed, &solid.bvh, query, target, sight, nearest);
    }
    if committed.others.is_some() && !is_done() {
        nearest = cast_others::<ANY>(committed, *query, *target, nearest);
    }
    nearest
}

/// The same, not inlined: for instances, and for rays that callbacks send on.
#[inline(never)]
pub fn cast_inside<const ANY: bool>(committed: &Committed, query: &Query, target: &Target, nearest: u32) -> u32 {
    cast_after::<ANY>(committed, query, target, nearest)
}

/// Among the triangles of all trees but the largest, the smallest first, for what is behind need not be looked at then.
/// By value, here and below, so that neither need lie in memory where there is nothing of that.
#[inline(never)]
fn cast_smaller<const ANY: bool>(
    committed: &Committed,
    query: Query,
    target: Target,
    sight: Sight,
    mut nearest: u32,
) -> u32 {
    for solid in committed.smaller.iter().rev() {
        nearest = cast_triangles::<ANY>(committed, &solid.bvh, &query, &target, sight, nearest);
        if ANY && target.tfar() < 0.0 {
            break;
        }
    }
    nearest
}

/// Among triangles, of which some may not pass.
#[inline(always)]
fn cast_triangles<const ANY: bool>(
    committed: &Committed,
    solid: &Bvh,
    query: &Query,
    target: &Target,
    sight: Sight,
    nearest: u32,
) -> u32 {
    if sight == Sight::Everything {
        return cast_solid::<ANY>(committed, solid, query, target, nearest);
    }
    show_solid(committed, solid, *query, *target, nearest)
}

/// Among triangles, of which each counts.
#[inline(always)]
fn cast_solid<const ANY: bool>(
    committed: &Committed,
    solid: &Bvh,
    query: &Query,
    target: &Target,
    nearest: u32,
) -> u32 {
    if ANY {
        // SAFETY: nobody writes to the ray meanwhile.
        let single = unsafe { target.single() };
        let occluded = if committed.excludes_start {
            solid.occludes(&SingleRay { tmin: after(single.tmin), ..*single })
        } else {
            solid.occludes(single)
        };
        if occluded {
            let named = Named { primitive: 0, u: 0.0, v: 0.0, ng: Vec3::ZERO };
            target.take(query, 0, 0.0, &named);
        }
        return INVALID_ID;
    }
    let mut found = TriangleFound::NONE;
    // SAFETY: as above.
    let single = unsafe { target.single() };
    let mut is_hit = solid.closest_triangle(single, &mut found);
    if committed.excludes_start && is_hit && found.hit.t == single.tmin {
        is_hit = beyond_start(solid, single, &mut found);
    }
    let TriangleFound { hit, normal } = &found;
    if is_hit
        && !(hit.t == single.tmax && nearest <= hit.geometry)
        && let Some(named) = name_solid(committed, hit.geometry, hit.primitive, [hit.u, hit.v], *normal)
    {
        target.take(query, hit.geometry, hit.t, &named);
        return hit.geometry;
    }
    nearest
}

/// The nearest triangle that is not where the ray begins.
#[cold]
fn beyond_start(solid: &Bvh, single: &SingleRay, found: &mut TriangleFound) -> bool {
    solid.closest_triangle(&SingleRay { tmin: after(single.tmin), ..*single }, found)
}

/// A hit with a triangle, whose normal is `ng`, in terms of its geometry.
#[inline(always)]
pub fn name_solid(committed: &Committed, geometry: u32, primitive: u32, [u, v]: [f32; 2], ng: Vec3) -> Option<Named> {
    if committed.is_plain {
        return Some(Named { primitive, u, v, ng });
    }
    let Some(Record { body: Body::Surface(surface), .. }) = committed.record(geometry) else { return None };
    Some(surface.name(primitive, u, v, ng))
}

/// Among the triangles, each of which has to pass.
#[inline(never)]
fn show_solid(committed: &Committed, solid: &Bvh, query: Query, target: Target, nearest: u32) -> u32 {
    let ray = target.ray();
    let mut nearest = Nearest::of(nearest);
    // Each is shown once, to filters that count.
    let mut shown = Vec::new();
    solid.visit_triangles(&for_triangles(committed, &ray), &mut |found| {
        let hit = &found.hit;
        if committed.repeats {
            let name = (hit.geometry, hit.primitive);
            if shown.contains(&name) {
                return onwards(&target);
            }
            shown.push(name);
        }
        if let Some(record) = committed.record(hit.geometry)
            && record.mask & ray.mask != 0
            && hit.t <= target.tfar()
            && let Body::Surface(surface) = &record.body
        {
            let named = surface.name(hit.primitive, hit.u, hit.v, found.normal);
            target.offer_to(&mut nearest, &query, record, hit.geometry, hit.t, &named);
        }
        onwards(&target)
    });
    nearest.geometry
}

/// How far the search still goes.
fn onwards(target: &Target) -> VisitFlow {
    let tfar = target.tfar();
    // Below 0 for a ray that has found what it wanted, or that a callback has ended.
    if tfar < 0.0 { VisitFlow::Break(()) } else { VisitFlow::Continue(tfar.next_up()) }
}

/// Among everything that is not a triangle that stands still.
#[inline(never)]
pub fn cast_others<const ANY: bool>(committed: &Committed, query: Query, target: Target, nearest: u32) -> u32 {
    let Some(others) = &committed.others else { return nearest };
    let ray = target.ray();
    let mut nearest = Nearest::of(nearest);
    let only_placed = committed.only_placed();
    if let Some([placed]) = only_placed {
        // Its own tree tells as fast as one over its box that nothing is there.
        if placed.mask & ray.mask != 0 && native(&ray).is_valid() {
            enter::<ANY>(&query, &target, placed, &ray, &mut nearest);
        }
        return nearest.geometry;
    }
    let visitor = &mut |i| {
        let index = i as usize;
        // Where all are instances, what they are need not be looked up.
        let item = if only_placed.is_some() { None } else { committed.items.get(index).copied() };
        let placed = item.map_or(index, |item| item.placed as usize);
        if let Some((ball, item)) = committed.balls.get(index).zip(item) {
            cast_point(committed, &query, &target, item, ball, &ray, &mut nearest);
        } else if let Some(placed) = committed.placed.get(placed) {
            if placed.mask & ray.mask != 0 {
                enter::<ANY>(&query, &target, placed, &ray, &mut nearest);
            }
        } else if let Some(item) = item
            && let Some(record) = committed.record(item.geometry)
            && record.mask & ray.mask != 0
        {
            cast_item::<ANY>(committed, &query, &target, record, item, &ray, &mut nearest);
        }
        onwards(&target)
    };
    if ANY {
        others.visit_any(&native(&ray), visitor)
    } else {
        others.visit(&native(&ray), visitor)
    }
    nearest.geometry
}

/// A point that stands still.
#[inline(always)]
fn cast_point(
    committed: &Committed,
    query: &Query,
    target: &Target,
    item: Item,
    ball: &Ball,
    ray: &RTCRay,
    nearest: &mut Nearest,
) {
    let Item { geometry, primitive, .. } = item;
    if let Some(record) = committed.record(geometry)
        && record.mask & ray.mask != 0
        && let Body::Linear(linear) = &record.body
    {
        round::offer_point(linear, primitive, ball, &native(ray), |t, named| {
            if (ray.tnear..=target.tfar()).contains(&t) {
                target.offer_to(nearest, query, record, geometry, t, named);
            }
        });
    }
}

fn cast_item<const ANY: bool>(
    committed: &Committed,
    query: &Query,
    target: &Target,
    record: &Record,
    item: Item,
    ray: &RTCRay,
    nearest: &mut Nearest,
) {
    let Item { geometry, primitive, .. } = item;
    match &record.body {
        Body::Surface(surface) => {
            if surface.steps.is_at(ray.time) {
                let corners = surface.corners_at(primitive as usize, ray.time);
                let native = Ray { tmax: target.tfar(), ..for_triangles(committed, ray) };
                if let Some(hit) = TriangleMethod::Exact.intersect(&native, corners) {
                    let named = surface.name(primitive, hit.u as f32, hit.v as f32, triangle_normal(corners));
                    target.offer_to(nearest, query, record, geometry, hit.t as f32, &named);
                }
            }
        }
        Body::Linear(linear) => {
            if linear.steps.is_at(ray.time) {
                round::offer(linear, primitive, &native(ray), |t, named| {
                    if (ray.tnear..=target.tfar()).contains(&t) {
                        target.offer_to(nearest, query, record, geometry, t, named);
                    }
                });
            }
        }
        Body::User(user) => {
            if user.is_at(ray.time) {
                let before = target.tfar();
                user::cast::<ANY>(query, target, record, item);
                if target.tfar() != before {
                    *nearest = Nearest { geometry, primitive };
                }
            }
        }
        Body::Instances(instances) => {
            // Those that stand still are entered by `Placed`.
            if let Some(instance) = instances.get(primitive as usize)
                && instance.motion.is_at(ray.time)
            {
                let own = Nearest { geometry, primitive };
                enter_at::<ANY>(query, target, own, &instance.scene, &instance.to_scene(ray.time), ray, nearest);
            }
        }
    }
}

/// Takes the ray through an instance that stands still.
#[inline(always)]
pub fn enter<const ANY: bool>(query: &Query, target: &Target, placed: &Placed, ray: &RTCRay, nearest: &mut Nearest) {
    let &Placed { ref scene, ref to_scene, geometry, primitive, .. } = placed;
    enter_at::<ANY>(query, target, Nearest { geometry, primitive }, scene, to_scene, ray, nearest);
}

/// Takes the ray through instance `own`: one level deep, as both Debians' Embree is built.
fn enter_at<const ANY: bool>(
    query: &Query,
    target: &Target,
    own: Nearest,
    scene: &Scene,
    to_scene: &DAffine3,
    ray: &RTCRay,
    nearest: &mut Nearest,
) {
    // SAFETY: the context is the caller's, which lives as long as the query and is this thread's, or our own.
    if unsafe { (*query.context).instance }.is_inside() {
        return;
    }
    // SAFETY: scenes are not committed while rays are traced: the interface's rule.
    let Some(committed) = (unsafe { scene.committed() }) else { return };
    let [org, dir] = [ray.org, ray.dir].map(|v| DVec3::from(v.map(f64::from)));
    let (org, dir) = (to_scene.transform_point3(org).as_vec3(), to_scene.transform_vector3(dir).as_vec3());
    // At the distance of the hit so far everything in here is, or nothing: as if none had been hit, or the lowest that
    // can be.
    let before = if *nearest <= own { 0 } else { INVALID_ID };
    let tfar = target.tfar();
    let mut now = before;
    within(query, InstanceId::new(own.geometry, own.primitive), || {
        target.set_place(org.to_array(), dir.to_array());
        now = cast_inside::<ANY>(committed, query, target, before);
        target.set_place(ray.org, ray.dir);
    });
    if now != before || target.tfar() != tfar {
        *nearest = own;
    }
}

/// Runs `work` with the context naming an instance.
pub fn within(query: &Query, instance: InstanceId, work: impl FnOnce()) {
    // SAFETY: as in `enter`; no reference is kept while `work` runs, which may give the context to callbacks.
    let before = unsafe { std::mem::replace(&mut (*query.context).instance, instance) };
    work();
    // SAFETY: as above.
    unsafe { (*query.context).instance = before }
}
