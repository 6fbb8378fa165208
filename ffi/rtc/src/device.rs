//! Devices: where errors go, who is asked before memory is taken, and the threads that build.

use std::collections::HashMap;
use std::ffi::{CString, c_void};
use std::process;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::{self, ThreadId};

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::abi::{RTCErrorFunction, RTCMemoryMonitorFunction, property};
use crate::failure::{Code, Failure, NONE, Result};

/// A callback of the caller's and what it wants to be given.
#[derive(Clone, Copy, Debug)]
pub struct Callback<F> {
    pub function: F,
    pub user: *mut c_void,
}

impl<F: Default> Default for Callback<F> {
    fn default() -> Self {
        Self { function: F::default(), user: std::ptr::null_mut() }
    }
}

// SAFETY: the pointer is never followed here, only handed back; that callbacks may come from any thread is part of the
// interface.
unsafe impl<F: Send> Send for Callback<F> {}
// SAFETY: as above.
unsafe impl<F: Sync> Sync for Callback<F> {}

/// What a device remembers of errors.
#[derive(Default)]
struct Errors {
    /// The first code of each thread since it asked.
    codes: HashMap<ThreadId, u32>,
    /// The last message of each thread, for as long as it may be looked at.
    messages: HashMap<ThreadId, CString>,
    function: Callback<RTCErrorFunction>,
}

/// A device.
#[derive(Default)]
pub struct Device {
    errors: Mutex<Errors>,
    memory: Mutex<Callback<RTCMemoryMonitorFunction>>,
    threads: Threads,
    verbose: bool,
}

/// The threads that build. A process that was forked from the one that made them has none of them, and to wait for
/// these would be for ever: it gets its own.
struct Threads {
    /// The process in which the others are.
    process: u32,
    /// Of the device's own, where it was asked for so many; otherwise those of the process.
    pool: Option<ThreadPool>,
    /// Of a process that was forked.
    forked: Mutex<Option<(u32, Arc<ThreadPool>)>>,
}

impl Default for Threads {
    /// Those of the process, which are there from the first device on.
    fn default() -> Self {
        static HOME: OnceLock<u32> = OnceLock::new();
        Self { process: *HOME.get_or_init(process::id), pool: None, forked: Mutex::default() }
    }
}

impl Threads {
    fn new(count: usize) -> Result<Self> {
        Ok(Self { process: process::id(), pool: Some(pool(count)?), forked: Mutex::default() })
    }

    fn run<R: Send>(&self, work: impl FnOnce() -> R + Send) -> Result<R> {
        let process = process::id();
        if process != self.process {
            return Ok(self.forked(process)?.install(work));
        }
        Ok(match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        })
    }

    #[cold]
    fn forked(&self, process: u32) -> Result<Arc<ThreadPool>> {
        let mut forked = self.forked.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, pool)) = forked.as_ref().filter(|(owner, _)| *owner == process) {
            return Ok(Arc::clone(pool));
        }
        let pool = Arc::new(pool(self.pool.as_ref().map_or(0, ThreadPool::current_num_threads))?);
        // One of a process between is as far away as the first.
        std::mem::forget(forked.replace((process, Arc::clone(&pool))));
        Ok(pool)
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        let process = process::id();
        if process != self.process {
            std::mem::forget(self.pool.take());
        }
        let forked = self.forked.get_mut().unwrap_or_else(PoisonError::into_inner);
        std::mem::forget(forked.take_if(|(owner, _)| *owner != process));
    }
}

/// The whole number that a value of a configuration begins with, of which no point makes another number.
fn whole(value: &str) -> Result<i64> {
    let end = value.char_indices().find(|&(i, c)| !(c.is_ascii_digit() || i == 0 && "+-".contains(c)));
    let (digits, rest) = value.split_at(end.map_or(value.len(), |(i, _)| i));
    let number = digits.parse().ok().filter(|_| !rest.starts_with('.'));
    number.ok_or_else(|| Failure::unknown("a device's threads and verbose are whole numbers"))
}

/// So many threads, 0 for one a processor.
fn pool(count: usize) -> Result<ThreadPool> {
    let failed = |error| Failure { code: Code::OutOfMemory, message: format!("threads: {error}") };
    ThreadPoolBuilder::new().num_threads(count).build().map_err(failed)
}

impl Device {
    /// From a configuration such as `threads=4,verbose=1`. Names that are not known, or mean nothing here, are passed
    /// over, as Embree does with most.
    ///
    /// # Errors
    /// For one of these two that has a value which does not begin with a whole number, which is told without a device.
    pub fn new(configuration: &str) -> Result<Self> {
        let mut device = Self::default();
        for part in configuration.split([',', ' ', '\t', '\n']) {
            let Some((name, value)) = part.split_once('=') else { continue };
            match name {
                "threads" => {
                    let threads = whole(value)?;
                    if threads > 0 {
                        device.threads = Threads::new(threads as usize)?;
                    }
                }
                "verbose" => device.verbose = whole(value)? > 0,
                _ => {}
            }
        }
        Ok(device)
    }

    /// Runs `work` on the device's threads.
    ///
    /// # Errors
    /// Where the system gives none to a process that was forked.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> Result<R> {
        self.threads.run(work)
    }

    /// Keeps an error, and tells the error function.
    pub fn report(&self, failure: &Failure) {
        let (code, thread) = (failure.code as u32, thread::current().id());
        let message = CString::new(failure.message.replace('\0', " ")).unwrap_or_default();
        let mut errors = self.errors.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = errors.codes.entry(thread).or_insert(NONE);
        if *kept == NONE {
            *kept = code;
        }
        errors.messages.insert(thread, message.clone());
        let Callback { function, user } = errors.function;
        // Not held while the caller's function runs, which may ask for the error.
        drop(errors);
        if self.verbose {
            eprintln!("twincast-rtc: error {code}: {}", failure.message);
        }
        if let Some(function) = function {
            // SAFETY: the caller promised a function of this type that may be called with its pointer; the message
            // lives until it returns.
            unsafe { function(user, code, message.as_ptr()) };
        }
    }

    /// Takes the thread's error.
    pub fn take_error(&self) -> u32 {
        let mut errors = self.errors.lock().unwrap_or_else(PoisonError::into_inner);
        errors.codes.remove(&thread::current().id()).unwrap_or(NONE)
    }

    /// The thread's last message; valid until its next error.
    #[cfg(feature = "v4")]
    pub fn last_message(&self) -> *const std::ffi::c_char {
        let errors = self.errors.lock().unwrap_or_else(PoisonError::into_inner);
        errors.messages.get(&thread::current().id()).map_or(c"".as_ptr(), |message| message.as_ptr())
    }

    pub fn set_error_function(&self, function: Callback<RTCErrorFunction>) {
        self.errors.lock().unwrap_or_else(PoisonError::into_inner).function = function;
    }

    pub fn set_memory_monitor(&self, function: Callback<RTCMemoryMonitorFunction>) {
        *self.memory.lock().unwrap_or_else(PoisonError::into_inner) = function;
    }

    /// Tells the memory monitor that so many bytes are taken, or (negative) given back.
    ///
    /// # Errors
    /// Where the monitor refuses what is about to be taken (not `done`).
    pub fn account(&self, bytes: isize, done: bool) -> Result<()> {
        let Callback { function, user } = *self.memory.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(function) = function else { return Ok(()) };
        // SAFETY: the caller promised a function of this type that may be called with its pointer.
        let goes_on = unsafe { function(user, bytes, done) };
        if goes_on || bytes <= 0 {
            return Ok(());
        }
        Err(Failure { code: Code::OutOfMemory, message: "memory monitor forced termination".into() })
    }

    /// What the device says of itself.
    pub fn property(&self, name: u32) -> Result<isize> {
        const VERSION: (isize, isize, isize) = if cfg!(feature = "v4") { (4, 3, 3) } else { (3, 13, 5) };
        let (major, minor, patch) = VERSION;
        Ok(match name {
            property::VERSION => 10000 * major + 100 * minor + patch,
            property::VERSION_MAJOR => major,
            property::VERSION_MINOR => minor,
            property::VERSION_PATCH => patch,
            // Packets are answered, ray by ray or in flight; callbacks are given one ray at a time.
            property::NATIVE_RAY4 | property::NATIVE_RAY8 | property::NATIVE_RAY16 => 0,
            property::RAY_STREAM if cfg!(feature = "v3") => 1,
            property::BACKFACE_CULLING_SPHERES if cfg!(feature = "v4") => 0,
            property::BACKFACE_CULLING_CURVES | property::BACKFACE_CULLING => 0,
            property::COMPACT_POLYS | property::SUBDIVISION => 0,
            // Round linear curves alone are not what programs mean by it; they may be asked for all the same.
            property::CURVES => 0,
            property::RAY_MASK | property::FILTER_FUNCTION | property::IGNORE_INVALID_RAYS => 1,
            property::TRIANGLES | property::QUADS | property::USER | property::POINTS => 1,
            // The internal one.
            property::TASKING_SYSTEM => 0,
            property::JOIN_COMMIT | property::PARALLEL_COMMIT => 1,
            property::CPU_DEVICE if cfg!(feature = "v4") => 1,
            property::SYCL_DEVICE if cfg!(feature = "v4") => 0,
            _ => return Err(Failure::argument("unknown readable property")),
        })
    }
}
