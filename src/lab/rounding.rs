//! What an engine may answer for a ray and a primitive, when it computes in f32 or in f64.
//!
//! The bounds are a priori rounding-error bounds (Higham 2002, chapter 3): a value computed by n rounded operations
//! from terms whose absolute values add up to P (the *permanent*: the same polynomial, every sign a plus) is off by at
//! most gamma(n) P. Terms of second order are added with gamma(n) u. Below, |x| is taken component by component; a, b,
//! c are corners relative to the ray's origin.
//!
//! - **Edges**, in Plücker form det(d, a, b) = d . ((b - a) x (b + a)) / 2. The corners are rounded when the origin is
//!   subtracted, which moves the determinant by u (|a| . |d x b| + |b| . |d x a|) and no more, since edges are formed
//!   from the same rounded corners; what follows rounds seven times (side, sum, product, difference, product, two
//!   sums): gamma(7) perm(d, b - a, |a| + |b|). Möller-Trumbore and Woop need no more operations on no larger terms.
//!   Embree accepts, beyond that, edges that are wrong by up to one epsilon of the sum of the three.
//! - **t** = n . a / n . d with n the product of two sides. A rounded corner moves the hit by u |n| . |a| / |n . d|
//!   times its barycentric weight; the rest is gamma(10) perm(a, e, e) in the numerator and gamma(10) perm(d, e, e) in
//!   the denominator, with e the longest side. Where the error of the denominator reaches it (a ray that grazes the
//!   plane) t can be anything.
//! - **Instances**: engines move the ray, not the triangle. The inverse matrix is the adjugate over the determinant;
//!   its error makes one of the moved origin, o', and direction, d': |o'| . |d x (b - a)| and |d'| . |a x b| in an
//!   edge,
//!   |n| . |o'| and t |n| . |d'| in the numerator of t.
//! - **Shapes** are intersected in f64, or exactly, by every engine; only the ray that they are given, which is f32, is
//!   rounded, and the boxes around them are met in f32 (`rounding/shapes.rs`).
//!
//! The counts are rounded up to [`Precision::operations`]. Measuring the error instead, by evaluating each engine's
//! formula again, would need the engine's own formula, and Embree has one for each instruction set.
#![allow(clippy::neg_cmp_op_on_partial_ord)] // Negated comparisons, so that NaN from an overflow leaves doubt.

use super::exact::{Approx, cross, det, vector};
use super::oracle::{Body, Primitive};
use crate::math::{Affine3, DMat3, DVec3, UNIT_ROUNDOFF, UNIT_ROUNDOFF_64, Vec3, gamma, gamma64, is_traceable};
use crate::ray::Ray;

mod shapes;
mod triangle;

/// What an engine computes in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// f32: Embree.
    Single,
    /// f64, and t rounded to f32 at the end: the native engine's distances.
    Double,
}

impl Precision {
    /// Rounded operations that are allowed for.
    pub const fn operations(self) -> u32 {
        match self {
            Self::Single => 16,
            Self::Double => 64,
        }
    }

    fn unit(self) -> f64 {
        match self {
            Self::Single => f64::from(UNIT_ROUNDOFF),
            Self::Double => UNIT_ROUNDOFF_64,
        }
    }

    fn gamma(self) -> f64 {
        match self {
            Self::Single => f64::from(gamma(self.operations())),
            Self::Double => gamma64(self.operations()),
        }
    }
}

/// The answers that rounding allows.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Whether the ray's line may be found to meet the primitive.
    pub may_meet: bool,
    /// Whether the ray's line may be found to pass it by.
    pub may_pass: bool,
    /// Where, from smallest to largest t, once for each time that the line meets the primitive.
    pub roots: [(f64, f64); 2],
}

impl Outcome {
    const MISS: Self = Self { may_meet: false, may_pass: true, roots: [NOWHERE; 2] };
    const ANYTHING: Self = Self { may_meet: true, may_pass: true, roots: [ANYWHERE; 2] };

    /// Whether a hit within the ray's range is a possible answer.
    pub fn may_hit(&self, ray: &Ray) -> bool {
        self.may_meet && self.roots.iter().any(|root| may_be_in_range(ray, root))
    }

    /// Whether a miss is a possible answer.
    pub fn may_miss(&self, ray: &Ray) -> bool {
        self.may_pass || !self.roots.iter().any(|root| is_in_range(ray, root))
    }

    /// The smallest and the largest t that a hit may be given.
    pub fn span(&self, ray: &Ray) -> (f64, f64) {
        let lowest = self.roots.iter().find(|root| may_be_in_range(ray, root)).unwrap_or(&self.roots[0]).0;
        let highest = self.roots.iter().find(|root| is_in_range(ray, root)).unwrap_or(&self.roots[1]).1;
        (lowest, highest)
    }
}

const ANYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
const NOWHERE: (f64, f64) = (f64::INFINITY, f64::INFINITY);

fn may_be_in_range(ray: &Ray, &(low, high): &(f64, f64)) -> bool {
    high >= f64::from(ray.tmin) && low <= f64::from(ray.tmax)
}

fn is_in_range(ray: &Ray, &(low, high): &(f64, f64)) -> bool {
    low >= f64::from(ray.tmin) && high <= f64::from(ray.tmax)
}

/// What an engine of this precision may answer for a ray and a primitive.
pub fn outcome(ray: &Ray, primitive: &Primitive, precision: Precision) -> Outcome {
    if !ray.is_valid() {
        return Outcome::MISS;
    }
    let Some(local) = LocalRay::new(ray, primitive.to_world.as_ref(), precision) else { return Outcome::ANYTHING };
    match primitive.body {
        Body::Triangle(corners) if !corners.into_iter().all(is_traceable) => Outcome::MISS,
        Body::Triangle(corners) => triangle::outcome(ray, corners, primitive.to_world.as_ref(), &local, precision),
        Body::Shape(shape) => {
            // Embree's boxes are f32, whatever is in them.
            let may_pass = precision == Precision::Single && shapes::may_pass_box(shape, &local);
            let outcome = shapes::outcome(shape, &local.rounded(primitive.to_world.is_some()));
            Outcome { may_pass: outcome.may_pass || may_pass, ..outcome }
        }
    }
}

/// A ray in a primitive's own coordinates, and how far an engine's may be from it.
struct LocalRay {
    origin: DVec3,
    direction: DVec3,
    origin_error: DVec3,
    direction_error: DVec3,
    /// Determinant of the transform to the world.
    determinant: f64,
}

impl LocalRay {
    /// None where the inverse is lost in rounding.
    fn new(ray: &Ray, to_world: Option<&Affine3>, precision: Precision) -> Option<Self> {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let Some(m) = to_world else {
            let (origin_error, direction_error) = (DVec3::ZERO, DVec3::ZERO);
            return Some(Self { origin, direction, origin_error, direction_error, determinant: 1.0 });
        };
        let matrix = m.matrix3.as_dmat3();
        let [x, y, z] = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(vector::<Approx>);
        let determinant = det(&x, &y, &z);
        let adjugate = DMat3::from_cols_array_2d(
            &[cross(&y, &z), cross(&z, &x), cross(&x, &y)].map(|row| row.map(|entry| entry.value)),
        )
        .transpose();
        let (size, g) = (matrix.abs(), precision.gamma());
        let determinant_error = g * permanent(size.x_axis, size.y_axis, size.z_axis) + determinant.error;
        if !(determinant.value.abs() > determinant_error) {
            return None;
        }
        let terms = DMat3::from_cols(
            permanent_cross(size.y_axis, size.z_axis),
            permanent_cross(size.z_axis, size.x_axis),
            permanent_cross(size.x_axis, size.y_axis),
        )
        .transpose();
        let inverse = adjugate * determinant.value.recip();
        let slack = determinant.value.abs() - determinant_error;
        // Of each entry of the inverse; and of its products with the ray, which are rounded as well.
        let inverse_error = terms * (g / slack) + inverse.abs() * (determinant_error / slack);
        let error = |v: DVec3| inverse_error * v + inverse.abs() * v * g;
        let translation = m.translation.as_dvec3();
        let local = Self {
            origin: inverse * (origin - translation),
            direction: inverse * direction,
            origin_error: error(origin.abs() + translation.abs()),
            direction_error: error(direction.abs()),
            determinant: determinant.value,
        };
        (local.origin.is_finite() && local.direction.is_finite()).then_some(local)
    }

    /// As a shape is given it: in f32, once it was moved.
    fn rounded(self, moved: bool) -> Self {
        let u = if moved { f64::from(UNIT_ROUNDOFF) } else { 0.0 };
        Self {
            origin_error: self.origin_error + (self.origin.abs() + self.origin_error) * u,
            direction_error: self.direction_error + (self.direction.abs() + self.direction_error) * u,
            ..self
        }
    }
}

/// The interval around t, widened by the rounding to f32.
fn around(t: f64, error: f64) -> (f64, f64) {
    let error = error + t.abs() * f64::from(UNIT_ROUNDOFF) + f64::from(f32::from_bits(1));
    if error.is_nan() || t.is_nan() { ANYWHERE } else { (t - error, t + error) }
}

/// The vector product with every sign a plus.
fn permanent_cross(x: DVec3, y: DVec3) -> DVec3 {
    DVec3::new(x.y * y.z + x.z * y.y, x.z * y.x + x.x * y.z, x.x * y.y + x.y * y.x)
}

/// The determinant with every sign a plus.
fn permanent(x: DVec3, y: DVec3, z: DVec3) -> f64 {
    x.dot(permanent_cross(y, z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::oracle::meet;
    use crate::math::{Mat3, Random};
    use crate::shape::{Shape, Sphere};

    /// Embree's robust test, in f32.
    fn pluecker(ray: &Ray, corners: [Vec3; 3]) -> Option<f32> {
        let [v0, v1, v2] = corners.map(|p| p - ray.origin);
        let (e0, e1, e2) = (v2 - v0, v0 - v1, v1 - v2);
        let u = e0.cross(v2 + v0).dot(ray.direction);
        let v = e1.cross(v0 + v1).dot(ray.direction);
        let w = e2.cross(v1 + v2).dot(ray.direction);
        let eps = f32::EPSILON * (u + v + w).abs();
        let n = e0.cross(e1);
        let den = n.dot(ray.direction);
        let inside = u.min(v).min(w) >= -eps || u.max(v).max(w) <= eps;
        (inside && den != 0.0).then(|| n.dot(v0) / den)
    }

    #[test]
    fn f32_answers_stay_within_the_outcome() {
        let mut random = Random::new(1, 0);
        let (mut unsure, mut hits) = (0, 0);
        for case in 0..200_000 {
            let corners = [random.vector(), random.vector(), random.vector()];
            let origin = random.vector() * if case % 3 == 0 { 1000.0 } else { 3.0 };
            // At an edge, a corner or the inside, so that all cases come up.
            let s = random.unit();
            let target = match case % 4 {
                0 => corners[0] + (corners[1] - corners[0]) * s,
                1 => corners[2],
                2 => (corners[0] + corners[1] + corners[2]) / 3.0,
                _ => random.vector(),
            };
            let ray = Ray::new(origin, target - origin);
            let primitive = Primitive { body: Body::Triangle(corners), to_world: None };
            let allowed = outcome(&ray, &primitive, Precision::Single);
            match pluecker(&ray, corners) {
                Some(t) => {
                    let (low, high) = allowed.span(&ray);
                    assert!(allowed.may_meet && low <= f64::from(t) && f64::from(t) <= high, "{t} {allowed:?}");
                    hits += 1;
                }
                None => assert!(allowed.may_pass, "{ray:?} {allowed:?}"),
            }
            let exact = meet(&ray, &primitive);
            assert!(if exact.is_some() { allowed.may_meet } else { allowed.may_pass });
            unsure += u32::from(allowed.may_meet && allowed.may_pass);
        }
        // About half of the rays are aimed at edges and corners; nearly no other may be called unsure.
        assert!((90_000..110_000).contains(&unsure), "{unsure}");
        assert!(hits > 80_000, "{hits}");
    }

    #[test]
    fn a_ray_moved_in_f32_stays_within_the_outcome() {
        let mut random = Random::new(2, 0);
        let mut unsure = 0;
        for case in 0..100_000 {
            let m = Affine3 {
                matrix3: Mat3::from_cols(random.vector(), random.vector(), random.vector()),
                translation: random.vector() * 100.0,
            };
            let corners = [random.vector(), random.vector(), random.vector()];
            let origin = random.vector() * 200.0;
            let inside = (corners[0] + corners[1] + corners[2]) / 3.0;
            let target = if case % 2 == 0 { corners[0].midpoint(corners[1]) } else { inside };
            let ray = Ray::new(origin, m.transform_point3(target) - origin);
            let primitive = Primitive { body: Body::Triangle(corners), to_world: Some(m) };
            let allowed = outcome(&ray, &primitive, Precision::Single);
            let inverse = m.inverse();
            let local = Ray::new(inverse.transform_point3(ray.origin), inverse.transform_vector3(ray.direction));
            match pluecker(&local, corners) {
                Some(t) => {
                    let (low, high) = allowed.span(&ray);
                    assert!(allowed.may_meet && low <= f64::from(t) && f64::from(t) <= high, "{t} {allowed:?}");
                }
                None => assert!(allowed.may_pass, "{ray:?} {allowed:?}"),
            }
            unsure += u32::from(case % 2 == 1 && allowed.may_meet && allowed.may_pass);
        }
        // A bound that always says "unsure" would hold as well. Of the rays aimed inside, those under an
        // ill-conditioned matrix may be, no others.
        assert!(unsure < 8_000, "{unsure}");
    }

    #[test]
    fn f64_leaves_next_to_no_doubt() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let primitive = Primitive { body: Body::Triangle(corners), to_world: None };
        let ray = |x: f32| Ray::new(Vec3::new(x, 0.25, 1.0), Vec3::NEG_Z);
        let at = |x: f32, precision| {
            let o = outcome(&ray(x), &primitive, precision);
            (o.may_meet, o.may_pass)
        };
        assert_eq!(at(1e-8, Precision::Single), (true, true));
        assert_eq!(at(1e-8, Precision::Double), (true, false));
        assert_eq!(at(-1e-8, Precision::Double), (false, true));
        assert_eq!(at(-1e-3, Precision::Single), (false, true));
    }

    #[test]
    fn spheres_are_unsure_only_at_the_silhouette() {
        let ball = Shape::Sphere(Sphere { centre: Vec3::ZERO, radius: 1.0 });
        let mut random = Random::new(3, 0);
        for _ in 0..20_000 {
            let origin = random.vector() * 4.0;
            let ray = Ray::new(origin, random.vector());
            let primitive = Primitive { body: Body::Shape(&ball), to_world: None };
            let allowed = outcome(&ray, &primitive, Precision::Double);
            match ball.intersect(&ray) {
                Some(hit) => {
                    let (low, high) = allowed.span(&ray);
                    assert!(allowed.may_hit(&ray) && low <= hit.t && hit.t <= high, "{} {allowed:?}", hit.t);
                }
                None => assert!(allowed.may_miss(&ray)),
            }
            assert!(!(allowed.may_meet && allowed.may_pass), "{ray:?}");
        }
        let touching = Ray::new(Vec3::new(-3.0, 1.0, 0.0), Vec3::X);
        let allowed = outcome(&touching, &Primitive { body: Body::Shape(&ball), to_world: None }, Precision::Double);
        assert!(allowed.may_hit(&touching) && allowed.may_miss(&touching));
    }
}
