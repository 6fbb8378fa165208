//! The threads that queries run on.
//!
//! Rayon's global pool would be shared with every other extension, and after a `fork` (Python's `multiprocessing` on Linux) its threads
//! are gone and the first query would wait for ever. So each process has pools of its own, one for each number of threads that was asked for, of
//! which the last few are kept.

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

/// Those that were used last, the last one at the end. Only locked with the interpreter's lock held, so that nobody forks meanwhile.
static POOLS: Mutex<Vec<Entry>> = Mutex::new(Vec::new());

/// So many pools are kept, for a program that takes turns between a few numbers of threads.
const KEPT: usize = 4;

/// More threads than this are a mistake.
const MOST: usize = 1024;

fn pool(threads: usize) -> PyResult<Arc<ThreadPool>> {
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let (process, threads) = (process::id(), threads.min(MOST));
    // Pools of the process that this one was forked from have no threads here: to drop them would wait for these.
    pools.extract_if(.., |entry| entry.process != process).for_each(std::mem::forget);
    let entry = match pools.iter().position(|entry| entry.threads == threads) {
        Some(i) => pools.remove(i),
        None => Entry { process, threads, pool: Arc::new(build(threads)?) },
    };
    let pool = Arc::clone(&entry.pool);
    pools.push(entry);
    if pools.len() > KEPT {
        // Its threads end once they have nothing to do; a query that runs on it holds it until then.
        pools.remove(0);
    }
    Ok(pool)
}

fn build(threads: usize) -> PyResult<ThreadPool> {
    let built = ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("twincast-{i}")).build();
    built.map_err(|error| PyRuntimeError::new_err(format!("no threads to run on: {error}")))
}

/// Runs `work` on so many threads, 0 for one a core, without the interpreter's lock.
///
/// # Errors
/// `RuntimeError` where the system gives no threads.
pub fn run<T: Send>(py: Python<'_>, threads: usize, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool(threads)?;
    Ok(py.detach(|| pool.install(work)))
}
