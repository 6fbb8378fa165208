//! One run of the network: pictures in, a picture out.
//!
//! Pixels are shared with the library, not copied, and it has them only as long as a call to [`Device::run`] lasts.
#![allow(unsafe_code, reason = "Open Image Denoise's C interface: owning devices and filters, and its callback")]

use std::ffi::{CStr, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

use super::library::{Functions, Handle};
use super::{Pixels, Watch};
use crate::error::{Error, Result};

const NAME: &str = "Open Image Denoise";

/// `OIDN_DEVICE_TYPE_CPU`.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;
/// `OIDN_ERROR_NONE`, `_UNSUPPORTED_HARDWARE` and `_CANCELLED`.
const NONE: c_int = 0;
const UNSUPPORTED: c_int = 5;
const CANCELLED: c_int = 6;

/// The processor, as the library uses it.
pub(super) struct Device<'l> {
    functions: &'l Functions,
    handle: Handle,
}

impl<'l> Device<'l> {
    /// With so many threads at most.
    pub(super) fn new(functions: &'l Functions, threads: usize) -> Result<Self> {
        // SAFETY: the library is loaded as long as `functions` lives, and takes any number; null says that it failed.
        let Some(handle) = (unsafe { (functions.new_device)(CPU) }) else {
            let unknown = || Error::Unavailable(format!("{NAME} does not say why it cannot be used"));
            return Err(failure(functions, None).unwrap_or_else(unknown));
        };
        let device = Self { functions, handle };
        let threads = c_int::try_from(threads).unwrap_or(c_int::MAX);
        // SAFETY: the handle is this device's, alive until it is dropped; the name ends with a zero.
        unsafe {
            (functions.set_device_int)(handle, c"numThreads".as_ptr(), threads);
            (functions.commit_device)(handle);
        }
        device.check()?;
        Ok(device)
    }

    /// The library's, as it counts: 10403 is 1.4.3.
    pub(super) fn version(&self) -> c_int {
        // SAFETY: as in `new`.
        unsafe { (self.functions.device_int)(self.handle, c"version".as_ptr()) }
    }

    /// Runs the filter for ray-traced pictures over inputs that are called so, with these flags set. All have `size`
    /// pixels, and so has the result.
    pub(super) fn run(
        &self,
        size: [u32; 2],
        inputs: &[(&CStr, &Pixels)],
        flags: &[&CStr],
        watch: Watch<'_>,
    ) -> Result<Pixels> {
        let [width, height] = size.map(|side| side as usize);
        let count = width * height;
        assert!(inputs.iter().all(|(_, pixels)| pixels.len() == count), "the caller compared the sizes");
        let mut output = vec![[0.0; 3]; count];
        let filter = Filter::new(self)?;
        for (name, pixels) in inputs {
            filter.set_image(name, pixels.as_ptr().cast_mut(), [width, height]);
        }
        filter.set_image(c"output", output.as_mut_ptr(), [width, height]);
        for flag in flags {
            // SAFETY: the handle is alive as long as the filter, and the name ends with a zero.
            unsafe { (self.functions.set_filter_bool)(filter.handle, flag.as_ptr(), true) };
        }
        // SAFETY: `progress` gets what it expects, the place of a `Watch`, which outlives the filter. The library calls
        // it only within the calls below. What it reads and writes there are the pixels of `inputs` and `output`, which
        // are borrowed or owned here for longer, of the sizes that were told; it writes to `output` alone, and nothing
        // else reads that meanwhile.
        unsafe {
            (self.functions.set_filter_progress)(
                filter.handle,
                Some(progress),
                ptr::from_ref(&watch).cast_mut().cast(),
            );
            (self.functions.commit_filter)(filter.handle);
            (self.functions.execute_filter)(filter.handle);
        }
        self.check()?;
        Ok(output)
    }

    /// An error where something went wrong since it was last asked, on this thread.
    fn check(&self) -> Result<()> {
        failure(self.functions, Some(self.handle)).map_or(Ok(()), Err)
    }
}

impl Drop for Device<'_> {
    fn drop(&mut self) {
        // SAFETY: this is the only reference to it but for filters, which are dropped before.
        unsafe { (self.functions.release_device)(self.handle) }
    }
}

/// What has a network's inputs and output.
struct Filter<'d> {
    device: &'d Device<'d>,
    handle: Handle,
}

impl<'d> Filter<'d> {
    fn new(device: &'d Device<'_>) -> Result<Self> {
        // SAFETY: the handle is alive as long as the device, and the name ends with a zero.
        let handle = unsafe { (device.functions.new_filter)(device.handle, c"RT".as_ptr()) };
        device.check()?;
        let unknown = || Error::Backend { backend: NAME, message: "no filter, and no word why".to_owned() };
        Ok(Self { device, handle: handle.ok_or_else(unknown)? })
    }

    /// Shares pixels with the filter. They must live until it has been executed for the last time.
    fn set_image(&self, name: &CStr, pixels: *mut [f32; 3], [width, height]: [usize; 2]) {
        let set = self.device.functions.set_shared_filter_image;
        // SAFETY: the handle is alive as long as the filter, and the name ends with a zero. The pixels are only noted
        // here.
        unsafe { set(self.handle, name.as_ptr(), pixels.cast(), FLOAT3, width, height, 0, 0, 0) }
    }
}

impl Drop for Filter<'_> {
    fn drop(&mut self) {
        // SAFETY: this is the only reference to it.
        unsafe { (self.device.functions.release_filter)(self.handle) }
    }
}

/// Passes on how far a filter is.
///
/// # Safety
/// `watch` must point to a [`Watch`].
unsafe extern "C" fn progress(watch: *mut c_void, done: f64) -> bool {
    // SAFETY: the caller says so; a watch may be used from any thread.
    let watch = unsafe { &*watch.cast_const().cast::<Watch<'_>>() };
    // A panic must not cross into the library: it ends the run instead.
    catch_unwind(AssertUnwindSafe(|| watch(done))).unwrap_or(false)
}

/// What went wrong since it was last asked, on this thread; of no device, why there is none.
fn failure(functions: &Functions, device: Option<Handle>) -> Option<Error> {
    let mut message: *const c_char = ptr::null();
    // SAFETY: the device is alive where there is one, and null is allowed.
    let code = unsafe { (functions.device_error)(device, &raw mut message) };
    if code == NONE {
        return None;
    }
    let words = if message.is_null() {
        format!("error {code}")
    } else {
        // SAFETY: the library's text, which ends with a zero and stays until it is asked again, on this thread.
        unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned()
    };
    Some(match code {
        CANCELLED => Error::Interrupted,
        UNSUPPORTED => Error::Unavailable(format!("{NAME} does not run here: {words}")),
        _ => Error::Backend { backend: NAME, message: words },
    })
}
