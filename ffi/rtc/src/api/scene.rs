//! Scenes.

use std::ffi::c_void;
use std::ptr::null;
use std::sync::Arc;

use super::{other, present, release, same_device, tell, with};
use crate::abi::{INVALID_ID, RTCBounds, RTCCollideFunc, RTCLinearBounds, RTCProgressMonitorFunction};
use crate::device::Device;
use crate::failure::{Failure, Result, guard};
use crate::geometry::Geometry;
use crate::handle;
use crate::scene::{Committed, Scene};
use crate::trace::collide;

/// A new scene.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcNewScene(device: *const Device) -> *const Scene {
    // SAFETY: the interface's rules.
    unsafe { with(device, null(), |_| Ok(handle::new(Arc::new(Scene::new(other(device)?))))) }
}

/// The device, with one reference more.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetSceneDevice(scene: *const Scene) -> *const Device {
    // SAFETY: the interface's rules.
    unsafe { with(scene, null(), |scene| Ok(handle::new(Arc::clone(&scene.device)))) }
}

/// One reference more.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcRetainScene(scene: *const Scene) {
    // SAFETY: the interface's rules.
    guard((), || None, || unsafe { handle::retain(scene) });
}

/// One reference fewer.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcReleaseScene(scene: *const Scene) {
    // SAFETY: the interface's rules.
    unsafe { release(scene) };
}

/// A geometry of the scene's device.
///
/// # Safety
/// As for [`handle::borrow`].
unsafe fn own(scene: &Scene, geometry: *const Geometry) -> Result<Arc<Geometry>> {
    // SAFETY: as the caller promises.
    let geometry = unsafe { other(geometry)? };
    same_device(scene, &*geometry)?;
    Ok(geometry)
}

/// Adds a geometry.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcAttachGeometry(scene: *const Scene, geometry: *const Geometry) -> u32 {
    // SAFETY: the interface's rules.
    unsafe { with(scene, INVALID_ID, |scene| scene.attach(own(scene, geometry)?)) }
}

/// Adds a geometry under an id of the caller's.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcAttachGeometryByID(scene: *const Scene, geometry: *const Geometry, id: u32) {
    // SAFETY: the interface's rules.
    unsafe { with(scene, (), |scene| scene.attach_by_id(own(scene, geometry)?, id)) }
}

/// Takes a geometry out.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcDetachGeometry(scene: *const Scene, id: u32) {
    // SAFETY: the interface's rules.
    unsafe { with(scene, (), |scene| scene.detach(id)) }
}

/// The geometry with an id; the reference stays the scene's.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetGeometry(scene: *const Scene, id: u32) -> *const Geometry {
    let get = |scene: &Scene| Ok(scene.geometry(id).map_or(null(), |geometry| Arc::as_ptr(&geometry)));
    // SAFETY: the interface's rules.
    unsafe { with(scene, null(), get) }
}

/// The same.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetGeometryThreadSafe(scene: *const Scene, id: u32) -> *const Geometry {
    // SAFETY: the interface's rules.
    unsafe { rtcGetGeometry(scene, id) }
}

/// The user pointer of the geometry with an id.
#[cfg(feature = "v4")]
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetGeometryUserDataFromScene(scene: *const Scene, id: u32) -> *mut c_void {
    let get = |scene: &Scene| Ok(scene.geometry(id).map_or(std::ptr::null_mut(), |geometry| geometry.user()));
    // SAFETY: the interface's rules.
    unsafe { with(scene, std::ptr::null_mut(), get) }
}

/// Makes what was set the scene that rays are traced in.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcCommitScene(scene: *const Scene) {
    // SAFETY: the interface's rules.
    unsafe { with(scene, (), Scene::commit) }
}

/// The same from several threads.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcJoinCommitScene(scene: *const Scene) {
    // SAFETY: the interface's rules.
    unsafe { with(scene, (), Scene::commit) }
}

/// Whom to tell of progress.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetSceneProgressMonitorFunction(
    scene: *const Scene,
    function: RTCProgressMonitorFunction,
    user: *mut c_void,
) {
    // SAFETY: the interface's rules.
    unsafe { tell(scene, |scene| scene.set_progress(function, user)) }
}

/// How much work goes into trees.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetSceneBuildQuality(scene: *const Scene, quality: u32) {
    // SAFETY: the interface's rules.
    unsafe { with(scene, (), |scene| scene.set_quality(quality)) }
}

/// What the scene is for.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetSceneFlags(scene: *const Scene, flags: u32) {
    // SAFETY: the interface's rules.
    unsafe { tell(scene, |scene| scene.set_flags(flags)) }
}

/// What the scene is for.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetSceneFlags(scene: *const Scene) -> u32 {
    // SAFETY: the interface's rules.
    unsafe { with(scene, 0, |scene| Ok(scene.state().flags)) }
}

/// The box around everything.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetSceneBounds(scene: *const Scene, bounds: *mut RTCBounds) {
    let get = |scene: &Scene| {
        // SAFETY: the interface's rules.
        let committed = unsafe { scene.unchanged() }?;
        // SAFETY: not null; the caller's, of this type.
        unsafe { present(bounds)?.write(committed.whole()) };
        Ok(())
    };
    // SAFETY: the interface's rules.
    unsafe { with(scene, (), get) }
}

/// The boxes around everything at both ends of time.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetSceneLinearBounds(scene: *const Scene, bounds: *mut RTCLinearBounds) {
    let get = |scene: &Scene| {
        // SAFETY: the interface's rules.
        let committed = unsafe { scene.unchanged() }?;
        // SAFETY: not null; the caller's, of this type.
        unsafe { present(bounds)?.write(RTCLinearBounds { bounds: committed.linear() }) };
        Ok(())
    };
    // SAFETY: the interface's rules.
    unsafe { with(scene, (), get) }
}

/// Which user primitives of two scenes may touch.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcCollide(
    first: *const Scene,
    second: *const Scene,
    function: RTCCollideFunc,
    user: *mut c_void,
) {
    let work = |first: &Scene| {
        // SAFETY: the interface's rules.
        let second = unsafe { other(second)? };
        // SAFETY: the interface's rules.
        let (a, b): (Option<&Committed>, Option<&Committed>) = unsafe { (first.committed(), second.committed()) };
        let (a, b) = a.zip(b).ok_or_else(|| Failure::operation("scene not committed"))?;
        collide(a, b, function, user)
    };
    // SAFETY: the interface's rules.
    unsafe { with(first, (), work) }
}
