//! Ctrl-C, and SIGTERM, which schedulers of batches send: stop cleanly at the first, at once at the second, and at the first where nothing has begun that could be left half done.

use std::sync::atomic::{AtomicBool, Ordering};

use super::complain;
use super::leave::leave;
#[cfg(unix)]
use super::signals;
use crate::error::{Error, Result};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static INSTALLED: AtomicBool = AtomicBool::new(false);
/// Whether files are being read or something is measured, and nothing is written.
static HARMLESS: AtomicBool = AtomicBool::new(false);
/// Whether it is being tried to write pictures.
static TRYING: AtomicBool = AtomicBool::new(false);

/// Has Ctrl-C set the flag that is returned, and a second one end the process with exit code 130. May be asked for again.
pub(super) fn install() -> Result<&'static AtomicBool> {
    if INSTALLED.swap(true, Ordering::Relaxed) {
        return Ok(&INTERRUPTED);
    }
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            leave(130);
        }
        leave_if_harmless();
    })
    .map_err(|error| Error::Unavailable(format!("Ctrl-C cannot be handled: {error}")))?;
    #[cfg(unix)]
    signals::have_termination_interrupt();
    Ok(&INTERRUPTED)
}

/// Reads or measures something, in the midst of which Ctrl-C ends the process: no loader need ask for it.
pub(super) fn while_nothing_is_written<T>(work: impl FnOnce() -> T) -> T {
    during(&HARMLESS, work)
}

/// Tries something out that Ctrl-C must let come to its end, for it tidies up.
pub(super) fn while_trying<T>(try_out: impl FnOnce() -> T) -> T {
    let done = during(&TRYING, try_out);
    if INTERRUPTED.load(Ordering::Relaxed) {
        leave_if_harmless();
    }
    done
}

/// Ends the process where nothing is written.
fn leave_if_harmless() {
    if HARMLESS.load(Ordering::Relaxed) && !TRYING.load(Ordering::Relaxed) {
        complain("error", &Error::Interrupted);
        leave(130);
    }
}

fn during<T>(flag: &AtomicBool, work: impl FnOnce() -> T) -> T {
    flag.store(true, Ordering::Relaxed);
    let done = work();
    flag.store(false, Ordering::Relaxed);
    done
}

/// Between two phases of work: an error once Ctrl-C was pressed.
pub(super) fn check() -> Result<()> {
    if INTERRUPTED.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}
