//! The textbooks' ways to meet a sphere, to compare and to learn from, in f32 as they are written.
//!
//! Only [`SphereMethod::Exact`] is what tracers use. The others fail where their numbers cancel: a small sphere far
//! away, a huge one seen from near its surface, a ray that touches.

use super::sphere::Sphere;
use crate::math::Vec3;
use crate::ray::Ray;

/// How a ray meets a sphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SphereMethod {
    /// The quadratic formula as it stands.
    Algebraic,
    /// From the foot of the perpendicular from the centre, back and forth by half the chord.
    Geometric,
    /// The discriminant from the distance between the centre and the line, the roots without cancellation.
    Accurate,
    /// Error bounds in f64, and exact arithmetic where they leave doubt. Never fails.
    #[default]
    Exact,
}

impl SphereMethod {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Algebraic, Self::Geometric, Self::Accurate, Self::Exact];

    /// As flags and reports have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Algebraic => "algebraic",
            Self::Geometric => "geometric",
            Self::Accurate => "accurate",
            Self::Exact => "exact",
        }
    }

    /// Where it is from.
    pub const fn source(self) -> &'static str {
        match self {
            Self::Algebraic => "Whitted 1980, An improved illumination model for shaded display",
            Self::Geometric => {
                "Haines 1989, Essential ray tracing algorithms (in Glassner, An introduction to ray tracing)"
            }
            Self::Accurate => {
                "Haines, Günther, Akenine-Möller 2019, Precision improvements for ray/sphere intersection"
            }
            Self::Exact => {
                "the same, with exact signs after Shewchuk 1997, Adaptive precision floating-point arithmetic"
            }
        }
    }

    /// Where the ray's line enters and leaves the sphere, the smaller t first, whatever the ray's range; None where it
    /// passes by, and for a ray or a sphere that is not valid.
    pub fn roots(self, ray: &Ray, sphere: &Sphere) -> Option<[f64; 2]> {
        if !ray.is_valid() || sphere.check().is_err() {
            return None;
        }
        let (f, d, r) = (ray.origin - sphere.centre, ray.direction, sphere.radius);
        let roots = match self {
            Self::Algebraic => algebraic(f, d, r),
            Self::Geometric => geometric(f, d, r),
            Self::Accurate => accurate(f, d, r),
            Self::Exact => {
                let [first, second] = sphere.roots(ray);
                return Some([first?, second?]);
            }
        };
        roots.map(|[first, second]| [first.min(second).into(), first.max(second).into()])
    }
}

fn algebraic(f: Vec3, d: Vec3, r: f32) -> Option<[f32; 2]> {
    let (a, b, c) = (d.dot(d), 2.0 * f.dot(d), f.dot(f) - r * r);
    let discriminant = b * b - 4.0 * a * c;
    (discriminant >= 0.0).then(|| [(-b - discriminant.sqrt()) / (2.0 * a), (-b + discriminant.sqrt()) / (2.0 * a)])
}

fn geometric(f: Vec3, d: Vec3, r: f32) -> Option<[f32; 2]> {
    let length = d.length();
    // To the foot of the perpendicular; its square; half the chord's.
    let foot = -f.dot(d) / length;
    let distance = f.dot(f) - foot * foot;
    let half = r * r - distance;
    (half >= 0.0).then(|| [(foot - half.sqrt()) / length, (foot + half.sqrt()) / length])
}

fn accurate(f: Vec3, d: Vec3, r: f32) -> Option<[f32; 2]> {
    let (a, b) = (d.dot(d), -f.dot(d));
    let discriminant = r * r - (f + d * (b / a)).length_squared();
    if discriminant < 0.0 {
        return None;
    }
    let c = f.dot(f) - r * r;
    let q = b + (a * discriminant).sqrt().copysign(b);
    // q is 0 only for a ray that starts on the sphere and touches it.
    Some(if q == 0.0 { [0.0; 2] } else { [c / q, q / a] })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> Sphere {
        Sphere { centre: Vec3::ZERO, radius: 1.0 }
    }

    #[test]
    fn all_agree_where_nothing_cancels() {
        for method in SphereMethod::ALL {
            let roots = |origin, direction| method.roots(&Ray::new(origin, direction), &unit());
            assert_eq!(roots(Vec3::X * 3.0, Vec3::NEG_X), Some([2.0, 4.0]), "{method:?}");
            assert_eq!(roots(Vec3::X * 3.0, Vec3::X * 2.0), Some([-2.0, -1.0]), "{method:?}");
            assert_eq!(roots(Vec3::ZERO, Vec3::Y * 0.5), Some([-2.0, 2.0]), "{method:?}");
            assert_eq!(roots(Vec3::new(3.0, 1.5, 0.0), Vec3::NEG_X), None, "{method:?}");
            assert_eq!(roots(Vec3::X, Vec3::ZERO), None);
        }
        let names: std::collections::BTreeSet<_> = SphereMethod::ALL.iter().map(|method| method.name()).collect();
        assert_eq!(names.len(), 4);
    }

    #[test]
    fn a_small_sphere_far_away_is_met_falsely_where_squares_cancel() {
        let mut false_hits = [0; 4];
        for i in 0..1000 {
            let (distance, angle) = (4000.0 + 37.0 * i as f32, i as f32);
            // Passes at 1.5 radii.
            let (way, aside) = (Vec3::new(angle.cos(), angle.sin(), 0.0), Vec3::new(-angle.sin(), angle.cos(), 0.0));
            let ray = Ray::new(way * -distance + aside * 1.5, way);
            for (count, method) in false_hits.iter_mut().zip(SphereMethod::ALL) {
                *count += i32::from(method.roots(&ray, &unit()).is_some());
            }
        }
        let [algebraic, geometric, accurate, exact] = false_hits;
        assert!(algebraic > 100 && geometric > 100, "{false_hits:?}");
        assert_eq!((accurate, exact), (0, 0), "{false_hits:?}");
    }

    #[test]
    fn the_ground_as_a_sphere_is_beyond_f32() {
        let ground = Sphere { centre: Vec3::new(0.0, -1e6, 0.0), radius: 1e6 };
        let mut worst = [0f64; 4];
        for i in 1..100 {
            let ray = Ray::new(Vec3::new(0.3, 1.0 + i as f32 * 0.1, 0.0), Vec3::new(i as f32 * 0.013, -0.5, 0.2));
            // In f64, from the foot of the perpendicular: nothing cancels at this height.
            let (d, f) = (ray.direction.as_dvec3(), ray.origin.as_dvec3() - ground.centre.as_dvec3());
            let height = (f.length_squared() - 1e12) / (2e6 * f.length());
            for (worst, method) in worst.iter_mut().zip(SphereMethod::ALL) {
                let t = method.roots(&ray, &ground).map_or(f64::INFINITY, |t| t[0]);
                let at = (f + d * t).length() - 1e6;
                *worst = worst.max(at.abs() / height.abs().max(1e-3));
            }
        }
        assert!(worst[..3].iter().all(|&error| error > 1e-4) && worst[3] < 1e-6, "{worst:?}");
    }
}
