//! What is made once, when it is first asked for.

use std::sync::OnceLock;

/// What is in the cell, made if it is empty. Several threads may make it at once; what the first of them has made is
/// kept.
///
/// Not made within `get_or_init`: there a thread of rayon's that waits for others may take up another query, which
/// waits for this very cell; and a process that is forked meanwhile would wait for a thread that it does not have.
pub fn made_outside<T>(cell: &OnceLock<T>, make: impl FnOnce() -> T) -> &T {
    cell.get().unwrap_or_else(|| {
        let made = make();
        cell.get_or_init(|| made)
    })
}
