//! A ray as indices see it: f64, with all the doubt there is about it in one number an axis.
//!
//! An index decides where to look by comparing t at planes. With u = 2^-53, t = (plane - origin) * (1 / direction) is
//! off by less than 4 u of the *distance* |plane| + |origin| seen along the axis, since the operands are f32 numbers
//! and the subtraction is the first thing that rounds. So planes are met `pad` too early and `pad` too late, with a pad
//! of 8 u (reach +
//! |origin|), where the reach bounds the coordinates of all planes: whatever happens at t happens within the bounds that the
//! index computes. An object's ray strays by more ([`placed`](super::placed)); that is added.
//!
//! A component that is zero has an infinite reciprocal: planes ahead of the origin are then never met, those behind it
//! always. Only a plane that goes through the padded origin itself gives 0 * infinity; every comparison is written so
//! that NaN changes nothing.
//!
//! The hit's own t is rounded too, to f64 and then to f32: by 2^-23 of itself in all. That goes into the range.

use crate::math::{Aabb, BVec3, DVec3, UNIT_ROUNDOFF_64};
use crate::ray::Ray;
use crate::trace::nearest::Nearest;

/// A range of t; empty where `from > to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TInterval {
    pub from: f64,
    pub to: f64,
}

impl TInterval {
    pub fn is_empty(self) -> bool {
        self.from > self.to
    }

    /// Cut off at `limit`.
    pub fn until(self, limit: f64) -> Self {
        Self { to: self.to.min(limit), ..self }
    }
}

/// A ray made ready for one index.
#[derive(Clone, Copy, Debug)]
pub(super) struct IndexRay {
    pub origin: DVec3,
    pub direction: DVec3,
    /// 1 / direction; infinite where that is zero.
    pub reciprocal: DVec3,
    /// What coordinates of the index and the origin add up to, on each axis.
    pub span: DVec3,
    /// How far a point of the ray may be from where it is computed to be, on each axis.
    pub pad: DVec3,
    /// What is subtracted from a plane for the earliest t at which it may be met,
    early: DVec3,
    /// and for the latest.
    late: DVec3,
    /// Whether larger coordinates are met first.
    pub backwards: [bool; 3],
    /// The smallest t that counts, rounded down.
    begin: f64,
}

/// By how much of itself a t that is compared with `tmin` or with a hit's t may be off.
const T_ERROR: f64 = 1.0 / (1 << 22) as f64;

impl IndexRay {
    /// `reach` bounds the coordinates of the index's planes, `stray` how far the ray is from where it should be.
    pub fn new(origin: DVec3, direction: DVec3, tmin: f32, reach: DVec3, stray: DVec3) -> Self {
        let span = reach + origin.abs();
        let pad = 8.0 * UNIT_ROUNDOFF_64 * span + stray * (1.0 + 1e-12);
        let reciprocal = direction.recip();
        let forward = pad.copysign(reciprocal);
        let tmin = f64::from(tmin);
        Self {
            origin,
            direction,
            reciprocal,
            span,
            pad,
            early: origin + forward,
            late: origin - forward,
            backwards: reciprocal.cmplt(DVec3::ZERO).into(),
            begin: tmin - tmin * T_ERROR - f64::from(f32::MIN_POSITIVE),
        }
    }

    /// A ray of the world.
    pub fn of_world(ray: &Ray, reach: DVec3, stray: DVec3) -> Self {
        Self::new(ray.origin.as_dvec3(), ray.direction.as_dvec3(), ray.tmin, reach, stray)
    }

    /// Where it is within the box, up to `limit`.
    #[inline]
    pub fn within(&self, min: DVec3, max: DVec3, limit: f64) -> TInterval {
        let backwards = BVec3::from_array(self.backwards);
        let first = DVec3::select(backwards, max, min);
        let second = DVec3::select(backwards, min, max);
        let from = (first - self.early) * self.reciprocal;
        let to = (second - self.late) * self.reciprocal;
        let mut range = TInterval { from: self.begin, to: limit };
        for axis in 0..3 {
            // NaN leaves the range as it is.
            if from[axis] > range.from {
                range.from = from[axis];
            }
            if to[axis] < range.to {
                range.to = to[axis];
            }
        }
        range
    }

    /// The same, of a box in f32.
    #[inline]
    pub fn within_box(&self, bounds: &Aabb, limit: f64) -> TInterval {
        self.within(bounds.min.as_dvec3(), bounds.max.as_dvec3(), limit)
    }

    /// The parts of a range before and behind a plane across an axis; they overlap by the doubt about where it is met.
    #[inline]
    pub fn split(&self, axis: usize, plane: f64, range: TInterval) -> (TInterval, TInterval) {
        let from = (plane - self.early[axis]) * self.reciprocal[axis];
        let to = (plane - self.late[axis]) * self.reciprocal[axis];
        let before = TInterval { to: if to < range.to { to } else { range.to }, ..range };
        let behind = TInterval { from: if from > range.from { from } else { range.from }, ..range };
        (before, behind)
    }
}

/// The largest t at which another hit could still matter.
#[inline]
pub(super) fn limit(nearest: &Nearest) -> f64 {
    let t = f64::from(nearest.limit());
    t + t * T_ERROR + f64::from(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_what_happens_and_little_more() {
        let ray = |d| IndexRay::new(DVec3::new(0.1, 0.2, 0.3), d, 0.0, DVec3::ONE, DVec3::ZERO);
        let range = ray(DVec3::new(0.3, 0.0, -0.0)).within(DVec3::new(0.4, 0.2, 0.3), DVec3::ONE, 9.0);
        assert!(
            range.from <= 1.0 && range.from > 1.0 - 1e-13 && range.to >= 3.0 && range.to < 3.0 + 1e-13,
            "{range:?}"
        );
        let beside = ray(DVec3::new(0.3, 0.0, -0.0)).within(DVec3::new(0.4, 0.3, 0.3), DVec3::ONE, 9.0);
        assert!(beside.is_empty(), "{beside:?}");
        let (before, behind) = ray(DVec3::new(-0.5, 0.0, 0.0)).split(0, -0.4, TInterval { from: 0.0, to: 4.0 });
        assert!(before.to >= 1.0 && behind.from <= 1.0 && before.to - behind.from < 1e-13);
        // Along the plane, on either side of it, and in it.
        let whole = TInterval { from: 0.0, to: 4.0 };
        for (zero, [below, above]) in [(0.0, [0, 1]), (-0.0, [1, 0])] {
            let along = ray(DVec3::new(1.0, zero, 0.0));
            let both = |plane| <[TInterval; 2]>::from(along.split(1, plane, whole));
            assert!(both(0.5)[below] == whole && both(0.5)[above].is_empty());
            assert!(both(0.1)[above] == whole && both(0.1)[below].is_empty());
            assert_eq!(both(0.2), [whole; 2]);
        }
    }
}
