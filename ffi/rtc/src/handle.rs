//! What C holds: pointers that count references.
//!
//! A handle is an [`Arc`] as a raw pointer, so that retain and release are its own counting, and objects that refer to
//! each other (a scene to its geometries, an instance to its scene) count along with the caller.

use std::sync::Arc;

use crate::failure::{Failure, Result};

/// A new handle, with one reference that is the caller's.
pub fn new<T>(object: Arc<T>) -> *const T {
    Arc::into_raw(object)
}

/// The object behind a handle.
///
/// # Safety
/// `handle` is null, or came from [`new`] and was not released as often as it was made and retained; and stays so as
/// long as the result is used.
pub unsafe fn borrow<'a, T>(handle: *const T) -> Result<&'a T> {
    // SAFETY: by what the caller promises it is null or points to a living object.
    unsafe { handle.as_ref() }.ok_or_else(|| Failure::argument("invalid argument"))
}

/// A reference of our own.
///
/// # Safety
/// As for [`borrow`].
pub unsafe fn share<T>(handle: *const T) -> Result<Arc<T>> {
    if handle.is_null() {
        return Err(Failure::argument("invalid argument"));
    }
    // SAFETY: the handle came from `Arc::into_raw`, and the count is at least 1, as the caller promises.
    unsafe {
        Arc::increment_strong_count(handle);
        Ok(Arc::from_raw(handle))
    }
}

/// One reference more for the caller.
///
/// # Safety
/// As for [`borrow`].
pub unsafe fn retain<T>(handle: *const T) -> Result<()> {
    // SAFETY: as the caller promises.
    new(unsafe { share(handle) }?);
    Ok(())
}

/// One reference fewer for the caller.
///
/// # Safety
/// As for [`borrow`]; and one of the references is the caller's to give up.
pub unsafe fn release<T>(handle: *const T) -> Result<()> {
    if handle.is_null() {
        return Err(Failure::argument("invalid argument"));
    }
    // SAFETY: the reference that `new` or `retain` made is taken back.
    drop(unsafe { Arc::from_raw(handle) });
    Ok(())
}
