//! Numbers without rounding, and numbers that know how much they were rounded.
//!
//! Every f32 is an integer times a power of two. [`Dyadic`] keeps both, so sums and products are exact, whatever the
//! scale; [`Rational`] is a quotient of two. They are slow, so a formula is first evaluated in [`Approx`], which is
//! f64 with a running error bound (Higham 2002, *Accuracy and Stability of Numerical Algorithms*, section 3.3): where
//! the bound leaves the sign open, and only there, it is evaluated again exactly. [`Ring`] lets one formula serve both.
//!
//! Expansions of f64 (Shewchuk 1997) would be faster, and would overflow and underflow at scales that f32 reaches.

use std::cmp::Ordering;

use num_bigint::{BigInt, Sign};
use num_traits::{Signed, Zero};

use crate::math::{UNIT_ROUNDOFF_64, Vec3};

/// What a polynomial in f32 numbers is made of.
pub trait Ring: Clone {
    /// A finite f32, exactly.
    fn new(x: f32) -> Self;
    /// The sum.
    fn add(&self, other: &Self) -> Self;
    /// The difference.
    fn sub(&self, other: &Self) -> Self;
    /// The product.
    fn mul(&self, other: &Self) -> Self;
}

/// A vector over a ring.
pub type Vector<R> = [R; 3];

/// A finite vector, exactly.
pub fn vector<R: Ring>(v: Vec3) -> Vector<R> {
    v.to_array().map(R::new)
}

/// Applies `f` to each pair of components.
pub fn zip<R: Ring>(a: &Vector<R>, b: &Vector<R>, f: impl Fn(&R, &R) -> R) -> Vector<R> {
    [f(&a[0], &b[0]), f(&a[1], &b[1]), f(&a[2], &b[2])]
}

/// The scalar product.
pub fn dot<R: Ring>(a: &Vector<R>, b: &Vector<R>) -> R {
    a[0].mul(&b[0]).add(&a[1].mul(&b[1])).add(&a[2].mul(&b[2]))
}

/// The vector product.
pub fn cross<R: Ring>(a: &Vector<R>, b: &Vector<R>) -> Vector<R> {
    let minor = |i: usize, j: usize| a[i].mul(&b[j]).sub(&a[j].mul(&b[i]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

/// The determinant of the matrix with these columns.
pub fn det<R: Ring>(a: &Vector<R>, b: &Vector<R>, c: &Vector<R>) -> R {
    dot(a, &cross(b, c))
}

/// An integer times a power of two.
#[derive(Clone, Debug)]
pub struct Dyadic {
    mantissa: BigInt,
    exponent: i64,
}

impl Dyadic {
    /// A finite f64, exactly.
    pub fn from_f64(x: f64) -> Self {
        debug_assert!(x.is_finite(), "only finite numbers are dyadic");
        let bits = x.to_bits();
        let (field, fraction) = ((bits >> 52 & 0x7ff) as i64, (bits & ((1 << 52) - 1)) as i64);
        // Subnormal numbers have the exponent of the smallest normal ones, and no hidden bit.
        let magnitude = if field == 0 { fraction } else { fraction | 1 << 52 };
        let mantissa = BigInt::from(if x.is_sign_negative() { -magnitude } else { magnitude });
        Self { mantissa, exponent: field.max(1) - 1075 }
    }

    /// -1, 0 or 1.
    pub fn signum(&self) -> i32 {
        match self.mantissa.sign() {
            Sign::Minus => -1,
            Sign::NoSign => 0,
            Sign::Plus => 1,
        }
    }

    /// The nearest f64; infinite where it is too large.
    pub fn to_f64(&self) -> f64 {
        let surplus = self.mantissa.bits().saturating_sub(64);
        let mut top = self.mantissa.magnitude() >> surplus;
        if (&top << surplus) != *self.mantissa.magnitude() {
            // What was cut off still decides between two f64 that are equally near to `top`.
            top |= num_bigint::BigUint::from(1u32);
        }
        let digits = top.iter_u64_digits().next().unwrap_or(0) as f64;
        let exponent = (self.exponent + surplus as i64).clamp(-3000, 3000) as i32;
        libm::scalbn(digits, exponent).copysign(f64::from(self.signum()))
    }

    /// The square root of a number that is not negative, rounded down, with at least 256 significant bits.
    pub fn sqrt(&self) -> Self {
        let up = 512u64.saturating_sub(self.mantissa.bits()) as i64;
        // An even exponent, so that its root is a power of two.
        let up = up + ((self.exponent - up) & 1);
        Self { mantissa: (&self.mantissa << up).sqrt(), exponent: (self.exponent - up) / 2 }
    }

    /// The same number with its sign changed.
    #[must_use]
    pub fn neg(&self) -> Self {
        Self { mantissa: -&self.mantissa, exponent: self.exponent }
    }

    /// Both mantissas, brought to the smaller exponent.
    fn align(&self, other: &Self) -> (BigInt, BigInt, i64) {
        let exponent = self.exponent.min(other.exponent);
        let shift = |x: &Self| &x.mantissa << (x.exponent - exponent);
        (shift(self), shift(other), exponent)
    }
}

impl Ring for Dyadic {
    fn new(x: f32) -> Self {
        Self::from_f64(f64::from(x))
    }

    fn add(&self, other: &Self) -> Self {
        let (a, b, exponent) = self.align(other);
        Self { mantissa: a + b, exponent }
    }

    fn sub(&self, other: &Self) -> Self {
        let (a, b, exponent) = self.align(other);
        Self { mantissa: a - b, exponent }
    }

    fn mul(&self, other: &Self) -> Self {
        Self { mantissa: &self.mantissa * &other.mantissa, exponent: self.exponent + other.exponent }
    }
}

/// A quotient of two dyadic numbers.
#[derive(Clone, Debug)]
pub struct Rational {
    numerator: Dyadic,
    /// Above 0.
    denominator: Dyadic,
}

impl Rational {
    /// `numerator / denominator`; None for a denominator of 0.
    pub fn new(numerator: Dyadic, denominator: Dyadic) -> Option<Self> {
        match denominator.signum() {
            0 => None,
            1 => Some(Self { numerator, denominator }),
            _ => Some(Self { numerator: numerator.neg(), denominator: denominator.neg() }),
        }
    }

    /// As `cmp`, of roots that are rounded to 256 bits, where those of two quadratics may be one: equal where they
    /// differ by 2^-200 of themselves.
    pub fn cmp_root(&self, other: &Self) -> Ordering {
        let (here, there) = (self.numerator.mul(&other.denominator), other.numerator.mul(&self.denominator));
        let difference = here.sub(&there);
        let magnitude = |x: Dyadic| if x.signum() < 0 { x.neg() } else { x };
        let sign = difference.signum();
        let excess = magnitude(difference).mul(&Dyadic::from_f64(2f64.powi(200))).sub(&magnitude(there));
        if excess.signum() <= 0 { Ordering::Equal } else { sign.cmp(&0) }
    }

    /// The sign of `constant + slope * self`.
    pub fn sign_of(&self, constant: &Dyadic, slope: &Dyadic) -> i32 {
        constant.mul(&self.denominator).add(&slope.mul(&self.numerator)).signum()
    }

    /// The nearest f64; infinite where it is too large.
    pub fn to_f64(&self) -> f64 {
        let (n, d) = (&self.numerator, &self.denominator);
        if n.mantissa.is_zero() {
            return 0.0;
        }
        // At least 66 bits of quotient; the last is set where the division leaves a rest.
        let up = (66 + d.mantissa.bits() as i64 - n.mantissa.bits() as i64).max(0);
        let scaled = n.mantissa.abs() << up;
        let quotient = &scaled / &d.mantissa;
        let rest = &quotient * &d.mantissa != scaled;
        let mantissa = (quotient << 1) + BigInt::from(u8::from(rest));
        let magnitude = Dyadic { mantissa, exponent: n.exponent - d.exponent - up - 1 }.to_f64();
        magnitude.copysign(f64::from(n.signum()))
    }
}

impl Ord for Rational {
    fn cmp(&self, other: &Self) -> Ordering {
        let difference = self.numerator.mul(&other.denominator).sub(&other.numerator.mul(&self.denominator));
        difference.signum().cmp(&0)
    }
}

impl PartialOrd for Rational {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Rational {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Rational {}

/// An f64 and a bound of its distance from the exact value.
#[derive(Clone, Copy, Debug)]
pub struct Approx {
    /// The rounded value.
    pub value: f64,
    /// The exact value lies within `value - error ..= value + error`.
    pub error: f64,
}

impl Approx {
    /// The sign, where the error leaves no doubt: -1 or 1, and 0 only for an exact zero.
    pub fn signum(&self) -> Option<i32> {
        match self.value.abs() {
            size if size > self.error => Some(if self.value > 0.0 { 1 } else { -1 }),
            0.0 if self.error == 0.0 => Some(0),
            _ => None,
        }
    }

    /// `value` after one rounding of operands whose own errors add up to `inherited`.
    fn rounded(value: f64, inherited: f64) -> Self {
        // The sums and products in the bound are rounded themselves, six times at most, and the bound's own products
        // may underflow, by less than the smallest normal number.
        const ENLARGE: f64 = 1.0 + 4.0 * f64::EPSILON;
        Self { value, error: (inherited + value.abs() * UNIT_ROUNDOFF_64) * ENLARGE }
    }
}

impl Ring for Approx {
    fn new(x: f32) -> Self {
        Self { value: f64::from(x), error: 0.0 }
    }

    fn add(&self, other: &Self) -> Self {
        Self::rounded(self.value + other.value, self.error + other.error)
    }

    fn sub(&self, other: &Self) -> Self {
        Self::rounded(self.value - other.value, self.error + other.error)
    }

    fn mul(&self, other: &Self) -> Self {
        let (a, b) = (self, other);
        let inherited = a.value.abs() * b.error + b.value.abs() * a.error + a.error * b.error;
        Self::rounded(a.value * b.value, inherited + f64::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn f64_survives_the_way_there_and_back() {
        for x in [0.0, 1.0, -1.5, 0.1, f64::MAX, f64::MIN_POSITIVE, 5e-324, -1e-310] {
            assert_eq!(Dyadic::from_f64(x).to_f64(), x);
        }
    }

    #[test]
    fn sums_do_not_lose_what_f64_loses() {
        let d = Dyadic::from_f64;
        let sum = d(1e300).add(&d(1e-300)).sub(&d(1e300));
        assert_eq!(sum.to_f64(), 1e-300);
        assert_eq!(d(1e-300).mul(&d(1e-300)).mul(&d(1e300)).mul(&d(1e300)).signum(), 1);
    }

    #[test]
    fn quotients_are_rounded_to_nearest() {
        for (a, b) in [(1.0, 3.0), (-2.0, 7.0), (1e30, 3e-30), (5.0, 0.1), (0.0, 3.0), (1.0, -3.0)] {
            let quotient = Rational::new(Dyadic::from_f64(a), Dyadic::from_f64(b)).unwrap();
            assert_eq!(quotient.to_f64(), a / b, "{a} / {b}");
        }
        assert!(Rational::new(Dyadic::from_f64(1.0), Dyadic::from_f64(0.0)).is_none());
    }

    #[test]
    fn rationals_compare_where_f64_cannot() {
        let third = |n: f64| Rational::new(Dyadic::from_f64(n), Dyadic::from_f64(3.0 * n)).unwrap();
        let more = Rational::new(Dyadic::from_f64(1.0).add(&Dyadic::from_f64(1e-40)), Dyadic::from_f64(3.0)).unwrap();
        assert_eq!(third(1.0), third(5.0));
        assert!(more > third(1.0));
        assert_eq!(more.to_f64(), third(1.0).to_f64());
    }

    #[test]
    fn square_roots_square_back() {
        for x in [2.0, 0.5, 1e-200, 3e150, 4.0, 0.0] {
            let root = Dyadic::from_f64(x).sqrt();
            let defect = root.mul(&root).sub(&Dyadic::from_f64(x)).to_f64();
            assert!(defect.abs() <= x * 1e-60, "{x}: {defect}");
        }
    }

    #[test]
    fn the_running_error_covers_the_exact_value() {
        let entries = [0.1f32, -3.7e5, 2.5e-8, 7.0, 1.1e-3, -0.3, 0.2, 9.9e4, -1e-7];
        for turn in 0..9 {
            let entry = |k: usize| entries[(k + turn * 2) % 9];
            let columns = [0, 3, 6].map(|k| Vec3::new(entry(k), entry(k + 1), entry(k + 2)));
            let approximate: Approx = det(&vector(columns[0]), &vector(columns[1]), &vector(columns[2]));
            let exact: Dyadic = det(&vector(columns[0]), &vector(columns[1]), &vector(columns[2]));
            let error = exact.sub(&Dyadic::from_f64(approximate.value)).to_f64().abs();
            assert!(error <= approximate.error && approximate.error < 1e-9, "{error} {approximate:?}");
        }
    }
}
