//! What vectors of SSE2 and of AVX2 do alike: to four f32, which within kernels of AVX2 become its instructions.
//!
//! SAFETY of every block below: no x86-64 is without these instructions.
#![allow(unsafe_code)] // Intrinsics.

use std::arch::x86_64::*;

/// The largest lane.
#[inline(always)]
pub fn largest(four: __m128) -> f32 {
    unsafe {
        let pair = _mm_max_ps(four, _mm_movehl_ps(four, four));
        _mm_cvtss_f32(_mm_max_ss(pair, _mm_shuffle_ps::<1>(pair, pair)))
    }
}

/// The smallest lane.
#[inline(always)]
pub fn smallest(four: __m128) -> f32 {
    unsafe {
        let pair = _mm_min_ps(four, _mm_movehl_ps(four, four));
        _mm_cvtss_f32(_mm_min_ss(pair, _mm_shuffle_ps::<1>(pair, pair)))
    }
}

/// Half the areas of three boxes of these sizes along the axes, of which the fourth lane is anything; and a number
/// more.
#[inline(always)]
pub fn half_areas([a, b, c]: [__m128; 3]) -> __m128 {
    unsafe {
        // Transposed: all x, all y, all z.
        let (ab_xy, ab_z) = (_mm_unpacklo_ps(a, b), _mm_unpackhi_ps(a, b));
        let x = _mm_movelh_ps(ab_xy, c);
        let y = _mm_shuffle_ps::<0b01_01_11_10>(ab_xy, c);
        let z = _mm_shuffle_ps::<0b10_10_01_00>(ab_z, c);
        _mm_add_ps(_mm_mul_ps(y, _mm_add_ps(x, z)), _mm_mul_ps(z, x))
    }
}
