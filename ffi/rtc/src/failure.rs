//! Errors as Embree tells them, and the wall at which everything that unwinds stops.
//!
//! A function of the interface has no error to return: the error is kept until `rtcGetDeviceError` fetches it, the
//! first one for each thread, and told to the device's error function at once. Where there is no device (a null
//! handle), it is kept for the thread alone.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::device::Device;

/// Codes of errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Code {
    /// A bug of this library, or a number that is none of the interface's.
    Unknown = 1,
    InvalidArgument = 2,
    InvalidOperation = 3,
    OutOfMemory = 4,
    Cancelled = 6,
}

/// No error.
pub const NONE: u32 = 0;

/// An error with its message.
#[derive(Clone, Debug)]
pub struct Failure {
    pub code: Code,
    pub message: String,
}

pub type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    pub fn argument(message: impl Into<String>) -> Self {
        Self { code: Code::InvalidArgument, message: message.into() }
    }

    pub fn operation(message: impl Into<String>) -> Self {
        Self { code: Code::InvalidOperation, message: message.into() }
    }

    /// Of numbers that are none of the interface's: a code that Embree has for these, too.
    pub fn unknown(message: &str) -> Self {
        Self { code: Code::Unknown, message: message.into() }
    }

    /// Of geometry that is not there.
    pub fn unsupported(what: &str) -> Self {
        Self::operation(format!("{what} not supported by this library"))
    }
}

thread_local! {
    /// Where there is no device.
    static HOMELESS: Cell<u32> = const { Cell::new(NONE) };
}

/// Takes the thread's own error.
pub fn take_homeless() -> u32 {
    HOMELESS.replace(NONE)
}

/// Runs what a function of the interface does. `device` is asked only after an error. A panic, which is a bug of this
/// library, is told as an unknown error; it must not unwind into code that knows nothing of it. An exception that the
/// error function throws is the caller's own, and goes through.
#[inline(always)]
pub fn guard<'a, T>(default: T, device: impl FnOnce() -> Option<&'a Device>, work: impl FnOnce() -> Result<T>) -> T {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(value)) => return value,
        Ok(Err(failure)) => report(device(), &failure),
        Err(panic) => report(device(), &of_panic(&*panic)),
    }
    default
}

#[cold]
fn of_panic(panic: &(dyn Any + Send)) -> Failure {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    Failure { code: Code::Unknown, message: format!("panic: {}", text.unwrap_or("no message")) }
}

/// Tells of an error where it is looked for.
#[cold]
#[inline(never)]
fn report(device: Option<&Device>, failure: &Failure) {
    match device {
        Some(device) => device.report(failure),
        None if HOMELESS.get() == NONE => HOMELESS.set(failure.code as u32),
        None => {}
    }
}
