//! Vectors of AVX2 and FMA, which AVX-512 has too.
//!
//! SAFETY of every block below: the vectors are made only in kernels that `isa::dispatch` runs, of an instruction set
//! that is `Present`; loads and stores go through references to arrays of the vector's size.
#![allow(unsafe_code)] // Intrinsics.

use std::arch::{asm, x86_64::*};

use super::{Array, Doubles, Group, Mask, PerRay, RAYS, TURNED, Three, Turned, Vector, quad};

/// A function of two vectors by its intrinsic, as a method.
macro_rules! lanewise {
    ($($name:ident: $intrinsic:ident;)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            Self(unsafe { $intrinsic(self.0, other.0) })
        })*
    };
}
pub(super) use lanewise;

/// The same address, of which the compiler does not know whose it is.
#[inline(always)]
#[expect(clippy::pointers_in_nomem_asm_block, reason = "nothing is read or written")]
pub(super) fn opaque<T>(mut address: *mut T) -> *mut T {
    // SAFETY: no instruction; the address comes back as it went in.
    unsafe { asm!("/* {0} */", inout(reg) address, options(pure, nomem, nostack, preserves_flags)) };
    address
}

/// Four f32.
#[derive(Clone, Copy)]
pub struct V4(__m128);

/// Eight f32.
#[derive(Clone, Copy)]
pub struct V8(pub __m256);

/// Four f64.
#[derive(Clone, Copy)]
pub struct D4(__m256d);

/// One truth a lane of four: its highest bit.
#[derive(Clone, Copy)]
pub struct M4(__m128);

/// One truth a lane of eight: its highest bit.
#[derive(Clone, Copy)]
pub struct M8(pub __m256);

impl Mask for M4 {
    lanewise! {
        and: _mm_and_ps;
        or: _mm_or_ps;
    }
    #[inline(always)]
    fn without(self, other: Self) -> Self {
        Self(unsafe { _mm_andnot_ps(other.0, self.0) })
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        unsafe { _mm_movemask_ps(self.0) as u32 }
    }
}

impl Mask for M8 {
    lanewise! {
        and: _mm256_and_ps;
        or: _mm256_or_ps;
    }
    #[inline(always)]
    fn without(self, other: Self) -> Self {
        Self(unsafe { _mm256_andnot_ps(other.0, self.0) })
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}

impl Vector for V4 {
    type Mask = M4;
    lanewise! {
        add: _mm_add_ps;
        sub: _mm_sub_ps;
        mul: _mm_mul_ps;
        div: _mm_div_ps;
        max: _mm_max_ps;
        min: _mm_min_ps;
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm_set1_ps(value) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self(unsafe { _mm_fmadd_ps(self.0, factor.0, summand.0) })
    }
    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        Self(unsafe { _mm_fmsub_ps(self.0, factor.0, subtrahend.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm_andnot_ps(_mm_set1_ps(-0.0), self.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> M4 {
        M4(unsafe { _mm_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> M4 {
        M4(unsafe { _mm_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn differs_in_sign(self, other: Self) -> M4 {
        M4(unsafe { _mm_xor_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn flip(self, other: Self) -> Self {
        Self(unsafe { _mm_xor_ps(self.0, _mm_and_ps(other.0, _mm_set1_ps(-0.0))) })
    }
    #[inline(always)]
    fn select(mask: M4, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm_blendv_ps(no.0, yes.0, mask.0) })
    }
    #[inline(always)]
    fn largest(self) -> f32 {
        quad::largest(self.0)
    }
    #[inline(always)]
    fn smallest(self) -> f32 {
        quad::smallest(self.0)
    }
}

impl Array<4> for V4 {
    #[inline(always)]
    fn load(values: &[f32; 4]) -> Self {
        Self(unsafe { _mm_loadu_ps(values.as_ptr()) })
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 4] {
        let mut values = [0.0; 4];
        unsafe { _mm_storeu_ps(values.as_mut_ptr(), self.0) };
        values
    }
    #[inline(always)]
    fn overwrite(self, values: &mut [f32; 4]) {
        unsafe { _mm_storeu_ps(opaque(values.as_mut_ptr()), self.0) };
    }
}

impl Three for V4 {
    #[inline(always)]
    fn yzx(self) -> Self {
        Self(unsafe { _mm_permute_ps::<0b11_00_10_01>(self.0) })
    }
}

impl Turned for V4 {
    #[inline(always)]
    fn turned(self, axis: usize) -> Self {
        let lanes = &TURNED[axis.min(2)];
        Self(unsafe { _mm_permutevar_ps(self.0, _mm_loadu_si128(lanes.as_ptr().cast())) })
    }
}

impl Vector for V8 {
    type Mask = M8;
    lanewise! {
        add: _mm256_add_ps;
        sub: _mm256_sub_ps;
        mul: _mm256_mul_ps;
        div: _mm256_div_ps;
        max: _mm256_max_ps;
        min: _mm256_min_ps;
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm256_set1_ps(value) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, summand.0) })
    }
    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        Self(unsafe { _mm256_fmsub_ps(self.0, factor.0, subtrahend.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm256_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> M8 {
        M8(unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> M8 {
        M8(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn differs_in_sign(self, other: Self) -> M8 {
        M8(unsafe { _mm256_xor_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn flip(self, other: Self) -> Self {
        Self(unsafe { _mm256_xor_ps(self.0, _mm256_and_ps(other.0, _mm256_set1_ps(-0.0))) })
    }
    #[inline(always)]
    fn select(mask: M8, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm256_blendv_ps(no.0, yes.0, mask.0) })
    }
    #[inline(always)]
    fn largest(self) -> f32 {
        let [low, high] = self.halves();
        low.max(high).largest()
    }
    #[inline(always)]
    fn smallest(self) -> f32 {
        let [low, high] = self.halves();
        low.min(high).smallest()
    }
}

impl V8 {
    #[inline(always)]
    fn halves(self) -> [V4; 2] {
        unsafe { [V4(_mm256_castps256_ps128(self.0)), V4(_mm256_extractf128_ps::<1>(self.0))] }
    }
}

impl Array<8> for V8 {
    #[inline(always)]
    fn load(values: &[f32; 8]) -> Self {
        Self(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 8] {
        let mut values = [0.0; 8];
        unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) };
        values
    }
    #[inline(always)]
    fn overwrite(self, values: &mut [f32; 8]) {
        unsafe { _mm256_storeu_ps(opaque(values.as_mut_ptr()), self.0) };
    }
}

impl Group for V8 {
    const LANES: usize = 8;
    #[inline(always)]
    fn at(values: &PerRay, group: usize) -> Self {
        Self::load(&values.0.as_chunks().0[group % (RAYS / 8)])
    }
    #[inline(always)]
    fn put(self, values: &mut PerRay, group: usize) {
        let values: &mut [f32; 8] = &mut values.0.as_chunks_mut().0[group % (RAYS / 8)];
        unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) };
    }
    #[inline(always)]
    fn put_where(self, mask: M8, values: &mut [f32; RAYS], group: usize) {
        let values = &mut values.as_chunks_mut().0[group % (RAYS / 8)];
        Self::select(mask, self, Self::load(values)).overwrite(values);
    }
}

impl Three for D4 {
    #[inline(always)]
    fn yzx(self) -> Self {
        Self(unsafe { _mm256_permute4x64_pd::<0b11_00_10_01>(self.0) })
    }
}

impl Doubles for D4 {
    type F = V4;
    lanewise! {
        add: _mm256_add_pd;
        sub: _mm256_sub_pd;
        mul: _mm256_mul_pd;
        div: _mm256_div_pd;
        max: _mm256_max_pd;
        min: _mm256_min_pd;
    }
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(unsafe { _mm256_set1_pd(value) })
    }
    #[inline(always)]
    fn load(values: &[f64; 4]) -> Self {
        Self(unsafe { _mm256_loadu_pd(values.as_ptr()) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> u32 {
        unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0)) as u32 }
    }
    #[inline(always)]
    fn less_select(self, other: Self, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm256_blendv_pd(no.0, yes.0, _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0)) })
    }
    #[inline(always)]
    fn first(self) -> Self {
        Self(unsafe { _mm256_permute4x64_pd::<0>(self.0) })
    }
    #[inline(always)]
    fn widen(values: V4) -> Self {
        Self(unsafe { _mm256_cvtps_pd(values.0) })
    }
    #[inline(always)]
    fn narrow(self) -> V4 {
        V4(unsafe { _mm256_cvtpd_ps(self.0) })
    }
    #[inline(always)]
    fn sums([Self(a), Self(b), Self(c), Self(d)]: [Self; 4]) -> Self {
        unsafe {
            let (ab, cd) = (_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d));
            let y = _mm256_permute2f128_pd::<0x20>(_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d));
            let (x, z) = (_mm256_permute2f128_pd::<0x20>(ab, cd), _mm256_permute2f128_pd::<0x31>(ab, cd));
            Self(_mm256_add_pd(_mm256_add_pd(x, y), z))
        }
    }
    #[inline(always)]
    fn to_array(self) -> [f64; 4] {
        let mut values = [0.0; 4];
        unsafe { _mm256_storeu_pd(values.as_mut_ptr(), self.0) };
        values
    }
}
