//! Several numbers at a time, by whatever the processor has.
//!
//! Kernels are generic over [`Simd`] and compiled once for each implementation: [`Portable`] (SSE2 on x86-64, plain
//! arrays elsewhere), [`Avx2`] and [`Avx512`]. They may differ in the last bit of an f32 where a product and a sum are
//! fused, so what is fused serves only tests that reject conservatively; where bits of f32 are kept, as by
//! [`super::levels::farthest`], products and sums are rounded one by one. f64 is never fused: its operations round as
//! the scalar ones of [`crate::shape::triangle`] do, so that the numbers of a hit are the same whoever computes them.
//!
//! Beside these, what vectors are made of: a number for each ray of a bundle ([`PerRay`]), and a box as the builder has
//! it ([`boxes`]).

mod arrays;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
pub(super) mod boxes;
pub(super) mod doubles;
pub(super) mod isa;
mod portable;
#[cfg(target_arch = "x86_64")]
pub(super) mod quad;
#[cfg(target_arch = "x86_64")]
mod sse2;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(target_arch = "x86_64")]
pub(super) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(super) use avx512::Avx512;
pub(super) use doubles::Doubles;
pub(super) use portable::Portable;
#[cfg(target_arch = "x86_64")]
pub(super) use x86::V8;

use self::boxes::Boxes;
use self::isa::Kernel;
use super::block::Block;
use super::node::{Child, Node};
use crate::math::Vec3;

/// Rays in a bundle: a bit of a word for each.
pub(super) const RAYS: usize = 64;

/// One number for each ray of a bundle.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct PerRay(pub [f32; RAYS]);

impl PerRay {
    pub const ZERO: Self = Self([0.0; RAYS]);
}

/// The two axes beside `axis`, and itself.
#[inline(always)]
pub(super) const fn axes(axis: usize) -> [usize; 3] {
    [(axis + 1) % 3, (axis + 2) % 3, axis]
}

/// An instruction set, as a family of vector types.
pub(super) trait Simd {
    /// Four f32.
    type V4: Vector + Array<4> + Three + Turned;
    /// Eight f32.
    type V8: Vector + Array<8> + Boxes;
    /// As many f32 as one instruction takes.
    type Wide: Group;
    /// Four f64.
    type D4: Doubles<F = Self::V4>;
    /// Runs a part of a kernel in a function of its own. All else ends up in one, in which nothing that lives long
    /// stays in a register: what is done once for many rays, and has a loop in it, is better apart.
    fn apart<K: Kernel>(kernel: K) -> K::Output;
    /// The same of a part in which nothing is wider than eight lanes, as
    /// [`dispatch_narrow`](self::isa::dispatch_narrow) runs it: with another instruction set than this, perhaps, so
    /// nothing that the part is given may be of this one.
    #[inline(always)]
    fn apart_narrow<K: Kernel>(kernel: K) -> K::Output {
        Self::apart(kernel)
    }
    /// Rows become columns.
    fn transpose(rows: [Self::V8; 8]) -> [Self::V8; 8];
    /// Children that the mask names, the farthest first, by where they are entered (not below 0, nor -0); then others.
    /// How many it names. Of `near` the lowest three bits are lost: in `sorted_near` they are the child's slot.
    fn far_to_near(
        near: Self::V8,
        mask: <Self::V8 as Vector>::Mask,
        child: &[Child; 8],
        sorted_near: &mut [u32; 8],
        sorted_child: &mut [Child; 8],
    ) -> usize;
    /// Of the children that the mask names the nearest, told as [`Self::far_to_near`] does; and how many others there
    /// are. These are stored likewise, but in order only where they are two, and else in one that is the same on every
    /// instruction set. Vectors take no branch that depends on what the mask names. If it names none, the child is
    /// anyone's.
    fn nearest_apart(
        near: Self::V8,
        mask: <Self::V8 as Vector>::Mask,
        child: &[Child; 8],
        other_near: &mut [u32; 8],
        other_child: &mut [Child; 8],
    ) -> (Child, usize);
    /// Of the first `count` of eight entries, as [`Self::far_to_near`] stores them, those that are not farther than the
    /// limit, in their order; then others. How many these are.
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
    /// The row of a node's bounds that starts `offset` bytes after the first. What is no row's start means some of its
    /// bytes.
    fn row(node: &Node, offset: u32) -> Self::V8;
    /// A component of a block's corners, `offset` bytes after that of the first axis. What is no such start means some
    /// of its numbers.
    fn corners(block: &Block, offset: u32) -> [Self::V8; 3];
    /// The corners of eight triangles component by component, as a block has them.
    fn by_component(triangles: &[[&Vec3; 3]; 8]) -> [[Self::V8; 3]; 3];
    /// Has four cache lines loaded that will be needed soon. A hint: there may be nothing.
    fn prefetch(address: *const u8);
    /// Whether anything is loaded for it.
    const PREFETCHES: bool = true;
    /// Whether many rays that go their own ways among triangles are answered sooner in flight than one after the other.
    const FLIES: bool = true;
    /// Has the cache line with this value loaded.
    fn prefetch_line<T>(value: &T);
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
    /// self * factor + summand, rounded once or twice: twice where no instruction does both.
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        self.mul(factor).add(summand)
    }
    /// self * factor - subtrahend, rounded likewise.
    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        self.mul(factor).sub(subtrahend)
    }
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

/// A vector in every lane, component by component.
#[inline(always)]
pub(super) fn everywhere<V: Vector>(v: Vec3) -> [V; 3] {
    [V::splat(v.x), V::splat(v.y), V::splat(v.z)]
}

/// Loaded from and stored to an array.
pub(super) trait Array<const N: usize>: Sized {
    fn load(values: &[f32; N]) -> Self;
    fn to_array(self) -> [f32; N];
    /// Stores all lanes, of which some are what is there already. In a plain store the compiler sees that, and stores
    /// the others alone, by a mask: on a Zen 4 that takes 12 cycles instead of 2 (of AVX2), and whoever loads them next
    /// waits for another 20 (of AVX-512, too).
    fn overwrite(self, values: &mut [f32; N]);
}

/// The components of a vector in the first three lanes of four.
pub(super) trait Three {
    /// The second lane, the third, the first; then one that means nothing.
    fn yzx(self) -> Self;
}

/// The same, in another order.
pub(super) trait Turned {
    /// The component along an axis third, those of the two axes that follow it before it; then one that means nothing.
    fn turned(self, axis: usize) -> Self;
}

/// Which lanes these are, axis by axis.
const TURNED: [[u32; 4]; 3] = [turned(0), turned(1), turned(2)];

const fn turned(axis: usize) -> [u32; 4] {
    let [x, y, z] = axes(axis);
    [x as u32, y as u32, z as u32, 3]
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

#[cfg(test)]
mod tests {
    use super::isa::{Present, dispatch};
    use super::*;
    use crate::trace::bvh::random::Random;

    #[derive(Clone, Copy)]
    struct Entered {
        near: [f32; 8],
        named: u32,
        child: [Child; 8],
    }

    impl Entered {
        #[inline(always)]
        fn mask<S: Simd>(&self) -> <S::V8 as Vector>::Mask {
            let mut out = [1.0; 8];
            for (slot, out) in out.iter_mut().enumerate() {
                *out -= (self.named >> slot & 1) as f32;
            }
            S::V8::load(&out).at_most(S::V8::splat(0.0))
        }

        /// What is entered where it is named, in the order of a sort: bits of `near` before slots, and the slot in the
        /// lowest.
        fn sorted(&self) -> Vec<(u32, Child)> {
            let mut all: Vec<_> = (0..8)
                .filter(|slot| self.named >> slot & 1 != 0)
                .map(|slot| (self.near[slot].to_bits() / 8 * 8 + slot as u32, self.child[slot]))
                .collect();
            all.sort_by_key(|&(near, _)| std::cmp::Reverse(near));
            all
        }
    }

    struct Sort(Entered);

    impl Kernel for Sort {
        type Output = Vec<(u32, Child)>;

        #[inline(always)]
        fn run<S: Simd>(self) -> Vec<(u32, Child)> {
            let Entered { near, child, .. } = self.0;
            let (mut sorted, mut children) = ([0; 8], [Child::NONE; 8]);
            let count = S::far_to_near(S::V8::load(&near), self.0.mask::<S>(), &child, &mut sorted, &mut children);
            sorted.into_iter().zip(children).take(count).collect()
        }
    }

    struct Nearest(Entered);

    impl Kernel for Nearest {
        type Output = (Child, Vec<(u32, Child)>);

        #[inline(always)]
        fn run<S: Simd>(self) -> (Child, Vec<(u32, Child)>) {
            let Entered { near, child, .. } = self.0;
            let (mut others, mut children) = ([0; 8], [Child::NONE; 8]);
            let near = S::V8::load(&near);
            let (nearest, count) = S::nearest_apart(near, self.0.mask::<S>(), &child, &mut others, &mut children);
            (nearest, others.into_iter().zip(children).take(count).collect())
        }
    }

    struct Within {
        limit: f32,
        entries: [(u32, Child); 8],
        count: usize,
    }

    impl Kernel for Within {
        type Output = Vec<(u32, Child)>;

        #[inline(always)]
        fn run<S: Simd>(self) -> Vec<(u32, Child)> {
            let entries = (&self.entries.map(|(near, _)| near), &self.entries.map(|(_, child)| child));
            let (mut near, mut child) = ([0; 8], [Child::NONE; 8]);
            let count = S::within(self.limit, entries, self.count, &mut near, &mut child);
            near.into_iter().zip(child).take(count).collect()
        }
    }

    /// Every choice of children, with numbers that are far apart, next to each other, and equal.
    fn cases() -> impl Iterator<Item = Entered> {
        let child = [3, 1, 4, 1, 5, 9, 2, 6].map(Child::inner);
        let tiny = f32::from_bits(9);
        let ties = [1.0, 0.0, tiny, 1.0, f32::INFINITY, 0.0, 1.0f32.next_up(), 2.0];
        let mut random = Random::new(1);
        let others = std::iter::repeat_with(move || [0; 8].map(|_| random.vec3().x.abs())).take(20);
        let nears = others.chain([ties, [0.0; 8]]);
        nears.flat_map(move |near| (0..256).map(move |named| Entered { near, named, child }))
    }

    /// Whichever children are named, each instruction set has them in the order of a sort.
    #[test]
    fn children_are_sorted_alike() {
        for case in cases() {
            for isa in Present::all() {
                assert_eq!(dispatch(isa, Sort(case)), case.sorted(), "{isa:?}: {:08b} of {:?}", case.named, case.near);
            }
        }
    }

    /// The nearest child is the last of a sort; the others are the same children, each once, and in order where they
    /// are two.
    #[test]
    fn the_nearest_child_is_told_apart() {
        for case in cases() {
            let mut expected = case.sorted();
            let nearest = expected.pop();
            for isa in Present::all() {
                let context = format!("{isa:?}: {:08b} of {:?}", case.named, case.near);
                let (child, mut others) = dispatch(isa, Nearest(case));
                assert_eq!(others, dispatch(Present::PORTABLE, Nearest(case)).1, "{context}");
                assert!(nearest.is_none_or(|(_, expected)| child == expected), "{context}");
                if others.len() > 2 {
                    others.sort_by_key(|&(near, _)| std::cmp::Reverse(near));
                }
                assert_eq!(others, expected, "{context}");
            }
        }
    }

    /// Of entries those are kept, in their order, that a filter keeps; the lowest three bits say nothing of where a
    /// child is entered.
    #[test]
    fn entries_within_a_limit_are_kept() {
        for case in cases() {
            let entry = |slot: usize| ((case.near[slot].to_bits() & !7) | slot as u32, case.child[slot]);
            let entries = [0, 1, 2, 3, 4, 5, 6, 7].map(entry);
            // Any of them may be the limit, be there more entries or fewer.
            let (limit, count) = (f32::from_bits(entries[case.named as usize % 8].0 & !7), case.named as usize % 13);
            let is_near = |(near, _): &(u32, Child)| f32::from_bits(near & !7) <= limit;
            let expected: Vec<_> = entries.into_iter().take(count).filter(is_near).collect();
            for isa in Present::all() {
                assert_eq!(
                    dispatch(isa, Within { limit, entries, count }),
                    expected,
                    "{isa:?}: {count} of {entries:?}"
                );
            }
        }
    }

    /// Numbers that are special, and some that are not.
    const NUMBERS: [f32; 16] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        -f32::NAN,
        f32::MIN_POSITIVE / 4.0,
        -f32::MAX,
        16_777_217.0,
        0.1,
        -2.5,
        3.000_000_2,
        1e-30,
        7.0,
    ];

    /// The bits of numbers, but of what is none only that.
    fn bits<const N: usize>(numbers: [f32; N]) -> Vec<u64> {
        numbers.iter().map(|x| if x.is_nan() { u64::MAX } else { x.to_bits().into() }).collect()
    }

    fn bits_of_doubles(numbers: [f64; 4]) -> Vec<u64> {
        numbers.iter().map(|x| if x.is_nan() { u64::MAX } else { x.to_bits() }).collect()
    }

    /// What operations on f32 make of two vectors.
    #[inline(always)]
    fn of_vectors<V: Vector + Array<N>, const N: usize>(a: &[f32; N], b: &[f32; N]) -> Vec<Vec<u64>> {
        let (p, q) = (V::load(a), V::load(b));
        let mut found = Vec::new();
        for v in [p.add(q), p.sub(q), p.mul(q), p.div(q), p.max(q), p.min(q), p.abs(), p.sqrt(), p.flip(q)] {
            found.push(bits(v.to_array()));
        }
        for mask in [p.less(q), p.at_most(q), p.differs_in_sign(q), p.less(q).or(p.differs_in_sign(q))] {
            found.push(vec![mask.bits().into()]);
            found.push(bits(V::select(mask, p, q).to_array()));
            let others = [mask.and(p.at_most(q)), mask.without(p.less(q))];
            found.push(others.map(|mask| mask.bits().into()).to_vec());
        }
        if a.iter().all(|x| !x.is_nan()) {
            // Of zeros either is the largest.
            found.push(bits([p.largest() + 0.0, p.smallest() + 0.0]));
        }
        let mut stored = *b;
        p.overwrite(&mut stored);
        found.push(bits(stored));
        found
    }

    /// What operations on f64 make of two vectors, and on f32 what there is of four alone.
    #[inline(always)]
    fn of_four<V: Vector + Array<4> + Three + Turned, D: Doubles<F = V>>(a: &[f32; 4], b: &[f32; 4]) -> Vec<Vec<u64>> {
        let mut found = of_vectors::<V, 4>(a, b);
        found.push(bits(V::load(a).yzx().to_array()));
        for axis in 0..3 {
            found.push(bits(V::load(a).turned(axis).to_array())[..3].to_vec());
        }
        // A third has more bits than an f32.
        let (p, q) = (D::widen(V::load(a)).div(D::splat(3.0)), D::widen(V::load(b)));
        for d in [p.add(q), p.sub(q), p.mul(q), p.div(q), p.max(q), p.min(q), p.abs(), p.first(), p.yzx()] {
            found.push(bits_of_doubles(d.to_array()));
        }
        found.push(bits_of_doubles(D::load(&p.to_array()).less_select(q, p, q).to_array()));
        found.push(vec![p.less(q).into()]);
        found.push(bits_of_doubles(D::sums([p, q, p.mul(q), p.sub(q)]).to_array()));
        found.push(bits(p.narrow().to_array()));
        found
    }

    struct Operations<'a>(&'a [f32; 8], &'a [f32; 8]);

    impl Kernel for Operations<'_> {
        type Output = Vec<Vec<u64>>;

        #[inline(always)]
        fn run<S: Simd>(self) -> Vec<Vec<u64>> {
            let Self(a, b) = self;
            let mut found = of_vectors::<S::V8, 8>(a, b);
            found.extend(of_four::<S::V4, S::D4>(&[a[0], a[1], a[2], a[3]], &[b[0], b[1], b[2], b[3]]));
            let rows = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| if i % 2 == 0 { a } else { b }.map(|x| x * i as f32));
            found.extend(S::transpose(rows.map(|row| S::V8::load(&row))).map(|row| bits(row.to_array())));
            let mut groups = PerRay([0.0; RAYS]);
            S::Wide::at(&PerRay(std::array::from_fn(|i| a[i % 8])), 1).put(&mut groups, 1);
            found.push(bits(groups.0));
            found
        }
    }

    /// Plain arrays, lane by lane: what other vectors are compared with.
    fn by_arrays(a: &[f32; 8], b: &[f32; 8], wide: usize) -> Vec<Vec<u64>> {
        let mut found = of_vectors::<[f32; 8], 8>(a, b);
        found.extend(of_four::<[f32; 4], [f64; 4]>(&[a[0], a[1], a[2], a[3]], &[b[0], b[1], b[2], b[3]]));
        let rows = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| if i % 2 == 0 { a } else { b }.map(|x| x * i as f32));
        found.extend(arrays::transpose(rows).map(bits));
        let second = wide..2 * wide;
        found.push(bits::<RAYS>(std::array::from_fn(|i| if second.contains(&i) { a[i % 8] } else { 0.0 })));
        found
    }

    /// Whatever has lanes does to each of them what is done to a number alone.
    #[test]
    fn vectors_do_what_arrays_do() {
        for shift in 0..NUMBERS.len() {
            for start in 0..NUMBERS.len() {
                let a = std::array::from_fn(|i| NUMBERS[(start + i) % 16]);
                let b = std::array::from_fn(|i| NUMBERS[(start + 3 * i + shift) % 16]);
                for isa in Present::all() {
                    let wide = if isa.isa() == isa::Isa::Avx512 { 16 } else { 8 };
                    assert_eq!(dispatch(isa, Operations(&a, &b)), by_arrays(&a, &b, wide), "{isa:?}: {a:?}, {b:?}");
                }
            }
        }
    }
}
