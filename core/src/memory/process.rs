//! What this process holds, as Linux tells; elsewhere nothing is known.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Most memory that this process has held so far, bytes.
pub fn peak() -> Option<u64> {
    entry("/proc/self/status", "VmHWM:")
}

/// Memory that this process holds now, bytes.
pub fn held() -> Option<u64> {
    entry("/proc/self/status", "VmRSS:")
}

/// Memory that could be had without driving anything else out, bytes.
pub fn available() -> Option<u64> {
    entry("/proc/meminfo", "MemAvailable:")
}

/// The value of a line of a name, a colon and a number of kB.
fn entry(file: &str, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}

/// How often memory is looked at.
const INTERVAL: Duration = Duration::from_millis(5);

/// Does some work, and tells by how many bytes more were held meanwhile than before, at most.
///
/// A second thread looks from time to time, so what is gone between two looks is not seen. The system's own mark
/// ([`peak`]) never falls, and tells nothing of a second piece of work that takes less than the first.
pub fn growth<T>(work: impl FnOnce() -> T) -> (T, Option<u64>) {
    let Some(before) = held() else { return (work(), None) };
    let is_done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let watcher = scope.spawn(|| {
            let mut most = before;
            while !is_done.load(Ordering::Relaxed) {
                most = most.max(held().unwrap_or(0));
                std::thread::park_timeout(INTERVAL);
            }
            most
        });
        let result = work();
        let after = held().unwrap_or(before);
        is_done.store(true, Ordering::Relaxed);
        watcher.thread().unpark();
        // It does nothing that panics.
        let most = watcher.join().unwrap_or(before).max(after);
        (result, Some(most - before))
    })
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn this_process_holds_memory_and_more_is_noticed() {
        let numbers = [peak(), held(), available()];
        assert!(numbers.iter().all(|bytes| bytes.is_some_and(|bytes| bytes > 100_000)), "{numbers:?}");
        assert!(peak() >= held());
        let (sum, growth) = growth(|| {
            let bytes = vec![1u8; 1 << 27];
            std::thread::sleep(4 * INTERVAL);
            std::hint::black_box(&bytes).iter().map(|&x| u64::from(x)).sum::<u64>()
        });
        assert_eq!(sum, 1 << 27);
        // Other tests hold and free memory as well.
        assert!(growth.is_some_and(|bytes| bytes > 1 << 26), "{growth:?}");
    }
}
