//! What is near a point: the caller is shown each primitive whose box is, and says how far to look.

use std::ffi::c_void;

use twincast_core::math::{self, Affine3, DAffine3, Vec3};
use twincast_core::trace::bvh::VisitFlow;

use crate::abi::{
    InstanceId, RTCPointQuery, RTCPointQueryContext, RTCPointQueryFunction, RTCPointQueryFunctionArguments,
};
use crate::scene::{Body, Committed, Instance, Item, Record};

/// A query of the caller's.
struct Search1 {
    query: *mut RTCPointQuery,
    context: *mut RTCPointQueryContext,
    function: RTCPointQueryFunction,
    user: *mut c_void,
}

/// Where the search is: in which coordinates.
struct Space {
    point: Vec3,
    /// Distances here in terms of those in the world, at most.
    stretch: f32,
    /// The same where all distances change alike, else 0: for callbacks.
    similarity: f32,
    is_instance: bool,
}

/// Shows primitives near the query's point; whether the caller changed the radius.
///
/// # Safety
/// The pointers are the caller's, to a query and a context that are this thread's alone.
pub unsafe fn point_query(
    committed: &Committed,
    query: *mut RTCPointQuery,
    context: *mut RTCPointQueryContext,
    function: RTCPointQueryFunction,
    user: *mut c_void,
) -> bool {
    // SAFETY: readable, as the caller promises.
    let point = Vec3::from(unsafe { (*query).point });
    let search = Search1 { query, context, function, user };
    search.run(committed, &Space { point, stretch: 1.0, similarity: 1.0, is_instance: false })
}

impl Search1 {
    fn radius(&self) -> f32 {
        // SAFETY: the query is the caller's, who may have changed it in a callback, on this thread.
        unsafe { (*self.query).radius }
    }

    fn run(&self, committed: &Committed, space: &Space) -> bool {
        let mut changed = false;
        let limit = || self.radius() * space.stretch;
        // SAFETY: the query is the caller's.
        let time = unsafe { (*self.query).time };
        let mut visitor = |item: Item| {
            if let Some(record) = committed.record(item.geometry) {
                changed |= match &record.body {
                    Body::Instances(instances) => {
                        let instance = instances.get(item.primitive as usize);
                        instance.is_some_and(|instance| !space.is_instance && self.enter(instance, item))
                    }
                    _ => self.show(record, item, space),
                };
            }
            VisitFlow::Continue(limit())
        };
        for solid in committed.solids().filter(|_| committed.names_triangles()) {
            solid
                .bvh
                .visit_near(space.point, limit(), &mut |geometry, primitive| visitor(Item::new(geometry, primitive)));
        }
        committed.near().visit(space.point, limit(), Some(time), &mut visitor);
        changed
    }

    /// Asks the query's function, then that of the geometry.
    fn show(&self, record: &Record, item: Item, space: &Space) -> bool {
        let mut arguments = RTCPointQueryFunctionArguments {
            query: self.query,
            user: self.user,
            primitive: item.primitive,
            geometry: item.geometry,
            context: self.context,
            similarity_scale: space.similarity,
        };
        let mut changed = false;
        for function in [self.function, record.functions.point_query].into_iter().flatten() {
            // SAFETY: the caller promised a function of this type; the arguments live until it returns.
            changed |= unsafe { function(&raw mut arguments) };
        }
        changed
    }

    /// Goes on in an instance.
    fn enter(&self, instance: &Instance, item: Item) -> bool {
        // SAFETY: the query is the caller's.
        let (time, point) = unsafe { ((*self.query).time, Vec3::from((*self.query).point)) };
        // SAFETY: scenes are not committed during queries: the interface's rule.
        let Some(committed) = (unsafe { instance.scene.committed() }) else { return false };
        let (to_world, to_scene) = (instance.motion.at(time), instance.to_scene(time));
        if !instance.motion.is_at(time) || !to_scene.is_finite() {
            return false;
        }
        let similarity = similarity(&to_scene);
        let columns = [to_scene.matrix3.x_axis, to_scene.matrix3.y_axis, to_scene.matrix3.z_axis];
        // The root of the sum of squares is at least the largest factor.
        let largest = columns.iter().map(|column| column.length_squared()).sum::<f64>().sqrt();
        let stretch = if similarity > 0.0 { similarity } else { largest };
        // SAFETY: the context is the caller's, this thread's alone.
        unsafe {
            (*self.context).world_to_instance = matrix(&to_scene.as_affine3());
            (*self.context).instance_to_world = matrix(&to_world);
            (*self.context).instance = InstanceId::new(item.geometry, item.primitive);
            (*self.context).depth = 1;
        }
        let changed = self.run(
            committed,
            &Space {
                point: to_scene.transform_point3(point.as_dvec3()).as_vec3(),
                // Similarities are so to a hundred-thousandth, of the squares of lengths; more than half as much along
                // some axis, and what is rounded here.
                stretch: (stretch * (1.0 + 2e-5)) as f32,
                similarity: similarity as f32,
                is_instance: true,
            },
        );
        // SAFETY: as above.
        unsafe {
            (*self.context).instance = InstanceId::OUTSIDE;
            (*self.context).depth = 0;
        }
        changed
    }
}

/// By what all distances change under a transform; 0 where they change differently.
fn similarity(transform: &DAffine3) -> f64 {
    math::similarity(&transform.matrix3, 1e-5).unwrap_or(0.0)
}

/// By columns.
fn matrix(transform: &Affine3) -> [f32; 16] {
    let columns = [
        transform.matrix3.x_axis.extend(0.0),
        transform.matrix3.y_axis.extend(0.0),
        transform.matrix3.z_axis.extend(0.0),
        transform.translation.extend(1.0),
    ];
    let mut all = [0.0; 16];
    for (four, column) in all.chunks_exact_mut(4).zip(columns) {
        four.copy_from_slice(&column.to_array());
    }
    all
}
