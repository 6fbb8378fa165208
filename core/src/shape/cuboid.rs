//! A box along the axes.
//!
//! The line is inside between the last of the three slabs it enters and the first that it leaves (Kay, Kajiya 1986,
//! *Ray tracing complex scenes*). Each t is a difference and a quotient in f64, off by at most 2^-51 of itself; where
//! that cannot tell which of two comes first, their order is decided exactly. So is, then, whether a ray through an
//! edge or a corner hits: it does. A component of the direction that is zero asks whether the origin lies in the slab,
//! and nothing is divided by it.

use super::distance::Support;
use super::line::{Interval, NO_ROOTS, Roots};
use super::{InvalidShape, in_f32};
use crate::math::number::{Formula, Number};
use crate::math::{Aabb, DVec2, DVec3, Vec3, is_traceable};
use crate::ray::Ray;

/// A box along the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner; equal to the smallest on an axis where the box is flat.
    pub max: Vec3,
}

impl Cuboid {
    /// The box between two corners.
    ///
    /// # Errors
    /// For corners that are not finite, or where `min` is not below `max` on two axes at least, and not above on any.
    pub fn new(min: Vec3, max: Vec3) -> Result<Self, InvalidShape> {
        let cuboid = Self { min, max };
        cuboid.check().map(|()| cuboid)
    }

    pub(super) fn check(&self) -> Result<(), InvalidShape> {
        let Self { min, max } = *self;
        InvalidShape::unless(is_traceable(min) && is_traceable(max), || {
            format!("the corners {min} and {max} are not finite")
        })?;
        InvalidShape::unless(min.cmple(max).all(), || {
            format!("the corner {min} is not the smallest; give it first, and {max} second, on every axis")
        })?;
        InvalidShape::unless(min.cmplt(max).bitmask().count_ones() >= 2, || {
            format!("between {min} and {max} is no area; let them differ on two axes at least")
        })
    }

    pub(super) fn bounds(&self) -> Aabb {
        Aabb { min: self.min, max: self.max }
    }

    pub(super) fn translated(&self, offset: DVec3) -> Self {
        Self { min: in_f32(self.min.as_dvec3() + offset), max: in_f32(self.max.as_dvec3() + offset) }
    }

    #[inline]
    pub(super) fn roots(&self, ray: &Ray) -> Roots {
        let mut slabs = [None; 3];
        for (axis, slab) in slabs.iter_mut().enumerate() {
            let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
            if direction != 0.0 {
                let (first, last) = (self.min[axis], self.max[axis]);
                let (first, last) = if direction > 0.0 { (first, last) } else { (last, first) };
                *slab = Some([first, last].map(|bound| Crossing { bound, origin, direction }));
            } else if !(self.min[axis]..=self.max[axis]).contains(&origin) {
                return NO_ROOTS;
            }
        }
        let mut inside = Interval::ALL;
        for [enter, exit] in slabs.iter().flatten() {
            let is_ordered = slabs.iter().flatten().all(|[_, other]| enter.is_before(other));
            if !is_ordered {
                return NO_ROOTS;
            }
            inside = inside.and(Interval { enter: enter.t(), exit: exit.t() });
        }
        // Where they are equal but for rounding, they may be rounded to the wrong order.
        [Some(inside.enter), Some(inside.exit.max(inside.enter))]
    }

    /// The plane of the face that is met at `t`, one of the roots.
    pub(super) fn support(&self, ray: &Ray, t: f64) -> Support {
        for axis in (0..3).filter(|&axis| ray.direction[axis] != 0.0) {
            for corner in [self.min, self.max] {
                let crossing =
                    Crossing { bound: corner[axis], origin: ray.origin[axis], direction: ray.direction[axis] };
                if crossing.t() == t {
                    return Support::Plane(corner.as_dvec3(), DVec3::AXES[axis]);
                }
            }
        }
        Support::Itself
    }

    /// The axis of the face that is nearest, and whether it is the upper one.
    fn face(&self, at: DVec3) -> (usize, bool) {
        let (low, high) = (at - self.min.as_dvec3(), self.max.as_dvec3() - at);
        let distance = low.abs().min(high.abs());
        let axis = (0..3).min_by(|&i, &j| distance[i].total_cmp(&distance[j])).unwrap_or(0);
        (axis, high[axis].abs() <= low[axis].abs())
    }

    pub(super) fn normal(&self, at: DVec3) -> DVec3 {
        let (axis, is_upper) = self.face(at);
        DVec3::AXES[axis] * if is_upper { 1.0 } else { -1.0 }
    }

    /// Over [0, 1] on each face, along the two axes that follow the face's own; on lower faces u runs the other way, so
    /// that a texture is mirrored on none.
    pub(super) fn uv(&self, at: DVec3) -> DVec2 {
        let (axis, is_upper) = self.face(at);
        let size = (self.max.as_dvec3() - self.min.as_dvec3()).max(DVec3::splat(f64::MIN_POSITIVE));
        let share = (at - self.min.as_dvec3()) / size;
        let u = share[(axis + 1) % 3];
        DVec2::new(if is_upper { u } else { 1.0 - u }, share[(axis + 2) % 3])
    }
}

/// Where a line crosses a plane across an axis.
#[derive(Clone, Copy)]
struct Crossing {
    bound: f32,
    origin: f32,
    /// Not 0.
    direction: f32,
}

impl Crossing {
    #[inline]
    fn t(&self) -> f64 {
        (f64::from(self.bound) - f64::from(self.origin)) / f64::from(self.direction)
    }

    /// Whether its t is not above that of `other`, exactly.
    #[inline]
    fn is_before(&self, other: &Self) -> bool {
        let (t, limit) = (self.t(), other.t());
        if (t - limit).abs() > t.abs().max(limit.abs()) * (8.0 * f64::EPSILON) {
            return t < limit;
        }
        let turned = (self.direction < 0.0) != (other.direction < 0.0);
        let [difference] = Difference(*self, *other).signs();
        if turned { difference >= 0 } else { difference <= 0 }
    }
}

/// The difference of two t, times both directions.
struct Difference(Crossing, Crossing);

impl Formula<1> for Difference {
    fn evaluate<N: Number>(&self) -> [N; 1] {
        let way = |c: &Crossing| N::new(c.bound.into()).sub(&N::new(c.origin.into()));
        let speed = |c: &Crossing| N::new(c.direction.into());
        [way(&self.0).mul(&speed(&self.1)).sub(&way(&self.1).mul(&speed(&self.0)))]
    }
}
