//! How a running render, or a measurement, is watched and stopped.

use std::sync::atomic::{AtomicBool, Ordering};

use super::Finished;
use crate::error::{Error, Result};

/// How a running render is watched and stopped.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// Set to stop: the render then returns [`Error::Interrupted`].
    pub cancel: Option<&'a AtomicBool>,
    /// Called after each tile, from any thread, with the number of its pixels.
    pub on_tile: Option<&'a (dyn Fn(u64) + Sync)>,
    /// Called with each tile's pixels, from any thread.
    pub on_pixels: Option<&'a (dyn Fn(Finished) + Sync)>,
}

impl<'a> Control<'a> {
    /// One that only stops.
    pub(crate) fn stopping(cancel: Option<&'a AtomicBool>) -> Self {
        Self { cancel, ..Self::default() }
    }

    /// Whether it is to stop.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed))
    }

    /// Whether it may go on.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if it is to stop.
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }
}
