//! The caller's own primitives.

use std::ffi::{c_int, c_void};

use super::Query;
use super::offer::{Target, filters};
use crate::abi::{RTCFilterFunctionNArguments, RTCUserFunctionNArguments};
use crate::scene::{Item, Record};

/// What a callback is given, and behind it what the functions need that it may call with it.
#[repr(C)]
pub struct UserCall {
    pub arguments: RTCUserFunctionNArguments,
    record: *const Record,
    pub query: *const Query,
}

/// Asks the caller whether the ray meets a primitive; the answer is written to the ray.
pub fn cast<const ANY: bool>(query: &Query, target: &Target, record: &Record, item: Item) {
    let functions = &record.functions;
    let own = if ANY { functions.occluded } else { functions.intersect };
    let Some(function) = query.user.or(own) else { return };
    let mut valid: c_int = -1;
    let call = UserCall {
        arguments: RTCUserFunctionNArguments {
            valid: &raw mut valid,
            user: record.geometry.user(),
            primitive: item.primitive,
            context: query.context,
            ray: target.pointer().cast::<c_void>(),
            count: 1,
            geometry: item.geometry,
        },
        record,
        query,
    };
    // SAFETY: the caller promised a function of this type. The ray is the caller's own, followed by its hit where it
    // has one; all else lives until the function returns.
    unsafe { function((&raw const call).cast()) };
}

/// Runs the filters of the geometry that a callback was called for.
///
/// # Safety
/// `call` is what this library gave to a callback that has not returned; `arguments` are the caller's, complete.
pub unsafe fn run_filters(call: *const UserCall, arguments: *const RTCFilterFunctionNArguments, any: bool) {
    // SAFETY: the call is alive, and so are what its pointers name.
    let (record, query) = unsafe { (&*(*call).record, &*(*call).query) };
    for filter in filters(query, record, any).into_iter().flatten() {
        // SAFETY: the caller promised a function of this type.
        unsafe { filter(arguments) };
        // SAFETY: one word for each ray of the caller's, of which there is one.
        if unsafe { *(*arguments).valid } == 0 {
            return;
        }
    }
}
