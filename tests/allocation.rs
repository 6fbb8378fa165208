//! An allocator that counts, so that tests can hold code to a limit.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system's allocator, counting what each thread holds.
struct Counting;

#[global_allocator]
static COUNTING: Counting = Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static MAX: Cell<isize> = const { Cell::new(0) };
    static BEGIN: Cell<isize> = const { Cell::new(0) };
}

fn add(bytes: isize) {
    // Threads that are ending have no counters any more, and need none.
    let _ = HELD.try_with(|held| {
        held.set(held.get() + bytes);
        let _ = MAX.try_with(|most| most.set(most.get().max(held.get())));
    });
}

// SAFETY: every call goes to the system's allocator with the arguments as they came; the counters are plain cells of
// the thread, which allocate nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        add(layout.size() as isize);
        // SAFETY: the caller keeps `alloc`'s contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        add(layout.size() as isize);
        // SAFETY: the caller keeps `alloc_zeroed`'s contract.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        add(-(layout.size() as isize));
        // SAFETY: the caller keeps `dealloc`'s contract, and the pointer came from the system's allocator.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both at once, as when it is copied; then the old one is gone.
        add(size as isize);
        add(-(layout.size() as isize));
        // SAFETY: the caller keeps `realloc`'s contract, and the pointer came from the system's allocator.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// Starts to measure on this thread.
pub fn start() {
    HELD.with(|held| {
        MAX.with(|most| most.set(held.get()));
        BEGIN.with(|begin| begin.set(held.get()));
    });
}

/// The most bytes that this thread has held at a time since [`start`], above what it held then.
pub fn most() -> usize {
    MAX.with(Cell::get).saturating_sub(BEGIN.with(Cell::get)).max(0) as usize
}

#[test]
fn counts_what_is_held_at_a_time() {
    start();
    for _ in 0..10 {
        std::hint::black_box(vec![1u8; 1_000_000]);
    }
    assert!((1_000_000..1_100_000).contains(&most()), "{}", most());
    let mut grown = vec![1u8; 1_000_000];
    grown.reserve_exact(2_000_000);
    std::hint::black_box(&grown);
    assert!((3_000_000..4_100_000).contains(&most()), "{}", most());
}
