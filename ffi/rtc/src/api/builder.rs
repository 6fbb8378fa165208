//! Embree's builder for trees of the caller's own, which there is none of here: each function tells so.

use std::ffi::c_void;
use std::ptr::null_mut;

use super::with;
use crate::device::Device;
use crate::failure::{Failure, guard};

/// Not in this library.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcNewBVH(device: *const Device) -> *mut c_void {
    // SAFETY: the interface's rules.
    unsafe { with(device, null_mut(), |_| Err(Failure::unsupported("building trees for the caller is"))) }
}

fn refuse<R>(default: R) -> R {
    guard(default, || None, || Err(Failure::argument("invalid argument")))
}

/// Not in this library.
#[unsafe(no_mangle)]
pub extern "C-unwind" fn rtcBuildBVH(_: *const c_void) -> *mut c_void {
    refuse(null_mut())
}

/// Not in this library.
#[unsafe(no_mangle)]
pub extern "C-unwind" fn rtcThreadLocalAlloc(_: *mut c_void, _: usize, _: usize) -> *mut c_void {
    refuse(null_mut())
}

/// Not in this library.
#[unsafe(no_mangle)]
pub extern "C-unwind" fn rtcMakeStaticBVH(_: *mut c_void) {
    refuse(());
}

/// Not in this library.
#[unsafe(no_mangle)]
pub extern "C-unwind" fn rtcRetainBVH(_: *mut c_void) {
    refuse(());
}

/// Not in this library.
#[unsafe(no_mangle)]
pub extern "C-unwind" fn rtcReleaseBVH(_: *mut c_void) {
    refuse(());
}
