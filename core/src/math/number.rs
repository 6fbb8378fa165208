//! Formulas that are evaluated in f64 with a bound on the error, and exactly where the bound leaves doubt.
//!
//! A [`Formula`] is written once, over any [`Number`]: [`Bounded`] carries a running error bound (Higham 2002,
//! *Accuracy and Stability of Numerical Algorithms*, section 3.3), [`Expansion`] is exact. [`Formula::values`] takes
//! the first where it is good enough for its user, else the second. So a formula need not be stable, only short: what
//! cancels is noticed. A bound derived by hand for each formula, the simpler alternative at run time, is a page of
//! analysis a formula.

use super::expansion::{Expansion, count_decision};
use super::{DVec3, UNIT_ROUNDOFF_64};

/// What sums and products are computed in.
pub trait Ring: Clone {
    /// The sum.
    fn add(&self, other: &Self) -> Self;
    /// The difference.
    fn sub(&self, other: &Self) -> Self;
    /// The product.
    fn mul(&self, other: &Self) -> Self;
}

/// What a polynomial is evaluated in.
pub trait Number: Ring {
    /// A finite number, exactly.
    fn new(x: f64) -> Self;
}

/// An f64, and how far it may be from the exact value.
#[derive(Clone, Copy, Debug)]
pub struct Bounded {
    /// The rounded value.
    pub value: f64,
    /// Its error is less than this by more than the rounding of the bound itself, once it is held against
    /// [`Bounded::MARGIN`].
    pub error: f64,
}

impl Bounded {
    /// The bound is computed in f64, too: each operation loses at most three roundings of it, and no formula has 1e13.
    pub const MARGIN: f64 = 1.01;

    /// Whether the relative error is at most `precision`; an exact zero is precise.
    #[inline]
    pub fn is_within(&self, precision: f64) -> bool {
        self.error * Self::MARGIN <= self.value.abs() * precision
    }

    /// Whether the sign is that of the exact value.
    #[inline]
    pub fn has_sign(&self) -> bool {
        self.error * Self::MARGIN < self.value.abs() || self.error == 0.0
    }
}

impl Number for Bounded {
    #[inline(always)]
    fn new(value: f64) -> Self {
        Self { value, error: 0.0 }
    }
}

impl Ring for Bounded {
    #[inline(always)]
    fn add(&self, other: &Self) -> Self {
        let value = self.value + other.value;
        Self { value, error: self.error + other.error + value.abs() * UNIT_ROUNDOFF_64 }
    }
    #[inline(always)]
    fn sub(&self, other: &Self) -> Self {
        let value = self.value - other.value;
        Self { value, error: self.error + other.error + value.abs() * UNIT_ROUNDOFF_64 }
    }
    #[inline(always)]
    fn mul(&self, other: &Self) -> Self {
        let (a, b) = (self, other);
        let value = a.value * b.value;
        let inherited = a.value.abs() * b.error + b.value.abs() * a.error + a.error * b.error;
        Self { value, error: inherited + value.abs() * UNIT_ROUNDOFF_64 }
    }
}

impl Number for Expansion {
    fn new(x: f64) -> Self {
        x.into()
    }
}

impl Ring for Expansion {
    fn add(&self, other: &Self) -> Self {
        self + other
    }
    fn sub(&self, other: &Self) -> Self {
        self - other
    }
    fn mul(&self, other: &Self) -> Self {
        self * other
    }
}

/// K polynomials of finite f64 numbers.
pub trait Formula<const K: usize> {
    /// Their values.
    fn evaluate<N: Number>(&self) -> [N; K];

    /// Their values in f64, where the error bounds are `good` enough; else off by at most one ulp.
    #[inline]
    fn values(&self, good: impl Fn(&[Bounded; K]) -> bool) -> [f64; K] {
        let quick = self.evaluate::<Bounded>();
        if good(&quick) { quick.map(|x| x.value) } else { exactly(self) }
    }

    /// Their signs (-1, 0 or 1), exactly.
    #[inline]
    fn signs(&self) -> [i32; K] {
        let values = self.values(|values| values.iter().all(Bounded::has_sign));
        values.map(|x| i32::from(x > 0.0) - i32::from(x < 0.0))
    }
}

/// The values by exact arithmetic, off by at most one ulp.
#[cold]
#[inline(never)]
pub fn exactly<const K: usize>(formula: &(impl Formula<K> + ?Sized)) -> [f64; K] {
    count_decision();
    formula.evaluate::<Expansion>().map(|x| x.estimate())
}

/// A vector of numbers.
pub type Vector<N> = [N; 3];

/// A finite vector, exactly.
#[inline(always)]
pub fn vector<N: Number>(v: DVec3) -> Vector<N> {
    [N::new(v.x), N::new(v.y), N::new(v.z)]
}

/// The difference.
#[inline(always)]
pub fn minus<N: Ring>(a: &Vector<N>, b: &Vector<N>) -> Vector<N> {
    [a[0].sub(&b[0]), a[1].sub(&b[1]), a[2].sub(&b[2])]
}

/// The sum.
#[inline(always)]
pub fn plus<N: Ring>(a: &Vector<N>, b: &Vector<N>) -> Vector<N> {
    [a[0].add(&b[0]), a[1].add(&b[1]), a[2].add(&b[2])]
}

/// The product with a number.
#[inline(always)]
pub fn times<N: Ring>(a: &Vector<N>, b: &N) -> Vector<N> {
    [a[0].mul(b), a[1].mul(b), a[2].mul(b)]
}

/// The scalar product.
#[inline(always)]
pub fn dot<N: Ring>(a: &Vector<N>, b: &Vector<N>) -> N {
    a[0].mul(&b[0]).add(&a[1].mul(&b[1])).add(&a[2].mul(&b[2]))
}

/// The vector product.
#[inline(always)]
pub fn cross<N: Ring>(a: &Vector<N>, b: &Vector<N>) -> Vector<N> {
    let minor = |i: usize, j: usize| a[i].mul(&b[j]).sub(&a[j].mul(&b[i]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (x + y) (x - y) - x^2: -y^2, of which f64 sees nothing for a small y.
    struct Cancelling {
        x: f64,
        y: f64,
    }

    impl Formula<1> for Cancelling {
        fn evaluate<N: Number>(&self) -> [N; 1] {
            let (x, y) = (N::new(self.x), N::new(self.y));
            [x.add(&y).mul(&x.sub(&y)).sub(&x.mul(&x))]
        }
    }

    #[test]
    fn what_cancels_is_noticed_and_computed_exactly() {
        for y in [1e-3, 1e-9, 1e-30, 1e-100] {
            let formula = Cancelling { x: 3.7, y };
            let [quick] = formula.evaluate::<Bounded>();
            assert!((quick.value + y * y).abs() <= quick.error * Bounded::MARGIN, "{y}");
            assert_eq!(formula.signs(), [-1]);
            let [value] = formula.values(|[x]| x.is_within(1e-9));
            assert!((value / (y * y) + 1.0).abs() < 1e-9, "{y}: {value}");
        }
        assert_eq!(Cancelling { x: 3.7, y: 0.0 }.signs(), [0]);
    }

    #[test]
    fn bounds_cover_the_exact_value_and_are_not_idle() {
        struct Triple([DVec3; 3]);
        impl Formula<1> for Triple {
            fn evaluate<N: Number>(&self) -> [N; 1] {
                let [a, b, c] = self.0.map(vector::<N>);
                [dot(&a, &cross(&minus(&b, &a), &plus(&c, &times(&a, &N::new(0.1)))))]
            }
        }
        for i in 0..500 {
            let x = |k: i32| libm::sin(f64::from(7 * i + 13 * k)) * libm::exp(libm::sin(f64::from(k * i)) * 9.0);
            let v = |k| DVec3::new(x(k), x(k + 1), x(k + 2));
            let triple = Triple([v(0), v(3), v(6)]);
            let [quick] = triple.evaluate::<Bounded>();
            let [exact] = triple.evaluate::<Expansion>();
            let error = (&exact - &quick.value.into()).estimate().abs();
            assert!(error <= quick.error * Bounded::MARGIN, "{error} {quick:?}");
            let [a, b, c] = triple.0.map(DVec3::length);
            assert!(quick.error <= 1e-14 * a * (a + b) * (a + c), "{quick:?}");
        }
    }
}
