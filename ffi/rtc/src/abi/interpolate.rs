//! Interpolation over a surface.

use std::ffi::c_void;

/// Where to write values and derivatives; any of them may be null.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Outputs {
    pub value: *mut f32,
    pub du: *mut f32,
    pub dv: *mut f32,
    pub dudu: *mut f32,
    pub dvdv: *mut f32,
    pub dudv: *mut f32,
}

/// At one place.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCInterpolateArguments {
    pub geometry: *mut c_void,
    pub primitive: u32,
    pub u: f32,
    pub v: f32,
    pub buffer_type: u32,
    pub slot: u32,
    pub outputs: Outputs,
    pub count: u32,
}

/// At several: values are by component, then by place.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCInterpolateNArguments {
    pub geometry: *mut c_void,
    /// -1 or 0 for each; null for all.
    pub valid: *const i32,
    pub primitives: *const u32,
    pub u: *const f32,
    pub v: *const f32,
    pub places: u32,
    pub buffer_type: u32,
    pub slot: u32,
    pub outputs: Outputs,
    pub count: u32,
}

const _: () = {
    assert!(size_of::<RTCInterpolateArguments>() == 88 && std::mem::offset_of!(RTCInterpolateArguments, outputs) == 32);
    assert!(size_of::<RTCInterpolateNArguments>() == 112);
};
