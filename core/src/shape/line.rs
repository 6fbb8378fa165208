//! A ray's line, and what intervals of it lie inside.
//!
//! Lengths are scaled by a power of two that brings the largest of them near 1, directions by another, which rounds
//! nothing: products of eight factors then neither overflow nor underflow in f64, unless lengths of one ray and one
//! shape differ by more than 1e60.

use crate::math::number::{Bounded, Formula};
use crate::math::{DVec3, Vec3};
use crate::ray::Ray;

/// The relative error that f64 is let pass in what t is computed of: t is then off by at most 2^-26 of itself, an
/// eighth of the rounding to f32.
pub(super) const PRECISION: f64 = 1.0 / (1 << 28) as f64;

/// The values of t where a line crosses a shape, rising: none, one or two.
pub(super) type Roots = [Option<f64>; 2];

/// No crossing.
pub(super) const NO_ROOTS: Roots = [None; 2];

/// A ray's line in units of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// Start, in these units.
    pub origin: DVec3,
    /// Direction, in these units.
    pub direction: DVec3,
    /// From the ray's lengths to these.
    scale: f64,
    /// From these t to the ray's.
    unit: f64,
}

impl Line {
    /// `size` bounds the coordinates and lengths of the shape. The ray is valid.
    #[inline]
    pub fn new(ray: &Ray, size: f32) -> Self {
        let length = power_of_two(ray.origin.abs().max_element().max(size));
        let speed = power_of_two(ray.direction.abs().max_element());
        // Of powers of two: exact.
        let (scale, pace) = (1.0 / length, 1.0 / speed);
        let (origin, direction) = (ray.origin.as_dvec3() * scale, ray.direction.as_dvec3() * pace);
        Self { origin, direction, scale, unit: length * pace }
    }

    /// A point or a vector in these units.
    #[inline]
    pub fn place(&self, v: Vec3) -> DVec3 {
        v.as_dvec3() * self.scale
    }

    /// A point that is f64, in these units.
    #[inline]
    pub fn place_f64(&self, v: DVec3) -> DVec3 {
        v * self.scale
    }

    /// A length in these units.
    #[inline]
    pub fn length(&self, x: f32) -> f64 {
        f64::from(x) * self.scale
    }

    /// The ray's t for one of this line's.
    #[inline]
    pub fn t(&self, t: f64) -> f64 {
        t * self.unit
    }
}

/// The largest power of two that is not above `x`, for a normal number.
#[inline]
fn power_of_two(x: f32) -> f64 {
    f64::from_bits(f64::from(x.max(f32::MIN_POSITIVE)).to_bits() & 0x7ff0_0000_0000_0000)
}

/// A quotient that is off by at most 2^-26 of itself; None for a denominator of 0.
#[inline]
pub(super) fn quotient(parts: &impl Formula<2>) -> Option<f64> {
    let good = |[n, d]: &[Bounded; 2]| n.is_within(PRECISION) && d.is_within(PRECISION);
    let [numerator, denominator] = parts.values(good);
    (denominator != 0.0).then(|| numerator / denominator)
}

/// A part of a line, closed; empty unless `enter <= exit`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interval {
    pub enter: f64,
    pub exit: f64,
}

impl Interval {
    /// All of the line.
    pub const ALL: Self = Self { enter: f64::NEG_INFINITY, exit: f64::INFINITY };
    /// Nothing of it.
    pub const EMPTY: Self = Self { enter: f64::INFINITY, exit: f64::NEG_INFINITY };

    /// Between two t in any order.
    pub fn between(a: f64, b: f64) -> Self {
        Self { enter: a.min(b), exit: a.max(b) }
    }

    /// What lies in both.
    pub fn and(self, other: Self) -> Self {
        Self { enter: self.enter.max(other.enter), exit: self.exit.min(other.exit) }
    }

    /// Its ends, where it is not empty.
    pub fn ends(&self) -> Roots {
        let is_some = self.enter <= self.exit;
        [is_some.then_some(self.enter), is_some.then_some(self.exit)]
    }
}
