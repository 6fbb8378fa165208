//! What is found is held against masks and filters, and written where the caller wants it.

use std::ffi::c_int;

use twincast_core::trace::bvh::SingleRay;

use super::Query;
use crate::abi::{RTCContext, RTCFilterFunctionN, RTCFilterFunctionNArguments, RTCHit, RTCRay, RTCRayHit};
use crate::geometry::Named;
use crate::scene::Record;

const _: () = {
    use std::mem::offset_of;
    assert!(size_of::<SingleRay>() <= size_of::<RTCRay>() && align_of::<SingleRay>() <= align_of::<RTCRay>());
    assert!(offset_of!(SingleRay, origin) == offset_of!(RTCRay, org));
    assert!(offset_of!(SingleRay, tmin) == offset_of!(RTCRay, tnear));
    assert!(offset_of!(SingleRay, direction) == offset_of!(RTCRay, dir));
    assert!(offset_of!(SingleRay, time) == offset_of!(RTCRay, time));
    assert!(offset_of!(SingleRay, tmax) == offset_of!(RTCRay, tfar));
};

/// What has been hit so far, or instances that it is in; at the same distance the lowest is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Nearest {
    pub geometry: u32,
    pub primitive: u32,
}

impl Nearest {
    /// Some primitive of a geometry that has no others among what is still looked at; nothing, if that is
    /// [`INVALID_ID`](crate::abi::INVALID_ID).
    pub const fn of(geometry: u32) -> Self {
        Self { geometry, primitive: 0 }
    }
}

/// A ray of the caller's, and where its hit goes; nowhere for a ray that asks for any hit.
///
/// Pointers and not references: callbacks are given the same ray, and write to it.
#[derive(Clone, Copy)]
pub struct Target {
    ray: *mut RTCRay,
    hit: *mut RTCHit,
}

impl Target {
    /// A ray that asks for the nearest hit.
    ///
    /// # Safety
    /// Both can be read and written as long as the target is used, by this thread alone.
    #[inline(always)]
    pub unsafe fn closest(ray_hit: *mut RTCRayHit) -> Self {
        let hit = ray_hit.wrapping_byte_add(std::mem::offset_of!(RTCRayHit, hit)).cast();
        Self { ray: ray_hit.cast(), hit }
    }

    /// A ray that asks for any hit.
    ///
    /// # Safety
    /// As for [`Target::closest`].
    pub unsafe fn any(ray: *mut RTCRay) -> Self {
        Self { ray, hit: std::ptr::null_mut() }
    }

    /// The ray as it is now.
    #[inline(always)]
    pub fn ray(&self) -> RTCRay {
        // SAFETY: readable, as who made the target promised.
        unsafe { self.ray.read() }
    }

    /// The ray as the native tracer reads it, where it is.
    ///
    /// # Safety
    /// Nobody writes to it as long as the result is used.
    #[inline(always)]
    pub unsafe fn single(&self) -> &SingleRay {
        // SAFETY: readable, as who made the target promised, and not written to; a ray begins with one of these.
        unsafe { &*self.ray.cast::<SingleRay>() }
    }

    /// Its mask.
    #[inline(always)]
    pub fn mask(&self) -> u32 {
        // SAFETY: as in `ray`.
        unsafe { (*self.ray).mask }
    }

    /// Where it is.
    pub fn pointer(&self) -> *mut RTCRay {
        self.ray
    }

    /// Where it ends now; below 0 for a ray that asked for any hit and has found one.
    #[inline(always)]
    pub fn tfar(&self) -> f32 {
        // SAFETY: as in `ray`.
        unsafe { (*self.ray).tfar }
    }

    fn set_tfar(&self, tfar: f32) {
        // SAFETY: writable, as who made the target promised.
        unsafe { (*self.ray).tfar = tfar };
    }

    /// Gives the ray another place, for the time that it is in an instance.
    pub fn set_place(&self, org: [f32; 3], dir: [f32; 3]) {
        // SAFETY: writable, as who made the target promised.
        unsafe { ((*self.ray).org, (*self.ray).dir) = (org, dir) };
    }

    /// Gives the ray another beginning and another time, likewise.
    #[cfg(feature = "v4")]
    pub fn set_span(&self, tnear: f32, time: f32) {
        // SAFETY: writable, as who made the target promised.
        unsafe { ((*self.ray).tnear, (*self.ray).time) = (tnear, time) };
    }

    /// Takes a hit: the nearest so far, or any.
    #[inline(always)]
    pub fn take(&self, query: &Query, geometry: u32, t: f32, named: &Named) {
        if self.hit.is_null() {
            return self.set_tfar(f32::NEG_INFINITY);
        }
        self.set_tfar(t);
        // SAFETY: writable, as who made the target promised.
        unsafe { self.hit.write(hit_of(query, geometry, named)) };
    }

    /// As [`Target::offer`], unless `nearest` is as far and lower.
    #[inline]
    pub fn offer_to(
        &self,
        nearest: &mut Nearest,
        query: &Query,
        record: &Record,
        geometry: u32,
        t: f32,
        named: &Named,
    ) {
        let own = Nearest { geometry, primitive: named.primitive };
        if t == self.tfar() && *nearest <= own {
            self.show(query, record, geometry, t, named);
        } else if self.offer(query, record, geometry, t, named) {
            *nearest = own;
        }
    }

    /// Has filters see a hit where another one has been taken, which stays.
    #[cold]
    fn show(&self, query: &Query, record: &Record, geometry: u32, t: f32, named: &Named) {
        if self.hit.is_null() || filters(query, record, false) == [None; 2] {
            return;
        }
        // SAFETY: readable and writable, as who made the target promised.
        let before = unsafe { self.hit.read() };
        if self.offer(query, record, geometry, t, named) {
            // SAFETY: as above.
            unsafe { self.hit.write(before) };
        }
    }

    /// Takes a hit, if filters let it pass: whether they do. It is no farther than the ray goes.
    fn offer(&self, query: &Query, record: &Record, geometry: u32, t: f32, named: &Named) -> bool {
        let filters = filters(query, record, self.hit.is_null());
        if filters == [None; 2] {
            self.take(query, geometry, t, named);
            return true;
        }
        let before = self.tfar();
        let mut hit = hit_of(query, geometry, named);
        let mut valid: c_int = -1;
        self.set_tfar(t);
        let arguments = RTCFilterFunctionNArguments {
            valid: &raw mut valid,
            user: record.geometry.user(),
            context: query.context,
            ray: self.ray.cast(),
            hit: (&raw mut hit).cast(),
            count: 1,
        };
        for filter in filters.into_iter().flatten() {
            // SAFETY: the caller promised a function of this type; the arguments live until it returns.
            unsafe { filter(&raw const arguments) };
            // SAFETY: the function may have written there; it is ours.
            if unsafe { (&raw const valid).read() } == 0 {
                self.set_tfar(before);
                return false;
            }
        }
        if self.hit.is_null() {
            self.set_tfar(f32::NEG_INFINITY);
        } else {
            // The filter may have changed both.
            // SAFETY: writable, as who made the target promised.
            unsafe { self.hit.write((&raw const hit).read()) };
        }
        true
    }
}

/// The filters that a hit of a geometry has to pass: the geometry's own, then that of the query.
pub fn filters(query: &Query, record: &Record, any: bool) -> [RTCFilterFunctionN; 2] {
    let functions = &record.functions;
    let own = if any { functions.occluded_filter } else { functions.intersect_filter };
    let of_query = if query.filters_all || functions.heeds_argument_filter { query.filter } else { None };
    [own, of_query]
}

/// A hit as the interface has it.
#[inline(always)]
pub fn hit_of(query: &Query, geometry: u32, named: &Named) -> RTCHit {
    // SAFETY: the context is the caller's, which lives as long as the query, or our own.
    let context: RTCContext = unsafe { query.context.read() };
    RTCHit {
        ng: named.ng.to_array(),
        u: named.u,
        v: named.v,
        primitive: named.primitive,
        geometry,
        instance: context.instance,
    }
}
