//! Several numbers at a time, by whatever the processor has.
//!
//! Kernels are generic over [`Simd`] and compiled once for each implementation: [`Portable`], plain arrays, [`Avx2`]
//! and [`Avx512`]. They may differ in the last bit of an f32 where a product and a sum are fused, so f32 serves only tests
//! that reject conservatively. f64 is never fused: its operations round as the scalar ones of
//! [`crate::shape::triangle`] do, so that the numbers of a hit are the same whoever computes them.

#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(target_arch = "x86_64")]
pub(super) use avx512::Avx512;
pub(super) use portable::Portable;
#[cfg(target_arch = "x86_64")]
pub(super) use x86::{Avx2, V8};

use super::block::Block;
use super::build::lanes::Boxes;
use super::bundle::{PerRay, RAYS};
use super::isa::Kernel;
use super::node::{Child, Node};

/// An instruction set, as a family of vector types.
pub(super) trait Simd {
    /// Four f32.
    type V4: Vector + Array<4> + Three;
    /// Eight f32.
    type V8: Vector + Array<8> + Boxes;
    /// As many f32 as one instruction takes.
    type Wide: Group;
    /// Four f64.
    type D4: Doubles<F = Self::V4>;
    /// Runs a part of a kernel in a function of its own. All else ends up in one, in which nothing that lives long stays in a register: what
    /// is done once for many rays, and has a loop in it, is better apart.
    fn apart<K: Kernel>(kernel: K) -> K::Output;
    /// Rows become columns.
    fn transpose(rows: [Self::V8; 8]) -> [Self::V8; 8];
    /// Children that the mask names, the farthest first, by where they are entered (not below 0, nor -0); then others. How many it names.
    /// Of `near` the lowest three bits are lost: in `sorted_near` they are the child's slot.
    fn far_to_near(
        near: Self::V8,
        mask: <Self::V8 as Vector>::Mask,
        child: &[Child; 8],
        sorted_near: &mut [u32; 8],
        sorted_child: &mut [Child; 8],
    ) -> usize;
    /// Of the children that the mask names the nearest, told as [`Self::far_to_near`] does; and how many others there are. These are stored likewise, but in
    /// order only where they are two. No branch depends on what the mask names. If it names none, the child is anyone's.
    fn nearest_apart(
        near: Self::V8,
        mask: <Self::V8 as Vector>::Mask,
        child: &[Child; 8],
        other_near: &mut [u32; 8],
        other_child: &mut [Child; 8],
    ) -> (Child, usize);
    /// Of the first `count` of eight entries, as [`Self::far_to_near`] stores them, those that are not farther than the limit, in their order; then others. How
    /// many these are.
    fn within(
        limit: f32,
        entries: (&[u32; 8], &[Child; 8]),
        count: usize,
        near: &mut [u32; 8],
        child: &mut [Child; 8],
    ) -> usize;
    /// Children that the mask names, in their order; then others. How many it names.
    fn named_first(mask: <Self::V8 as Vector>::Mask, child: &[Child; 8], named: &mut [Child; 8]) -> usize;
    /// A bit for each number whose highest bit is set.
    fn highest_bits(numbers: &[u32; 32]) -> u32;
    /// A bit for each number that is `number`.
    fn equal(numbers: &[u32; 32], number: u32) -> u32;
    /// The row of a node's bounds that starts `offset` bytes after the first. What is no row's start means some of its bytes.
    fn row(node: &Node, offset: u32) -> Self::V8;
    /// A component of a block's corners, `offset` bytes after that of the first axis. What is no such start means some of its numbers.
    fn corners(block: &Block, offset: u32) -> [Self::V8; 3];
    /// Has four cache lines loaded that will be needed soon. A hint: there may be nothing.
    fn prefetch(address: *const u8);
    /// Has all of these loaded.
    #[inline(always)]
    fn prefetch_all<T>(values: &[T]) {
        for offset in (0..size_of_val(values)).step_by(256) {
            Self::prefetch(values.as_ptr().cast::<u8>().wrapping_add(offset));
        }
    }
    /// Where a value is, or would be.
    #[inline(always)]
    fn address<T>(values: &[T], index: u32) -> *const u8 {
        values.as_ptr().wrapping_add(index as usize).cast()
    }
}

/// One truth a lane.
pub(super) trait Mask: Copy {
    fn and(self, other: Self) -> Self;
    fn or(self, other: Self) -> Self;
    /// Where self holds and other does not.
    fn without(self, other: Self) -> Self;
    /// Bit i is set where it holds in lane i.
    fn bits(self) -> u32;
}

/// Values of f32. `max` and `min` return the second operand where one is NaN.
pub(super) trait Vector: Copy {
    type Mask: Mask;
    fn splat(value: f32) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// self * factor + summand, rounded once or twice.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    /// self * factor - subtrahend, rounded once or twice.
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn abs(self) -> Self;
    fn sqrt(self) -> Self;
    /// Where self is at most other; not for NaN.
    fn at_most(self, other: Self) -> Self::Mask;
    /// Where self is less than other; not for NaN.
    fn less(self, other: Self) -> Self::Mask;
    /// Where one has a minus sign, be it that of a zero, and the other has not.
    fn differs_in_sign(self, other: Self) -> Self::Mask;
    /// With its sign changed where the other has a minus sign, be it that of a zero.
    fn flip(self, other: Self) -> Self;
    /// `yes` where the mask holds, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// The largest lane; NaN are passed over or not.
    fn largest(self) -> f32;
    /// The smallest lane; NaN are passed over or not.
    fn smallest(self) -> f32;
}

/// The largest magnitude of a component.
#[inline(always)]
pub(super) fn size<V: Vector>([x, y, z]: [V; 3]) -> V {
    x.abs().max(y.abs()).max(z.abs())
}

/// Loaded from and stored to an array.
pub(super) trait Array<const N: usize>: Sized {
    fn load(values: &[f32; N]) -> Self;
    fn to_array(self) -> [f32; N];
    /// Stores all lanes, of which some are what is there already. In a plain store the compiler sees that, and stores the others
    /// alone, by a mask: on a Zen 4 that takes 12 cycles instead of 2 (of AVX2), and whoever loads them next waits for another 20 (of AVX-512, too).
    fn overwrite(self, values: &mut [f32; N]);
}

/// The components of a vector in the first three lanes of four.
pub(super) trait Three {
    /// The second lane, the third, the first; then one that means nothing.
    fn yzx(self) -> Self;
}

/// The rays of a bundle, group by group.
pub(super) trait Group: Vector {
    /// Rays in a group.
    const LANES: usize;
    fn at(values: &PerRay, group: usize) -> Self;
    fn put(self, values: &mut PerRay, group: usize);
    /// Sets the group's values where the mask holds. All of them are stored: see [`Array::overwrite`].
    fn put_where(self, mask: Self::Mask, values: &mut [f32; RAYS], group: usize);
}

/// Four values of f64.
pub(super) trait Doubles: Three + Copy {
    /// As many f32.
    type F: Array<4>;
    fn splat(value: f64) -> Self;
    fn load(values: &[f64; 4]) -> Self;
    /// Exact.
    fn widen(values: Self::F) -> Self;
    /// Rounded to nearest.
    fn narrow(self) -> Self::F;
    fn to_array(self) -> [f64; 4];
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// The second where one is NaN.
    fn max(self, other: Self) -> Self;
    /// The second where one is NaN.
    fn min(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// Bit i is set where self is less than other in lane i; not for NaN.
    fn less(self, other: Self) -> u32;
    /// Of each of them the sum of its first three lanes, in their order.
    fn sums(of: [Self; 4]) -> Self;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::bvh::isa::{Isa, dispatch};
    use crate::trace::bvh::random::Random;

    struct Sort {
        near: [f32; 8],
        named: u32,
        child: [Child; 8],
    }

    impl Kernel for Sort {
        type Output = Vec<(u32, Child)>;

        #[inline(always)]
        fn run<S: Simd>(self) -> Vec<(u32, Child)> {
            let mut out = [1.0; 8];
            for (slot, out) in out.iter_mut().enumerate() {
                *out -= (self.named >> slot & 1) as f32;
            }
            let mask = S::V8::load(&out).at_most(S::V8::splat(0.0));
            let (mut near, mut child) = ([0; 8], [Child::NONE; 8]);
            let count = S::far_to_near(S::V8::load(&self.near), mask, &self.child, &mut near, &mut child);
            near.into_iter().zip(child).take(count).collect()
        }
    }

    /// Whichever children are named, each instruction set has them in the order of a sort: bits of `near` before slots, and the slot in the lowest.
    #[test]
    fn children_are_sorted_alike() {
        let child = [3, 1, 4, 1, 5, 9, 2, 6].map(Child::inner);
        let tiny = f32::from_bits(9);
        let ties = [1.0, 0.0, tiny, 1.0, f32::INFINITY, 0.0, 1.0f32.next_up(), 2.0];
        let mut random = Random::new(1);
        let others = std::iter::repeat_with(|| [0; 8].map(|_| random.vec3().x.abs())).take(20);
        for near in others.chain([ties, [0.0; 8]]) {
            for named in 0..256u32 {
                let mut expected: Vec<_> = (0..8)
                    .filter(|slot| named >> slot & 1 != 0)
                    .map(|slot| (near[slot].to_bits() / 8 * 8 + slot as u32, child[slot]))
                    .collect();
                expected.sort_by_key(|&(near, _)| std::cmp::Reverse(near));
                for isa in [Isa::Portable, Isa::Avx2, Isa::Avx512].into_iter().filter(|isa| isa.is_available()) {
                    let sorted = dispatch(isa, Sort { near, named, child });
                    assert_eq!(sorted, expected, "{isa:?}: {named:08b} of {near:?}");
                }
            }
        }
    }
}
