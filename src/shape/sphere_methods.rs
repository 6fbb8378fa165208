//! The textbooks' ways to meet a sphere, to compare and to learn from, in f32 as they are written.
//!
//! Only [`SphereMethod::Exact`] is what tracers use. The others fail where their numbers cancel: a small sphere far away, a huge
//! one seen from near its surface, a ray that touches.

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
    if !(discriminant >= 0.0) {
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

    /// The figures of the documentation: what each gets wrong.
    #[test]
    fn a_small_sphere_far_away_is_lost_by_all_but_the_accurate() {
        // Passes at 1.5 radii.
        let ray = Ray::new(Vec3::new(4097.0, 1.5, 0.0), Vec3::NEG_X);
        let hits = SphereMethod::ALL.map(|method| method.roots(&ray, &unit()).is_some());
        assert_eq!(hits, [true, true, false, false], "false hits");
    }

    #[test]
    fn the_ground_as_a_sphere_needs_roots_without_cancellation() {
        let ground = Sphere { centre: Vec3::new(0.0, -1e6, 0.0), radius: 1e6 };
        let ray = Ray::new(Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, -1.0, 0.0));
        let error = SphereMethod::ALL.map(|method| method.roots(&ray, &ground).map_or(1.0, |t| (t[0] - 1.0).abs()));
        assert!(error[0] > 0.01 && error[1] > 0.01, "{error:?}");
        assert!(error[3] < 1e-12, "{error:?}");
    }
}
