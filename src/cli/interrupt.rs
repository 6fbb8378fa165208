//! Ctrl-C: stop cleanly at the first, at once at the second.

use std::sync::atomic::{AtomicBool, Ordering};

use super::leave::leave;
use crate::error::{Error, Result};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static INSTALLED: AtomicBool = AtomicBool::new(false);

/// Has Ctrl-C set the flag that is returned, and a second one end the process with exit code 130. May be asked for again.
pub(super) fn install() -> Result<&'static AtomicBool> {
    if INSTALLED.swap(true, Ordering::Relaxed) {
        return Ok(&INTERRUPTED);
    }
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            leave(130);
        }
    })
    .map_err(|error| Error::Unavailable(format!("Ctrl-C cannot be handled: {error}")))?;
    Ok(&INTERRUPTED)
}

/// Between two phases of work: an error once Ctrl-C was pressed.
pub(super) fn check() -> Result<()> {
    if INTERRUPTED.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}
