//! Objects that move while the shutter is open.
//!
//! Two matrices are given, those of time 0 and 1; in between each entry is interpolated in f64 and rounded to f32, and
//! what comes of it is the transform that a ray of that time meets, exactly. Turning by quaternions, the alternative,
//! keeps lengths where an object turns far within one exposure, but vertices then run along curves, and no box around
//! them is simple. Embree interpolates matrices as well.

use std::borrow::Cow;

use super::Placement;
use crate::error::Error;
use crate::math::{Aabb, Affine3, DAffine3, DMat3, DVec3, UNIT_ROUNDOFF, Vec3, gamma64};

/// Where an object moves to.
#[derive(Clone, Debug)]
pub struct Motion {
    /// From the object's coordinates to the world's at time 1.
    pub end: Affine3,
    /// The most that each entry of the inverse's linear part may be, at any time.
    inverse: DMat3,
    /// The most that the inverse, times the transform, may be off from 1: the largest sum of a row.
    residual: f64,
}

impl Motion {
    /// None where the transform is singular on the way, at the time that is given then; or so nearly that f64 cannot
    /// tell.
    pub(super) fn new(start: &Affine3, end: Affine3) -> Result<Self, f64> {
        let (a, b) = (start.as_daffine3().matrix3, end.as_daffine3().matrix3);
        let mut motion = Self { end, inverse: DMat3::ZERO, residual: 0.0 };
        // A millionth of the volume that is there at the ends: a matrix that rounding alone keeps regular shows
        // nothing.
        let floor = 1e-6 * a.determinant().abs().min(b.determinant().abs());
        motion.include(&a, &b, [0.0, 1.0], floor)?;
        Ok(motion)
    }

    /// Bounds the inverse between two times by halving, until the determinant keeps its sign in Bernstein's form, at
    /// least `floor` large.
    fn include(&mut self, a: &DMat3, b: &DMat3, [from, to]: [f64; 2], floor: f64) -> Result<(), f64> {
        const SHORTEST: f64 = 1e-7;
        let middle = from.midpoint(to);
        let determinants = determinants(a, b);
        let least = determinants.map(f64::abs).into_iter().fold(f64::INFINITY, f64::min);
        let keeps_sign = determinants.iter().all(|d| *d > 0.0) || determinants.iter().all(|d| *d < 0.0);
        let most = a.abs().max_entries(&b.abs());
        let cofactors = cofactors(&most);
        // What rounding may make of a determinant: that of three products of entries, to f32 and in f64.
        let doubt = 8.0 * f64::from(UNIT_ROUNDOFF) * most.x_axis.dot(cofactors.x_axis);
        if keeps_sign && least > (2.0 * doubt).max(floor) {
            let inverse = cofactors.transpose() * (2.0 / least);
            self.inverse = self.inverse.max_entries(&inverse);
            let residual = inverse * most * DVec3::ONE * gamma64(64);
            self.residual = self.residual.max(2.0 * residual.max_element());
            return Ok(());
        }
        if to - from < SHORTEST || !least.is_finite() {
            return Err(middle);
        }
        let half = (*a + *b) * 0.5;
        self.include(a, &half, [from, middle], floor)?;
        self.include(&half, b, [middle, to], floor)
    }
}

/// Says of an instance that [`Motion::new`] gave a time.
pub(super) fn singular_on_the_way(index: usize, name: &str, time: f64) -> Error {
    let why = "matrices are interpolated, so it may neither be mirrored nor turn by half a circle on the way, with all that it stands in";
    Error::Scene(format!("instance {index} ({name:?}) moves through a singular transform near time {time:.3}; {why}"))
}

/// The determinant of (1 - s) a + s b, a cubic, in Bernstein's form: it lies between the least and the largest of
/// these.
fn determinants(a: &DMat3, b: &DMat3) -> [f64; 4] {
    let det = |x: DVec3, y: DVec3, z: DVec3| x.dot(y.cross(z));
    let one = |p: &DMat3, q: &DMat3| {
        det(q.x_axis, p.y_axis, p.z_axis) + det(p.x_axis, q.y_axis, p.z_axis) + det(p.x_axis, p.y_axis, q.z_axis)
    };
    [a.determinant(), one(a, b) / 3.0, one(b, a) / 3.0, b.determinant()]
}

/// The most that the cofactors may be, given the most that the entries of the matrix may be.
fn cofactors(m: &DMat3) -> DMat3 {
    let cross = |p: DVec3, q: DVec3| DVec3::new(p.y * q.z + p.z * q.y, p.z * q.x + p.x * q.z, p.x * q.y + p.y * q.x);
    DMat3::from_cols(cross(m.y_axis, m.z_axis), cross(m.z_axis, m.x_axis), cross(m.x_axis, m.y_axis))
}

/// The larger of each two entries.
trait MaxEntries {
    fn max_entries(&self, other: &Self) -> Self;
}

impl MaxEntries for DMat3 {
    fn max_entries(&self, other: &Self) -> Self {
        Self::from_cols(self.x_axis.max(other.x_axis), self.y_axis.max(other.y_axis), self.z_axis.max(other.z_axis))
    }
}

/// The most that the entries of a placement's transform may be, at any time.
pub(super) struct Extremes {
    /// From the object to the world.
    pub forward: DMat3,
    pub inverse: DMat3,
    pub translation: DVec3,
    /// The most that the inverse, times the transform, is off from 1 because something moves.
    pub residual: f64,
}

impl Placement {
    pub(super) fn extremes(&self) -> Extremes {
        let start = self.to_world.as_daffine3();
        let (forward, inverse, translation) =
            (start.matrix3.abs(), self.to_object.matrix3.abs(), start.translation.abs());
        let Some(motion) = &self.motion else { return Extremes { forward, inverse, translation, residual: 0.0 } };
        let end = motion.end.as_daffine3();
        Extremes {
            forward: forward.max_entries(&end.matrix3.abs()),
            inverse: motion.inverse,
            translation: translation.max(end.translation.abs()),
            residual: motion.residual,
        }
    }

    /// The object where it stands at a time from 0 to 1. Where rounding leaves a transform that nothing undoes,
    /// `to_object` is not finite, and no ray of that time meets the object.
    #[inline]
    pub fn at(&self, time: f32) -> Cow<'_, Self> {
        match &self.motion {
            None => Cow::Borrowed(self),
            Some(motion) => Cow::Owned(self.moved(motion, time)),
        }
    }

    fn moved(&self, motion: &Motion, time: f32) -> Self {
        let s = f64::from(time);
        // Monotone up to f64's rounding, which the rounding to f32 undoes: never beyond either end.
        let between = |a: Vec3, b: Vec3| (a.as_dvec3() * (1.0 - s) + b.as_dvec3() * s).as_vec3();
        let (a, b) = (&self.to_world, &motion.end);
        let to_world = Affine3::from_cols(
            between(a.matrix3.x_axis, b.matrix3.x_axis),
            between(a.matrix3.y_axis, b.matrix3.y_axis),
            between(a.matrix3.z_axis, b.matrix3.z_axis),
            between(a.translation, b.translation),
        );
        Self { to_world, to_object: to_world.as_daffine3().inverse(), motion: None, ..*self }
    }

    /// A box around the object whose own box is `object`, in world coordinates, at all times; rounded outwards.
    pub fn bounds(&self, object: Aabb) -> Aabb {
        let [start, end] = self.ends_of(object, |rows| object.extents(rows));
        start.union(end)
    }

    /// Boxes around the object at time 0 and at time 1; at all times in between it is within the box between these.
    /// Tighter than by its own box alone, of an object of which more is known: `extents` are at least the scalar
    /// products of any of its points with the rows of the given matrix, directions in the object's coordinates, and
    /// with the opposite ones.
    #[inline(always)]
    pub fn ends_of(&self, object: Aabb, extents: impl Fn(&DMat3) -> [DVec3; 2]) -> [Aabb; 2] {
        let Some(motion) = &self.motion else { return [bounds_placed(&self.to_world, object, extents); 2] };
        if object.is_empty() {
            return [Aabb::EMPTY; 2];
        }
        let start = self.to_world.as_daffine3();
        let reach = object.min.abs().max(object.max.abs()).as_dvec3();
        // Points run along straight lines but for the rounding of the transform to f32.
        let end = motion.end.as_daffine3();
        let most = start.matrix3.abs().max_entries(&end.matrix3.abs());
        let rounding = most * reach + start.translation.abs().max(end.translation.abs());
        let slack = rounding * (1.01 * f64::from(UNIT_ROUNDOFF));
        [bounds_under(&start, reach, slack, &extents), bounds_under(&end, reach, slack, &extents)]
    }
}

/// The box in the world of an object that a transform places; `extents` are as of [`Placement::ends_of`].
#[inline(always)]
pub(super) fn bounds_placed(to_world: &Affine3, object: Aabb, extents: impl Fn(&DMat3) -> [DVec3; 2]) -> Aabb {
    if object.is_empty() {
        return Aabb::EMPTY;
    }
    let reach = object.min.abs().max(object.max.abs()).as_dvec3();
    bounds_under(&to_world.as_daffine3(), reach, DVec3::ZERO, &extents)
}

/// `reach` is the largest magnitude of each coordinate of the object.
#[inline(always)]
fn bounds_under(to_world: &DAffine3, reach: DVec3, slack: DVec3, extents: &impl Fn(&DMat3) -> [DVec3; 2]) -> Aabb {
    let DAffine3 { matrix3, translation } = to_world;
    // f64 rounding of the sums, far below one step of f32.
    let slack = slack + (matrix3.abs() * reach + translation.abs()) * gamma64(16);
    let [along, against] = extents(matrix3);
    let (min, max) = ((translation - against - slack).as_vec3(), (translation + along + slack).as_vec3());
    Aabb { min: min.map(f32::next_down), max: max.map(f32::next_up) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Mat3;
    use glam::Quat;

    fn turned(degrees: f32) -> Affine3 {
        Affine3::from_quat(Quat::from_rotation_y(degrees.to_radians()))
    }

    fn placement(to_world: Affine3, end: Affine3) -> Placement {
        let motion = Motion::new(&to_world, end).expect("regular at all times");
        let to_object = to_world.as_daffine3().inverse();
        Placement { instance: 0, object: 0, to_world, to_object, motion: Some(Box::new(motion)) }
    }

    #[test]
    fn half_a_turn_is_singular_in_the_middle_and_less_is_not() {
        let time = Motion::new(&turned(0.0), turned(180.0)).expect_err("the middle is a line");
        assert!((time - 0.5).abs() < 1e-3, "{time}");
        let mirrored = Affine3::from_scale(Vec3::new(-3.0, 1.0, 1.0));
        let time = Motion::new(&Affine3::IDENTITY, mirrored).expect_err("it passes through a plane");
        assert!((time - 0.25).abs() < 1e-3, "{time}");
        for degrees in [10.0, 90.0, 170.0, 179.0] {
            assert!(Motion::new(&turned(0.0), turned(degrees)).is_ok(), "{degrees} degrees");
        }
    }

    /// At many times of many motions: ends are what they were, the inverse is below its bound, corners are in the box.
    #[test]
    fn bounds_hold_at_all_times() {
        let object = Aabb { min: Vec3::new(-1.0, -0.5, 2.0), max: Vec3::new(3.0, 0.25, 4.0) };
        let shear = Mat3::from_cols(Vec3::X, Vec3::new(3.0, 1.0, 0.0), Vec3::Z * 0.01);
        let ends = [
            turned(150.0),
            Affine3 { matrix3: shear, translation: Vec3::new(1e4, -3.0, 0.0) },
            Affine3::from_scale(Vec3::splat(1e-3)),
        ];
        for end in ends {
            let moving = placement(turned(20.0), end);
            let motion = moving.motion.as_ref().expect("it moves");
            let bounds = moving.bounds(object);
            assert_eq!(moving.at(0.0).to_world, moving.to_world);
            assert_eq!(moving.at(1.0).to_world, end);
            for step in 0..=1000 {
                let now = moving.at(step as f32 / 1000.0);
                let residual = (now.to_object.matrix3 * now.to_world.as_daffine3().matrix3 - DMat3::IDENTITY).abs();
                assert!((residual * DVec3::ONE).max_element() <= motion.residual);
                let (inverse, most) = (now.to_object.matrix3.abs(), motion.inverse);
                assert_eq!(inverse.max_entries(&most), most, "step {step}");
                for corner in object.corners() {
                    let point = now.to_world.as_daffine3().transform_point3(corner.as_dvec3());
                    let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
                    assert!(point.cmpge(low).all() && point.cmple(high).all(), "step {step}: {point}");
                }
            }
        }
    }
}
