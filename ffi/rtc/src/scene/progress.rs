//! Telling the caller how far a commit is, who may end it.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::abi::RTCProgressMonitorFunction;
use crate::device::Callback;
use crate::failure::{Code, Failure, Result};

/// The progress monitor, which may cancel.
pub struct Progress {
    monitor: Callback<RTCProgressMonitorFunction>,
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl Progress {
    pub fn new(monitor: Callback<RTCProgressMonitorFunction>) -> Self {
        Self { monitor, done: AtomicU64::new(0), is_cancelled: AtomicBool::new(false) }
    }

    fn tell(&self, part: f64) {
        if let Some(function) = self.monitor.function {
            // SAFETY: the caller promised a function of this type that may be called with its pointer, from any thread.
            if !unsafe { function(self.monitor.user, part) } {
                self.is_cancelled.store(true, Ordering::Relaxed);
            }
        }
    }

    /// So much of all is done.
    ///
    /// # Errors
    /// Where the caller has had enough.
    pub fn at(&self, part: f64) -> Result<()> {
        if !self.is_cancelled.load(Ordering::Relaxed) {
            self.tell(part);
        }
        if self.is_cancelled.load(Ordering::Relaxed) {
            let message = "progress monitor forced termination".into();
            return Err(Failure { code: Code::Cancelled, message });
        }
        Ok(())
    }

    /// So many more of all have found their place. The build goes on after a cancellation; what it makes is dropped.
    pub fn built(&self, more: u64, all: u64) {
        let done = self.done.fetch_add(more, Ordering::Relaxed) + more;
        if !self.is_cancelled.load(Ordering::Relaxed) {
            self.tell((done as f64 / all as f64).min(1.0));
        }
    }
}
