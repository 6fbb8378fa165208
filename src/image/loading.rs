//! Shared libraries that are opened at run time: the loader's words, and functions by their names.
#![allow(unsafe_code, reason = "opening a shared library, and saying of which types its functions are")]

use std::path::Path;

use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};

/// Opens a library, by its path or by a name that the system looks for; else says why it cannot be loaded, in the loader's words.
///
/// # Safety
/// What stands at `place` must be a library that may be loaded: its initialisers run.
pub(super) unsafe fn open(place: &Path) -> Result<Library, String> {
    // SAFETY: the caller vouches for the library.
    unsafe { Library::open(Some(place), RTLD_NOW | RTLD_LOCAL) }.map_err(|error| reason(&error, place))
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

/// The loader's words mostly begin with the name.
fn reason(error: &libloading::Error, place: &Path) -> String {
    let place = place.display().to_string();
    let cause = std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string);
    if cause.contains(&place) { cause } else { format!("{place}: {cause}") }
}
