//! Boxes in vectors, as the builder has them: what it asks of a vector beyond arithmetic. All implementations give the
//! same bits, so the tree is the same for every instruction set: nothing is fused.
#![allow(unsafe_code)] // Intrinsics; see `x86`.

use super::Vector;

/// Most items that [`Boxes::ranks`] sorts.
pub(in crate::trace::bvh) const RANKED: usize = 32;

/// Eight lanes that hold a box as [-min, max].
pub(in crate::trace::bvh) trait Boxes: Copy {
    /// [max, -min].
    fn swap_halves(self) -> Self;
    /// Each lane towards zero; anything for what does not fit.
    fn truncate(self) -> [i32; 8];
    /// `left` and `right`, this box joined to the first where its doubled centre on `axis` (0, 1, 2) lies before `at`,
    /// else to the second; and whether it does.
    fn join_side(self, axis: usize, at: f32, left: Self, right: Self) -> (Self, Self, bool);
    /// Half the surface of three boxes; the last lane is anything.
    fn half_areas(boxes: [Self; 3]) -> [f32; 4];
    /// For each of the first `n` keys, none of them NaN, how many of these are less. The rest is anything.
    fn ranks(keys: &[f32; RANKED], n: usize) -> [u32; RANKED];
}

/// Half the surface of a box; without order for an empty one.
#[inline(always)]
pub(in crate::trace::bvh) fn half_area(bounds: &[f32; 8]) -> f32 {
    let &[a, b, c, _, d, e, f, _] = bounds;
    let (x, y, z) = (a + d, b + e, c + f);
    y * (x + z) + z * x
}

impl Boxes for [f32; 8] {
    #[inline(always)]
    fn swap_halves(self) -> Self {
        let [a, b, c, d, e, f, g, h] = self;
        [e, f, g, h, a, b, c, d]
    }

    #[inline(always)]
    fn truncate(self) -> [i32; 8] {
        self.map(|x| x as i32)
    }

    #[inline(always)]
    fn join_side(self, axis: usize, at: f32, left: Self, right: Self) -> (Self, Self, bool) {
        let is_left = self[axis % 4 + 4] - self[axis % 4] < at;
        let (mut sides, side) = ([left, right], usize::from(!is_left));
        sides[side] = self.max(sides[side]);
        let [left, right] = sides;
        (left, right, is_left)
    }

    #[inline(always)]
    fn half_areas([a, b, c]: [Self; 3]) -> [f32; 4] {
        [half_area(&a), half_area(&b), half_area(&c), 0.0]
    }

    #[inline(always)]
    fn ranks(keys: &[f32; RANKED], n: usize) -> [u32; RANKED] {
        let mut ranks = [0; RANKED];
        for &key in &keys[..n] {
            for (rank, &other) in ranks[..n].iter_mut().zip(keys) {
                *rank += u32::from(key < other);
            }
        }
        ranks
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::{Boxes, RANKED};
    use crate::trace::bvh::simd::{V8, quad};

    /// SAFETY of every block below: these vectors are made only in kernels that `isa::dispatch` runs, of a `Present`
    /// instruction set; loads and stores go through references to arrays of the vector's size.
    impl Boxes for V8 {
        #[inline(always)]
        fn swap_halves(self) -> Self {
            Self(unsafe { _mm256_permute2f128_ps::<1>(self.0, self.0) })
        }

        #[inline(always)]
        fn truncate(self) -> [i32; 8] {
            let mut lanes = [0; 8];
            unsafe { _mm256_storeu_si256(lanes.as_mut_ptr().cast(), _mm256_cvttps_epi32(self.0)) };
            lanes
        }

        #[inline(always)]
        fn join_side(self, axis: usize, at: f32, left: Self, right: Self) -> (Self, Self, bool) {
            unsafe {
                let of = |lane: usize| _mm256_permutevar8x32_ps(self.0, _mm256_set1_epi32(lane as i32));
                let is_left = _mm256_cmp_ps::<_CMP_LT_OQ>(_mm256_sub_ps(of(axis + 4), of(axis)), _mm256_set1_ps(at));
                // Both sides and no branch, which would be guessed wrong every other time.
                let nothing = _mm256_set1_ps(f32::NEG_INFINITY);
                let left = _mm256_max_ps(_mm256_blendv_ps(nothing, self.0, is_left), left.0);
                let right = _mm256_max_ps(_mm256_blendv_ps(self.0, nothing, is_left), right.0);
                (Self(left), Self(right), _mm256_movemask_ps(is_left) & 1 != 0)
            }
        }

        #[inline(always)]
        fn half_areas(boxes: [Self; 3]) -> [f32; 4] {
            let mut areas = [0.0; 4];
            unsafe {
                let size = |v: __m256| _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
                let sum = quad::half_areas([size(boxes[0].0), size(boxes[1].0), size(boxes[2].0)]);
                _mm_storeu_ps(areas.as_mut_ptr(), sum);
            }
            areas
        }

        #[inline(always)]
        fn ranks(keys: &[f32; RANKED], n: usize) -> [u32; RANKED] {
            let mut ranks = [0u32; RANKED];
            for (ranks, others) in ranks.chunks_exact_mut(8).zip(keys.chunks_exact(8)).take(n.div_ceil(8)) {
                unsafe {
                    let others = _mm256_loadu_ps(others.as_ptr());
                    let mut count = _mm256_setzero_si256();
                    for key in &keys[..n] {
                        let less = _mm256_cmp_ps::<_CMP_LT_OQ>(_mm256_set1_ps(*key), others);
                        count = _mm256_sub_epi32(count, _mm256_castps_si256(less));
                    }
                    _mm256_storeu_si256(ranks.as_mut_ptr().cast(), count);
                }
            }
            ranks
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of any size and sign, from a linear congruence.
    fn numbers<const N: usize>(seed: u32) -> [f32; N] {
        let mut state = seed;
        [(); N].map(|()| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 1000.0 - 8000.0
        })
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn all_give_the_bits_of_arrays() {
        use crate::trace::bvh::simd::isa::{self, Kernel, Present};
        use crate::trace::bvh::simd::{Array, Simd};
        type Found = (bool, [[f32; 8]; 2], [i32; 8], [u32; 3], [u32; RANKED]);
        struct All([[f32; 8]; 3], [f32; RANKED]);
        impl All {
            #[inline(always)]
            fn of<V: Array<8> + Boxes>(&self) -> Found {
                let boxes = self.0.map(|b| V::load(&b));
                let [x, y, z, _] = V::half_areas(boxes).map(f32::to_bits);
                let (left, right, is_left) = boxes[1].swap_halves().join_side(1, 0.0, boxes[0], boxes[0]);
                (
                    is_left,
                    [left.to_array(), right.to_array()],
                    boxes[2].truncate(),
                    [x, y, z],
                    V::ranks(&self.1, RANKED),
                )
            }
        }
        impl Kernel for All {
            type Output = Found;
            #[inline(always)]
            fn run<S: Simd>(self) -> Found {
                self.of::<S::V8>()
            }
        }
        for seed in 0..100 {
            let all = || All([numbers(seed), numbers(seed + 1000), numbers(seed + 2000)], numbers(seed + 3000));
            for isa in Present::all() {
                assert_eq!(isa::dispatch(isa, all()), all().of::<[f32; 8]>(), "{isa:?}");
            }
        }
    }

    #[test]
    fn half_areas_and_ranks() {
        // A box of 1 x 2 x 3.
        let bounds = [-1.0, -1.0, -1.0, 9.0, 2.0, 3.0, 4.0, 9.0];
        assert_eq!(<[f32; 8]>::half_areas([bounds; 3])[..3], [11.0; 3]);
        let keys: [f32; RANKED] = numbers(7);
        let ranks = <[f32; 8]>::ranks(&keys, RANKED);
        let mut sorted = keys;
        sorted.sort_by(f32::total_cmp);
        for (key, rank) in keys.into_iter().zip(ranks) {
            assert_eq!(key, sorted[rank as usize]);
        }
    }
}
