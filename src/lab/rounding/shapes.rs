//! What may be answered for a shape, whose engines get a ray that was moved to the shape's coordinates and rounded
//! there.
//!
//! A ray that is off by no more than `blur` near a convex solid meets what the exact ray meets of the solid made larger
//! by as much, and passes by only what passes the solid made smaller. Larger and smaller are copies scaled about an
//! inner point: with a ball of radius rho around it inside the solid, scaling by 1 + blur / rho covers every point
//! within blur of it, and by 1 - blur / rho leaves as much room inside. The ray is scaled in place of the solid.
//!
//! A ray that was not moved is exact, and so is the verdict. Of disks, polygons and open sides that were placed by a
//! transform, only a clear miss of the box around them is told from the rest.

use super::super::exact_shapes::{Crossing, crossings_of};
use super::*;
use crate::math::Aabb;
use crate::shape::{Cone, Cuboid, Cylinder, Shape, Sphere};

/// What a t may be off by, of itself, before it is rounded to f32.
const T_ERROR: f64 = 1.0 / (1 << 26) as f64;

pub(super) fn outcome(shape: &Shape, ray: &LocalRay) -> Outcome {
    let exact = ray.origin_error == DVec3::ZERO && ray.direction_error == DVec3::ZERO;
    match shape {
        Shape::Sphere(sphere) => quadric(sphere, ray),
        Shape::Plane(plane) if shape.check().is_ok() => {
            let normal = plane.normal.as_dvec3().normalize();
            flat(normal, ray.origin - plane.point.as_dvec3(), ray)
        }
        Shape::Plane(_) => Outcome::MISS,
        Shape::Cuboid(cuboid) => {
            let half = (cuboid.max.as_dvec3() - cuboid.min.as_dvec3()) * 0.5;
            solid(shape, ray, (cuboid.min.as_dvec3() + half, half.min_element()))
        }
        Shape::Ellipsoid(ellipsoid) => {
            let inverse = ellipsoid.axes.as_dmat3().inverse();
            // Not above the smallest half axis: the matrix norm is not above Frobenius's.
            let norm = inverse.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
            solid(shape, ray, (ellipsoid.centre.as_dvec3(), norm.recip()))
        }
        Shape::Cylinder(c @ Cylinder { capped: true, .. }) => {
            let cone = Cone { base: c.base, base_radius: c.radius, apex: c.apex, apex_radius: c.radius, capped: true };
            solid(shape, ray, inside_cone(&cone))
        }
        Shape::Cone(cone @ Cone { capped: true, .. }) => solid(shape, ray, inside_cone(cone)),
        Shape::Disk(_) | Shape::Polygon(_) | Shape::Cylinder(_) | Shape::Cone(_) if exact => {
            let found = crossings_of(ray.origin, ray.direction, shape);
            let roots = between(&found, &found);
            Outcome { may_meet: !found.is_empty(), may_pass: found.is_empty(), roots }
        }
        Shape::Disk(_) | Shape::Polygon(_) | Shape::Cylinder(_) | Shape::Cone(_) => {
            let Aabb { min, max } = shape.bounds();
            let blur = blur(ray, min.as_dvec3() * 0.5 + max.as_dvec3() * 0.5, (max - min).as_dvec3().length()) as f32;
            let around = Cuboid { min: min - Vec3::splat(blur.next_up()), max: max + Vec3::splat(blur.next_up()) };
            let passes = blur.is_finite() && crossings_of(ray.origin, ray.direction, &Shape::Cuboid(around)).is_empty();
            if passes { Outcome::MISS } else { Outcome::ANYTHING }
        }
    }
}

/// Whether the ray passes so close by the side of the shape's box that f32 may find it outside.
///
/// A slab's t is off by a few roundings of the way there, which is that of the ray's origin and the box together. What
/// is flat along an axis stays so: both of its t are the same number.
pub(super) fn may_pass_box(shape: &Shape, ray: &LocalRay) -> bool {
    let Aabb { min, max } = shape.bounds();
    if min.cmpgt(max).any() {
        return false;
    }
    let reach = ray.origin.abs().max(min.abs().as_dvec3()).max(max.abs().as_dvec3()).max_element();
    let error = (f64::from(gamma(Precision::Single.operations())) * reach + ray.origin_error.max_element()) as f32;
    let inside = Vec3::select((max - min).cmpgt(Vec3::splat(4.0 * error)), Vec3::splat(error), Vec3::ZERO);
    crossings_of(ray.origin, ray.direction, &Shape::Cuboid(Cuboid { min: min + inside, max: max - inside })).is_empty()
}

/// How far the ray may be off where it is within `size` of `centre`.
fn blur(ray: &LocalRay, centre: DVec3, size: f64) -> f64 {
    let farthest = ((ray.origin - centre).length() + size) / ray.direction.length();
    ray.origin_error.length() + farthest * ray.direction_error.length()
}

/// A point within a capped cone, and its distance from the surface or less.
fn inside_cone(cone: &Cone) -> (DVec3, f64) {
    let (base, apex) = (cone.base.as_dvec3(), cone.apex.as_dvec3());
    let (r0, r1) = (f64::from(cone.base_radius), f64::from(cone.apex_radius));
    // Nearer to the end that is wider.
    let share = if r0 > r1 { 0.25 } else { 0.75 };
    let length = (apex - base).length();
    let side = (r0 + (r1 - r0) * share) / f64::hypot(1.0, (r1 - r0) / length);
    (base + (apex - base) * share, side.min(length * 0.25))
}

/// A convex solid, with an inner point and its distance from the surface.
fn solid(shape: &Shape, ray: &LocalRay, (centre, depth): (DVec3, f64)) -> Outcome {
    let bounds = shape.bounds();
    if bounds.is_empty() {
        return Outcome::MISS;
    }
    let size = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length();
    let blur = blur(ray, centre, size);
    // The centre itself is rounded.
    let share = if blur == 0.0 { 0.0 } else { 1.01 * blur / depth + gamma64(64) };
    if !(share < 0.5) {
        return Outcome::ANYTHING;
    }
    let scaled = |factor: f64| {
        let origin = if factor == 1.0 { ray.origin } else { centre + (ray.origin - centre) / factor };
        crossings_of(origin, ray.direction / factor, shape)
    };
    let (larger, smaller) = (scaled(1.0 + share), scaled(1.0 - share));
    Outcome { may_meet: !larger.is_empty(), may_pass: smaller.is_empty(), roots: between(&larger, &smaller) }
}

/// The spans of the first and of the last crossing, between those of a larger and of a smaller shape.
fn between(larger: &[Crossing], smaller: &[Crossing]) -> [(f64, f64); 2] {
    let t = |crossing: Option<&Crossing>| crossing.map(|(t, _)| t.to_f64());
    let (Some(enter), Some(exit)) = (t(larger.first()), t(larger.last())) else { return [NOWHERE; 2] };
    let (enters, exits) = (t(smaller.first()).unwrap_or(exit), t(smaller.last()).unwrap_or(enter));
    let low = |t: f64| around(t, T_ERROR * t.abs()).0;
    let high = |t: f64| around(t, T_ERROR * t.abs()).1;
    [(low(enter), high(enters)), (low(exits), high(exit))]
}

/// A plane with a unit normal; `from` leads from it to the ray's origin.
fn flat(normal: DVec3, from: DVec3, ray: &LocalRay) -> Outcome {
    let g = Precision::Double.gamma();
    let (height, speed) = (normal.dot(from), normal.dot(ray.direction));
    let height_error = normal.abs().dot(ray.origin_error + from.abs() * g);
    let speed_error = normal.abs().dot(ray.direction_error + ray.direction.abs() * g);
    if !(speed.abs() > speed_error) {
        return Outcome::ANYTHING;
    }
    let t = -height / speed;
    let error = (height_error + t.abs() * speed_error) / (speed.abs() - speed_error) + T_ERROR * t.abs();
    Outcome { may_meet: true, may_pass: false, roots: [around(t, error); 2] }
}

fn quadric(sphere: &Sphere, ray: &LocalRay) -> Outcome {
    let Sphere { centre, radius } = *sphere;
    if !(radius > 0.0 && is_traceable(centre) && is_traceable(Vec3::splat(radius))) {
        return Outcome::MISS;
    }
    let (g, r) = (Precision::Double.gamma(), f64::from(radius));
    let (f, d) = (ray.origin - centre.as_dvec3(), ray.direction);
    let (a, b, c) = (d.dot(d), d.dot(f), f.dot(f) - r * r);
    let sums = |f: DVec3, d: DVec3| (d.dot(d), d.dot(f), f.dot(f) + r * r);
    let still = sums(f.abs(), d.abs());
    let with = sums(f.abs() + ray.origin_error, d.abs() + ray.direction_error);
    let error = |still: f64, with: f64| g * with + (with - still).max(0.0);
    let (discriminant, bound) =
        (b * b - a * c, error(still.1 * still.1 + still.0 * still.2, with.1 * with.1 + with.0 * with.2));
    if discriminant < -bound {
        return Outcome::MISS;
    }
    let (a_error, b_error) = (error(still.0, with.0), error(still.1, with.1));
    if !(a > a_error && discriminant.is_finite() && bound.is_finite()) {
        return Outcome::ANYTHING;
    }
    let [low, middle, high] = [discriminant - bound, discriminant, discriminant + bound].map(|x| x.max(0.0).sqrt());
    let root = |sign: f64| {
        let t = (-b + sign * middle) / a;
        around(t, (b_error + (high - low) + t.abs() * a_error) / (a - a_error))
    };
    Outcome { may_meet: true, may_pass: !(discriminant > bound), roots: [root(-1.0), root(1.0)] }
}

#[cfg(test)]
mod tests {
    use super::super::{Body, Precision, Primitive, outcome};
    use super::*;
    use crate::ray::Ray;
    use crate::shape::Disk;

    #[test]
    fn along_the_side_of_a_box_f32_alone_may_pass() {
        let cuboid = Shape::Cuboid(Cuboid::new(Vec3::ZERO, Vec3::ONE).unwrap());
        let disk = Shape::Disk(Disk::new(Vec3::splat(0.5), Vec3::Z, 0.5).unwrap());
        let may_pass = |shape: &Shape, x: f32, precision: Precision| {
            let ray = Ray::new(Vec3::new(x, 0.5, 3.0), Vec3::NEG_Z);
            let answer = outcome(&ray, &Primitive { body: Body::Shape(shape), to_world: None }, precision);
            assert!(answer.may_meet, "{shape:?} {x}");
            answer.may_pass
        };
        for shape in [&cuboid, &disk] {
            for x in [0.0, 1.0] {
                assert!(may_pass(shape, x, Precision::Single) && !may_pass(shape, x, Precision::Double));
            }
            assert!(
                !may_pass(shape, 0.4, Precision::Single),
                "the disk's box is flat, and nothing passes through that"
            );
        }
    }
}
