//! Queries of version 4: with arguments, or none; and rays that user geometry sends on.

use super::{present, with};
use crate::abi::*;
use crate::scene::{Committed, Scene};
use crate::trace::{
    Packed, Query, Target, UserCall, cast_inside, cast_one, intersect_lanes, occluded_lanes, run_filters, within,
};

/// Asks a committed scene.
///
/// # Safety
/// As for the functions of the interface.
#[inline(always)]
unsafe fn ask<T>(
    scene: *const Scene,
    arguments: *const RTCIntersectArguments,
    rays: *mut T,
    work: impl FnOnce(&Committed, &Query),
) {
    let ask = |scene: &Scene| {
        present(rays)?;
        let mut own = RTCContext { instance: InstanceId::OUTSIDE };
        let mut query = Query { context: &raw mut own, filter: None, filters_all: false, user: None };
        // SAFETY: null or the caller's.
        if let Some(arguments) = unsafe { arguments.as_ref() } {
            if !arguments.context.is_null() {
                query.context = arguments.context;
            }
            query.filter = arguments.filter;
            query.filters_all = arguments.flags & query_flag::INVOKE_ARGUMENT_FILTER != 0;
            query.user = arguments.user;
        }
        // SAFETY: the interface's rules.
        work(unsafe { scene.traceable() }?, &query);
        Ok(())
    };
    // SAFETY: as the caller promises.
    unsafe { with(scene, (), ask) }
}

/// The nearest hit of a ray.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcIntersect1(
    scene: *const Scene,
    ray: *mut RTCRayHit,
    arguments: *const RTCIntersectArguments,
) {
    // SAFETY: the interface's rules.
    unsafe { ask(scene, arguments, ray, |scene, query| cast_one::<false>(scene, query, &Target::closest(ray))) }
}

/// Whether a ray hits anything.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcOccluded1(
    scene: *const Scene,
    ray: *mut RTCRay,
    arguments: *const RTCOccludedArguments,
) {
    // SAFETY: the interface's rules.
    unsafe { ask(scene, arguments, ray, |scene, query| cast_one::<true>(scene, query, &Target::any(ray))) }
}

macro_rules! packets {
    ($($name:ident $count:literal $trace:ident)*) => {$(
        /// Several rays.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $name(
            valid: *const i32,
            scene: *const Scene,
            rays: *mut u32,
            arguments: *const RTCIntersectArguments,
        ) {
            let work = |committed: &Committed, query: &Query| {
                // SAFETY: the interface's rules.
                let lanes = unsafe { Packed::new(rays, $count) };
                // SAFETY: an array of so many, by the interface's rules.
                $trace(committed, query, &lanes, |lane| unsafe { *valid.add(lane) != 0 });
            };
            if valid.is_null() {
                // Which is reported there.
                // SAFETY: null is.
                return unsafe { ask(scene, arguments, std::ptr::null_mut::<u32>(), work) };
            }
            // SAFETY: the interface's rules.
            unsafe { ask(scene, arguments, rays, work) }
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

/// Sends the ray of a callback on into a scene, from another place, as if that were an instance. Callbacks of this
/// library are given one ray at a time, so packets are refused.
///
/// # Safety
/// As for the functions of the interface.
unsafe fn forward(
    call: *const RTCUserFunctionNArguments,
    scene: *const Scene,
    ray: *const RTCRay,
    instance: InstanceId,
    any: bool,
) {
    let work = |scene: &Scene| {
        present(call.cast_mut())?;
        present(ray.cast_mut())?;
        // SAFETY: what this library gave to a callback that has not returned: the call, its query and its ray.
        let (query, own) = unsafe { (&*(*call.cast::<UserCall>()).query, (*call).ray) };
        // SAFETY: as above.
        let target = unsafe { if any { Target::any(own.cast()) } else { Target::closest(own.cast::<RTCRayHit>()) } };
        // SAFETY: the interface's rules.
        let (Some(committed), new) = (unsafe { (scene.committed(), ray.read()) }) else { return Ok(()) };
        let before = target.ray();
        within(query, instance, || {
            target.set_place(new.org, new.dir);
            target.set_span(new.tnear, new.time);
            // Of what was hit before the ray was sent on nothing is known.
            if any {
                cast_inside::<true>(committed, query, &target, INVALID_ID);
            } else {
                cast_inside::<false>(committed, query, &target, INVALID_ID);
            }
            target.set_place(before.org, before.dir);
            target.set_span(before.tnear, before.time);
        });
        Ok(())
    };
    // SAFETY: the interface's rules.
    unsafe { with(scene, (), work) }
}

macro_rules! forwards {
    ($($plain:ident $extended:ident $any:literal)*) => {$(
        /// Sends a ray on.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $plain(
            call: *const RTCUserFunctionNArguments,
            scene: *const Scene,
            ray: *const RTCRay,
            instance: u32,
        ) {
            // SAFETY: the interface's rules.
            unsafe { forward(call, scene, ray, InstanceId::new(instance, 0), $any) }
        }

        /// Sends a ray on, into one of an array.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $extended(
            call: *const RTCUserFunctionNArguments,
            scene: *const Scene,
            ray: *const RTCRay,
            instance: u32,
            instance_primitive: u32,
        ) {
            // SAFETY: the interface's rules.
            unsafe { forward(call, scene, ray, InstanceId::new(instance, instance_primitive), $any) }
        }
    )*};
}

forwards! {
    rtcForwardIntersect1 rtcForwardIntersect1Ex false
    rtcForwardOccluded1 rtcForwardOccluded1Ex true
}

macro_rules! refused {
    ($($plain:ident $extended:ident)*) => {$(
        /// Callbacks of this library are given one ray at a time: there is no packet to send on.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $plain(
            _: *const i32,
            _: *const RTCUserFunctionNArguments,
            scene: *const Scene,
            _: *mut u32,
            _: u32,
        ) {
            // SAFETY: the interface's rules.
            unsafe { refuse(scene) }
        }

        /// The same.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $extended(
            _: *const i32,
            _: *const RTCUserFunctionNArguments,
            scene: *const Scene,
            _: *mut u32,
            _: u32,
            _: u32,
        ) {
            // SAFETY: the interface's rules.
            unsafe { refuse(scene) }
        }
    )*};
}

/// # Safety
/// As for [`crate::handle::borrow`].
unsafe fn refuse(scene: *const Scene) {
    let message = "callbacks are given single rays: forward them one by one";
    // SAFETY: as the caller promises.
    unsafe { with(scene, (), |_| Err(crate::failure::Failure::operation(message))) }
}

refused! {
    rtcForwardIntersect4 rtcForwardIntersect4Ex
    rtcForwardIntersect8 rtcForwardIntersect8Ex
    rtcForwardIntersect16 rtcForwardIntersect16Ex
    rtcForwardOccluded4 rtcForwardOccluded4Ex
    rtcForwardOccluded8 rtcForwardOccluded8Ex
    rtcForwardOccluded16 rtcForwardOccluded16Ex
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

filters!(rtcInvokeIntersectFilterFromGeometry false rtcInvokeOccludedFilterFromGeometry true);
