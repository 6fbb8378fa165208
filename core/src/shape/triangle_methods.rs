//! The textbooks' ways to meet a triangle, to compare and to learn from, in f32 as they are written.
//!
//! Only [`TriangleMethod::Exact`] is what tracers use ([`triangle`](super::triangle)). The others decide for numbers
//! that were rounded: most of them miss some rays at an edge that two triangles share, or hit both.

use super::triangle::{self, TriangleHit};
use crate::math::{Vec3, is_traceable};
use crate::ray::Ray;

/// How a ray meets a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TriangleMethod {
    /// The plane first; then whether the point is on the inner side of the three planes through the ray's origin and an
    /// edge.
    SidePlanes,
    /// The plane first; then whether the point is on the same side of each edge as the third corner.
    SameSide,
    /// The plane first; then whether the areas of the three triangles at the point add up to the whole.
    Areas,
    /// t, u and v at once, by Cramer's rule.
    MoellerTrumbore,
    /// Sheared so that the ray is an axis: watertight.
    Woop,
    /// Error bounds in f64, and exact arithmetic where they leave doubt. Never fails.
    #[default]
    Exact,
}

impl TriangleMethod {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::SidePlanes, Self::SameSide, Self::Areas, Self::MoellerTrumbore, Self::Woop, Self::Exact];

    /// As flags and reports have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SidePlanes => "side-planes",
            Self::SameSide => "same-side",
            Self::Areas => "areas",
            Self::MoellerTrumbore => "moeller-trumbore",
            Self::Woop => "woop",
            Self::Exact => "exact",
        }
    }

    /// Where it is from.
    pub const fn source(self) -> &'static str {
        match self {
            Self::SidePlanes => {
                "Haines 1989, Essential ray tracing algorithms (in Glassner, An introduction to ray tracing)"
            }
            Self::SameSide => "Ericson 2005, Real-time collision detection, 5.4.2",
            Self::Areas => "Badouel 1990, An efficient ray-polygon intersection (in Graphics gems)",
            Self::MoellerTrumbore => "Möller, Trumbore 1997, Fast, minimum storage ray/triangle intersection",
            Self::Woop => "Woop, Benthin, Wald 2013, Watertight ray/triangle intersection",
            Self::Exact => "Plücker's test as in Woop 2013, with exact signs after Shewchuk 1997",
        }
    }

    /// The intersection, if `tmin <= t <= tmax`; None for a ray or corners that are not valid.
    pub fn intersect(self, ray: &Ray, corners: [Vec3; 3]) -> Option<TriangleHit> {
        if !ray.is_valid() || !corners.into_iter().all(is_traceable) {
            return None;
        }
        let found = match self {
            Self::SidePlanes => on_plane(ray, corners).filter(|at| inside_side_planes(ray, corners, at)),
            Self::SameSide => on_plane(ray, corners).filter(|at| is_same_side(corners, at)),
            Self::Areas => on_plane(ray, corners).filter(|at| fills_area(corners, at)),
            Self::MoellerTrumbore => moeller_trumbore(ray, corners),
            Self::Woop => woop(ray, corners),
            Self::Exact => return triangle::intersect(ray, &corners),
        };
        let [t, u, v] = found.map(|found| [found.t, found.u, found.v])?;
        let in_range = ray.reaches(t.into());
        in_range.then(|| TriangleHit { t: t.into(), u: u.into(), v: v.into() })
    }
}

/// In f32.
struct Found {
    t: f32,
    u: f32,
    v: f32,
    point: Vec3,
}

/// The point of the plane, with weights from areas.
fn on_plane(ray: &Ray, [a, b, c]: [Vec3; 3]) -> Option<Found> {
    let normal = (b - a).cross(c - a);
    let slope = normal.dot(ray.direction);
    if slope == 0.0 {
        return None;
    }
    let t = normal.dot(a - ray.origin) / slope;
    let point = ray.origin + ray.direction * t;
    let area = normal.length_squared();
    let (u, v) = ((c - point).cross(a - point).dot(normal) / area, (a - point).cross(b - point).dot(normal) / area);
    Some(Found { t, u, v, point })
}

fn inside_side_planes(ray: &Ray, corners: [Vec3; 3], at: &Found) -> bool {
    let [a, b, c] = corners.map(|p| p - ray.origin);
    let out = at.point - ray.origin;
    let sides = [b.cross(a).dot(out), c.cross(b).dot(out), a.cross(c).dot(out)];
    // Of one sign, whichever side is seen.
    sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
}

fn is_same_side([a, b, c]: [Vec3; 3], at: &Found) -> bool {
    let same = |p: Vec3, q: Vec3, third: Vec3| (q - p).cross(at.point - p).dot((q - p).cross(third - p)) >= 0.0;
    same(a, b, c) && same(b, c, a) && same(c, a, b)
}

/// By how much the parts may be more than the whole: their rounding. Points just outside pass.
const AREA_SLACK: f32 = 1e-6;

fn fills_area([a, b, c]: [Vec3; 3], at: &Found) -> bool {
    let area = |p: Vec3, q: Vec3, r: Vec3| (q - p).cross(r - p).length();
    let parts = area(at.point, a, b) + area(at.point, b, c) + area(at.point, c, a);
    parts <= area(a, b, c) * (1.0 + AREA_SLACK)
}

fn moeller_trumbore(ray: &Ray, [a, b, c]: [Vec3; 3]) -> Option<Found> {
    let (e1, e2) = (b - a, c - a);
    let p = ray.direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let inverse = 1.0 / determinant;
    let from = ray.origin - a;
    let u = from.dot(p) * inverse;
    let q = from.cross(e1);
    let v = ray.direction.dot(q) * inverse;
    let t = e2.dot(q) * inverse;
    let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
    inside.then(|| Found { t, u, v, point: ray.origin + ray.direction * t })
}

fn woop(ray: &Ray, corners: [Vec3; 3]) -> Option<Found> {
    let size = ray.direction.abs();
    let z = (0..3).max_by(|&i, &j| size[i].total_cmp(&size[j])).unwrap_or(2);
    let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
    if ray.direction[z] < 0.0 {
        std::mem::swap(&mut x, &mut y);
    }
    let d = ray.direction;
    let (sx, sy, sz) = (d[x] / d[z], d[y] / d[z], 1.0 / d[z]);
    let [a, b, c] = corners.map(|p| {
        let p = p - ray.origin;
        [p[x] - sx * p[z], p[y] - sy * p[z], sz * p[z]]
    });
    let edge = |p: &[f32; 3], q: &[f32; 3]| p[0] * q[1] - p[1] * q[0];
    let mut weights = [edge(&c, &b), edge(&a, &c), edge(&b, &a)];
    if weights.contains(&0.0) {
        // The products of two f32 are exact in f64, so a zero that is left is one.
        let edge =
            |p: &[f32; 3], q: &[f32; 3]| (f64::from(p[0]) * f64::from(q[1]) - f64::from(p[1]) * f64::from(q[0])) as f32;
        weights = [edge(&c, &b), edge(&a, &c), edge(&b, &a)];
    }
    let [u, v, w] = weights;
    let mixed = weights.iter().any(|&x| x < 0.0) && weights.iter().any(|&x| x > 0.0);
    let determinant = u + v + w;
    if mixed || determinant == 0.0 {
        return None;
    }
    let t = (u * a[2] + v * b[2] + w * c[2]) / determinant;
    // Weights of the second and of the third corner.
    Some(Found { t, u: v / determinant, v: w / determinant, point: ray.origin + ray.direction * t })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    #[test]
    fn all_agree_away_from_edges() {
        let mut random = Random::new(1, 0);
        let (mut hits, mut misses) = (0, 0);
        for _ in 0..20_000 {
            let corners = [(); 3].map(|()| random.vector());
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let (u, v) = (random.unit() * 1.5 - 0.25, random.unit() * 1.5 - 0.25);
            let target = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
            let origin = random.vector() * 3.0;
            let ray = Ray::new(origin, target - origin);
            let margin = u.abs().min(v.abs()).min((1.0 - u - v).abs());
            if margin < 0.01 || normal.length() < 0.1 || normal.dot(ray.direction).abs() < 0.05 {
                continue;
            }
            let expected = TriangleMethod::Exact.intersect(&ray, corners);
            hits += usize::from(expected.is_some());
            misses += usize::from(expected.is_none());
            for method in TriangleMethod::ALL {
                match (method.intersect(&ray, corners), expected) {
                    (Some(a), Some(b)) => {
                        let error = (a.t - b.t).abs().max((a.u - b.u).abs()).max((a.v - b.v).abs());
                        assert!(error < 1e-3, "{method:?} {a:?} {b:?}");
                    }
                    (found, expected) => assert_eq!(found.is_some(), expected.is_some(), "{method:?} {ray:?}"),
                }
            }
        }
        assert!(hits > 2000 && misses > 2000, "{hits} {misses}");
    }

    /// Rays at the edge that two triangles share, which neither is hit by.
    #[test]
    fn only_woop_and_the_exact_test_do_not_leak() {
        let mut random = Random::new(2, 0);
        let mut leaks = [0; 6];
        for _ in 0..20_000 {
            let [a, b, c, d] = [(); 4].map(|()| random.vector());
            let origin = random.vector() * 4.0;
            // The third corners on opposite sides of the plane of the origin and the edge, so that it is no silhouette.
            let side = |p: Vec3| (a - origin).cross(b - origin).dot(p - origin);
            if side(c) * side(d) > -0.01 {
                continue;
            }
            let ray = Ray::new(origin, a.lerp(b, 0.1 + 0.8 * random.unit()) - origin);
            for (leaks, method) in leaks.iter_mut().zip(TriangleMethod::ALL) {
                let hit = |corners| method.intersect(&ray, corners).is_some();
                *leaks += u32::from(!hit([a, b, c]) && !hit([b, a, d]));
            }
        }
        let [side, same, _, moeller, woop, exact] = leaks;
        assert_eq!((woop, exact), (0, 0), "{leaks:?}");
        assert!(side > 50 && same > 50 && moeller > 50, "{leaks:?}");
    }
}
