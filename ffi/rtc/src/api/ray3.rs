//! Queries of version 3: with a context, which holds the filter.

use super::{present, with};
use crate::abi::{RTCContext, RTCFilterFunctionNArguments, RTCRay, RTCRayHit, RTCRayHitNp, RTCUserFunctionNArguments};
use crate::scene::{Committed, Scene};
use crate::trace::{
    Packed, Pointers, Query, Spare, Target, UserCall, cast_one, intersect_lanes, occluded_lanes, run_filters,
};

/// Asks a committed scene.
///
/// # Safety
/// As for the functions of the interface.
#[inline(always)]
unsafe fn ask<T>(scene: *const Scene, context: *mut RTCContext, rays: *mut T, work: impl FnOnce(&Committed, &Query)) {
    let ask = |scene: &Scene| {
        present(context)?;
        present(rays)?;
        // SAFETY: not null; the caller's.
        let RTCContext { filter, .. } = unsafe { context.read() };
        let query = Query { context, filter, filters_all: true, user: None };
        // SAFETY: the interface's rules.
        work(unsafe { scene.traceable() }?, &query);
        Ok(())
    };
    // SAFETY: as the caller promises.
    unsafe { with(scene, (), ask) }
}

/// Whether a ray of a packet is asked for.
///
/// # Safety
/// `valid` is an array with that place.
#[inline(always)]
unsafe fn is_valid(valid: *const i32, lane: usize) -> bool {
    // SAFETY: as the caller promises.
    unsafe { *valid.add(lane) != 0 }
}

/// The nearest hit of a ray.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcIntersect1(scene: *const Scene, context: *mut RTCContext, ray: *mut RTCRayHit) {
    // SAFETY: the interface's rules.
    unsafe { ask(scene, context, ray, |scene, query| cast_one::<false>(scene, query, &Target::closest(ray))) }
}

/// Whether a ray hits anything.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcOccluded1(scene: *const Scene, context: *mut RTCContext, ray: *mut RTCRay) {
    // SAFETY: the interface's rules.
    unsafe { ask(scene, context, ray, |scene, query| cast_one::<true>(scene, query, &Target::any(ray))) }
}

macro_rules! packets {
    ($($name:ident $count:literal $trace:ident)*) => {$(
        /// Several rays.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $name(valid: *const i32, scene: *const Scene, context: *mut RTCContext, rays: *mut u32) {
            let work = |committed: &Committed, query: &Query| {
                // SAFETY: the interface's rules.
                let lanes = unsafe { Packed::new(rays, $count) };
                // SAFETY: an array of so many, by the interface's rules.
                $trace(committed, query, &lanes, |lane| unsafe { is_valid(valid, lane) });
            };
            if valid.is_null() {
                // Which is reported there.
                // SAFETY: null is.
                return unsafe { ask(scene, context, std::ptr::null_mut::<u32>(), work) };
            }
            // SAFETY: the interface's rules.
            unsafe { ask(scene, context, rays, work) }
        }
    )*};
}

packets! {
    rtcIntersect4 4 intersect_lanes
    rtcIntersect8 8 intersect_lanes
    rtcIntersect16 16 intersect_lanes
    rtcOccluded4 4 occluded_lanes
    rtcOccluded8 8 occluded_lanes
    rtcOccluded16 16 occluded_lanes
}

/// The nearest hit of each ray of a stream.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcIntersect1M(
    scene: *const Scene,
    context: *mut RTCContext,
    rays: *mut RTCRayHit,
    count: u32,
    stride: usize,
) {
    let work = |scene: &Committed, query: &Query| {
        for i in 0..count as usize {
            // SAFETY: so many rays, so far apart, by the interface's rules.
            let target = unsafe { Target::closest(rays.wrapping_byte_add(i * stride)) };
            cast_one::<false>(scene, query, &target);
        }
    };
    // SAFETY: the interface's rules.
    unsafe { ask(scene, context, rays, work) }
}

/// Whether each ray of a stream hits anything.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcOccluded1M(
    scene: *const Scene,
    context: *mut RTCContext,
    rays: *mut RTCRay,
    count: u32,
    stride: usize,
) {
    let work = |scene: &Committed, query: &Query| {
        for i in 0..count as usize {
            // SAFETY: so many rays, so far apart, by the interface's rules.
            let target = unsafe { Target::any(rays.wrapping_byte_add(i * stride)) };
            cast_one::<true>(scene, query, &target);
        }
    };
    // SAFETY: the interface's rules.
    unsafe { ask(scene, context, rays, work) }
}

/// The nearest hit of each ray of a list.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcIntersect1Mp(
    scene: *const Scene,
    context: *mut RTCContext,
    rays: *mut *mut RTCRayHit,
    count: u32,
) {
    let work = |scene: &Committed, query: &Query| {
        for i in 0..count as usize {
            // SAFETY: so many pointers to rays, by the interface's rules.
            let target = unsafe { Target::closest(*rays.add(i)) };
            cast_one::<false>(scene, query, &target);
        }
    };
    // SAFETY: the interface's rules.
    unsafe { ask(scene, context, rays, work) }
}

/// Whether each ray of a list hits anything.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcOccluded1Mp(
    scene: *const Scene,
    context: *mut RTCContext,
    rays: *mut *mut RTCRay,
    count: u32,
) {
    let work = |scene: &Committed, query: &Query| {
        for i in 0..count as usize {
            // SAFETY: so many pointers to rays, by the interface's rules.
            let target = unsafe { Target::any(*rays.add(i)) };
            cast_one::<true>(scene, query, &target);
        }
    };
    // SAFETY: the interface's rules.
    unsafe { ask(scene, context, rays, work) }
}

macro_rules! streams {
    ($($packets:ident $pointers:ident $trace:ident)*) => {$(
        /// A stream of packets.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $packets(
            scene: *const Scene,
            context: *mut RTCContext,
            rays: *mut u32,
            width: u32,
            count: u32,
            stride: usize,
        ) {
            let work = |scene: &Committed, query: &Query| {
                for i in 0..count as usize {
                    // SAFETY: so many packets, so far apart, by the interface's rules.
                    let lanes = unsafe { Packed::new(rays.wrapping_byte_add(i * stride), width as usize) };
                    $trace(scene, query, &lanes, |_| true);
                }
            };
            // SAFETY: the interface's rules.
            unsafe { ask(scene, context, rays, work) }
        }

        /// A stream in an array for each word.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $pointers(
            scene: *const Scene,
            context: *mut RTCContext,
            rays: *const RTCRayHitNp,
            count: u32,
        ) {
            let work = |scene: &Committed, query: &Query| {
                let spare = Spare::new();
                // SAFETY: so many arrays, by the interface's rules.
                let lanes = unsafe { Pointers::new(rays.cast(), count as usize, &spare) };
                $trace(scene, query, &lanes, |_| true);
            };
            // SAFETY: the interface's rules.
            unsafe { ask(scene, context, rays.cast_mut(), work) }
        }
    )*};
}

streams! {
    rtcIntersectNM rtcIntersectNp intersect_lanes
    rtcOccludedNM rtcOccludedNp occluded_lanes
}

macro_rules! filters {
    ($($name:ident $any:literal)*) => {$(
        /// Runs the filters that a hit of user geometry has to pass; within its callback.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $name(
            call: *const RTCUserFunctionNArguments,
            arguments: *const RTCFilterFunctionNArguments,
        ) {
            // SAFETY: what this library gave to the callback, by the interface's rules.
            crate::failure::guard((), || None, || Ok(unsafe { run_filters(call.cast::<UserCall>(), arguments, $any) }));
        }
    )*};
}

filters!(rtcFilterIntersection false rtcFilterOcclusion true);
