//! Whether pictures can be written, found out while other work goes on.
//!
//! Only a picture is proof, and the first takes a quarter of a second, in which OpenImageIO's libraries are loaded. So
//! it is made on a thread of its own, beside the reading of the scene. What is wrong is told as if it had been found
//! before.

use std::panic::resume_unwind;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};

use super::{interrupt, outputs};
use crate::error::{Error, Result};

/// A trial that is going on.
///
/// It has to be joined before the process ends: libraries that are being loaded must not be torn down beside that.
#[must_use]
pub(super) struct Trial {
    thread: JoinHandle<Result<()>>,
    cancel: &'static AtomicBool,
}

impl Trial {
    /// Tries these out. Where one cannot be written, `cancel` is set, so that the work for it ends.
    pub(super) fn start(pictures: Vec<PathBuf>, cancel: &'static AtomicBool) -> Result<Self> {
        let work = move || {
            let tried = interrupt::while_trying(|| outputs::try_out(&pictures));
            if tried.is_err() {
                cancel.store(true, Ordering::Relaxed);
            }
            tried
        };
        let thread = Builder::new().name("trial".to_owned()).spawn(work);
        let thread = thread.map_err(|error| Error::Unavailable(format!("no thread can be started: {error}")))?;
        Ok(Self { thread, cancel })
    }

    /// What came of the work beside it; but its own error where it has one.
    pub(super) fn join<T>(self, outcome: Result<T>) -> Result<T> {
        let tried = self.thread.join().unwrap_or_else(|panic| resume_unwind(panic));
        if tried.is_err() {
            // Unless the user has stopped it as well, what follows may go on.
            self.cancel.store(interrupt::is_wanted(), Ordering::Relaxed);
        }
        tried.and(outcome)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static CANCEL: AtomicBool = AtomicBool::new(false);

    #[test]
    fn a_failure_stops_the_work_and_is_what_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let trial = Trial::start(vec![folder.path().join("missing/a.png")], &CANCEL).expect("a thread");
        while !CANCEL.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
        let error = trial.join::<()>(Err(Error::Interrupted)).expect_err("no such folder");
        assert!(error.to_string().contains("does not exist"), "{error}");
        assert!(!CANCEL.load(Ordering::Relaxed));

        let trial = Trial::start(vec![folder.path().join("a.png")], &CANCEL).expect("a thread");
        assert_eq!(trial.join(Ok(7)).expect("it can be written"), 7);
        let trial = Trial::start(vec![folder.path().join("a.png")], &CANCEL).expect("a thread");
        assert!(matches!(trial.join::<()>(Err(Error::Interrupted)), Err(Error::Interrupted)));
    }
}
