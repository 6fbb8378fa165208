//! What callbacks are given, and what comes with a query.

use std::ffi::{c_int, c_void};

use super::{InstanceId, RTCBounds};

/// Which instance a ray is in, and in version 3 what goes with the query.
#[cfg(feature = "v3")]
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCContext {
    pub flags: u32,
    pub filter: RTCFilterFunctionN,
    pub instance: InstanceId,
}

/// Which instance a ray is in.
#[cfg(feature = "v4")]
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCContext {
    pub instance: InstanceId,
}

/// What goes with a query; `F` is the callback of user geometry, if it is to be that of the query.
#[cfg(feature = "v4")]
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCArguments<F> {
    pub flags: u32,
    pub feature_mask: u32,
    pub context: *mut RTCContext,
    pub filter: RTCFilterFunctionN,
    pub user: F,
}

#[cfg(feature = "v4")]
pub type RTCIntersectArguments = RTCArguments<RTCIntersectFunctionN>;
#[cfg(feature = "v4")]
pub type RTCOccludedArguments = RTCArguments<RTCOccludedFunctionN>;

#[cfg(feature = "v4")]
const _: () = assert!(size_of::<RTCIntersectArguments>() == 32);
#[cfg(feature = "v3")]
const _: () = assert!(size_of::<RTCContext>() == 24 && std::mem::offset_of!(RTCContext, instance) == 16);

/// For a filter: may the hit count?
#[repr(C)]
#[derive(Debug)]
pub struct RTCFilterFunctionNArguments {
    /// -1, or 0 where a hit does not count.
    pub valid: *mut c_int,
    pub user: *mut c_void,
    pub context: *mut RTCContext,
    pub ray: *mut c_void,
    pub hit: *mut c_void,
    pub count: u32,
}

pub type RTCFilterFunctionN = Option<unsafe extern "C" fn(*const RTCFilterFunctionNArguments)>;

/// For user geometry: where is it met, or is it at all?
#[repr(C)]
#[derive(Debug)]
pub struct RTCUserFunctionNArguments {
    pub valid: *mut c_int,
    pub user: *mut c_void,
    pub primitive: u32,
    pub context: *mut RTCContext,
    /// Ray and hit, or a ray alone.
    pub ray: *mut c_void,
    pub count: u32,
    pub geometry: u32,
}

const _: () = assert!(size_of::<RTCUserFunctionNArguments>() == 48);

pub type RTCIntersectFunctionN = Option<unsafe extern "C" fn(*const RTCUserFunctionNArguments)>;
pub type RTCOccludedFunctionN = RTCIntersectFunctionN;

/// For user geometry: where is it?
#[repr(C)]
#[derive(Debug)]
pub struct RTCBoundsFunctionArguments {
    pub user: *mut c_void,
    pub primitive: u32,
    pub time_step: u32,
    pub bounds: *mut RTCBounds,
}

pub type RTCBoundsFunction = Option<unsafe extern "C" fn(*const RTCBoundsFunctionArguments)>;

/// It may throw what the caller catches: C++ programs do.
pub type RTCErrorFunction = Option<unsafe extern "C-unwind" fn(*mut c_void, u32, *const std::ffi::c_char)>;
pub type RTCMemoryMonitorFunction = Option<unsafe extern "C" fn(*mut c_void, isize, bool) -> bool>;
pub type RTCProgressMonitorFunction = Option<unsafe extern "C" fn(*mut c_void, f64) -> bool>;
pub type RTCCollideFunc = Option<unsafe extern "C" fn(*mut c_void, *mut super::RTCCollision, u32)>;
