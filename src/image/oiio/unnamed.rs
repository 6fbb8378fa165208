//! Files that have no place, and are nowhere but in memory.
#![allow(unsafe_code, reason = "a system call that makes a file")]

use std::ffi::CStr;
use std::fs::File;
use std::io;
use std::os::fd::{AsRawFd, FromRawFd};
use std::path::PathBuf;

/// A new one, which is gone once it is closed, and a path under which this process can open it meanwhile. `name` is
/// shown to those who look at the process alone.
pub(super) fn create(name: &CStr) -> io::Result<(File, PathBuf)> {
    // SAFETY: the name is a string that ends in 0.
    let descriptor = unsafe { libc::memfd_create(name.as_ptr(), libc::MFD_CLOEXEC) };
    if descriptor < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the descriptor was made above, and nobody else has it.
    let file = unsafe { File::from_raw_fd(descriptor) };
    let path = PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()));
    Ok((file, path))
}
