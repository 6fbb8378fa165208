//! AVX-512: twice as many rays of a bundle at a time. The rest is as with AVX2.
//!
//! SAFETY of every block below: as in `x86`.
#![allow(unsafe_code)] // Intrinsics.

use std::arch::x86_64::*;

use super::avx2::Avx2;
use super::isa::{self, Kernel};
use super::x86::{D4, V4, V8, lanewise, opaque};
use super::{Group, Mask, PerRay, RAYS, Simd, Vector};
use crate::math::Vec3;
use crate::trace::bvh::block::Block;
use crate::trace::bvh::node::{Child, Node};

/// AVX-512 F, VL, DQ and BW.
pub struct Avx512;

impl Simd for Avx512 {
    type V4 = V4;
    type V8 = V8;
    type Wide = V16;
    type D4 = D4;

    #[inline(always)]
    fn apart<K: Kernel>(kernel: K) -> K::Output {
        // SAFETY: it is called by kernels of this instruction set.
        unsafe { isa::avx512_apart(kernel) }
    }

    #[inline(always)]
    fn apart_narrow<K: Kernel>(kernel: K) -> K::Output {
        Avx2::apart(kernel)
    }

    #[inline(always)]
    fn prefetch(address: *const u8) {
        Avx2::prefetch(address);
    }

    #[inline(always)]
    fn prefetch_line<T>(value: &T) {
        Avx2::prefetch_line(value);
    }

    #[inline(always)]
    fn far_to_near(
        near: V8,
        mask: <V8 as Vector>::Mask,
        child: &[Child; 8],
        sorted_near: &mut [u32; 8],
        sorted_child: &mut [Child; 8],
    ) -> usize {
        Avx2::far_to_near(near, mask, child, sorted_near, sorted_child)
    }

    #[inline(always)]
    fn nearest_apart(
        near: V8,
        mask: <V8 as Vector>::Mask,
        child: &[Child; 8],
        other_near: &mut [u32; 8],
        other_child: &mut [Child; 8],
    ) -> (Child, usize) {
        Avx2::nearest_apart(near, mask, child, other_near, other_child)
    }

    #[inline(always)]
    fn within(
        limit: f32,
        entries: (&[u32; 8], &[Child; 8]),
        count: usize,
        near: &mut [u32; 8],
        child: &mut [Child; 8],
    ) -> usize {
        Avx2::within(limit, entries, count, near, child)
    }

    #[inline(always)]
    fn named_first(mask: <V8 as Vector>::Mask, child: &[Child; 8], named: &mut [Child; 8]) -> usize {
        Avx2::named_first(mask, child, named)
    }

    #[inline(always)]
    fn highest_bits(numbers: &[u32; 32]) -> u32 {
        Avx2::highest_bits(numbers)
    }

    #[inline(always)]
    fn equal(numbers: &[u32; 32], number: u32) -> u32 {
        Avx2::equal(numbers, number)
    }

    #[inline(always)]
    fn row(node: &Node, offset: u32) -> V8 {
        Avx2::row(node, offset)
    }

    #[inline(always)]
    fn corners(block: &Block, offset: u32) -> [V8; 3] {
        Avx2::corners(block, offset)
    }

    #[inline(always)]
    fn by_component(triangles: &[[&Vec3; 3]; 8]) -> [[V8; 3]; 3] {
        Avx2::by_component(triangles)
    }

    #[inline(always)]
    fn transpose(rows: [V8; 8]) -> [V8; 8] {
        Avx2::transpose(rows)
    }
}

/// Sixteen f32.
#[derive(Clone, Copy)]
pub struct V16(__m512);

/// A bit for each of sixteen lanes.
#[derive(Clone, Copy)]
pub struct M16(__mmask16);

impl Mask for M16 {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
    #[inline(always)]
    fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.into()
    }
}

impl Vector for V16 {
    type Mask = M16;
    lanewise! {
        add: _mm512_add_ps;
        sub: _mm512_sub_ps;
        mul: _mm512_mul_ps;
        div: _mm512_div_ps;
        max: _mm512_max_ps;
        min: _mm512_min_ps;
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(value) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, summand.0) })
    }
    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        Self(unsafe { _mm512_fmsub_ps(self.0, factor.0, subtrahend.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm512_andnot_ps(_mm512_set1_ps(-0.0), self.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm512_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> M16 {
        M16(unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> M16 {
        M16(unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn differs_in_sign(self, other: Self) -> M16 {
        M16(unsafe { _mm512_movepi32_mask(_mm512_castps_si512(_mm512_xor_ps(self.0, other.0))) })
    }
    #[inline(always)]
    fn flip(self, other: Self) -> Self {
        Self(unsafe { _mm512_xor_ps(self.0, _mm512_and_ps(other.0, _mm512_set1_ps(-0.0))) })
    }
    #[inline(always)]
    fn select(mask: M16, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm512_mask_blend_ps(mask.0, no.0, yes.0) })
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

impl V16 {
    #[inline(always)]
    fn halves(self) -> [V8; 2] {
        unsafe { [V8(_mm512_castps512_ps256(self.0)), V8(_mm512_extractf32x8_ps::<1>(self.0))] }
    }
}

impl Group for V16 {
    const LANES: usize = 16;
    #[inline(always)]
    fn at(values: &PerRay, group: usize) -> Self {
        let values: &[f32; 16] = &values.0.as_chunks().0[group % (RAYS / 16)];
        Self(unsafe { _mm512_loadu_ps(values.as_ptr()) })
    }
    #[inline(always)]
    fn put(self, values: &mut PerRay, group: usize) {
        let values: &mut [f32; 16] = &mut values.0.as_chunks_mut().0[group % (RAYS / 16)];
        unsafe { _mm512_storeu_ps(values.as_mut_ptr(), self.0) };
    }
    #[inline(always)]
    fn put_where(self, mask: M16, values: &mut [f32; RAYS], group: usize) {
        let values: &mut [f32; 16] = &mut values.as_chunks_mut().0[group % (RAYS / 16)];
        unsafe {
            let old = _mm512_loadu_ps(values.as_ptr());
            _mm512_storeu_ps(opaque(values.as_mut_ptr()), _mm512_mask_blend_ps(mask.0, old, self.0));
        }
    }
}
