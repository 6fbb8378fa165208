//! Four and eight f32 at a time, by whatever the processor has.
//!
//! Kernels are generic over [`Simd`] and compiled once for each implementation: [`Portable`], plain arrays, and
//! [`Avx2`]. The two may differ in the last bit where a product and a sum are fused, so they serve only tests that
//! reject conservatively; what decides a hit is one piece of scalar code ([`crate::shape::triangle`]).
#![allow(unsafe_code)] // Intrinsics; see `Avx2`.

use super::build::lanes::Boxes;

/// An instruction set, as a pair of vector types.
pub(super) trait Simd {
    type V4: Vector<4>;
    type V8: Vector<8> + Boxes;
}

/// N values of f32. `max` and `min` return the second operand where one is NaN.
pub(super) trait Vector<const N: usize>: Copy {
    fn splat(value: f32) -> Self;
    fn load(values: &[f32; N]) -> Self;
    fn to_array(self) -> [f32; N];
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// self * factor + summand, rounded once or twice.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// Bit i is set where lane i of self is at most that of other; not for NaN.
    fn at_most(self, other: Self) -> u32;
    /// Bit i is set where lane i of self is less than that of other; not for NaN.
    fn less(self, other: Self) -> u32;
}

/// Plain arrays.
pub(super) struct Portable;

impl Simd for Portable {
    type V4 = [f32; 4];
    type V8 = [f32; 8];
}

#[inline(always)]
fn zip<const N: usize>(a: [f32; N], b: [f32; N], f: impl Fn(f32, f32) -> f32) -> [f32; N] {
    std::array::from_fn(
        #[inline(always)]
        |i| f(a[i], b[i]),
    )
}

#[inline(always)]
fn mask<const N: usize>(a: [f32; N], b: [f32; N], f: impl Fn(f32, f32) -> bool) -> u32 {
    (0..N).fold(
        0,
        #[inline(always)]
        |mask, i| mask | u32::from(f(a[i], b[i])) << i,
    )
}

impl<const N: usize> Vector<N> for [f32; N] {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        [value; N]
    }
    #[inline(always)]
    fn load(values: &[f32; N]) -> Self {
        *values
    }
    #[inline(always)]
    fn to_array(self) -> [f32; N] {
        self
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        zip(
            self,
            other,
            #[inline(always)]
            |a, b| a + b,
        )
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        zip(
            self,
            other,
            #[inline(always)]
            |a, b| a - b,
        )
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        zip(
            self,
            other,
            #[inline(always)]
            |a, b| a * b,
        )
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        zip(
            self,
            other,
            #[inline(always)]
            |a, b| a / b,
        )
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        // Not f32::mul_add: without the instruction that is a call.
        self.mul(factor).add(summand)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        zip(
            self,
            other,
            #[inline(always)]
            |a, b| if a > b { a } else { b },
        )
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        zip(
            self,
            other,
            #[inline(always)]
            |a, b| if a < b { a } else { b },
        )
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f32::abs)
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> u32 {
        mask(
            self,
            other,
            #[inline(always)]
            |a, b| a <= b,
        )
    }
    #[inline(always)]
    fn less(self, other: Self) -> u32 {
        mask(
            self,
            other,
            #[inline(always)]
            |a, b| a < b,
        )
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use x86::{Avx2, V8};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Simd, Vector};
    use std::arch::x86_64::*;

    /// AVX2 and FMA.
    ///
    /// SAFETY of every block below: the vectors are made only in kernels that `isa::dispatch` runs, which asks the
    /// processor first; loads and stores go through references to arrays of the vector's size.
    pub struct Avx2;

    impl Simd for Avx2 {
        type V4 = V4;
        type V8 = V8;
    }

    #[derive(Clone, Copy)]
    pub struct V4(__m128);

    #[derive(Clone, Copy)]
    pub struct V8(pub __m256);

    /// The operations of one vector type by its intrinsics.
    macro_rules! vector {
        ($vector:ident, $n:literal, $set1:ident, $load:ident, $store:ident, $add:ident, $sub:ident, $mul:ident, $div:ident,
         $fmadd:ident, $max:ident, $min:ident, $andnot:ident, $cmp:ident, $movemask:ident) => {
            impl Vector<$n> for $vector {
                #[inline(always)]
                fn splat(value: f32) -> Self {
                    Self(unsafe { $set1(value) })
                }
                #[inline(always)]
                fn load(values: &[f32; $n]) -> Self {
                    Self(unsafe { $load(values.as_ptr()) })
                }
                #[inline(always)]
                fn to_array(self) -> [f32; $n] {
                    let mut values = [0.0; $n];
                    unsafe { $store(values.as_mut_ptr(), self.0) };
                    values
                }
                #[inline(always)]
                fn add(self, other: Self) -> Self {
                    Self(unsafe { $add(self.0, other.0) })
                }
                #[inline(always)]
                fn sub(self, other: Self) -> Self {
                    Self(unsafe { $sub(self.0, other.0) })
                }
                #[inline(always)]
                fn mul(self, other: Self) -> Self {
                    Self(unsafe { $mul(self.0, other.0) })
                }
                #[inline(always)]
                fn div(self, other: Self) -> Self {
                    Self(unsafe { $div(self.0, other.0) })
                }
                #[inline(always)]
                fn mul_add(self, factor: Self, summand: Self) -> Self {
                    Self(unsafe { $fmadd(self.0, factor.0, summand.0) })
                }
                #[inline(always)]
                fn max(self, other: Self) -> Self {
                    Self(unsafe { $max(self.0, other.0) })
                }
                #[inline(always)]
                fn min(self, other: Self) -> Self {
                    Self(unsafe { $min(self.0, other.0) })
                }
                #[inline(always)]
                fn abs(self) -> Self {
                    Self(unsafe { $andnot($set1(-0.0), self.0) })
                }
                #[inline(always)]
                fn at_most(self, other: Self) -> u32 {
                    unsafe { $movemask($cmp::<_CMP_LE_OQ>(self.0, other.0)) as u32 }
                }
                #[inline(always)]
                fn less(self, other: Self) -> u32 {
                    unsafe { $movemask($cmp::<_CMP_LT_OQ>(self.0, other.0)) as u32 }
                }
            }
        };
    }

    vector!(
        V4,
        4,
        _mm_set1_ps,
        _mm_loadu_ps,
        _mm_storeu_ps,
        _mm_add_ps,
        _mm_sub_ps,
        _mm_mul_ps,
        _mm_div_ps,
        _mm_fmadd_ps,
        _mm_max_ps,
        _mm_min_ps,
        _mm_andnot_ps,
        _mm_cmp_ps,
        _mm_movemask_ps
    );
    vector!(
        V8,
        8,
        _mm256_set1_ps,
        _mm256_loadu_ps,
        _mm256_storeu_ps,
        _mm256_add_ps,
        _mm256_sub_ps,
        _mm256_mul_ps,
        _mm256_div_ps,
        _mm256_fmadd_ps,
        _mm256_max_ps,
        _mm256_min_ps,
        _mm256_andnot_ps,
        _mm256_cmp_ps,
        _mm256_movemask_ps
    );
}
