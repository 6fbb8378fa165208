//! In the place of the library in a build without the feature `oidn`: there is none, and nothing can be asked of it.

use std::ffi::CStr;
use std::path::Path;

use super::{Pixels, Watch};
use crate::error::{Error, Result};

/// No library, ever.
#[derive(Debug)]
pub(super) enum Library {}

impl Library {
    pub(super) fn open(_path: Option<&Path>) -> Result<Self> {
        Err(Error::Unavailable("denoising is not in this build: build with --features oidn".to_owned()))
    }

    pub(super) fn version(&self) -> [u32; 3] {
        match *self {}
    }

    pub(super) fn device(&self, _threads: usize) -> Result<Device<'_>> {
        match *self {}
    }
}

/// What it would run on.
pub(super) struct Device<'l>(&'l Library);

impl Device<'_> {
    pub(super) fn run(&self, _: [u32; 2], _: &[(&CStr, &Pixels)], _: &[&CStr], _: Watch<'_>) -> Result<Pixels> {
        match *self.0 {}
    }
}
