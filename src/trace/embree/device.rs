//! The device: what all scenes share, and what Embree reports to.
//!
//! Embree's calls return nothing; errors go to a callback. [`Device::check`] asks after each step of a build whether
//! one came. Rays never ask: a query that is well formed has no errors to report, and the question would cost more
//! than the ray.
#![allow(unsafe_code, reason = "Embree's C interface: owning a device, and its two callbacks")]

use std::ffi::{CStr, CString, c_char, c_void};
use std::sync::atomic::{AtomicBool, AtomicIsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::{Instructions, backend, sys};
use crate::error::{Error, Result};

/// An Embree device, held by every scene made with it.
pub(super) struct Device {
    raw: sys::RTCDevice,
    state: Arc<State>,
}

/// What Embree's callbacks write to.
#[derive(Default)]
pub(super) struct State {
    /// The first error since the last check.
    error: Mutex<Option<String>>,
    /// Whether there is one.
    has_error: AtomicBool,
    /// A callback of ours panicked: answers since then cannot be trusted.
    panicked: AtomicBool,
    /// Allocated less freed.
    bytes: AtomicIsize,
}

// SAFETY: Embree's devices are reference-counted atomically and may be used from any thread; `State` is Sync.
unsafe impl Send for Device {}
// SAFETY: as above; through a shared reference only properties are read, and scenes made, which Embree synchronises.
unsafe impl Sync for Device {}

impl Device {
    /// A device whose scenes are built on `threads` threads, or on as many as there are processors, and which uses no
    /// `instructions` but these.
    pub(super) fn new(threads: Option<usize>, instructions: Instructions) -> Result<Arc<Self>> {
        let threads = threads.map(|count| format!("threads={}", count.max(1)));
        let isa = match instructions {
            Instructions::All => None,
            Instructions::Avx2 => Some("max_isa=avx2".to_owned()),
            Instructions::Sse2 => Some("max_isa=sse2".to_owned()),
        };
        let config = threads.into_iter().chain(isa).collect::<Vec<_>>().join(",");
        let config = CString::new(config).map_err(|e| backend(e.to_string()))?;
        // SAFETY: the string ends in NUL and outlives the call.
        let raw = unsafe { sys::rtcNewDevice(config.as_ptr()) };
        if raw.is_null() {
            // SAFETY: without a device, the error of the last rtcNewDevice on this thread is asked for.
            let code = unsafe { sys::rtcGetDeviceError(std::ptr::null_mut()) };
            return Err(backend(format!("cannot make a device: {}", error_name(code))));
        }
        let device = Self { raw, state: Arc::default() };
        let state = Arc::as_ptr(&device.state).cast_mut().cast::<c_void>();
        // SAFETY: both callbacks only use `state`, shared; it outlives the last of Embree's references to the device,
        // for every scene keeps this `Device`, whose drop releases the device before the state.
        unsafe {
            sys::rtcSetDeviceErrorFunction(device.raw, Some(on_error), state);
            sys::rtcSetDeviceMemoryMonitorFunction(device.raw, Some(on_memory), state);
        }
        device.check("setting up the device")?;
        device.check_layout()?;
        Ok(Arc::new(device))
    }

    /// Embree's handle, valid as long as `self`.
    pub(super) const fn raw(&self) -> sys::RTCDevice {
        self.raw
    }

    /// What callbacks may hold on to.
    pub(super) const fn state(&self) -> &Arc<State> {
        &self.state
    }

    /// The first error since the last check, as having happened while `doing` something.
    pub(super) fn check(&self, doing: &str) -> Result<()> {
        // For the sake of millions of instances, after each of which there is none.
        if !self.state.has_error.load(Ordering::Acquire) {
            return Ok(());
        }
        let mut error = self.state.error.lock().unwrap_or_else(PoisonError::into_inner);
        self.state.has_error.store(false, Ordering::Release);
        let error = error.take();
        error.map_or(Ok(()), |error| Err(backend(format!("{doing}: {error}"))))
    }

    /// Bytes that Embree holds.
    pub(super) fn bytes(&self) -> usize {
        self.state.bytes.load(Ordering::Relaxed).max(0).unsigned_abs()
    }

    /// Does something in which Embree allocates, and tells how many more bytes it holds afterwards than it says by
    /// itself.
    pub(super) fn untold_bytes<T>(&self, work: impl FnOnce() -> T) -> (T, usize) {
        let before = (allocated(), self.bytes());
        let done = work();
        let (allocated, told) = (allocated().saturating_sub(before.0), self.bytes().saturating_sub(before.1));
        (done, allocated.saturating_sub(told))
    }

    /// The version of the library that was loaded.
    pub(super) fn version(&self) -> String {
        let [major, minor, patch] = self.version_numbers();
        format!("{major}.{minor}.{patch}")
    }

    fn version_numbers(&self) -> [isize; 3] {
        [
            sys::RTC_DEVICE_PROPERTY_VERSION_MAJOR,
            sys::RTC_DEVICE_PROPERTY_VERSION_MINOR,
            sys::RTC_DEVICE_PROPERTY_VERSION_PATCH,
        ]
        // SAFETY: the device is alive and the properties exist in every version.
        .map(|property| unsafe { sys::rtcGetDeviceProperty(self.raw, property) })
    }

    /// Symbols carry no version, so nothing else keeps a library away whose hits are longer than ours: those of 4.3
    /// and later are (16 bytes a ray), and it would write past ours.
    fn check_layout(&self) -> Result<()> {
        let [major, minor, _] = self.version_numbers();
        let has_long_hits = |major: isize, minor: isize| (major, minor) >= (4, 3);
        let (built_major, built_minor) = (sys::RTC_VERSION_MAJOR as isize, sys::RTC_VERSION_MINOR as isize);
        if major == built_major && has_long_hits(major, minor) == has_long_hits(built_major, built_minor) {
            return Ok(());
        }
        let (loaded, built) = (self.version(), sys::VERSION);
        Err(Error::Unavailable(format!(
            "embree: this build is for Embree {built}, but {loaded} was loaded; rebuild it"
        )))
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the one reference that `new` took; scenes hold their own.
        unsafe { sys::rtcReleaseDevice(self.raw) }
    }
}

impl State {
    fn report(&self, error: String) {
        let mut first = self.error.lock().unwrap_or_else(PoisonError::into_inner);
        first.get_or_insert(error);
        self.has_error.store(true, Ordering::Release);
    }

    /// Notes that a callback of ours panicked.
    pub(super) fn report_panic(&self) {
        self.panicked.store(true, Ordering::Relaxed);
        self.report("a shape's code panicked".to_owned());
    }

    /// Whether one did, ever.
    #[inline]
    pub(super) fn has_panicked(&self) -> bool {
        self.panicked.load(Ordering::Relaxed)
    }
}

/// Bytes that glibc's allocator has handed out to the whole process; 0 where another one is used.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn allocated() -> usize {
    // SAFETY: only counts.
    let counts = unsafe { libc::mallinfo2() };
    counts.uordblks + counts.hblkhd
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn allocated() -> usize {
    0
}

/// `RTCErrorFunction`.
///
/// # Safety
/// Embree's: `state` is what was registered with it, `message` is null or ends in NUL.
unsafe extern "C" fn on_error(state: *mut c_void, code: sys::RTCError, message: *const c_char) {
    // SAFETY: registered in `Device::new` as a pointer to a State that outlives the device.
    let state = unsafe { &*state.cast::<State>() };
    let words = if message.is_null() {
        String::new()
    } else {
        // SAFETY: Embree passes a C string.
        unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned()
    };
    state.report(format!("{}: {words}", error_name(code)));
}

/// `RTCMemoryMonitorFunction`: `bytes` were allocated, or freed if negative. True lets it go on.
///
/// # Safety
/// Embree's: `state` is what was registered with it.
unsafe extern "C" fn on_memory(state: *mut c_void, bytes: isize, _after: bool) -> bool {
    // SAFETY: registered in `Device::new` as a pointer to a State that outlives the device.
    let state = unsafe { &*state.cast::<State>() };
    state.bytes.fetch_add(bytes, Ordering::Relaxed);
    true
}

/// Numbers, for 4.3 has one more than 3.13.
fn error_name(code: sys::RTCError) -> String {
    let name = match code {
        0 => "RTC_ERROR_NONE",
        1 => "RTC_ERROR_UNKNOWN",
        2 => "RTC_ERROR_INVALID_ARGUMENT",
        3 => "RTC_ERROR_INVALID_OPERATION",
        4 => "RTC_ERROR_OUT_OF_MEMORY",
        5 => "RTC_ERROR_UNSUPPORTED_CPU",
        6 => "RTC_ERROR_CANCELLED",
        7 => "RTC_ERROR_LEVEL_ZERO_RAYTRACING_SUPPORT_MISSING",
        other => return format!("RTC_ERROR {other}"),
    };
    name.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn embrees_errors_come_out_once_with_code_and_step() {
        let device = Device::new(Some(1), Instructions::All).unwrap();
        // SAFETY: the device is alive; Embree refuses a type that does not exist and returns null.
        let geometry = unsafe { sys::rtcNewGeometry(device.raw(), 9999) };
        assert!(geometry.is_null());
        let error = device.check("making a geometry").unwrap_err();
        assert_eq!(error.exit_code(), 3);
        let text = error.to_string();
        assert!(text.starts_with("embree: making a geometry: RTC_ERROR_"), "{text}");
        device.check("again").unwrap();
    }

    #[test]
    fn error_names_are_the_headers() {
        let codes = [
            (sys::RTC_ERROR_NONE, "RTC_ERROR_NONE"),
            (sys::RTC_ERROR_UNKNOWN, "RTC_ERROR_UNKNOWN"),
            (sys::RTC_ERROR_INVALID_ARGUMENT, "RTC_ERROR_INVALID_ARGUMENT"),
            (sys::RTC_ERROR_INVALID_OPERATION, "RTC_ERROR_INVALID_OPERATION"),
            (sys::RTC_ERROR_OUT_OF_MEMORY, "RTC_ERROR_OUT_OF_MEMORY"),
            (sys::RTC_ERROR_UNSUPPORTED_CPU, "RTC_ERROR_UNSUPPORTED_CPU"),
            (sys::RTC_ERROR_CANCELLED, "RTC_ERROR_CANCELLED"),
        ];
        for (code, name) in codes {
            assert_eq!(error_name(code), name);
        }
    }

    #[test]
    fn a_panic_in_a_callback_is_an_error_of_the_next_check() {
        let device = Device::new(Some(1), Instructions::All).unwrap();
        assert!(!device.state().has_panicked());
        device.state().report_panic();
        assert!(device.state().has_panicked());
        assert!(device.check("building").unwrap_err().to_string().contains("panicked"));
    }
}
