//! A sphere.

use super::ShapeHit;
use crate::math::{Aabb, DVec3, Vec2, Vec3, is_traceable};
use crate::ray::Ray;

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// The middle.
    pub centre: Vec3,
    /// The radius; a sphere whose radius is not above 0 cannot be hit.
    pub radius: f32,
}

impl Sphere {
    /// The box around it, rounded outwards.
    pub fn bounds(&self) -> Aabb {
        let traceable = is_traceable(self.centre) && self.radius > 0.0 && is_traceable(Vec3::splat(self.radius));
        if !traceable {
            return Aabb::EMPTY;
        }
        let round = |x: f32, out: fn(f32) -> f32| out(x);
        let (low, high) = (self.centre - self.radius, self.centre + self.radius);
        Aabb {
            min: Vec3::from_array(low.to_array().map(|x| round(x, f32::next_down))),
            max: Vec3::from_array(high.to_array().map(|x| round(x, f32::next_up))),
        }
    }

    /// The nearest intersection with `tmin <= t <= tmax`, in f64.
    pub fn intersect(&self, ray: &Ray) -> Option<ShapeHit> {
        self.intersect_all(ray).next()
    }

    /// Both intersections, the nearer first, where `tmin <= t <= tmax`; a tangent has the same one twice.
    pub fn intersect_all(&self, ray: &Ray) -> impl Iterator<Item = ShapeHit> {
        let valid = |t: &f64| (ray.tmin..=ray.tmax).contains(&(*t as f32)) && (*t as f32).is_finite();
        let hit = |t: f64| ShapeHit { t, uv: self.uv(ray.origin.as_dvec3() + ray.direction.as_dvec3() * t) };
        self.roots(ray).into_iter().flatten().filter(valid).map(hit)
    }

    /// Where the ray's line enters and leaves, in f64.
    ///
    /// The discriminant is taken from the distance between the centre and the ray's line, not from the difference of
    /// two large squares, and the roots without cancellation (Haines, Günther, Akenine-Möller 2019, *Precision
    /// improvements for ray/sphere intersection*, Ray Tracing Gems ch. 7).
    fn roots(&self, ray: &Ray) -> Option<[f64; 2]> {
        let (origin, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let f = origin - self.centre.as_dvec3();
        let r = f64::from(self.radius);
        let a = d.length_squared();
        let b = -f.dot(d);
        let discriminant = r * r - (f + d * (b / a)).length_squared();
        if !(discriminant >= 0.0 && r > 0.0) {
            return None;
        }
        let c = f.length_squared() - r * r;
        let q = b + (a * discriminant).sqrt().copysign(b);
        // q is 0 only for a ray that starts on the sphere and touches it.
        let (t0, t1) = if q == 0.0 { (0.0, 0.0) } else { (c / q, q / a) };
        Some(if t0 <= t1 { [t0, t1] } else { [t1, t0] })
    }

    /// The unit normal, outwards, at `point` on the surface.
    pub fn normal(&self, point: DVec3) -> DVec3 {
        (point - self.centre.as_dvec3()).normalize_or(DVec3::Y)
    }

    /// Longitude from -z about +y, and latitude from the south pole, both over [0, 1].
    fn uv(&self, point: DVec3) -> Vec2 {
        let n = self.normal(point);
        let turn = libm::atan2(n.x, -n.z) / std::f64::consts::TAU;
        let latitude = libm::asin(n.y.clamp(-1.0, 1.0)) / std::f64::consts::PI;
        Vec2::new((turn + if turn < 0.0 { 1.0 } else { 0.0 }) as f32, (latitude + 0.5) as f32)
    }
}
