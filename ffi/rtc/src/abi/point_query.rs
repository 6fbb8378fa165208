//! Point queries.

use std::ffi::c_void;

use super::InstanceId;

/// A point, and how far to look around it.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug)]
pub struct RTCPointQuery {
    pub point: [f32; 3],
    pub time: f32,
    pub radius: f32,
}

const _: () = assert!(size_of::<RTCPointQuery>() == 32);

/// Which instance a point query is in.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug)]
pub struct RTCPointQueryContext {
    /// By columns.
    pub world_to_instance: [f32; 16],
    pub instance_to_world: [f32; 16],
    pub instance: InstanceId,
    /// How many instances: 0 or 1.
    pub depth: u32,
}

const _: () = assert!(size_of::<RTCPointQueryContext>() == 144);

/// For a point query's function: a primitive that may be near.
#[repr(C, align(16))]
#[derive(Debug)]
pub struct RTCPointQueryFunctionArguments {
    pub query: *mut RTCPointQuery,
    pub user: *mut c_void,
    pub primitive: u32,
    pub geometry: u32,
    pub context: *mut RTCPointQueryContext,
    pub similarity_scale: f32,
}

const _: () = assert!(size_of::<RTCPointQueryFunctionArguments>() == 48);

pub type RTCPointQueryFunction = Option<unsafe extern "C" fn(*mut RTCPointQueryFunctionArguments) -> bool>;
