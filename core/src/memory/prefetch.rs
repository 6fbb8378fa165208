//! Hints about what will be needed soon.
#![allow(unsafe_code)] // The instruction, which does nothing but hint.

/// Has the cache line of an address loaded, into all caches. There may be nothing at that address.
#[inline(always)]
pub fn prefetch(address: *const u8) {
    // SAFETY: every x86-64 has the instruction, and it never faults.
    #[cfg(target_arch = "x86_64")]
    unsafe {
        std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(address.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}
