//! The same kernels compiled twice.
//!
//! Rust never contracts a product and a sum into an FMA by itself, so code that is compiled for AVX2 gives the same
//! bits as the same code compiled for any other processor, only faster. Everything below [`dispatch`] is
//! `inline(always)`, so that it ends up in one function per instruction set. Intrinsics, the alternative, would have to
//! be written and proven a second time for the portable path.
#![allow(unsafe_code)] // Calling a function that needs AVX2 after having asked the processor.

/// An instruction set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    /// Whatever the program was compiled for.
    Portable,
    /// x86-64 with AVX2.
    Avx2,
}

impl Isa {
    /// The best of this processor.
    pub fn detect() -> Self {
        if Self::Avx2.is_available() { Self::Avx2 } else { Self::Portable }
    }

    /// Whether this processor has it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => std::arch::is_x86_feature_detected!("avx2"),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 => false,
        }
    }
}

/// Runs `kernel` compiled for `isa`, which must be available.
#[inline(always)]
pub(super) fn dispatch<R>(isa: Isa, kernel: impl FnOnce() -> R) -> R {
    match isa {
        // SAFETY: `Bvh::build_for` keeps only an instruction set that this processor has.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => unsafe { with_avx2(kernel) },
        _ => kernel(),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<R>(kernel: impl FnOnce() -> R) -> R {
    kernel()
}
