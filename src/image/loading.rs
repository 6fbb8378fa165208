//! Shared libraries that are opened at run time: the loader's words, and functions by their names.
#![allow(unsafe_code, reason = "opening a shared library, and saying of which types its functions are")]

use std::ffi::c_int;
use std::path::Path;

use libloading::os::unix::{Library, RTLD_LOCAL};

/// Opens a library, by its path or by a name that the system looks for; else says why it cannot be loaded, in the
/// loader's words, which mostly begin with a library's name: this one's, or that of one it needs. What it calls in
/// others is looked up now (`RTLD_NOW`), or as it is called first (`RTLD_LAZY`), which is how programs are linked and
/// takes less time.
///
/// # Safety
/// What stands at `place` must be a library that may be loaded: its initialisers run.
pub(super) unsafe fn open(place: &Path, binding: c_int) -> Result<Library, String> {
    // SAFETY: the caller vouches for the library.
    let opened = unsafe { Library::open(Some(place), binding | RTLD_LOCAL) };
    opened.map_err(|error| std::error::Error::source(&error).map_or_else(|| error.to_string(), ToString::to_string))
}

/// The first of these functions that a library has, else the first name.
///
/// # Safety
/// `T` must be the type of a pointer to each of them, and the library must not be closed while it is used.
pub(super) unsafe fn function<T: Copy>(library: &Library, names: &[&'static str]) -> Result<T, &'static str> {
    let found = names.iter().find_map(|name| {
        // SAFETY: the caller says that a function of this name has this type.
        unsafe { library.get::<T>(name.as_bytes()) }.ok()
    });
    found.map(|symbol| *symbol).ok_or(names[0])
}
