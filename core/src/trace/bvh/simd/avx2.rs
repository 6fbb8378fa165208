//! AVX2 and FMA.
//!
//! SAFETY of every block below: as in `x86`; or loads and stores stay within what a reference leads to, as is said
//! where they do.
#![allow(unsafe_code)] // Intrinsics.

use std::arch::x86_64::*;
use std::mem::offset_of;

use super::isa::{self, Kernel};
use super::x86::{D4, M8, V4, V8};
use super::{Mask, Simd};
use crate::math::Vec3;
use crate::memory;
use crate::trace::bvh::block::Block;
use crate::trace::bvh::node::{Child, Node};

/// AVX2 and FMA.
pub struct Avx2;

impl Simd for Avx2 {
    type V4 = V4;
    type V8 = V8;
    type Wide = V8;
    type D4 = D4;

    #[inline(always)]
    fn apart<K: Kernel>(kernel: K) -> K::Output {
        // SAFETY: it is called by kernels of this instruction set, or of AVX-512, which nobody has without this.
        unsafe { isa::avx2_apart(kernel) }
    }

    #[inline(always)]
    fn prefetch(address: *const u8) {
        for line in 0..4 {
            memory::prefetch(address.wrapping_add(64 * line));
        }
    }

    #[inline(always)]
    fn prefetch_line<T>(value: &T) {
        memory::prefetch(std::ptr::from_ref(value).cast());
    }

    #[inline(always)]
    fn far_to_near(
        near: V8,
        mask: M8,
        child: &[Child; 8],
        sorted_near: &mut [u32; 8],
        sorted_child: &mut [Child; 8],
    ) -> usize {
        unsafe {
            // Numbers not below 0 are ordered as their bits are.
            let named = mask.bits() as usize % 256;
            let count = named.count_ones();
            let order = order(named);
            let near = _mm256_permutevar8x32_epi32(_mm256_castps_si256(near.0), order);
            let mut keys = _mm256_or_si256(_mm256_and_si256(near, _mm256_set1_epi32(!7)), order);
            if count <= 2 {
                keys = exchange::<0b10>(keys, _mm256_shuffle_epi32::<0b11_10_00_01>(keys));
            } else {
                let places = _mm256_setr_epi32(1, 2, 3, 4, 5, 6, 7, 8);
                let lanes = _mm256_set1_epi32(count as i32);
                keys = _mm256_or_si256(keys, _mm256_cmpgt_epi32(places, lanes));
                // Batcher 1968, Sorting networks and their applications: bitonic, all comparators one way.
                keys = exchange::<0b1010_1010>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
                keys = exchange::<0b1100_1100>(keys, _mm256_shuffle_epi32::<0b00_01_10_11>(keys));
                keys = exchange::<0b1010_1010>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
                if count > 4 {
                    let reverse = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
                    keys = exchange::<0b1111_0000>(keys, _mm256_permutevar8x32_epi32(keys, reverse));
                    keys = exchange::<0b1100_1100>(keys, _mm256_shuffle_epi32::<0b01_00_11_10>(keys));
                    keys = exchange::<0b1010_1010>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
                }
            }
            _mm256_storeu_si256(sorted_near.as_mut_ptr().cast(), keys);
            // The lowest three bits choose.
            let children = _mm256_permutevar8x32_epi32(_mm256_loadu_si256(child.as_ptr().cast()), keys);
            _mm256_storeu_si256(sorted_child.as_mut_ptr().cast(), children);
            count as usize
        }
    }

    #[inline(always)]
    fn nearest_apart(
        near: V8,
        mask: M8,
        child: &[Child; 8],
        other_near: &mut [u32; 8],
        other_child: &mut [Child; 8],
    ) -> (Child, usize) {
        unsafe {
            let slots = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let keys = _mm256_or_si256(_mm256_and_si256(_mm256_castps_si256(near.0), _mm256_set1_epi32(!7)), slots);
            // Numbers not below 0 are ordered as their bits are.
            let last = _mm256_castsi256_ps(_mm256_set1_epi32(i32::MAX));
            let named = _mm256_castps_si256(_mm256_blendv_ps(last, _mm256_castsi256_ps(keys), mask.0));
            let four = _mm_min_epi32(_mm256_castsi256_si128(named), _mm256_extracti128_si256::<1>(named));
            let two = _mm_min_epi32(four, _mm_shuffle_epi32::<0b01_00_11_10>(four));
            let one = _mm_min_epi32(two, _mm_shuffle_epi32::<0b10_11_00_01>(two));
            let nearest = _mm_cvtsi128_si32(one) as usize % 8;
            let others = (mask.bits() as usize % 256) & !(1 << nearest);
            let order = order(others);
            let keys = _mm256_permutevar8x32_epi32(keys, order);
            // The first two, the farther first; the others as they are.
            let partners = _mm256_shuffle_epi32::<0b11_10_00_01>(keys);
            let sorted = _mm256_blend_epi32::<0b01>(keys, _mm256_max_epi32(keys, partners));
            let keys = _mm256_blend_epi32::<0b10>(sorted, _mm256_min_epi32(keys, partners));
            _mm256_storeu_si256(other_near.as_mut_ptr().cast(), keys);
            // The lowest three bits choose.
            let children = _mm256_permutevar8x32_epi32(_mm256_loadu_si256(child.as_ptr().cast()), keys);
            _mm256_storeu_si256(other_child.as_mut_ptr().cast(), children);
            (child[nearest], others.count_ones() as usize)
        }
    }

    #[inline(always)]
    fn within(
        limit: f32,
        (nears, children): (&[u32; 8], &[Child; 8]),
        count: usize,
        near: &mut [u32; 8],
        child: &mut [Child; 8],
    ) -> usize {
        unsafe {
            let (keys, children) =
                (_mm256_loadu_si256(nears.as_ptr().cast()), _mm256_loadu_si256(children.as_ptr().cast()));
            let nears = _mm256_castsi256_ps(_mm256_and_si256(keys, _mm256_set1_epi32(!7)));
            let is_within = _mm256_cmp_ps::<_CMP_LE_OQ>(nears, _mm256_set1_ps(limit));
            let named = (_mm256_movemask_ps(is_within) as usize % 256) & ((1 << count.min(8)) - 1);
            let order = order(named);
            _mm256_storeu_si256(near.as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(keys, order));
            _mm256_storeu_si256(child.as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(children, order));
            named.count_ones() as usize
        }
    }

    #[inline(always)]
    fn named_first(mask: M8, child: &[Child; 8], named: &mut [Child; 8]) -> usize {
        unsafe {
            let bits = mask.bits() as usize % 256;
            let order = order(bits);
            let children = _mm256_permutevar8x32_epi32(_mm256_loadu_si256(child.as_ptr().cast()), order);
            _mm256_storeu_si256(named.as_mut_ptr().cast(), children);
            bits.count_ones() as usize
        }
    }

    #[inline(always)]
    fn highest_bits(numbers: &[u32; 32]) -> u32 {
        highest(
            numbers,
            #[inline(always)]
            |eight| eight,
        )
    }

    #[inline(always)]
    fn equal(numbers: &[u32; 32], number: u32) -> u32 {
        let sought = unsafe { _mm256_set1_epi32(number as i32) };
        highest(
            numbers,
            #[inline(always)]
            |eight| unsafe { _mm256_cmpeq_epi32(eight, sought) },
        )
    }

    #[inline(always)]
    fn row(node: &Node, offset: u32) -> V8 {
        // The mask keeps it within the node, which is eight rows long: a compare and a branch would be two
        // instructions, and end what the compiler sees at once.
        const WITHIN: u32 = 7 * Node::ROW;
        const { assert!(size_of::<Node>() as u32 == WITHIN + Node::ROW) };
        unsafe { V8(_mm256_loadu_ps(std::ptr::from_ref(node).byte_add((offset & WITHIN) as usize).cast())) }
    }

    #[inline(always)]
    fn corners(block: &Block, offset: u32) -> [V8; 3] {
        // Up to seven rows of 32 bytes further the three rows that follow are within the block.
        const WITHIN: u32 = 7 * 32;
        const { assert!(offset_of!(Block, corners) as u32 + WITHIN + Block::AXIS <= size_of::<Block>() as u32) };
        unsafe {
            let first = std::ptr::from_ref(block).byte_add(offset_of!(Block, corners) + (offset & WITHIN) as usize);
            let rows = first.cast::<[f32; 8]>();
            [
                V8(_mm256_loadu_ps(rows.cast())),
                V8(_mm256_loadu_ps(rows.add(1).cast())),
                V8(_mm256_loadu_ps(rows.add(2).cast())),
            ]
        }
    }

    #[inline(always)]
    fn by_component(triangles: &[[&Vec3; 3]; 8]) -> [[V8; 3]; 3] {
        let mut corners = [[V8(unsafe { _mm256_setzero_ps() }); 3]; 3];
        // Loops: what is a function's argument is not inlined here, and then not of this instruction set.
        for k in 0..3 {
            let mut rows = [unsafe { _mm_setzero_ps() }; 8];
            for (row, triangle) in rows.iter_mut().zip(triangles) {
                *row = row_of_three(triangle[k]);
            }
            for (axis, component) in columns_of_three(rows).into_iter().enumerate() {
                corners[axis][k] = component;
            }
        }
        corners
    }

    #[inline(always)]
    fn transpose(rows: [V8; 8]) -> [V8; 8] {
        let [V8(a), V8(b), V8(c), V8(d), V8(e), V8(f), V8(g), V8(h)] = rows;
        unsafe {
            let (ab0, ab1) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let (cd0, cd1) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
            let (ef0, ef1) = (_mm256_unpacklo_ps(e, f), _mm256_unpackhi_ps(e, f));
            let (gh0, gh1) = (_mm256_unpacklo_ps(g, h), _mm256_unpackhi_ps(g, h));
            let (p0, p1) = (_mm256_shuffle_ps::<0x44>(ab0, cd0), _mm256_shuffle_ps::<0xee>(ab0, cd0));
            let (p2, p3) = (_mm256_shuffle_ps::<0x44>(ab1, cd1), _mm256_shuffle_ps::<0xee>(ab1, cd1));
            let (q0, q1) = (_mm256_shuffle_ps::<0x44>(ef0, gh0), _mm256_shuffle_ps::<0xee>(ef0, gh0));
            let (q2, q3) = (_mm256_shuffle_ps::<0x44>(ef1, gh1), _mm256_shuffle_ps::<0xee>(ef1, gh1));
            [
                V8(_mm256_permute2f128_ps::<0x20>(p0, q0)),
                V8(_mm256_permute2f128_ps::<0x20>(p1, q1)),
                V8(_mm256_permute2f128_ps::<0x20>(p2, q2)),
                V8(_mm256_permute2f128_ps::<0x20>(p3, q3)),
                V8(_mm256_permute2f128_ps::<0x31>(p0, q0)),
                V8(_mm256_permute2f128_ps::<0x31>(p1, q1)),
                V8(_mm256_permute2f128_ps::<0x31>(p2, q2)),
                V8(_mm256_permute2f128_ps::<0x31>(p3, q3)),
            ]
        }
    }
}

/// Three numbers, and a zero: what lies behind them is not read.
#[inline(always)]
fn row_of_three(numbers: &Vec3) -> __m128 {
    unsafe { _mm_maskload_ps(std::ptr::from_ref(numbers).cast(), _mm_setr_epi32(-1, -1, -1, 0)) }
}

/// Eight rows of three become three columns of eight.
#[inline(always)]
fn columns_of_three([a, b, c, d, e, f, g, h]: [__m128; 8]) -> [V8; 3] {
    unsafe {
        let (ae, bf) = (_mm256_set_m128(e, a), _mm256_set_m128(f, b));
        let (cg, dh) = (_mm256_set_m128(g, c), _mm256_set_m128(h, d));
        let (low, high) = (_mm256_unpacklo_ps(ae, bf), _mm256_unpacklo_ps(cg, dh));
        let z = _mm256_shuffle_ps::<0x44>(_mm256_unpackhi_ps(ae, bf), _mm256_unpackhi_ps(cg, dh));
        [V8(_mm256_shuffle_ps::<0x44>(low, high)), V8(_mm256_shuffle_ps::<0xee>(low, high)), V8(z)]
    }
}

/// The highest bits of what becomes of the numbers, eight at a time.
#[inline(always)]
fn highest(numbers: &[u32; 32], change: impl Fn(__m256i) -> __m256i) -> u32 {
    let mut bits = 0;
    for k in 0..4 {
        // Four times eight are what there is.
        unsafe {
            let eight = change(_mm256_loadu_si256(numbers.as_ptr().add(8 * k).cast()));
            bits |= (_mm256_movemask_ps(_mm256_castsi256_ps(eight)) as u32) << (8 * k);
        }
    }
    bits
}

/// For each set of lanes an order, a byte a lane, in which they come first.
const NAMED_FIRST: [i64; 256] = {
    let mut orders = [0; 256];
    let mut named = 0;
    while named < 256 {
        let (mut lane, mut place) = (0, 0);
        while lane < 8 {
            if named >> lane & 1 != 0 {
                orders[named] |= (lane as i64) << (8 * place);
                place += 1;
            }
            lane += 1;
        }
        // What follows repeats the first of them, which leaves one alone in its place.
        let first = orders[named] & 7;
        while place < 8 {
            orders[named] |= first << (8 * place);
            place += 1;
        }
        named += 1;
    }
    orders
};

/// The lanes of a set, and then others, in their order, a lane each.
#[inline(always)]
fn order(named: usize) -> __m256i {
    unsafe { _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(NAMED_FIRST[named])) }
}

/// Of each pair of lanes the smaller value goes to the one that is named.
#[inline(always)]
unsafe fn exchange<const SMALLER: i32>(keys: __m256i, partners: __m256i) -> __m256i {
    unsafe {
        let (most, least) = (_mm256_max_epi32(keys, partners), _mm256_min_epi32(keys, partners));
        _mm256_blend_epi32::<SMALLER>(most, least)
    }
}
