//! Memory that is large: arrays on huge pages, files mapped, and arrays that are either.
//!
//! An array of hundreds of megabytes on pages of 4 kB costs a fault for each page when it is first written, and misses
//! of the translation buffer whenever it is read out of order. Measured on a virtual machine, first writing 360 MB
//! takes 0.18 s on small pages and 0.04 s on huge ones. Linux gives huge pages on request (`madvise`), which is all
//! that is unsafe in this file; elsewhere nothing is asked.
#![allow(unsafe_code)] // One system call, which changes no byte.

mod array;
mod mapped;
mod prefetch;
pub mod process;
pub(crate) mod room;

pub(crate) use array::Array;
pub use mapped::Mapped;
pub use prefetch::prefetch;

use bytemuck::Zeroable;

/// Arrays below this many bytes have no huge page in them. Rays among 100,000 spheres, whose tree is of 5 MB, took 0.7
/// to 1.1 us in small pages, from one process to the next, and take 0.7 us in huge ones.
const LEAST: usize = 1 << 21;

/// Bytes in a unit that suits them, for messages.
pub fn in_words(bytes: u64) -> String {
    match bytes as f64 {
        b if b < 1e4 => format!("{b} B"),
        b if b < 1e7 => format!("{:.0} kB", b / 1e3),
        b if b < 1e10 => format!("{:.0} MB", b / 1e6),
        b => format!("{:.1} GB", b / 1e9),
    }
}

/// So many zeros. The system hands them out as they are first touched, so they cost nothing until then.
pub fn zeroed<T: Zeroable>(count: usize) -> Vec<T> {
    let mut items = bytemuck::zeroed_vec(count);
    advise(&mut items);
    items
}

/// An empty vector with room for exactly so many.
pub fn with_capacity<T>(count: usize) -> Vec<T> {
    let mut items = Vec::with_capacity(count);
    advise(&mut items);
    items
}

fn advise<T>(items: &mut Vec<T>) {
    let bytes = items.capacity().saturating_mul(size_of::<T>());
    if bytes >= LEAST && size_of::<T>() > 0 {
        huge_pages(items.as_mut_ptr() as usize, bytes);
    }
}

#[cfg(target_os = "linux")]
fn huge_pages(address: usize, bytes: usize) {
    // Whole pages only, within the range.
    const PAGE: usize = 4096;
    let (begin, end) = (address.next_multiple_of(PAGE), (address + bytes) / PAGE * PAGE);
    // SAFETY: the range lies within one allocation that the caller holds. The advice says how the system should back
    // it, and leaves its contents and its protection alone. A refusal changes nothing either, and is none of our
    // business: the pages then stay small.
    unsafe {
        libc::madvise(begin as *mut libc::c_void, end - begin, libc::MADV_HUGEPAGE);
    }
}

#[cfg(not(target_os = "linux"))]
fn huge_pages(_: usize, _: usize) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_read_well() {
        assert_eq!(
            [9_999, 123_456, 12_345_678, 12_345_678_901].map(in_words),
            ["9999 B", "123 kB", "12 MB", "12.3 GB"]
        );
    }

    #[test]
    fn holds_what_was_asked_for() {
        for count in [0, 1, LEAST / 4 - 1, LEAST] {
            let zeros: Vec<u32> = zeroed(count);
            assert!(zeros.len() == count && zeros.iter().all(|&x| x == 0));
            let mut room: Vec<u32> = with_capacity(count);
            assert!(room.is_empty() && room.capacity() >= count);
            room.resize(count, 7);
            assert!(room.iter().all(|&x| x == 7));
        }
    }
}
