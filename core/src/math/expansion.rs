//! Exact arithmetic on sums of f64 (Shewchuk 1997, *Adaptive precision floating-point arithmetic and fast robust
//! geometric predicates*).
//!
//! An [`Expansion`] is a sum of f64 components that do not overlap, smallest first. Sums and products of expansions are
//! exact while nothing overflows or underflows; with f32 inputs and products of up to five factors nothing does. The
//! first components live in place and single ones are added and multiplied as such, since most of what decides a hit
//! has few: a half to three quarters of the time that a `Vec` and the general rule take. Rationals over big integers,
//! the simpler alternative, would cost ten times as much; integers that fit into 128 bits, as those of most triangles
//! do, a fifth.

use std::ops::{Add, Mul, Neg, Sub};
use std::sync::atomic::{AtomicU64, Ordering};

use smallvec::{SmallVec, smallvec};

/// A sum of f64, kept exactly.
#[derive(Clone, Debug, Default)]
pub struct Expansion(SmallVec<[f64; 8]>);

static DECISIONS: AtomicU64 = AtomicU64::new(0);

/// How many decisions of this process were left to exact arithmetic, because f64 could not take them.
pub fn decisions() -> u64 {
    DECISIONS.load(Ordering::Relaxed)
}

/// Counts one of them.
pub(crate) fn count_decision() {
    DECISIONS.fetch_add(1, Ordering::Relaxed);
}

impl From<f64> for Expansion {
    fn from(value: f64) -> Self {
        Self(if value == 0.0 { SmallVec::new() } else { smallvec![value] })
    }
}

impl From<f32> for Expansion {
    fn from(value: f32) -> Self {
        f64::from(value).into()
    }
}

impl Expansion {
    /// A rounded sum or product and its error, neither of which need be there.
    #[inline]
    fn of((rounded, error): (f64, f64)) -> Self {
        let mut sum = Self::from(error);
        if rounded != 0.0 {
            sum.0.push(rounded);
        }
        sum
    }

    /// The nearest f64, off by at most one ulp.
    pub fn estimate(&self) -> f64 {
        self.0.iter().sum()
    }

    /// Times a power of two.
    pub fn scaled(mut self, power: f64) -> Self {
        self.0.iter_mut().for_each(|component| *component *= power);
        self
    }

    /// -1, 0 or 1: exact, since the largest component outweighs the rest.
    pub fn signum(&self) -> i32 {
        match self.0.last() {
            Some(&largest) if largest > 0.0 => 1,
            Some(_) => -1,
            None => 0,
        }
    }

    /// self + sign * other; the sign is 1 or -1.
    #[inline]
    fn plus(&self, sign: f64, other: &Self) -> Self {
        if let ([a], [b]) = (&self.0[..], &other.0[..]) {
            return Self::of(two_sum(*a, sign * b));
        }
        let mut sum = self.clone();
        other.0.iter().for_each(|component| sum.grow(sign * component));
        sum
    }

    /// Shewchuk's GROW-EXPANSION with zero elimination.
    fn grow(&mut self, value: f64) {
        if value == 0.0 {
            return;
        }
        let mut carry = value;
        let mut kept = 0;
        for i in 0..self.0.len() {
            let (sum, error) = two_sum(carry, self.0[i]);
            carry = sum;
            if error != 0.0 {
                self.0[kept] = error;
                kept += 1;
            }
        }
        self.0.truncate(kept);
        if carry != 0.0 {
            self.0.push(carry);
        }
    }
}

impl Add for &Expansion {
    type Output = Expansion;
    #[inline]
    fn add(self, other: &Expansion) -> Expansion {
        self.plus(1.0, other)
    }
}

impl Neg for &Expansion {
    type Output = Expansion;
    fn neg(self) -> Expansion {
        Expansion(self.0.iter().map(|c| -c).collect())
    }
}

impl Sub for &Expansion {
    type Output = Expansion;
    #[inline]
    fn sub(self, other: &Expansion) -> Expansion {
        self.plus(-1.0, other)
    }
}

impl Mul for &Expansion {
    type Output = Expansion;
    #[inline]
    fn mul(self, other: &Expansion) -> Expansion {
        if let ([a], [b]) = (&self.0[..], &other.0[..]) {
            return Expansion::of(two_product(*a, *b));
        }
        let mut product = Expansion::default();
        for &a in &self.0 {
            for &b in &other.0 {
                let (high, low) = two_product(a, b);
                product.grow(low);
                product.grow(high);
            }
        }
        product
    }
}

/// a + b as a rounded sum and its error (Knuth 1969).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

/// a * b as a rounded product and its error.
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    (product, a.mul_add(b, -product))
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_bigint::BigInt;
    use proptest::prelude::*;

    /// A finite f64 with a small exponent, as an integer over 2^200.
    fn scaled(value: f64) -> BigInt {
        let bits = value.to_bits();
        let exponent = ((bits >> 52) & 0x7ff) as i64;
        let mantissa = (bits & ((1 << 52) - 1)) | if exponent > 0 { 1 << 52 } else { 0 };
        let shift = 200 + exponent.max(1) - 1075;
        let magnitude = BigInt::from(mantissa) << u64::try_from(shift).expect("the test's exponents are small");
        if value < 0.0 { -magnitude } else { magnitude }
    }

    fn total(e: &Expansion) -> BigInt {
        e.0.iter().map(|&c| scaled(c)).sum()
    }

    proptest! {
        #[test]
        fn sums_and_products_equal_big_integers(
            a in prop::collection::vec(-1e6f32..1e6, 1..5),
            b in prop::collection::vec(-1e-3f32..1e-3, 1..5),
        ) {
            let sum = |values: &[f32]| values.iter().fold(Expansion::default(), |e, &v| &e + &v.into());
            let big = |values: &[f32]| values.iter().map(|&v| scaled(v.into())).sum::<BigInt>();
            let (x, y) = (sum(&a), sum(&b));
            prop_assert_eq!(total(&(&x + &y)), big(&a) + big(&b));
            prop_assert_eq!(total(&(&x - &y)), big(&a) - big(&b));
            prop_assert_eq!(total(&(&x * &y)) << 200, big(&a) * big(&b));
            let difference = big(&a) - big(&b);
            let sign = if difference.sign() == num_bigint::Sign::Minus { -1 } else { i32::from(difference != BigInt::ZERO) };
            prop_assert_eq!((&x - &y).signum(), sign);
        }
    }

    #[test]
    fn cancellation_to_zero_is_zero() {
        let x = &Expansion::from(1e16) + &Expansion::from(1.0);
        assert_eq!((&x - &x).signum(), 0);
        assert_eq!((&(&x - &Expansion::from(1e16)) - &Expansion::from(1.0)).signum(), 0);
    }
}
