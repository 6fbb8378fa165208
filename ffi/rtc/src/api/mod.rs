//! The exported functions: checks of handles, and calls of what does the work.
//!
//! What is safe about all of them is what the interface says: handles are null or alive, callbacks are of the type that
//! is asked for, pointers name what the structures say, scenes are not changed or committed while rays are traced in
//! them, and an object is changed by one thread at a time. The comments below refer to these as the interface's rules;
//! nothing here can check more than whether a pointer is null.

mod builder;
mod device;
mod geometry;
mod instance;
mod interpolate;
mod point;
#[cfg(feature = "v3")]
mod ray3;
#[cfg(feature = "v4")]
mod ray4;
mod scene;
mod subdivision;

use std::sync::Arc;

use crate::buffer::Buffer;
use crate::device::Device;
use crate::failure::{Failure, Result, guard};
use crate::geometry::Geometry;
use crate::handle;
use crate::scene::Scene;

/// Objects that know where their errors go.
trait Owned {
    fn device(&self) -> &Device;
}

impl Owned for Device {
    fn device(&self) -> &Device {
        self
    }
}

impl Owned for Buffer {
    fn device(&self) -> &Device {
        &self.device
    }
}

impl Owned for Geometry {
    fn device(&self) -> &Device {
        &self.device
    }
}

impl Owned for Scene {
    fn device(&self) -> &Device {
        &self.device
    }
}

/// Does `work` with the object behind a handle; errors go to its device.
///
/// # Safety
/// As for [`handle::borrow`].
#[inline(always)]
unsafe fn with<T: Owned, R>(handle: *const T, default: R, work: impl FnOnce(&T) -> Result<R>) -> R {
    // SAFETY: as the caller promises.
    let object = unsafe { handle::borrow(handle) };
    let device = object.as_ref().ok().map(|object: &&T| object.device());
    guard(default, || device, || work(object?))
}

/// Does what cannot fail with the object behind a handle.
///
/// # Safety
/// As for [`handle::borrow`].
unsafe fn tell<T: Owned>(handle: *const T, work: impl FnOnce(&T)) {
    let work = |object: &T| {
        work(object);
        Ok(())
    };
    // SAFETY: as the caller promises.
    unsafe { with(handle, (), work) }
}

/// Gives up the caller's reference to an object, whose device lives on for the message.
///
/// # Safety
/// As for [`handle::release`].
unsafe fn release<T: Owned>(handle: *const T) {
    // Nothing can fail but the null handle, which has no device.
    // SAFETY: as the caller promises.
    guard((), || None, || unsafe { handle::release(handle) });
}

/// A reference of our own to a second object of a call.
///
/// # Safety
/// As for [`handle::borrow`].
unsafe fn other<T>(handle: *const T) -> Result<Arc<T>> {
    // SAFETY: as the caller promises.
    unsafe { handle::share(handle) }
}

/// Two objects of a call must be of one device.
fn same_device(a: &impl Owned, b: &impl Owned) -> Result<()> {
    if std::ptr::eq(a.device(), b.device()) {
        Ok(())
    } else {
        Err(Failure::argument("inputs are from different devices"))
    }
}

/// A pointer that must not be null.
fn present<T>(pointer: *mut T) -> Result<*mut T> {
    if pointer.is_null() { Err(Failure::argument("invalid argument")) } else { Ok(pointer) }
}
