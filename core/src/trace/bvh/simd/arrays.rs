//! Vectors as plain arrays, for processors of which nothing else is known here. Whatever is done to them, their lanes
//! are numbers one by one: they are what other vectors are compared with.

use super::{Array, Doubles, Group, Mask, PerRay, RAYS, TURNED, Three, Turned, Vector};

#[inline(always)]
fn zip<T: Copy, const N: usize>(a: [T; N], b: [T; N], f: impl Fn(T, T) -> T) -> [T; N] {
    std::array::from_fn(
        #[inline(always)]
        |i| f(a[i], b[i]),
    )
}

/// One truth a lane: a bit of it.
#[derive(Clone, Copy)]
pub struct Bits(u32);

impl Mask for Bits {
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
        self.0
    }
}

#[inline(always)]
fn compare<const N: usize>(a: [f32; N], b: [f32; N], f: impl Fn(f32, f32) -> bool) -> Bits {
    let mut bits = 0;
    for i in 0..N {
        bits |= u32::from(f(a[i], b[i])) << i;
    }
    Bits(bits)
}

/// A function of two lanes, as a method of two arrays.
macro_rules! lanewise {
    ($($name:ident: $f:expr;)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            zip(self, other, #[inline(always)] $f)
        })*
    };
}

impl<const N: usize> Vector for [f32; N] {
    type Mask = Bits;
    lanewise! {
        add: |a, b| a + b;
        sub: |a, b| a - b;
        mul: |a, b| a * b;
        div: |a, b| a / b;
        max: |a, b| if a > b { a } else { b };
        min: |a, b| if a < b { a } else { b };
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        [value; N]
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f32::abs)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(f32::sqrt)
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> Bits {
        compare(
            self,
            other,
            #[inline(always)]
            |a, b| a <= b,
        )
    }
    #[inline(always)]
    fn less(self, other: Self) -> Bits {
        compare(
            self,
            other,
            #[inline(always)]
            |a, b| a < b,
        )
    }
    #[inline(always)]
    fn differs_in_sign(self, other: Self) -> Bits {
        compare(
            self,
            other,
            #[inline(always)]
            |a, b| a.is_sign_negative() != b.is_sign_negative(),
        )
    }
    #[inline(always)]
    fn flip(self, other: Self) -> Self {
        zip(
            self,
            other,
            #[inline(always)]
            |a, b| if b.is_sign_negative() { -a } else { a },
        )
    }
    #[inline(always)]
    fn select(Bits(mask): Bits, yes: Self, no: Self) -> Self {
        std::array::from_fn(
            #[inline(always)]
            |i| if mask >> i & 1 != 0 { yes[i] } else { no[i] },
        )
    }
    #[inline(always)]
    fn largest(self) -> f32 {
        self.into_iter().fold(f32::NEG_INFINITY, |most, x| if x > most { x } else { most })
    }
    #[inline(always)]
    fn smallest(self) -> f32 {
        self.into_iter().fold(f32::INFINITY, |least, x| if x < least { x } else { least })
    }
}

impl<const N: usize> Array<N> for [f32; N] {
    #[inline(always)]
    fn load(values: &[f32; N]) -> Self {
        *values
    }
    #[inline(always)]
    fn to_array(self) -> [f32; N] {
        self
    }
    #[inline(always)]
    fn overwrite(self, values: &mut [f32; N]) {
        *values = self;
    }
}

impl<T> Three for [T; 4] {
    #[inline(always)]
    fn yzx(self) -> Self {
        let [x, y, z, w] = self;
        [y, z, x, w]
    }
}

impl<T: Copy> Turned for [T; 4] {
    #[inline(always)]
    fn turned(self, axis: usize) -> Self {
        let [x, y, z, w] = TURNED[axis.min(2)];
        [self[x as usize], self[y as usize], self[z as usize], self[w as usize]]
    }
}

impl Group for [f32; 8] {
    const LANES: usize = 8;
    #[inline(always)]
    fn at(values: &PerRay, group: usize) -> Self {
        values.0.as_chunks().0[group % (RAYS / 8)]
    }
    #[inline(always)]
    fn put(self, values: &mut PerRay, group: usize) {
        values.0.as_chunks_mut().0[group % (RAYS / 8)] = self;
    }
    #[inline(always)]
    fn put_where(self, Bits(mask): Bits, values: &mut [f32; RAYS], group: usize) {
        let values: &mut [f32; 8] = &mut values.as_chunks_mut().0[group % (RAYS / 8)];
        for (i, (slot, value)) in values.iter_mut().zip(self).enumerate() {
            *slot = if mask >> i & 1 != 0 { value } else { *slot };
        }
    }
}

impl Doubles for [f64; 4] {
    type F = [f32; 4];
    lanewise! {
        add: |a, b| a + b;
        sub: |a, b| a - b;
        mul: |a, b| a * b;
        div: |a, b| a / b;
        max: |a, b| if a > b { a } else { b };
        min: |a, b| if a < b { a } else { b };
    }
    #[inline(always)]
    fn splat(value: f64) -> Self {
        [value; 4]
    }
    #[inline(always)]
    fn load(values: &[f64; 4]) -> Self {
        *values
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f64::abs)
    }
    #[inline(always)]
    fn less(self, other: Self) -> u32 {
        let mut bits = 0;
        for i in 0..4 {
            bits |= u32::from(self[i] < other[i]) << i;
        }
        bits
    }
    #[inline(always)]
    fn less_select(self, other: Self, yes: Self, no: Self) -> Self {
        std::array::from_fn(
            #[inline(always)]
            |i| if self[i] < other[i] { yes[i] } else { no[i] },
        )
    }
    #[inline(always)]
    fn first(self) -> Self {
        [self[0]; 4]
    }
    #[inline(always)]
    fn widen(values: [f32; 4]) -> Self {
        values.map(f64::from)
    }
    #[inline(always)]
    fn narrow(self) -> [f32; 4] {
        self.map(|x| x as f32)
    }
    #[inline(always)]
    fn to_array(self) -> [f64; 4] {
        self
    }
    #[inline(always)]
    fn sums(of: [Self; 4]) -> Self {
        of.map(|[x, y, z, _]| x + y + z)
    }
}

/// Rows become columns.
#[cfg_attr(all(target_arch = "x86_64", not(test)), expect(dead_code, reason = "SSE2 has its own"))]
#[inline(always)]
pub fn transpose(rows: [[f32; 8]; 8]) -> [[f32; 8]; 8] {
    std::array::from_fn(
        #[inline(always)]
        |i| rows.map(|row| row[i]),
    )
}
