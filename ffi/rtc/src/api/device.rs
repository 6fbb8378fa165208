//! Devices and buffers.

use std::ffi::{CStr, c_char, c_void};
use std::ops::Range;
use std::ptr::null;
use std::sync::Arc;

use super::{other, release, with};
use crate::abi::{RTCErrorFunction, RTCMemoryMonitorFunction};
use crate::buffer::Buffer;
use crate::device::{Callback, Device};
use crate::failure::{Failure, guard, take_homeless};
use crate::handle;

/// Embree's own, for its tests, which set them.
const SWITCHES: Range<u32> = 1_000_000..1_000_004;

/// The same, which ask for tests by number, up to the first that there is not.
const TESTS: Range<u32> = 2_000_000..3_000_000;

/// A new device.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcNewDevice(configuration: *const c_char) -> *const Device {
    guard(
        null(),
        || None,
        || {
            let text = if configuration.is_null() {
                String::new()
            } else {
                // SAFETY: a C string, by the interface's rules.
                unsafe { CStr::from_ptr(configuration) }.to_string_lossy().into_owned()
            };
            Ok(handle::new(Arc::new(Device::new(&text)?)))
        },
    )
}

/// One reference more.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcRetainDevice(device: *const Device) {
    // SAFETY: the interface's rules.
    guard((), || None, || unsafe { handle::retain(device) });
}

/// One reference fewer.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcReleaseDevice(device: *const Device) {
    // SAFETY: the interface's rules.
    unsafe { release(device) };
}

/// What a device says of itself.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetDeviceProperty(device: *const Device, property: u32) -> isize {
    if TESTS.contains(&property) {
        return 0;
    }
    // SAFETY: the interface's rules.
    unsafe { with(device, 0, |device| device.property(property)) }
}

/// Nothing can be set; what Embree keeps for its own tests is passed over.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetDeviceProperty(device: *const Device, property: u32, _value: isize) {
    let refuse = |_: &Device| {
        if SWITCHES.contains(&property) { Ok(()) } else { Err(Failure::argument("unknown writable property")) }
    };
    // SAFETY: the interface's rules.
    unsafe { with(device, (), refuse) }
}

/// The first error of this thread since it last asked.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetDeviceError(device: *const Device) -> u32 {
    // SAFETY: the interface's rules; null asks for what went wrong without a device.
    match unsafe { device.as_ref() } {
        None => take_homeless(),
        Some(device) => guard(1, || None, || Ok(device.take_error())),
    }
}

/// An error in words, which are Embree's.
#[cfg(feature = "v4")]
#[unsafe(no_mangle)]
pub extern "C-unwind" fn rtcGetErrorString(error: u32) -> *const c_char {
    let name = match error {
        0 => c"No Error",
        1 => c"Unknown error",
        2 => c"Invalid argument",
        3 => c"Invalid operation",
        4 => c"Out of Memory",
        5 => c"Unsupported CPU",
        6 => c"Build cancelled",
        7 => c"Level Zero raytracing support missing",
        _ => c"Invalid error code",
    };
    name.as_ptr()
}

/// The last message of this thread.
#[cfg(feature = "v4")]
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetDeviceLastErrorMessage(device: *const Device) -> *const c_char {
    // SAFETY: the interface's rules.
    match unsafe { device.as_ref() } {
        None => c"".as_ptr(),
        Some(device) => guard(c"".as_ptr(), || None, || Ok(device.last_message())),
    }
}

/// Whom to tell of errors.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetDeviceErrorFunction(
    device: *const Device,
    function: RTCErrorFunction,
    user: *mut c_void,
) {
    let set = |device: &Device| {
        device.set_error_function(Callback { function, user });
        Ok(())
    };
    // SAFETY: the interface's rules.
    unsafe { with(device, (), set) }
}

/// Whom to tell of memory.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetDeviceMemoryMonitorFunction(
    device: *const Device,
    function: RTCMemoryMonitorFunction,
    user: *mut c_void,
) {
    let set = |device: &Device| {
        device.set_memory_monitor(Callback { function, user });
        Ok(())
    };
    // SAFETY: the interface's rules.
    unsafe { with(device, (), set) }
}

/// A new buffer.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcNewBuffer(device: *const Device, bytes: usize) -> *const Buffer {
    // SAFETY: the interface's rules.
    unsafe { with(device, null(), |_| Ok(handle::new(Arc::new(Buffer::new(other(device)?, bytes)?)))) }
}

/// A new buffer over the caller's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcNewSharedBuffer(
    device: *const Device,
    data: *mut c_void,
    bytes: usize,
) -> *const Buffer {
    // SAFETY: the interface's rules.
    unsafe { with(device, null(), |_| Ok(handle::new(Arc::new(Buffer::shared(other(device)?, data.cast(), bytes))))) }
}

/// Where a buffer is.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcGetBufferData(buffer: *const Buffer) -> *mut c_void {
    // SAFETY: the interface's rules.
    unsafe { with(buffer, std::ptr::null_mut(), |buffer| Ok(buffer.data().cast())) }
}

/// One reference more.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcRetainBuffer(buffer: *const Buffer) {
    // SAFETY: the interface's rules.
    guard((), || None, || unsafe { handle::retain(buffer) });
}

/// One reference fewer.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcReleaseBuffer(buffer: *const Buffer) {
    // SAFETY: the interface's rules.
    unsafe { release(buffer) };
}
