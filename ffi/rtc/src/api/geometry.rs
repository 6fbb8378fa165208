//! Geometries.

use std::ffi::c_void;
use std::ptr::{null, null_mut};
use std::sync::Arc;

use super::{other, release, same_device, tell, with};
use crate::abi::*;
use crate::buffer::{Buffer, Items};
use crate::device::Device;
use crate::failure::{Failure, Result, guard};
use crate::geometry::{Functions, Geometry, Kind, State};
use crate::handle;

/// A new geometry.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcNewGeometry(device: *const Device, kind: u32) -> *const Geometry {
    let mut absent = None;
    let make = |_: &Device| {
        // SAFETY: the interface's rules.
        let (geometry, failure) = Geometry::new(unsafe { other(device)? }, kind)?;
        absent = failure;
        Ok(handle::new(Arc::new(geometry)))
    };
    // SAFETY: the interface's rules.
    let geometry = unsafe { with(device, null(), make) };
    if let Some(failure) = absent {
        // SAFETY: the interface's rules; the error function may throw, so that there must be no wall around it.
        unsafe { with(device, (), |_| Err(failure)) };
    }
    geometry
}

/// One reference more.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcRetainGeometry(geometry: *const Geometry) {
    // SAFETY: the interface's rules.
    guard((), || None, || unsafe { handle::retain(geometry) });
}

/// One reference fewer.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcReleaseGeometry(geometry: *const Geometry) {
    // SAFETY: the interface's rules.
    unsafe { release(geometry) };
}

/// Makes what was set count at the next commit of the scene.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcCommitGeometry(geometry: *const Geometry) {
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), Geometry::commit) }
}

/// Shows the geometry.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcEnableGeometry(geometry: *const Geometry) {
    // SAFETY: the interface's rules.
    unsafe { tell(geometry, |geometry| geometry.set_enabled(true)) }
}

/// Hides the geometry.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcDisableGeometry(geometry: *const Geometry) {
    // SAFETY: the interface's rules.
    unsafe { tell(geometry, |geometry| geometry.set_enabled(false)) }
}

/// How many time steps there are.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryTimeStepCount(geometry: *const Geometry, count: u32) {
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), |geometry| geometry.set_time_steps(count)) }
}

/// When the first and the last time step are.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryTimeRange(geometry: *const Geometry, start: f32, end: f32) {
    let set = |state: &mut State| {
        // NaN is refused as well.
        if start.partial_cmp(&end).is_none_or(|order| order.is_gt()) {
            return Err(Failure::argument("startTime has to be smaller or equal to the endTime"));
        }
        state.time_range = (start, end);
        Ok(())
    };
    // SAFETY: the interface's rules.
    unsafe { modify(geometry, set) }
}

/// How many attributes there are.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryVertexAttributeCount(geometry: *const Geometry, count: u32) {
    const MAX: u32 = 1 << 16;
    let set = |geometry: &Geometry| {
        let is_mesh = !matches!(geometry.kind, Kind::User | Kind::Instance | Kind::InstanceArray);
        geometry.demand(is_mesh && count <= MAX)?;
        geometry.modify(|state| {
            state.attributes.resize(count as usize, None);
            Ok(())
        })
    };
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

/// Which rays see the geometry.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryMask(geometry: *const Geometry, mask: u32) {
    // SAFETY: the interface's rules.
    unsafe {
        modify(geometry, |state| {
            state.mask = mask;
            Ok(())
        });
    }
}

/// Heeded in scenes that are dynamic: to refit, and low, where the scene's own quality is medium and all geometries of
/// a tree ask for it.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryBuildQuality(geometry: *const Geometry, quality: u32) {
    let set = |state: &mut State| {
        if quality > quality::REFIT {
            return Err(Failure::unknown("invalid build quality"));
        }
        state.quality = quality;
        Ok(())
    };
    // SAFETY: the interface's rules.
    unsafe { modify(geometry, set) }
}

/// Curves of a minimal width on the screen are not built in, as in both Debians' Embree, which say so: programs ask by
/// this whether they are.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryMaxRadiusScale(geometry: *const Geometry, _scale: f32) {
    // SAFETY: the interface's rules.
    unsafe { modify(geometry, |_| Err(Failure::operation("min-width feature is not enabled"))) }
}

/// Sets a buffer.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryBuffer(
    geometry: *const Geometry,
    kind: u32,
    slot: u32,
    format: u32,
    buffer: *const Buffer,
    offset: usize,
    stride: usize,
    count: usize,
) {
    let set = |geometry: &Geometry| {
        // SAFETY: the interface's rules.
        let buffer = unsafe { other(buffer)? };
        same_device(geometry, &*buffer)?;
        geometry.set_buffer((kind, slot), buffer, Items { format, offset, stride, count })
    };
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

/// Sets a buffer over the caller's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetSharedGeometryBuffer(
    geometry: *const Geometry,
    kind: u32,
    slot: u32,
    format: u32,
    data: *const c_void,
    offset: usize,
    stride: usize,
    count: usize,
) {
    let set = |geometry: &Geometry| {
        let items = Items { format, offset, stride, count };
        let buffer = Buffer::shared(Arc::clone(&geometry.device), data.cast_mut().cast(), items.end()?);
        geometry.set_buffer((kind, slot), Arc::new(buffer), items)
    };
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

/// Sets a new buffer.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetNewGeometryBuffer(
    geometry: *const Geometry,
    kind: u32,
    slot: u32,
    format: u32,
    stride: usize,
    count: usize,
) -> *mut c_void {
    let set = |geometry: &Geometry| {
        let items = Items { format, offset: 0, stride, count };
        Ok(geometry.new_buffer((kind, slot), items)?.cast())
    };
    // SAFETY: the interface's rules.
    unsafe { with(geometry, null_mut(), set) }
}

/// Where a buffer's first item is.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetGeometryBufferData(
    geometry: *const Geometry,
    kind: u32,
    slot: u32,
) -> *mut c_void {
    // SAFETY: the interface's rules.
    unsafe { with(geometry, null_mut(), |geometry| Ok(geometry.buffer_data((kind, slot))?.cast())) }
}

/// A buffer has been written to.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcUpdateGeometryBuffer(geometry: *const Geometry, kind: u32, slot: u32) {
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), |geometry| geometry.update_buffer((kind, slot))) }
}

/// The filter of nearest hits.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryIntersectFilterFunction(
    geometry: *const Geometry,
    filter: RTCFilterFunctionN,
) {
    let set = |geometry: &Geometry| geometry.set_filter(|functions| functions.intersect_filter = filter);
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

/// The filter of any hits.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryOccludedFilterFunction(
    geometry: *const Geometry,
    filter: RTCFilterFunctionN,
) {
    let set = |geometry: &Geometry| geometry.set_filter(|functions| functions.occluded_filter = filter);
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

/// Whether filters that come with queries are run.
#[cfg(feature = "v4")]
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryEnableFilterFunctionFromArguments(
    geometry: *const Geometry,
    enable: bool,
) {
    let set = |geometry: &Geometry| geometry.set_filter(|functions| functions.heeds_argument_filter = enable);
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

/// The pointer that callbacks are given.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryUserData(geometry: *const Geometry, user: *mut c_void) {
    // SAFETY: the interface's rules.
    unsafe { tell(geometry, |geometry| geometry.set_user(user)) }
}

/// The pointer that callbacks are given.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetGeometryUserData(geometry: *const Geometry) -> *mut c_void {
    // SAFETY: the interface's rules.
    unsafe { with(geometry, null_mut(), |geometry| Ok(geometry.user())) }
}

/// The function of point queries.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryPointQueryFunction(
    geometry: *const Geometry,
    function: RTCPointQueryFunction,
) {
    // SAFETY: the interface's rules.
    unsafe { set_function(geometry, |functions| functions.point_query = function, false) }
}

/// How many primitives user geometry has.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryUserPrimitiveCount(geometry: *const Geometry, count: u32) {
    let set = |geometry: &Geometry| {
        geometry.demand(geometry.kind == Kind::User)?;
        if geometry.state().primitive_count == count {
            return Ok(());
        }
        geometry.modify(|state| {
            state.primitive_count = count;
            Ok(())
        })
    };
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

/// Where user geometry is.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryBoundsFunction(
    geometry: *const Geometry,
    function: RTCBoundsFunction,
    // Callbacks are given the geometry's own, as the interface says; Embree has no use for this one either.
    _user: *mut c_void,
) {
    // SAFETY: the interface's rules.
    unsafe { set_function(geometry, |functions| functions.bounds = function, true) }
}

/// Where user geometry is hit.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryIntersectFunction(
    geometry: *const Geometry,
    function: RTCIntersectFunctionN,
) {
    // SAFETY: the interface's rules.
    unsafe { set_function(geometry, |functions| functions.intersect = function, true) }
}

/// Whether user geometry is hit.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryOccludedFunction(
    geometry: *const Geometry,
    function: RTCOccludedFunctionN,
) {
    // SAFETY: the interface's rules.
    unsafe { set_function(geometry, |functions| functions.occluded = function, true) }
}

/// # Safety
/// As for [`handle::borrow`].
unsafe fn modify(geometry: *const Geometry, change: impl FnOnce(&mut State) -> Result<()>) {
    // SAFETY: as the caller promises.
    unsafe { with(geometry, (), |geometry| geometry.modify(change)) }
}

/// # Safety
/// As for [`handle::borrow`].
unsafe fn set_function(geometry: *const Geometry, set: impl FnOnce(&mut Functions), only_user: bool) {
    let change = |geometry: &Geometry| {
        geometry.demand(!only_user || geometry.kind == Kind::User)?;
        geometry.set_functions(set);
        Ok(())
    };
    // SAFETY: as the caller promises.
    unsafe { with(geometry, (), change) }
}
