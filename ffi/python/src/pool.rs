//! The threads that queries run on.
//!
//! Rayon's global pool would be shared with every other extension, and after a `fork` (Python's `multiprocessing` on
//! Linux) its threads are gone and the first query would wait for ever. So each process has pools of its own, one for
//! each number of threads that was asked for, of which the last few are kept.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::iter::plumbing::{Producer, ProducerCallback};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::stack;

struct Entry {
    process: u32,
    threads: usize,
    pool: Arc<ThreadPool>,
}

/// Those that were used last, the last one at the end. Only locked with the interpreter's lock held, so that nobody
/// forks meanwhile.
static POOLS: Mutex<Vec<Entry>> = Mutex::new(Vec::new());

/// So many pools are kept, for a program that takes turns between a few numbers of threads.
const KEPT: usize = 4;

/// More threads than this are a mistake.
const MAX: usize = 1024;

/// How often it is looked whether Ctrl-C was pressed.
const BEAT: Duration = Duration::from_millis(20);

fn pool(threads: usize) -> PyResult<Arc<ThreadPool>> {
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let (process, threads) = (process::id(), threads.min(MAX));
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

/// The same for work that may be called off: it is told so where Python has a signal to handle, whose exception is the
/// result then.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    threads: usize,
    work: impl FnOnce(&AtomicBool) -> T + Send,
) -> PyResult<T> {
    let pool = pool(threads)?;
    let (cancel, end) = (AtomicBool::new(false), End::default());
    let (mut answer, mut signal) = (None, None);
    pool.in_place_scope(|scope| {
        let (answer, cancel, end) = (&mut answer, &cancel, &end);
        scope.spawn(move |_| {
            let _told = Told(end);
            *answer = Some(work(cancel));
        });
        while !py.detach(|| end.comes_within(BEAT)) {
            if let Err(error) = py.check_signals() {
                cancel.store(true, Ordering::Relaxed);
                signal = Some(error);
            }
        }
    });
    match signal {
        Some(signal) => Err(signal),
        // Where the work panics, the scope does.
        None => answer.ok_or_else(|| PyRuntimeError::new_err("the work ended without an answer")),
    }
}

/// Does all tasks, on so many threads, without the interpreter's lock; one by itself here, where there is
/// [room](crate::stack) for it, since to hand it to another thread would take longer than a few rays do. What is left
/// is not done once Python has a signal to handle, whose exception is the result.
pub fn each<I: IndexedParallelIterator>(
    py: Python<'_>,
    threads: usize,
    tasks: I,
    work: impl Fn(I::Item) + Send + Sync,
) -> PyResult<()> {
    if tasks.len() <= 1 && stack::has_room() {
        // Not by rayon's own `for_each`, which would start its global pool.
        py.detach(|| tasks.with_producer(Here(work)));
        return Ok(());
    }
    interruptible(py, threads, |cancel| {
        tasks.for_each(|task| {
            if !cancel.load(Ordering::Relaxed) {
                work(task);
            }
        });
    })
}

/// Does tasks one after the other.
struct Here<F>(F);

impl<T, F: Fn(T)> ProducerCallback<T> for Here<F> {
    type Output = ();

    fn callback<P: Producer<Item = T>>(self, tasks: P) {
        tasks.into_iter().for_each(self.0);
    }
}

/// That work has come to its end.
#[derive(Default)]
struct End {
    is_there: Mutex<bool>,
    comes: Condvar,
}

impl End {
    /// Whether it has come, for which it waits so long.
    fn comes_within(&self, time: Duration) -> bool {
        let is_there = self.is_there.lock().unwrap_or_else(PoisonError::into_inner);
        let (is_there, _) = self
            .comes
            .wait_timeout_while(is_there, time, |is_there| !*is_there)
            .unwrap_or_else(PoisonError::into_inner);
        *is_there
    }
}

/// Tells of the end when dropped, so also where the work panics.
struct Told<'a>(&'a End);

impl Drop for Told<'_> {
    fn drop(&mut self) {
        *self.0.is_there.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.0.comes.notify_one();
    }
}
