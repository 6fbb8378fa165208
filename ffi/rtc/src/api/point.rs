//! Point queries.

use std::ffi::c_void;

use super::{present, with};
use crate::abi::{RTCPointQuery, RTCPointQueryContext, RTCPointQueryFunction};
use crate::scene::Scene;
use crate::trace::point_query;

/// What is near a point.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcPointQuery(
    scene: *const Scene,
    query: *mut RTCPointQuery,
    context: *mut RTCPointQueryContext,
    function: RTCPointQueryFunction,
    user: *mut c_void,
) -> bool {
    let ask = |scene: &Scene| {
        present(query)?;
        present(context)?;
        // SAFETY: the interface's rules.
        let committed = unsafe { scene.committed() };
        // SAFETY: not null; the caller's.
        Ok(committed.is_some_and(|committed| unsafe { point_query(committed, query, context, function, user) }))
    };
    // SAFETY: the interface's rules.
    unsafe { with(scene, false, ask) }
}

/// What is near each of several points, one after the other.
///
/// # Safety
/// As for the functions of the interface; `queries` are so many structures of arrays.
unsafe fn several(
    (valid, count): (*const i32, usize),
    scene: *const Scene,
    queries: *mut f32,
    context: *mut RTCPointQueryContext,
    function: RTCPointQueryFunction,
    users: *mut *mut c_void,
) -> bool {
    if valid.is_null() || queries.is_null() {
        // Which is reported there.
        // SAFETY: null is.
        return unsafe { rtcPointQuery(scene, std::ptr::null_mut(), context, function, std::ptr::null_mut()) };
    }
    let mut changed = false;
    // SAFETY: an array of so many, by the interface's rules.
    for i in (0..count).filter(|&i| unsafe { *valid.add(i) } != 0) {
        // SAFETY: x, y, z, time and radius, each of so many.
        let at = |k: usize| unsafe { *queries.add(k * count + i) };
        let mut query = RTCPointQuery { point: [at(0), at(1), at(2)], time: at(3), radius: at(4) };
        // SAFETY: an array of so many, or null.
        let user = if users.is_null() { std::ptr::null_mut() } else { unsafe { *users.add(i) } };
        // SAFETY: the query is ours, all else by the interface's rules.
        changed |= unsafe { rtcPointQuery(scene, &raw mut query, context, function, user) };
        // SAFETY: as above.
        unsafe { *queries.add(4 * count + i) = query.radius };
    }
    changed
}

macro_rules! packets {
    ($($name:ident $count:literal)*) => {$(
        /// What is near each of some points.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $name(
            valid: *const i32,
            scene: *const Scene,
            queries: *mut c_void,
            context: *mut RTCPointQueryContext,
            function: RTCPointQueryFunction,
            users: *mut *mut c_void,
        ) -> bool {
            // SAFETY: the interface's rules.
            unsafe { several((valid, $count), scene, queries.cast(), context, function, users) }
        }
    )*};
}

packets!(rtcPointQuery4 4 rtcPointQuery8 8 rtcPointQuery16 16);
