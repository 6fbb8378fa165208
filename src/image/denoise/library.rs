//! Open Image Denoise as a file: where it is looked for, and its functions by their names.
//!
//! Versions 1.4 and 2 differ in how the functions that set numbers are called, `oidnSetFilter1b` or
//! `oidnSetFilterBool`; in version 2 the former are inline functions of the header. Both are asked for. What they take
//! is the same (A. T. Áfra and others, `include/OpenImageDenoise/oidn.h` of 1.4.3 and 2.3). Before 1.4 normals had
//! another range, and guides could not be denoised.
#![allow(unsafe_code, reason = "opening a shared library, and saying of which types its functions are")]

use std::ffi::{c_char, c_int, c_void};
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::ptr::NonNull;

use libloading::os::unix::{Library as File, RTLD_NOW};

use super::VARIABLE;
use super::device::Device;
use crate::error::{Error, Result};
use crate::image::loading::{self, function};

/// Names of the library, the newest first.
const NAMES: [&str; 2] = ["libOpenImageDenoise.so.2", "libOpenImageDenoise.so.1"];

/// The oldest version that is of use, as the library counts: 1.4.0.
const OLDEST: c_int = 1_04_00;

/// A device or a filter of the library.
pub(super) type Handle = NonNull<c_void>;

/// Called with the part that is done; whether to go on.
pub(super) type Progress = unsafe extern "C" fn(*mut c_void, f64) -> bool;

/// The functions that are used. `Option<Handle>` is a pointer that may be null.
#[derive(Clone, Copy, Debug)]
pub(super) struct Functions {
    pub(super) new_device: unsafe extern "C" fn(c_int) -> Option<Handle>,
    pub(super) set_device_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    pub(super) device_int: unsafe extern "C" fn(Handle, *const c_char) -> c_int,
    pub(super) device_error: unsafe extern "C" fn(Option<Handle>, *mut *const c_char) -> c_int,
    pub(super) commit_device: unsafe extern "C" fn(Handle),
    pub(super) release_device: unsafe extern "C" fn(Handle),
    pub(super) new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Option<Handle>,
    /// Name, pixels, format, width, height, offset, and bytes from pixel to pixel and from row to row, 0 for packed
    /// ones.
    pub(super) set_shared_filter_image:
        unsafe extern "C" fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize),
    pub(super) set_filter_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    pub(super) set_filter_progress: unsafe extern "C" fn(Handle, Option<Progress>, *mut c_void),
    pub(super) commit_filter: unsafe extern "C" fn(Handle),
    pub(super) execute_filter: unsafe extern "C" fn(Handle),
    pub(super) release_filter: unsafe extern "C" fn(Handle),
}

/// The library, opened. It is never closed: threads that it has started may outlive every device.
#[derive(Debug)]
pub(super) struct Library {
    functions: Functions,
    /// As the library counts: 10403 is 1.4.3.
    version: c_int,
    _file: ManuallyDrop<File>,
}

impl Library {
    /// The library at a path or in a folder, else where the system looks for libraries.
    pub(super) fn open(path: Option<&Path>) -> Result<Self> {
        let places: Vec<PathBuf> = match path {
            None => NAMES.iter().map(PathBuf::from).collect(),
            Some(folder) if folder.is_dir() => NAMES.iter().map(|name| folder.join(name)).collect(),
            Some(path) => vec![path.to_owned()],
        };
        let mut refusals = Vec::new();
        for place in &places {
            // SAFETY: what a library does when it is loaded is up to whoever installed it under this name, or named it
            // in the environment, as with every library that a program is linked with.
            match unsafe { loading::open(place, RTLD_NOW) } {
                Ok(file) => return Self::new(file, place),
                Err(words) => refusals.push(reason(words, place)),
            }
        }
        let refusals = refusals.join("; ");
        Err(Error::Unavailable(format!(
            "Open Image Denoise cannot be loaded ({refusals}): install a package of it, or unpack a release from \
             www.openimagedenoise.org and name the file lib/{} of it in the environment variable {VARIABLE}",
            NAMES[0]
        )))
    }

    fn new(file: File, place: &Path) -> Result<Self> {
        let unusable = |message: String| Error::Unavailable(format!("{}: {message}", place.display()));
        let functions = Functions::of(&file).map_err(|name| unusable(format!("has no function {name}")))?;
        let file = ManuallyDrop::new(file);
        let version = Device::new(&functions, 1)?.version();
        if version < OLDEST {
            return Err(unusable(format!("is Open Image Denoise {}; 1.4 or later is needed", dotted(version))));
        }
        Ok(Self { functions, version, _file: file })
    }

    /// Major, minor and patch.
    pub(super) fn version(&self) -> [u32; 3] {
        [10_000, 100, 1].map(|unit| (self.version / unit % 100).unsigned_abs())
    }

    /// A device that computes with so many threads.
    pub(super) fn device(&self, threads: usize) -> Result<Device<'_>> {
        Device::new(&self.functions, threads)
    }
}

impl Functions {
    /// Those of a library; the name of one that it lacks.
    fn of(file: &File) -> std::result::Result<Self, &'static str> {
        // SAFETY: each name is Open Image Denoise's own for a function of the type of the field it is put into, in
        // every version from 1.4 on, as its headers have it; that the file is that library is vouched for by its name.
        unsafe {
            Ok(Self {
                new_device: function(file, &["oidnNewDevice"])?,
                set_device_int: function(file, &["oidnSetDeviceInt", "oidnSetDevice1i"])?,
                device_int: function(file, &["oidnGetDeviceInt", "oidnGetDevice1i"])?,
                device_error: function(file, &["oidnGetDeviceError"])?,
                commit_device: function(file, &["oidnCommitDevice"])?,
                release_device: function(file, &["oidnReleaseDevice"])?,
                new_filter: function(file, &["oidnNewFilter"])?,
                set_shared_filter_image: function(file, &["oidnSetSharedFilterImage"])?,
                set_filter_bool: function(file, &["oidnSetFilterBool", "oidnSetFilter1b"])?,
                set_filter_progress: function(file, &["oidnSetFilterProgressMonitorFunction"])?,
                commit_filter: function(file, &["oidnCommitFilter"])?,
                execute_filter: function(file, &["oidnExecuteFilter"])?,
                release_filter: function(file, &["oidnReleaseFilter"])?,
            })
        }
    }
}

/// The loader's words, with the name of the library.
fn reason(words: String, place: &Path) -> String {
    let place = place.display().to_string();
    if words.contains(&place) { words } else { format!("{place}: {words}") }
}

fn dotted(version: c_int) -> String {
    format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100)
}
