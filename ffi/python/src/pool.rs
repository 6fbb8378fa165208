//! The threads that queries run on.
//!
//! Rayon's global pool would be shared with every other extension, and after a `fork` (Python's `multiprocessing` on Linux) its threads
//! are gone and the first query would wait for ever. So each process has pools of its own, one for each number of threads that was asked for.

use std::process;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

struct Entry {
    process: u32,
    threads: usize,
    pool: Arc<ThreadPool>,
}

static POOLS: Mutex<Vec<Entry>> = Mutex::new(Vec::new());

/// More threads than this are a mistake.
const MOST: usize = 1024;

fn pool(threads: usize) -> PyResult<Arc<ThreadPool>> {
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let process = process::id();
    if let Some(entry) = pools.iter().find(|entry| (entry.process, entry.threads) == (process, threads)) {
        return Ok(Arc::clone(&entry.pool));
    }
    // Pools of the process that this one was forked from have no threads here: to drop them would wait for these.
    pools.extract_if(.., |entry| entry.process != process).for_each(std::mem::forget);
    let built =
        ThreadPoolBuilder::new().num_threads(threads.min(MOST)).thread_name(|i| format!("twincast-{i}")).build();
    let built = built.map_err(|error| PyRuntimeError::new_err(format!("no threads to run on: {error}")))?;
    let pool = Arc::new(built);
    pools.push(Entry { process, threads, pool: Arc::clone(&pool) });
    Ok(pool)
}

/// Runs `work` on so many threads, 0 for one a core, without the interpreter's lock.
///
/// # Errors
/// `RuntimeError` where the system gives no threads.
pub fn run<T: Send>(py: Python<'_>, threads: usize, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool(threads)?;
    Ok(py.detach(|| pool.install(work)))
}
