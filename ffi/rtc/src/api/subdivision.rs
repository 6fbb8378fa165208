//! Functions of subdivision geometry, which there is none of: each tells so.

use std::ffi::c_void;

use super::with;
use crate::failure::Failure;
use crate::geometry::{Geometry, Kind, Shape};

/// # Safety
/// As for [`crate::handle::borrow`].
unsafe fn refuse<R>(geometry: *const Geometry, default: R) -> R {
    // SAFETY: as the caller promises.
    unsafe { with(geometry, default, |_| Err(Failure::operation("operation not supported for this geometry"))) }
}

macro_rules! refused {
    ($($name:ident ($($argument:ty),*) $(-> $result:ty)?;)*) => {$(
        /// Not for any geometry of this library.
        #[unsafe(no_mangle)]
        pub unsafe extern "C-unwind" fn $name(geometry: *const Geometry $(, _: $argument)*) $(-> $result)? {
            // SAFETY: the interface's rules.
            unsafe { refuse(geometry, refused!(@default $($result)?)) }
        }
    )*};
    (@default) => { () };
    (@default $result:ty) => { crate::abi::INVALID_ID };
}

/// Of curves, which are not divided here, and of what is never hit: passed over.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcSetGeometryTessellationRate(geometry: *const Geometry, _rate: f32) {
    let set =
        |geometry: &Geometry| geometry.demand(matches!(geometry.kind, Kind::Linear(Shape::RoundCurve) | Kind::Absent));
    // SAFETY: the interface's rules.
    unsafe { with(geometry, (), set) }
}

refused! {
    rtcSetGeometryTopologyCount(u32);
    rtcSetGeometrySubdivisionMode(u32, u32);
    rtcSetGeometryVertexAttributeTopology(u32, u32);
    rtcSetGeometryDisplacementFunction(*const c_void);
    rtcGetGeometryFirstHalfEdge(u32) -> u32;
    rtcGetGeometryFace(u32) -> u32;
    rtcGetGeometryNextHalfEdge(u32) -> u32;
    rtcGetGeometryPreviousHalfEdge(u32) -> u32;
    rtcGetGeometryOppositeHalfEdge(u32, u32) -> u32;
}
