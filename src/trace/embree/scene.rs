//! Scenes: one to add geometries to, one to ask.
//!
//! Triangles are copied into buffers that Embree allocates, because its vector loads read up to 16 bytes past the last
//! element and a `Vec` promises no such thing. Sharing the world's arrays would save 18 bytes a triangle (of 90 or so),
//! at the price of padding every mesh everywhere.
#![allow(unsafe_code, reason = "Embree's C interface: owning scenes and geometries, filling buffers")]

use std::ffi::c_void;
use std::sync::Arc;

use super::device::{Device, State};
use super::{Options, Quality, backend, id, query, sys};
use crate::error::Result;
use crate::math::{Affine3, Vec3};
use crate::shape::Shape;

/// A scene that geometries are added to. Only [`SceneBuilder::commit`] makes something that can be queried of it.
pub(super) struct SceneBuilder(Parts);

/// A committed scene: it does not change any more, and any number of threads may query it.
pub(super) struct Scene(Parts);

/// Fields are dropped in this order: Embree lets go of what it points to before that is gone.
struct Parts {
    raw: SceneHandle,
    shapes: Vec<Arc<ShapeList>>,
    objects: Vec<Arc<Scene>>,
    device: Arc<Device>,
}

/// The user data of a geometry of shapes.
pub(super) struct ShapeList {
    pub(super) shapes: Arc<Vec<Shape>>,
    pub(super) state: Arc<State>,
}

// SAFETY: Embree allows any thread to query a committed scene, and to release one; all else here is Send and Sync.
unsafe impl Send for Scene {}
// SAFETY: as above; a `Scene` has no method that changes it.
unsafe impl Sync for Scene {}

impl Scene {
    /// Embree's handle of a committed scene, valid as long as `self`.
    #[inline]
    pub(super) const fn raw(&self) -> sys::RTCScene {
        self.0.raw.0
    }

    /// Panics if a shape's code has panicked in a query: Embree's own frames must not be unwound, so it is done here.
    #[inline]
    pub(super) fn check_panic(&self) {
        assert!(!self.0.device.state().has_panicked(), "a shape's code panicked in a query of Embree");
    }
}

impl SceneBuilder {
    /// An empty scene.
    pub(super) fn new(device: &Arc<Device>, options: &Options) -> Result<Self> {
        // SAFETY: the device is alive.
        let raw = SceneHandle(unsafe { sys::rtcNewScene(device.raw()) });
        device.check("making a scene")?;
        let quality = match options.quality {
            Quality::Low => sys::RTC_BUILD_QUALITY_LOW,
            Quality::Medium => sys::RTC_BUILD_QUALITY_MEDIUM,
            Quality::High => sys::RTC_BUILD_QUALITY_HIGH,
        };
        let flag = |on: bool, flag| if on { flag } else { sys::RTC_SCENE_FLAG_NONE };
        let flags =
            flag(options.robust, sys::RTC_SCENE_FLAG_ROBUST) | flag(options.compact, sys::RTC_SCENE_FLAG_COMPACT);
        // SAFETY: the scene was just made, without an error.
        unsafe {
            sys::rtcSetSceneBuildQuality(raw.0, quality);
            sys::rtcSetSceneFlags(raw.0, flags);
        }
        device.check("setting up a scene")?;
        Ok(Self(Parts { raw, shapes: Vec::new(), objects: Vec::new(), device: Arc::clone(device) }))
    }

    /// Adds a mesh as geometry `id`. Triangles with a corner that is not finite are never hit.
    pub(super) fn add_triangles(&mut self, id: u32, positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<()> {
        check_indices(positions.len(), triangles)?;
        let geometry = self.geometry(sys::RTC_GEOMETRY_TYPE_TRIANGLE)?;
        self.fill(&geometry, sys::RTC_BUFFER_TYPE_VERTEX, sys::RTC_FORMAT_FLOAT3, positions)?;
        self.fill(&geometry, sys::RTC_BUFFER_TYPE_INDEX, sys::RTC_FORMAT_UINT3, triangles)?;
        self.attach(&geometry, id)
    }

    /// Adds shapes as geometry `id`; Embree asks for their bounds and intersections by callback.
    pub(super) fn add_shapes(&mut self, id: u32, shapes: &Arc<Vec<Shape>>) -> Result<()> {
        let count = super::id(shapes.len())?;
        let geometry = self.geometry(sys::RTC_GEOMETRY_TYPE_USER)?;
        let list = Arc::new(ShapeList { shapes: Arc::clone(shapes), state: Arc::clone(self.0.device.state()) });
        let user_data = Arc::as_ptr(&list).cast_mut().cast::<c_void>();
        self.0.shapes.push(list);
        // SAFETY: the geometry is alive. The callbacks only read `user_data`, which this scene keeps until Embree has
        // released the geometry.
        unsafe {
            sys::rtcSetGeometryUserPrimitiveCount(geometry.0, count);
            sys::rtcSetGeometryUserData(geometry.0, user_data);
            sys::rtcSetGeometryBoundsFunction(geometry.0, Some(query::on_bounds), std::ptr::null_mut());
            sys::rtcSetGeometryIntersectFunction(geometry.0, Some(query::on_intersect));
            sys::rtcSetGeometryOccludedFunction(geometry.0, Some(query::on_occluded));
        }
        self.attach(&geometry, id)
    }

    /// Adds `object`, placed by `to_world`, as geometry `id`; it may move to `end`.
    pub(super) fn add_instance(
        &mut self,
        id: u32,
        object: &Arc<Scene>,
        to_world: &Affine3,
        end: Option<&Affine3>,
    ) -> Result<()> {
        let geometry = self.geometry(sys::RTC_GEOMETRY_TYPE_INSTANCE)?;
        let columns = |transform: &Affine3| transform.to_cols_array();
        // SAFETY: geometry and object are alive; Embree reads the 12 floats of this format during the call, and the
        // object is kept with this scene.
        unsafe {
            sys::rtcSetGeometryInstancedScene(geometry.0, object.raw());
            let format = sys::RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR;
            if let Some(end) = end {
                sys::rtcSetGeometryTimeStepCount(geometry.0, 2);
                sys::rtcSetGeometryTransform(geometry.0, 1, format, columns(end).as_ptr().cast());
            }
            sys::rtcSetGeometryTransform(geometry.0, 0, format, columns(to_world).as_ptr().cast());
        }
        self.attach(&geometry, id)?;
        // One reference an object is enough, and placements come in runs of one object.
        if !self.0.objects.last().is_some_and(|last| Arc::ptr_eq(last, object)) {
            self.0.objects.push(Arc::clone(object));
        }
        Ok(())
    }

    /// Builds the tree.
    pub(super) fn commit(self) -> Result<Scene> {
        // SAFETY: the scene is alive, and nobody else has it.
        unsafe { sys::rtcCommitScene(self.0.raw.0) };
        self.0.device.check("building")?;
        Ok(Scene(self.0))
    }

    fn geometry(&self, kind: sys::RTCGeometryType) -> Result<GeometryHandle> {
        // SAFETY: the device is alive.
        let geometry = GeometryHandle(unsafe { sys::rtcNewGeometry(self.0.device.raw(), kind) });
        self.0.device.check("making a geometry").map(|()| geometry)
    }

    /// Gives `geometry` a buffer of `items`, allocated (and padded) by Embree.
    fn fill<T: bytemuck::Pod>(
        &self,
        geometry: &GeometryHandle,
        kind: sys::RTCBufferType,
        format: sys::RTCFormat,
        items: &[T],
    ) -> Result<()> {
        id(items.len())?;
        // SAFETY: the geometry is alive; the format is three 4-byte numbers, the size of an item.
        let buffer = unsafe {
            const { assert!(size_of::<T>() == 12) };
            sys::rtcSetNewGeometryBuffer(geometry.0, kind, 0, format, size_of::<T>(), items.len())
        };
        self.0.device.check("allocating a buffer")?;
        if buffer.is_null() {
            return Err(backend("allocating a buffer: Embree returned none"));
        }
        // SAFETY: Embree allocated room for as many items, aligned to 16 bytes; it is new, so it overlaps nothing.
        unsafe { std::ptr::copy_nonoverlapping(items.as_ptr(), buffer.cast(), items.len()) };
        Ok(())
    }

    fn attach(&self, geometry: &GeometryHandle, id: u32) -> Result<()> {
        // SAFETY: both are alive; the scene takes a reference of its own.
        unsafe {
            sys::rtcCommitGeometry(geometry.0);
            sys::rtcAttachGeometryByID(self.0.raw.0, geometry.0, id);
        }
        self.0.device.check("adding a geometry")
    }
}

/// Embree reads vertices unchecked while it traces.
fn check_indices(vertices: usize, triangles: &[[u32; 3]]) -> Result<()> {
    let wrong = |corners: &[u32; 3]| corners.iter().copied().find(|&corner| corner as usize >= vertices);
    match triangles.iter().enumerate().find_map(|(i, corners)| Some((i, wrong(corners)?))) {
        None => Ok(()),
        Some((i, corner)) => Err(backend(format!(
            "triangle {i} has corner {corner}, but there are {vertices} vertices; corners count from 0"
        ))),
    }
}

/// One reference to a scene; null only where Embree failed to make one.
struct SceneHandle(sys::RTCScene);

impl Drop for SceneHandle {
    fn drop(&mut self) {
        if !self.0.is_null() {
            // SAFETY: the one reference that rtcNewScene gave.
            unsafe { sys::rtcReleaseScene(self.0) }
        }
    }
}

/// One reference to a geometry; null only where Embree failed to make one.
struct GeometryHandle(sys::RTCGeometry);

impl Drop for GeometryHandle {
    fn drop(&mut self) {
        if !self.0.is_null() {
            // SAFETY: the one reference that rtcNewGeometry gave.
            unsafe { sys::rtcReleaseGeometry(self.0) }
        }
    }
}
