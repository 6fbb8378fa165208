//! Instances.

use std::ffi::c_void;
#[cfg(feature = "v4")]
use std::sync::Arc;

use super::{other, present, with};
use crate::abi::{RTCQuaternionDecomposition, format};
use crate::failure::{Failure, Result};
use crate::geometry::{Geometry, Transform, read_transform, transform_words, write_transform};
use crate::scene::Scene;

/// The scene that is placed.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryInstancedScene(geometry: *const Geometry, scene: *const Scene) {
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), |geometry| geometry.set_scenes(vec![other(scene)?])) }
}

/// The scenes of which an instance array places one or another.
#[cfg(feature = "v4")]
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryInstancedScenes(
    geometry: *const Geometry,
    scenes: *mut *const Scene,
    count: usize,
) {
    let set = |geometry: &Geometry| {
        present(scenes)?;
        // SAFETY: so many handles, by the interface's rules.
        let scenes = (0..count).map(|i| unsafe { other(*scenes.add(i)) });
        geometry.set_scenes(scenes.collect::<Result<Vec<Arc<Scene>>>>()?)
    };
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

/// Where an instance is at a time step.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryTransform(
    geometry: *const Geometry,
    step: u32,
    format: u32,
    matrix: *const c_void,
) {
    let set = |geometry: &Geometry| {
        present(matrix.cast_mut())?;
        let words = transform_words(format).filter(|_| format != format::QUATERNION_DECOMPOSITION);
        let words = words.ok_or_else(|| Failure::operation("invalid matrix format"))?;
        // SAFETY: as many floats as the format has, by the interface's rules; they may be unaligned for all that is
        // known.
        let floats: Vec<f32> = (0..words).map(|i| unsafe { matrix.cast::<f32>().add(i).read_unaligned() }).collect();
        geometry.set_transform(step, Transform::Matrix(read_transform(format, &floats)?))
    };
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

/// Where an instance is at a time step, to be interpolated part by part.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryTransformQuaternion(
    geometry: *const Geometry,
    step: u32,
    parts: *const RTCQuaternionDecomposition,
) {
    let set = |geometry: &Geometry| {
        present(parts.cast_mut())?;
        // SAFETY: not null; a structure of this type, by the interface's rules.
        geometry.set_transform(step, Transform::Quaternion(unsafe { parts.read_unaligned() }))
    };
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

/// Where an instance is at a time.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetGeometryTransform(
    geometry: *const Geometry,
    time: f32,
    format: u32,
    matrix: *mut c_void,
) {
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), |geometry| write(geometry, 0, time, format, matrix)) }
}

/// Where one instance of an array is at a time.
#[cfg(feature = "v4")]
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetGeometryTransformEx(
    geometry: *const Geometry,
    primitive: u32,
    time: f32,
    format: u32,
    matrix: *mut c_void,
) {
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), |geometry| write(geometry, primitive, time, format, matrix)) }
}

/// Where an instance of a scene is at a time.
#[cfg(feature = "v4")]
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetGeometryTransformFromScene(
    scene: *const Scene,
    id: u32,
    time: f32,
    format: u32,
    matrix: *mut c_void,
) {
    let get = |scene: &Scene| {
        let geometry = scene.geometry(id).ok_or_else(|| Failure::argument("invalid geometry ID"))?;
        // SAFETY: as below.
        unsafe { write(&geometry, 0, time, format, matrix) }
    };
    // SAFETY: the interface's rules.
    unsafe { with(scene, (), get) }
}

/// # Safety
/// `matrix` has room for as many floats as the format has.
unsafe fn write(geometry: &Geometry, primitive: u32, time: f32, format: u32, matrix: *mut c_void) -> Result<()> {
    present(matrix)?;
    let floats = write_transform(format, &geometry.transform_at(primitive, time)?)?;
    for (i, value) in floats.into_iter().enumerate() {
        // SAFETY: as the caller promises.
        unsafe { matrix.cast::<f32>().add(i).write_unaligned(value) };
    }
    Ok(())
}
