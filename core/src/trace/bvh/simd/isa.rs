//! One kernel, compiled once for each instruction set, which is chosen once for as much work as possible: a batch, a
//! subtree, a caller's ray.
#![allow(unsafe_code)] // Calling a function that needs AVX2 after having asked the processor.

use crate::trace::bvh::simd::{Portable, Simd};

/// An instruction set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    /// Whatever the program was compiled for.
    Portable,
    /// x86-64 with AVX2 and FMA.
    Avx2,
    /// x86-64 with AVX-512 (F, VL, DQ, BW) besides.
    Avx512,
}

impl Isa {
    /// All of them, the best last.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// Those that this processor has, the best last.
    pub fn available() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|isa| isa.is_available())
    }

    /// The best of this processor.
    pub fn detect() -> Self {
        Self::available().last().unwrap_or(Self::Portable)
    }

    /// As in options and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// As what kernels are run with.
    ///
    /// # Panics
    /// Where this processor does not have it.
    pub(in crate::trace::bvh) fn demand(self) -> Present {
        assert!(self.is_available(), "{self:?} is not available on this processor");
        Present(self)
    }

    /// Whether this processor has it.
    #[cfg(target_arch = "x86_64")]
    pub fn is_available(self) -> bool {
        use std::arch::is_x86_feature_detected as has;
        match self {
            Self::Portable => true,
            Self::Avx2 => {
                has!("avx2") && has!("fma") && has!("bmi1") && has!("bmi2") && has!("lzcnt") && has!("popcnt")
            }
            Self::Avx512 => {
                Self::Avx2.is_available() && has!("avx512f") && has!("avx512vl") && has!("avx512dq") && has!("avx512bw")
            }
        }
    }

    /// Whether this processor has it.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn is_available(self) -> bool {
        self == Self::Portable
    }
}

/// An instruction set that this processor has: it was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::trace::bvh) struct Present(Isa);

impl Present {
    pub(in crate::trace::bvh) const fn isa(self) -> Isa {
        self.0
    }

    #[cfg(test)]
    pub(in crate::trace::bvh) const PORTABLE: Self = Self(Isa::Portable);

    /// All that there are, the best last.
    #[cfg(test)]
    pub(in crate::trace::bvh) fn all() -> impl Iterator<Item = Self> {
        Isa::available().map(Self)
    }
}

/// Work that is compiled for each instruction set: everything below `run` is `inline(always)`, so that it ends up in
/// one function per instruction set, but for what runs [apart](Simd::apart). What is [narrow](dispatch_narrow) has one
/// for AVX2 and AVX-512.
pub(in crate::trace::bvh) trait Kernel {
    type Output;
    fn run<S: Simd>(self) -> Self::Output;
}

/// Runs `kernel` compiled for `isa`.
#[inline(always)]
pub(in crate::trace::bvh) fn dispatch<K: Kernel>(Present(isa): Present, kernel: K) -> K::Output {
    match isa {
        // SAFETY: `Present` is made of what this processor has.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => unsafe { with_avx2(kernel) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => unsafe { with_avx512(kernel) },
        _ => portable(kernel),
    }
}

/// Runs `kernel`, in which nothing is wider than eight lanes, compiled for AVX2 where `isa` is AVX-512: AVX-512's masks
/// have a latency that AVX2's vectors do not. On a Zen 4, rays in flight and distances compiled for AVX-512 reach 0.93
/// to 0.95 of their rate with AVX2. Not for single rays, which use AVX-512's 32 registers: with AVX2 they reach 0.95 to
/// 0.98 of their rate with AVX-512.
#[inline(always)]
pub(in crate::trace::bvh) fn dispatch_narrow<K: Kernel>(Present(isa): Present, kernel: K) -> K::Output {
    match isa {
        // SAFETY: as in `dispatch`; a processor that has AVX-512, as `Isa::is_available` asks, has AVX2.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 | Isa::Avx512 => unsafe { with_avx2(kernel) },
        _ => portable(kernel),
    }
}

/// Not inlined: whoever has something better need not make room for it.
#[inline(never)]
pub(super) fn portable<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Portable>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn with_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<super::Avx2>()
}

/// As [`with_avx2`], in a function of its own: see [`Simd::apart`].
#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn avx2_apart<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<super::Avx2>()
}

/// As [`with_avx512`], in a function of its own.
#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw")]
pub(super) fn avx512_apart<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<super::Avx512>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw")]
fn with_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<super::Avx512>()
}
