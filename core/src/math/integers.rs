//! A ray's line, and points, as integers: exact arithmetic where numbers have few digits.
//!
//! A float is an integer times a power of two. Along each axis all coordinates are multiples of the least power of any
//! of them, and differences of f32 of like sizes have 25 bits or a few more; a signed volume of three of them, or of a
//! direction and two, is a sum of six products, which i128 holds where the bits of the factors come to 122. So it is
//! for nearly all that is decided exactly: rays through the corners of a grid or of a scan. What is left goes to an
//! [`Expansion`](super::expansion::Expansion), which takes five times as long.

use super::DVec3;
use super::number::{Ring, Vector};

/// A line, and K times three points relative to where it starts. Along each axis lengths, and the direction, are
/// multiples of a power of two of its own, which is in all volumes of three of them.
#[derive(Clone, Debug)]
pub(crate) struct Integers<const K: usize> {
    pub direction: Vector<i64>,
    pub points: [[Vector<i64>; 3]; K],
    /// The direction is also so many powers of two too large: where a volume of three points is divided by one of two
    /// and the direction, the quotient is too small by them.
    pub exponent: i32,
}

/// Beside the bits of three factors: a sign, three for six products, and two for the sum of three such sums, or where
/// two of the factors are edges, one bit longer each.
const SPARE: u32 = 6;

impl<const K: usize> Integers<K> {
    /// None where they have too many digits.
    #[inline]
    pub fn new(origin: DVec3, direction: DVec3, points: &[[DVec3; 3]; K]) -> Option<Self> {
        let (mut all, mut bits, mut way) = ([[[0; 3]; 3]; K], [0; 3], [Float::ZERO; 3]);
        for axis in 0..3 {
            let origin = Float::new(origin[axis]);
            let points = points.map(|points| points.map(|point| Float::new(point[axis])));
            let unit = points.as_flattened().iter().fold(origin.exponent, |unit, point| unit.min(point.exponent));
            let start = origin.over(unit)?;
            let mut largest = 0;
            for (to, point) in all.as_flattened_mut().iter_mut().zip(points.as_flattened()) {
                // Of 62 bits at most, both.
                let relative = point.over(unit)? - start;
                largest |= relative.unsigned_abs();
                to[axis] = relative;
            }
            bits[axis] = length(largest);
            // Where all are zero any unit will do.
            way[axis] = Float::new(direction[axis]).divided_by_power(if unit == i32::MAX { 0 } else { unit });
        }
        let unit = way.iter().fold(i32::MAX, |unit, component| unit.min(component.exponent));
        let direction = [way[0].over(unit)?, way[1].over(unit)?, way[2].over(unit)?];
        let [x, y, z] = bits;
        let [dx, dy, dz] = direction.map(|component| length(component.unsigned_abs()));
        let most = (dx + y + z).max(x + dy + z).max(x + y + dz).max(x + y + z);
        (most + SPARE <= i128::BITS).then_some(Self {
            direction,
            points: all,
            exponent: if unit == i32::MAX { 0 } else { -unit },
        })
    }
}

/// Binary digits.
fn length(x: u64) -> u32 {
    u64::BITS - x.leading_zeros()
}

/// A finite number, as an odd integer and a power of two.
#[derive(Clone, Copy)]
struct Float {
    odd: i64,
    exponent: i32,
}

impl Float {
    const ZERO: Self = Self { odd: 0, exponent: i32::MAX };
    /// Bits of the fraction.
    const FRACTION: u32 = f64::MANTISSA_DIGITS - 1;

    #[inline(always)]
    fn new(x: f64) -> Self {
        let bits = x.to_bits();
        let (fraction, power) = (bits & ((1 << Self::FRACTION) - 1), (bits >> Self::FRACTION & 0x7ff) as i32);
        let whole = if power == 0 { fraction } else { fraction | 1 << Self::FRACTION };
        if whole == 0 {
            return Self::ZERO;
        }
        let even = whole.trailing_zeros();
        let odd = (whole >> even) as i64;
        Self { odd: if x < 0.0 { -odd } else { odd }, exponent: power.max(1) - 1075 + even as i32 }
    }

    /// Over 2 to that power.
    #[inline(always)]
    fn divided_by_power(self, exponent: i32) -> Self {
        if self.odd == 0 { self } else { Self { exponent: self.exponent - exponent, ..self } }
    }

    /// As an integer of at most 62 bits, in units of 2 to that power, which is not above its own.
    #[inline(always)]
    fn over(self, unit: i32) -> Option<i64> {
        if self.odd == 0 {
            return Some(0);
        }
        let shift = (self.exponent - unit) as u32;
        (shift.saturating_add(length(self.odd.unsigned_abs())) <= 62).then(|| self.odd << shift)
    }
}

impl Ring for i128 {
    #[inline(always)]
    fn add(&self, other: &Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn sub(&self, other: &Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn mul(&self, other: &Self) -> Self {
        self * other
    }
}
