//! Vectors of SSE2, which every x86-64 has: two of four f32, or of two f64, are one of twice as many.
//!
//! SAFETY of every block below: no x86-64 is without these instructions.
#![allow(unsafe_code)] // Intrinsics.

use std::arch::x86_64::*;

use bytemuck::cast;

use super::boxes::{Boxes, RANKED};
use super::x86::lanewise;
use super::{Array, Doubles, Group, Mask, PerRay, RAYS, Three, Turned, Vector, quad};

/// Four f32.
#[derive(Clone, Copy)]
pub struct V4(__m128);

/// Eight f32.
#[derive(Clone, Copy)]
pub struct V8([V4; 2]);

/// Four f64.
#[derive(Clone, Copy)]
pub struct D4([__m128d; 2]);

/// One truth a lane of four: all its bits.
#[derive(Clone, Copy)]
pub struct M4(__m128);

/// One truth a lane of eight.
#[derive(Clone, Copy)]
pub struct M8([M4; 2]);

/// A function of two vectors, half by half, as a method.
macro_rules! by_halves {
    ($($name:ident -> $result:ident;)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> $result {
            $result([self.0[0].$name(other.0[0]), self.0[1].$name(other.0[1])])
        })*
    };
}

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
    by_halves! {
        and -> Self;
        or -> Self;
        without -> Self;
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0[0].bits() | self.0[1].bits() << 4
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
    fn abs(self) -> Self {
        Self(unsafe { _mm_andnot_ps(_mm_set1_ps(-0.0), self.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> M4 {
        M4(unsafe { _mm_cmple_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> M4 {
        M4(unsafe { _mm_cmplt_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn differs_in_sign(self, other: Self) -> M4 {
        M4(unsafe { _mm_castsi128_ps(_mm_srai_epi32::<31>(_mm_castps_si128(_mm_xor_ps(self.0, other.0)))) })
    }
    #[inline(always)]
    fn flip(self, other: Self) -> Self {
        Self(unsafe { _mm_xor_ps(self.0, _mm_and_ps(other.0, _mm_set1_ps(-0.0))) })
    }
    #[inline(always)]
    fn select(M4(mask): M4, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm_or_ps(_mm_and_ps(mask, yes.0), _mm_andnot_ps(mask, no.0)) })
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
        Self(cast(*values))
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 4] {
        cast(self.0)
    }
    #[inline(always)]
    fn overwrite(self, values: &mut [f32; 4]) {
        *values = self.to_array();
    }
}

impl Three for V4 {
    #[inline(always)]
    fn yzx(self) -> Self {
        Self(unsafe { _mm_shuffle_ps::<0b11_00_10_01>(self.0, self.0) })
    }
}

impl Turned for V4 {
    #[inline(always)]
    fn turned(self, axis: usize) -> Self {
        match axis {
            0 => self.yzx(),
            1 => Self(unsafe { _mm_shuffle_ps::<0b11_01_00_10>(self.0, self.0) }),
            _ => self,
        }
    }
}

impl Vector for V8 {
    type Mask = M8;
    by_halves! {
        add -> Self;
        sub -> Self;
        mul -> Self;
        div -> Self;
        max -> Self;
        min -> Self;
        flip -> Self;
        at_most -> M8;
        less -> M8;
        differs_in_sign -> M8;
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([V4::splat(value); 2])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self([self.0[0].abs(), self.0[1].abs()])
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self([self.0[0].sqrt(), self.0[1].sqrt()])
    }
    #[inline(always)]
    fn select(M8(mask): M8, yes: Self, no: Self) -> Self {
        Self([V4::select(mask[0], yes.0[0], no.0[0]), V4::select(mask[1], yes.0[1], no.0[1])])
    }
    #[inline(always)]
    fn largest(self) -> f32 {
        self.0[0].max(self.0[1]).largest()
    }
    #[inline(always)]
    fn smallest(self) -> f32 {
        self.0[0].min(self.0[1]).smallest()
    }
}

impl Array<8> for V8 {
    #[inline(always)]
    fn load(&[a, b, c, d, e, f, g, h]: &[f32; 8]) -> Self {
        Self([V4::load(&[a, b, c, d]), V4::load(&[e, f, g, h])])
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 8] {
        cast([self.0[0].0, self.0[1].0])
    }
    #[inline(always)]
    fn overwrite(self, values: &mut [f32; 8]) {
        *values = self.to_array();
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
        values.0.as_chunks_mut().0[group % (RAYS / 8)] = self.to_array();
    }
    #[inline(always)]
    fn put_where(self, mask: M8, values: &mut [f32; RAYS], group: usize) {
        let values = &mut values.as_chunks_mut().0[group % (RAYS / 8)];
        Self::select(mask, self, Self::load(values)).overwrite(values);
    }
}

/// Rows become columns.
#[inline(always)]
pub fn transpose([a, b, c, d, e, f, g, h]: [V8; 8]) -> [V8; 8] {
    let ([i, j, k, l], [m, n, o, p]) = (quarter([a, b, c, d], 0), quarter([a, b, c, d], 1));
    let ([q, r, s, t], [u, v, w, x]) = (quarter([e, f, g, h], 0), quarter([e, f, g, h], 1));
    [V8([i, q]), V8([j, r]), V8([k, s]), V8([l, t]), V8([m, u]), V8([n, v]), V8([o, w]), V8([p, x])]
}

/// The columns of one half of four rows.
#[inline(always)]
fn quarter([V8(p), V8(q), V8(r), V8(s)]: [V8; 4], half: usize) -> [V4; 4] {
    let [V4(p), V4(q), V4(r), V4(s)] = [p[half], q[half], r[half], s[half]];
    unsafe {
        let (low, high) = (_mm_unpacklo_ps(p, q), _mm_unpackhi_ps(p, q));
        let (next_low, next_high) = (_mm_unpacklo_ps(r, s), _mm_unpackhi_ps(r, s));
        [
            V4(_mm_movelh_ps(low, next_low)),
            V4(_mm_movehl_ps(next_low, low)),
            V4(_mm_movelh_ps(high, next_high)),
            V4(_mm_movehl_ps(next_high, high)),
        ]
    }
}

impl Boxes for V8 {
    #[inline(always)]
    fn swap_halves(self) -> Self {
        Self([self.0[1], self.0[0]])
    }

    #[inline(always)]
    fn truncate(self) -> [i32; 8] {
        cast(unsafe { [_mm_cvttps_epi32(self.0[0].0), _mm_cvttps_epi32(self.0[1].0)] })
    }

    #[inline(always)]
    fn join_side(self, axis: usize, at: f32, left: Self, right: Self) -> (Self, Self, bool) {
        let [least, most] = self.0;
        if most.sub(least).to_array()[axis % 4] < at {
            (self.max(left), right, true)
        } else {
            (left, self.max(right), false)
        }
    }

    #[inline(always)]
    fn half_areas(boxes: [Self; 3]) -> [f32; 4] {
        let size = |V8([least, most]): V8| least.add(most).0;
        V4(quad::half_areas([size(boxes[0]), size(boxes[1]), size(boxes[2])])).to_array()
    }

    #[inline(always)]
    fn ranks(keys: &[f32; RANKED], n: usize) -> [u32; RANKED] {
        let mut ranks = [0; RANKED];
        let (fours, _) = keys.as_chunks();
        for (ranks, others) in ranks.as_chunks_mut::<4>().0.iter_mut().zip(fours).take(n.div_ceil(4)) {
            let others = V4::load(others);
            let mut count = unsafe { _mm_setzero_si128() };
            for &key in &keys[..n] {
                count = unsafe { _mm_sub_epi32(count, _mm_castps_si128(V4::splat(key).less(others).0)) };
            }
            *ranks = cast(count);
        }
        ranks
    }
}

impl Three for D4 {
    #[inline(always)]
    fn yzx(self) -> Self {
        let [xy, zw] = self.0;
        Self(unsafe { [_mm_shuffle_pd::<0b01>(xy, zw), _mm_shuffle_pd::<0b10>(xy, zw)] })
    }
}

/// A function of two vectors by its intrinsic, half by half, as a method.
macro_rules! pairwise {
    ($($name:ident: $intrinsic:ident;)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            Self(unsafe { [$intrinsic(self.0[0], other.0[0]), $intrinsic(self.0[1], other.0[1])] })
        })*
    };
}

impl Doubles for D4 {
    type F = V4;
    pairwise! {
        add: _mm_add_pd;
        sub: _mm_sub_pd;
        mul: _mm_mul_pd;
        div: _mm_div_pd;
        max: _mm_max_pd;
        min: _mm_min_pd;
    }
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([unsafe { _mm_set1_pd(value) }; 2])
    }
    #[inline(always)]
    fn load(&[x, y, z, w]: &[f64; 4]) -> Self {
        Self([cast([x, y]), cast([z, w])])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        let D4([sign, _]) = Self::splat(-0.0);
        Self(unsafe { [_mm_andnot_pd(sign, self.0[0]), _mm_andnot_pd(sign, self.0[1])] })
    }
    #[inline(always)]
    fn less(self, other: Self) -> u32 {
        unsafe {
            let [low, high] = [_mm_cmplt_pd(self.0[0], other.0[0]), _mm_cmplt_pd(self.0[1], other.0[1])];
            (_mm_movemask_pd(low) | _mm_movemask_pd(high) << 2) as u32
        }
    }
    #[inline(always)]
    fn less_select(self, other: Self, yes: Self, no: Self) -> Self {
        Self([
            less_select(self.0[0], other.0[0], yes.0[0], no.0[0]),
            less_select(self.0[1], other.0[1], yes.0[1], no.0[1]),
        ])
    }
    #[inline(always)]
    fn first(self) -> Self {
        Self([unsafe { _mm_unpacklo_pd(self.0[0], self.0[0]) }; 2])
    }
    #[inline(always)]
    fn widen(V4(values): V4) -> Self {
        Self(unsafe { [_mm_cvtps_pd(values), _mm_cvtps_pd(_mm_movehl_ps(values, values))] })
    }
    #[inline(always)]
    fn narrow(self) -> V4 {
        V4(unsafe { _mm_movelh_ps(_mm_cvtpd_ps(self.0[0]), _mm_cvtpd_ps(self.0[1])) })
    }
    #[inline(always)]
    fn to_array(self) -> [f64; 4] {
        cast(self.0)
    }
    #[inline(always)]
    fn sums([a, b, c, d]: [Self; 4]) -> Self {
        Self([sums(a, b), sums(c, d)])
    }
}

#[inline(always)]
fn less_select(a: __m128d, b: __m128d, yes: __m128d, no: __m128d) -> __m128d {
    unsafe {
        let mask = _mm_cmplt_pd(a, b);
        _mm_or_pd(_mm_and_pd(mask, yes), _mm_andnot_pd(mask, no))
    }
}

#[inline(always)]
fn sums(D4([p, pz]): D4, D4([q, qz]): D4) -> __m128d {
    unsafe { _mm_add_pd(_mm_add_pd(_mm_unpacklo_pd(p, q), _mm_unpackhi_pd(p, q)), _mm_unpacklo_pd(pz, qz)) }
}
