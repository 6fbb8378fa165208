//! Queries, and what Embree calls back during them.
#![allow(unsafe_code, reason = "Embree's C interface: queries and the callbacks of shapes")]

use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::packet::{Active, RayHits, Rays, hit_row, ray_row};
use super::scene::{Scene, ShapeList};
use super::single::{SingleRay, SingleRayHit};
use super::sys;
use crate::math::{Aabb, Vec3};
use crate::ray::Ray;
use crate::shape::Shape;

/// How queries are made: the context of Embree 3. What its inline functions would initialise is written out, for
/// bindgen passes over those.
#[cfg(not(embree4))]
pub(super) struct Mode(sys::RTCIntersectContext);

/// How queries are made: the arguments of Embree 4.
#[cfg(embree4)]
pub(super) struct Mode {
    intersect: sys::RTCIntersectArguments,
    occluded: sys::RTCOccludedArguments,
}

impl Mode {
    /// For rays that start and point alike, or not.
    #[cfg(not(embree4))]
    #[inline]
    pub(super) fn new(coherent: bool) -> Self {
        let flags = if coherent {
            sys::RTC_INTERSECT_CONTEXT_FLAG_COHERENT
        } else {
            sys::RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT
        };
        Self(sys::RTCIntersectContext { flags, instID: [sys::INVALID_ID; _], ..Default::default() })
    }

    /// For rays that start and point alike, or not.
    #[cfg(embree4)]
    #[inline]
    pub(super) fn new(coherent: bool) -> Self {
        let flags = if coherent { sys::RTC_RAY_QUERY_FLAG_COHERENT } else { sys::RTC_RAY_QUERY_FLAG_INCOHERENT };
        let feature_mask = sys::RTC_FEATURE_FLAG_ALL;
        Self {
            intersect: sys::RTCIntersectArguments { flags, feature_mask, ..Default::default() },
            occluded: sys::RTCOccludedArguments { flags, feature_mask, ..Default::default() },
        }
    }
}

/// Finds the nearest hit of the ray that `query` holds.
#[inline(always)]
pub(super) fn intersect(query: &mut SingleRayHit, scene: &Scene, mode: &mut Mode) {
    let query = (&raw mut *query).cast::<sys::RTCRayHit>();
    // SAFETY: the scene is committed; `packet` asserts that the query has the size and alignment of RTCRayHit.
    unsafe {
        #[cfg(not(embree4))]
        sys::rtcIntersect1(scene.raw(), &mut mode.0, query);
        #[cfg(embree4)]
        sys::rtcIntersect1(scene.raw(), query, &mut mode.intersect);
    }
}

/// Finds whether the ray that `query` holds hits anything.
#[inline(always)]
pub(super) fn occluded(query: &mut SingleRay, scene: &Scene, mode: &mut Mode) {
    let query = (&raw mut *query).cast::<sys::RTCRay>();
    // SAFETY: the scene is committed; `packet` asserts that the query has the size and alignment of RTCRay.
    unsafe {
        #[cfg(not(embree4))]
        sys::rtcOccluded1(scene.raw(), &mut mode.0, query);
        #[cfg(embree4)]
        sys::rtcOccluded1(scene.raw(), query, &mut mode.occluded);
    }
}

/// Stands for Embree's functions over packets of `4 * G` rays, of which there are three.
pub(super) struct Packets;

/// Queries of packets.
pub(super) trait PacketQuery<const G: usize> {
    /// The nearest hit of each active ray.
    fn intersect(packet: &mut RayHits<G>, active: &Active<G>, scene: &Scene, mode: &mut Mode);
    /// Whether each active ray hits anything.
    fn occluded(rays: &mut Rays<G>, active: &Active<G>, scene: &Scene, mode: &mut Mode);
}

macro_rules! packet_query {
    ($groups:literal, $intersect:ident, $occluded:ident) => {
        impl PacketQuery<$groups> for Packets {
            #[inline(always)]
            fn intersect(packet: &mut RayHits<$groups>, active: &Active<$groups>, scene: &Scene, mode: &mut Mode) {
                let (active, packet) = (active.as_ptr(), (&raw mut *packet).cast());
                // SAFETY: the scene is committed; `packet` asserts size and alignment, the mask is 64-byte aligned.
                unsafe {
                    #[cfg(not(embree4))]
                    sys::$intersect(active, scene.raw(), &mut mode.0, packet);
                    #[cfg(embree4)]
                    sys::$intersect(active, scene.raw(), packet, &mut mode.intersect);
                }
            }

            #[inline(always)]
            fn occluded(rays: &mut Rays<$groups>, active: &Active<$groups>, scene: &Scene, mode: &mut Mode) {
                let (active, rays) = (active.as_ptr(), (&raw mut *rays).cast());
                // SAFETY: as above.
                unsafe {
                    #[cfg(not(embree4))]
                    sys::$occluded(active, scene.raw(), &mut mode.0, rays);
                    #[cfg(embree4)]
                    sys::$occluded(active, scene.raw(), rays, &mut mode.occluded);
                }
            }
        }
    };
}
packet_query!(1, rtcIntersect4, rtcOccluded4);
packet_query!(2, rtcIntersect8, rtcOccluded8);
packet_query!(4, rtcIntersect16, rtcOccluded16);

/// By how much of a coordinate bounds are made larger: four steps of f32.
const BOUNDS_PAD: f32 = 4.0 * f32::EPSILON;

/// `RTCBoundsFunction`: the bounds of one shape; empty ones make Embree leave it out.
///
/// # Safety
/// Embree's: `args` are its own, with the user data that [`SceneBuilder::add_shapes`] registered.
///
/// [`SceneBuilder::add_shapes`]: super::scene::SceneBuilder::add_shapes
pub(super) unsafe extern "C" fn on_bounds(args: *const sys::RTCBoundsFunctionArguments) {
    // SAFETY: Embree's arguments are valid during the call, and `bounds_o` is its to be written.
    let (args, bounds) = unsafe { (&*args, &mut *(*args).bounds_o) };
    // SAFETY: the user data is a ShapeList, kept by the scene that Embree is building.
    let list = unsafe { shape_list(args.geometryUserPtr) };
    let Aabb { mut min, mut max } = guard(list, Aabb::EMPTY, || list.shapes[args.primID as usize].bounds());
    if min.cmple(max).all() {
        // A ray along the very side of a box is outside for Embree, and the side of a box may be a shape's.
        let pad = (min.abs().max(max.abs()) * BOUNDS_PAD).max(Vec3::splat(f32::MIN_POSITIVE));
        (min, max) = (min - pad, max + pad);
    }
    [bounds.lower_x, bounds.lower_y, bounds.lower_z] = min.to_array();
    [bounds.upper_x, bounds.upper_y, bounds.upper_z] = max.to_array();
}

/// `RTCIntersectFunctionN`.
///
/// # Safety
/// As of [`on_bounds`].
pub(super) unsafe extern "C" fn on_intersect(args: *const sys::RTCIntersectFunctionNArguments) {
    // SAFETY: Embree's arguments are valid during the call.
    let args = unsafe { &*args };
    let width = args.N as usize;
    // SAFETY: the user data is a ShapeList, kept by the scene. The packet is `width` lanes of the rows of a ray and
    // then at least 8 rows of a hit, all 4-byte numbers, and the mask `width` numbers; nobody else uses them meanwhile.
    let (list, words, active) = unsafe {
        let words = (ray_row::COUNT + hit_row::INSTANCE + 1) * width;
        (
            shape_list(args.geometryUserPtr),
            std::slice::from_raw_parts_mut(args.rayhit.cast::<u32>(), words),
            std::slice::from_raw_parts_mut(args.valid, width),
        )
    };
    // SAFETY: Embree always passes a context.
    let instance = unsafe { (*args.context).instID[0] };
    let (rays, hits) = words.split_at_mut(ray_row::COUNT * width);
    each_hit(list, args.primID, rays, active, Shape::hit_at, |lane, hit, rays| {
        rays[ray_row::TFAR * width + lane] = (hit.t as f32).to_bits();
        let mut set = |row: usize, bits: u32| hits[row * width + lane] = bits;
        // Nobody asks for the normal; zeros, because Embree's filters and debuggers may look at it.
        (hit_row::NORMAL..hit_row::U).for_each(|row| set(row, 0));
        set(hit_row::U, hit.uv.x.to_bits());
        set(hit_row::V, hit.uv.y.to_bits());
        set(hit_row::PRIMITIVE, args.primID);
        set(hit_row::GEOMETRY, args.geomID);
        set(hit_row::INSTANCE, instance);
    });
}

/// `RTCOccludedFunctionN`.
///
/// # Safety
/// As of [`on_bounds`].
pub(super) unsafe extern "C" fn on_occluded(args: *const sys::RTCOccludedFunctionNArguments) {
    // SAFETY: Embree's arguments are valid during the call.
    let args = unsafe { &*args };
    let width = args.N as usize;
    // SAFETY: as in `on_intersect`, without the rows of a hit.
    let (list, rays, active) = unsafe {
        (
            shape_list(args.geometryUserPtr),
            std::slice::from_raw_parts_mut(args.ray.cast::<u32>(), ray_row::COUNT * width),
            std::slice::from_raw_parts_mut(args.valid, width),
        )
    };
    each_hit(
        list,
        args.primID,
        rays,
        active,
        |_, _, _| (),
        |lane, (), rays| {
            rays[ray_row::TFAR * width + lane] = f32::NEG_INFINITY.to_bits();
        },
    );
}

/// Calls `found` with the lane, what `hit_at` makes of the shape, the ray and t, and the rays for each active ray that
/// hits the shape.
fn each_hit<T>(
    list: &ShapeList,
    primitive: u32,
    rays: &mut [u32],
    active: &mut [i32],
    hit_at: impl Fn(&Shape, &Ray, f64) -> T,
    mut found: impl FnMut(usize, T, &mut [u32]),
) {
    let width = active.len();
    for (lane, active) in active.iter_mut().enumerate() {
        if *active != -1 {
            continue;
        }
        let get = |row: usize| f32::from_bits(rays[row * width + lane]);
        let vector = |row: usize| Vec3::new(get(row), get(row + 1), get(row + 2));
        let ray = Ray {
            origin: vector(ray_row::ORIGIN),
            direction: vector(ray_row::DIRECTION),
            tmin: get(ray_row::TNEAR),
            tmax: get(ray_row::TFAR),
            // A shape stands still in its own coordinates.
            time: 0.0,
        };
        let hit = guard(list, None, || {
            let shape = &list.shapes[primitive as usize];
            shape.crossings(&ray).next().map(|t| hit_at(shape, &ray, t))
        });
        // Version 4 reads the answer from the mask, version 3 goes on using it as the mask of its own.
        if cfg!(embree4) {
            *active = if hit.is_some() { -1 } else { 0 };
        }
        if let Some(hit) = hit {
            found(lane, hit, rays);
        }
    }
}

/// What `f` returns; `otherwise` where it panics, which is noted: no panic may unwind into Embree.
fn guard<T>(list: &ShapeList, otherwise: T, f: impl FnOnce() -> T) -> T {
    catch_unwind(AssertUnwindSafe(f)).unwrap_or_else(|_| {
        list.state.report_panic();
        otherwise
    })
}

/// # Safety
/// `user_data` is what `SceneBuilder::add_shapes` registered, and its scene is alive.
unsafe fn shape_list<'a>(user_data: *mut c_void) -> &'a ShapeList {
    // SAFETY: the caller's.
    unsafe { &*user_data.cast::<ShapeList>() }
}
