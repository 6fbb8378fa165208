//! Whether a thread that somebody else has made has room for a query on its stack.
//!
//! A query takes up to half a mebibyte, even of one ray, and threads may have been given a quarter of one
//! (`threading.stack_size`). Of its own threads a process can be asked by unsafe code alone; but the stack of its first
//! one grows up to a limit that the system tells.

use std::fs;
use std::process;
use std::sync::OnceLock;

/// Several times what queries were seen to take, and a good part of it may be in use.
const ROOM: u64 = 4 << 20;

/// The process whose first thread has room, as [`learn`] finds it; none where it has not, or where nobody knows.
static ROOMY: OnceLock<Option<u32>> = OnceLock::new();

thread_local! {
    /// Whether the thread is its process's first one.
    static IS_FIRST: bool = is_first();
}

/// To be called by the process that others may be forked from: what forks goes on with the stack of any of its threads.
pub fn learn() {
    ROOMY.get_or_init(|| most().filter(|&most| most >= ROOM).map(|_| process::id()));
}

/// Whether the thread is known to have room for a query.
pub fn has_room() -> bool {
    ROOMY.get().is_some_and(|&roomy| roomy == Some(process::id())) && IS_FIRST.with(|&is_first| is_first)
}

/// How many bytes the stack of the first thread may grow to; none where nobody says.
fn most() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max stack size"))?;
    match line.split_whitespace().next()? {
        "unlimited" => Some(u64::MAX),
        bytes => bytes.parse().ok(),
    }
}

fn is_first() -> bool {
    // PROCESS/task/THREAD.
    let Ok(link) = fs::read_link("/proc/thread-self") else { return false };
    link.file_name().is_some_and(|thread| thread.to_str() == Some(&process::id().to_string()))
}
