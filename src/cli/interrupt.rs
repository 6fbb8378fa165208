//! Ctrl-C, and SIGTERM, which schedulers of batches send: stop cleanly at the first, at once at the second, and at the
//! first where nothing has begun that could be left half done.

use std::sync::atomic::{AtomicBool, Ordering};

use super::complain;
use super::leave::leave;
#[cfg(unix)]
use super::signals;
use crate::error::{Error, Result};

/// Whether the user wants the process to end.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Whether work is to stop, for that or because it would be in vain.
static STOP: AtomicBool = AtomicBool::new(false);
static INSTALLED: AtomicBool = AtomicBool::new(false);
/// Whether files are being read or something is measured, and nothing is written.
static HARMLESS: AtomicBool = AtomicBool::new(false);
/// Whether it is being tried to write pictures.
static TRYING: AtomicBool = AtomicBool::new(false);

/// Has Ctrl-C set the flag that is returned, and a second one end the process with exit code 130. May be asked for
/// again.
pub(super) fn install() -> Result<&'static AtomicBool> {
    if INSTALLED.swap(true, Ordering::Relaxed) {
        return Ok(&STOP);
    }
    ctrlc::set_handler(|| {
        let is_second = INTERRUPTED.swap(true, Ordering::Relaxed);
        STOP.store(true, Ordering::Relaxed);
        if is_second {
            leave(130);
        }
        leave_if_harmless();
    })
    .map_err(|error| Error::Unavailable(format!("Ctrl-C cannot be handled: {error}")))?;
    #[cfg(unix)]
    signals::have_termination_interrupt();
    Ok(&STOP)
}

/// Whether the user, or who else sends signals, wants the process to end.
pub(super) fn is_wanted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Reads or measures something, in the midst of which Ctrl-C ends the process: no loader need ask for it.
pub(super) fn while_nothing_is_written<T>(work: impl FnOnce() -> T) -> T {
    during(&HARMLESS, work)
}

/// Tries something out that Ctrl-C must let come to its end, for it tidies up.
pub(super) fn while_trying<T>(try_out: impl FnOnce() -> T) -> T {
    let done = during(&TRYING, try_out);
    if is_wanted() {
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

/// Between two phases of work: an error once it is to stop.
pub(super) fn check() -> Result<()> {
    if STOP.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}
