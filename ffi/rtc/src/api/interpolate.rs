//! Interpolation.

use super::{present, with};
use crate::abi::{Outputs, RTCInterpolateArguments, RTCInterpolateNArguments};
use crate::failure::guard;
use crate::geometry::{Geometry, Place, interpolate};

/// Values at a place.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcInterpolate(arguments: *const RTCInterpolateArguments) {
    guard((), || None, || present(arguments.cast_mut()).map(|_| ()));
    // SAFETY: the interface's rules; null was reported.
    let Some(arguments) = (unsafe { arguments.as_ref() }) else { return };
    let RTCInterpolateArguments { primitive, u, v, buffer_type, slot, outputs, count, .. } = *arguments;
    let place = Place { primitive, u, v, buffer_type, slot };
    // SAFETY: the interface's rules.
    unsafe {
        with(arguments.geometry.cast_const().cast(), (), |geometry| interpolate(geometry, &place, &outputs, count, 1))
    }
}

/// Values at several places.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn rtcInterpolateN(arguments: *const RTCInterpolateNArguments) {
    guard((), || None, || present(arguments.cast_mut()).map(|_| ()));
    // SAFETY: the interface's rules; null was reported.
    let Some(arguments) = (unsafe { arguments.as_ref() }) else { return };
    let RTCInterpolateNArguments { valid, primitives, u, v, places, buffer_type, slot, outputs, count, .. } =
        *arguments;
    let work = |geometry: &Geometry| {
        for i in 0..places as usize {
            // SAFETY: arrays of so many, or null for `valid`, by the interface's rules.
            let (is_valid, primitive, u, v) =
                unsafe { (valid.is_null() || *valid.add(i) != 0, *primitives.add(i), *u.add(i), *v.add(i)) };
            let at = |output: *mut f32| if output.is_null() { output } else { output.wrapping_add(i) };
            let outputs = Outputs {
                value: at(outputs.value),
                du: at(outputs.du),
                dv: at(outputs.dv),
                dudu: at(outputs.dudu),
                dvdv: at(outputs.dvdv),
                dudv: at(outputs.dudv),
            };
            if is_valid {
                let place = Place { primitive, u, v, buffer_type, slot };
                // SAFETY: room for all components of all places, by the interface's rules.
                unsafe { interpolate(geometry, &place, &outputs, count, places as usize)? };
            }
        }
        Ok(())
    };
    // SAFETY: the interface's rules.
    unsafe { with(arguments.geometry.cast_const().cast(), (), work) }
}
