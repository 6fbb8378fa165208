//! How many threads work.

use std::num::NonZero;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Error, Result};

/// As many as help, and some more; a thousand threads on two cores wait for each other for minutes.
pub(super) fn parse_threads(text: &str) -> std::result::Result<usize, String> {
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let most = (4 * cores).max(256);
    text.parse().ok().filter(|&n| n <= most).ok_or_else(|| format!("expected a number from 0 to {most}"))
}

/// So many threads as `--threads` says; 0 is one for each core.
///
/// # Errors
/// [`Error::Usage`] where the system refuses them.
pub(super) fn pool(threads: usize) -> Result<ThreadPool> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| Error::Usage(format!("--threads {threads}: {error}")))
}
