//! Points of a light's surface, chosen evenly: by the cone they fill for spheres (Shirley, Wang, Zimmerman 1996, *Monte
//! Carlo techniques for direct lighting calculations*), by the solid angle they fill for rectangles and disks that are
//! near, by area for other flat ones.

use super::ellipse::SphericalEllipse;
use super::light::LightSample;
use super::rectangle::SphericalRectangle;
use crate::math::{DVec2, DVec3, UNIT_ROUNDOFF, Vec3, gamma, tangents};
use crate::scene::AreaShape;

/// Chained f32 roundings in the test of a ray against what stands in a light's place; generous.
const ROUNDINGS: u32 = 32;

/// Where a light is met at less than this, what stands in its place is taken to be in the way rather than that what
/// stands before it is not.
const MIN_COSINE: f64 = 1e-3;

/// What arrives at `point` from the part of the light that `xi`, a point of the unit square, chooses, as if all of it
/// shone like that part; none where the light turns its back.
pub(super) fn sample(shape: &AreaShape, radiance: Vec3, point: DVec3, xi: DVec2) -> Option<LightSample> {
    match *shape {
        AreaShape::Rectangle { centre, half_edges: [a, b] } => {
            if let Some(seen) = near(point, centre, [a, b]) {
                return Some(towards(point, seen.at(xi), 1.0 / seen.solid_angle, radiance, a.cross(b)));
            }
            let at = xi * 2.0 - 1.0;
            // The cross product of the halves is a quarter of the area.
            flat(point, centre + a * at.x + b * at.y, a.cross(b) * 4.0, radiance)
        }
        AreaShape::Disk { centre, normal, radius } => {
            if let Some(seen) = SphericalEllipse::seen_from(point, centre, normal, radius) {
                let (offset, pdf) = seen.at(xi);
                return Some(towards(point, offset, pdf, radiance, normal));
            }
            let [x, y] = tangents(normal);
            let (distance, angle) = (radius * xi.x.sqrt(), xi.y * std::f64::consts::TAU);
            let at = centre + (x * libm::cos(angle) + y * libm::sin(angle)) * distance;
            flat(point, at, normal * (std::f64::consts::PI * radius * radius), radiance)
        }
        AreaShape::Sphere { centre, radius } => sphere(point, centre, radius, radiance, xi),
    }
}

/// The rectangle as the point sees it, where that is what directions are chosen by; none for other parallelograms.
fn near(point: DVec3, centre: DVec3, half_edges: [DVec3; 2]) -> Option<SphericalRectangle> {
    let [a, b] = half_edges;
    // As far as files in f32 have it.
    let is_rectangle = a.dot(b).abs() <= 1e-5 * a.length() * b.length();
    if is_rectangle { SphericalRectangle::seen_from(point, centre, half_edges) } else { None }
}

/// From the light at `offset` from the point, in whose direction as many are chosen, per steradian; `across` is a
/// vector across it.
fn towards(point: DVec3, offset: DVec3, pdf: f64, radiance: Vec3, across: DVec3) -> LightSample {
    let to_light = offset.normalize();
    let cosine = to_light.dot(across.normalize_or_zero());
    let color = radiance * (1.0 / (std::f64::consts::PI * pdf)) as f32;
    let end = Some(short_of(point + offset, to_light, point, cosine));
    LightSample { to_light, color, end, pdf: Some(pdf) }
}

/// From a point on a flat light of the given area (a vector across it): E = L cos A / d^2, of which a white matte
/// surface sends on 1 / pi.
fn flat(point: DVec3, at: DVec3, area: DVec3, radiance: Vec3) -> Option<LightSample> {
    let offset = at - point;
    let squared = offset.length_squared();
    let to_light = offset.try_normalize()?;
    let facing = -to_light.dot(area);
    if facing <= 0.0 {
        return None;
    }
    let color = radiance * (facing / (std::f64::consts::PI * squared)) as f32;
    let end = Some(short_of(at, to_light, point, facing / area.length()));
    let pdf = Some(squared / facing);
    color.is_finite().then_some(LightSample { to_light, color, end, pdf })
}

/// From a direction of the cone that the sphere fills; none where a point on it looks away from it.
fn sphere(point: DVec3, centre: DVec3, radius: f64, radiance: Vec3, xi: DVec2) -> Option<LightSample> {
    let offset = centre - point;
    let distance = offset.length();
    let axis = offset.try_normalize().unwrap_or(DVec3::Y);
    let side = Side::of(distance, centre, radius);
    let opening = opening(distance, radius, side);
    let height = xi.x * opening;
    let (cosine, off_axis) = (1.0 - height, (height * (2.0 - height)).max(0.0).sqrt());
    let [x, y] = tangents(axis);
    let angle = xi.y * std::f64::consts::TAU;
    let to_light = axis * cosine + (x * libm::cos(angle) + y * libm::sin(angle)) * off_axis;
    if side == Side::On && cosine <= 0.0 {
        return None;
    }
    // The solid angle is 2 pi times the opening.
    let color = radiance * (2.0 * opening) as f32;
    let half_chord = (radius * radius - (distance * off_axis).powi(2)).max(0.0).sqrt();
    let way = distance * cosine + if side == Side::Outside { -half_chord } else { half_chord };
    let at = point + to_light * way.max(0.0);
    let pdf = Some(1.0 / (std::f64::consts::TAU * opening));
    let end = Some(short_of(at, to_light, point, half_chord / radius));
    Some(LightSample { to_light, color, end, pdf })
}

/// The cone that a sphere fills, as 1 - cos of its half angle, without the difference; of all directions for a point
/// inside.
fn opening(distance: f64, radius: f64, side: Side) -> f64 {
    let sine = (radius / distance).min(1.0);
    if side == Side::Outside { sine * sine / (1.0 + (1.0 - sine * sine).sqrt()) } else { 2.0 }
}

/// Where a point is, of a sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    /// It sees a cone full of it.
    Outside,
    /// It sees it in one half of all directions, and nothing of it in the other: what has its place is convex and does
    /// not light itself.
    On,
    /// It sees it wherever it looks.
    Inside,
}

impl Side {
    /// Of a point so far from the centre.
    fn of(distance: f64, centre: DVec3, radius: f64) -> Self {
        // By what f32 rounds of the centre, along all axes, and of the radius of what stands in its place; not by more,
        // for what stands beside it is not on it.
        let slack = f64::from(UNIT_ROUNDOFF) * (2.0 * centre.abs().max_element() + 16.0 * radius);
        let above = distance - radius;
        if above.abs() <= slack.min(radius / 16.0) {
            Self::On
        } else if above > 0.0 {
            Self::Outside
        } else {
            Self::Inside
        }
    }
}

/// How densely [`sample`] chooses the direction from `point` to `at`, a point of the light, per steradian; none where
/// the light turns its back.
pub(super) fn pdf(shape: &AreaShape, point: DVec3, at: DVec3) -> Option<f64> {
    let area = match *shape {
        AreaShape::Rectangle { centre, half_edges: [a, b] } => {
            if let Some(seen) = near(point, centre, [a, b]) {
                return Some(1.0 / seen.solid_angle);
            }
            a.cross(b) * 4.0
        }
        AreaShape::Disk { centre, normal, radius } => {
            if let Some(seen) = SphericalEllipse::seen_from(point, centre, normal, radius) {
                return Some(seen.pdf(at - point));
            }
            normal * (std::f64::consts::PI * radius * radius)
        }
        AreaShape::Sphere { centre, radius } => {
            let distance = (centre - point).length();
            return Some(1.0 / (std::f64::consts::TAU * opening(distance, radius, Side::of(distance, centre, radius))));
        }
    };
    let offset = at - point;
    let facing = -offset.normalize_or_zero().dot(area);
    (facing > 0.0).then(|| offset.length_squared() / facing)
}

/// A point before `at` on the way from `point`, by what f32 may move the surface there, across it: what stands in the
/// light's place must not be in its way. `cosine` is of the way to the surface's normal.
pub(super) fn short_of(at: DVec3, to_light: DVec3, point: DVec3, cosine: f64) -> DVec3 {
    let slack = f64::from(gamma(ROUNDINGS)) * (at.abs().max_element() + (at - point).length());
    let along = slack / cosine.abs().max(MIN_COSINE);
    at - to_light * along.min((at - point).dot(to_light).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean over a grid, of colour times the cosine at a surface whose normal is `normal`.
    fn reflected(shape: &AreaShape, point: DVec3, normal: DVec3) -> f64 {
        mean(400, shape, point, normal)
    }

    fn mean(side: i32, shape: &AreaShape, point: DVec3, normal: DVec3) -> f64 {
        let xi = |k: i32| (DVec2::new(f64::from(k % side), f64::from(k / side)) + 0.5) / f64::from(side);
        let each = (0..side * side).filter_map(|k| sample(shape, Vec3::ONE, point, xi(k)));
        each.map(|light| f64::from(light.color.x) * light.to_light.dot(normal).max(0.0)).sum::<f64>()
            / f64::from(side * side)
    }

    /// Form factors from Howell, *A catalog of radiation heat transfer configuration factors*.
    #[test]
    fn form_factors() {
        let (r, d) = (0.7, 2.0);
        let up = DVec3::Y * d;
        // B-17: a sphere, its centre above the element: (r / d)^2, times the cosine for an element that leans.
        let ball = AreaShape::Sphere { centre: up, radius: r };
        for lean in [0.0, 0.5, 1.0f64] {
            let normal = DVec3::new(lean.sin(), lean.cos(), 0.0);
            let got = reflected(&ball, DVec3::ZERO, normal);
            assert!((got - (r / d).powi(2) * lean.cos()).abs() < 1e-5, "{lean}: {got}");
        }
        // B-12: a parallel disk over the element: r^2 / (d^2 + r^2).
        let disk = AreaShape::Disk { centre: up, normal: DVec3::NEG_Y, radius: r };
        assert!((reflected(&disk, DVec3::ZERO, DVec3::Y) - r * r / (d * d + r * r)).abs() < 1e-5);
        // B-3: a parallel rectangle a x b with a corner over the element, at distance c.
        let (a, b) = (1.5, 0.8);
        let corner = AreaShape::Rectangle {
            centre: DVec3::new(a / 2.0, d, b / 2.0),
            half_edges: [DVec3::X * a / 2.0, DVec3::Z * b / 2.0],
        };
        let (x, y) = (a / d, b / d);
        let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
        let expected = (x / p * (y / p).atan() + y / q * (x / q).atan()) / std::f64::consts::TAU;
        assert!((reflected(&corner, DVec3::ZERO, DVec3::Y) - expected).abs() < 1e-5, "X x Z is -Y: it shines down");
        let turned = AreaShape::Rectangle {
            centre: DVec3::new(a / 2.0, d, b / 2.0),
            half_edges: [DVec3::Z * b / 2.0, DVec3::X * a / 2.0],
        };
        assert_eq!(reflected(&turned, DVec3::ZERO, DVec3::Y), 0.0, "and this one up");
        assert_eq!(pdf(&turned, DVec3::ZERO, DVec3::Y * d), None);
        let back = AreaShape::Disk { centre: up, normal: DVec3::Y, radius: r };
        assert_eq!(reflected(&back, DVec3::ZERO, DVec3::Y), 0.0, "behind it is dark");
    }

    /// The pdf that is told afterwards is the one that was sampled with, and color is radiance / (pi pdf).
    #[test]
    fn pdfs_agree() {
        let centre = DVec3::new(1.0, 4.0, 2.0);
        for shape in [
            AreaShape::Sphere { centre, radius: 1.5 },
            AreaShape::Sphere { centre, radius: 15.0 },
            AreaShape::Disk { centre, normal: DVec3::new(0.6, -0.8, 0.0), radius: 2.0 },
            AreaShape::Rectangle { centre, half_edges: [DVec3::X, DVec3::Z * 2.0] },
            // By area: no rectangle, and far away.
            AreaShape::Rectangle { centre, half_edges: [DVec3::X, DVec3::Z * 2.0 + DVec3::X * 0.1] },
            AreaShape::Rectangle { centre, half_edges: [DVec3::X * 0.1, DVec3::Z * 0.2] },
            AreaShape::Disk { centre, normal: DVec3::new(0.6, -0.8, 0.0), radius: 0.5 },
        ] {
            let arriving = sample(&shape, Vec3::ONE, DVec3::ZERO, DVec2::new(0.3, 0.6)).unwrap();
            let (sampled, at) = (arriving.pdf.unwrap(), arriving.end.unwrap());
            let told = pdf(&shape, DVec3::ZERO, at).unwrap();
            assert!((sampled / told - 1.0).abs() < 1e-4, "{shape:?}: {sampled} {told}");
            assert!((f64::from(arriving.color.x) * std::f64::consts::PI * sampled - 1.0).abs() < 1e-6);
        }
    }

    /// A light a thousand times as large as it is away fills the half of all directions: 256 tell so. By area, few
    /// points of it would be near.
    #[test]
    fn few_directions_suffice_where_a_light_is_near() {
        let (centre, wide) = (DVec3::new(150.0, 3.0, -200.0), 3000.0);
        for shape in [
            AreaShape::Disk { centre, normal: DVec3::NEG_Y, radius: wide },
            AreaShape::Rectangle { centre, half_edges: [DVec3::X * wide, DVec3::Z * wide] },
        ] {
            let found = mean(16, &shape, DVec3::ZERO, DVec3::Y);
            assert!((found - 1.0).abs() < 0.02, "{shape:?}: {found}");
        }
    }

    #[test]
    fn within_a_ball_of_light_everything_is_as_bright() {
        let ball = AreaShape::Sphere { centre: DVec3::new(0.1, 0.2, 0.3), radius: 2.0 };
        assert!((reflected(&ball, DVec3::ZERO, DVec3::Y) - 1.0).abs() < 1e-3);
    }

    /// A ball is convex: what stands on it, to within f32, is not lit by it but from its inside.
    #[test]
    fn a_ball_does_not_light_itself() {
        for (centre, radius) in [(DVec3::ZERO, 1.0), (DVec3::new(3.0, -40.0, 7.0), 0.125), (DVec3::splat(0.1), 1e-3)] {
            let ball = AreaShape::Sphere { centre, radius };
            for k in 0..50 {
                let angle = f64::from(k);
                let outwards = DVec3::new(angle.sin(), (0.37 * angle).cos(), angle.cos()).normalize();
                let point = (centre + outwards * radius).as_vec3().as_dvec3();
                assert_eq!(mean(20, &ball, point, outwards), 0.0, "{centre}, {radius}");
                let inside = mean(20, &ball, point, -outwards);
                assert!((inside - 1.0).abs() < 0.01, "{centre}, {radius}: {inside}");
            }
        }
    }

    /// What stands close beside a ball far from zero sees the cone that it fills: (r / d)^2 under it, to where its
    /// shadow rays would end behind it.
    #[test]
    fn what_is_beside_a_ball_is_not_on_it() {
        let (centre, radius) = (DVec3::new(1000.0, 0.1, 1000.0), 0.1);
        let ball = AreaShape::Sphere { centre, radius };
        for above in [0.01, 0.003] {
            let distance = radius * (1.0 + above);
            let point = centre - DVec3::Y * distance;
            let expected = (radius / distance).powi(2);
            assert!((reflected(&ball, point, DVec3::Y) - expected).abs() < 1e-4);
            let end = sample(&ball, Vec3::ONE, point, DVec2::new(0.01, 0.5)).unwrap().end.unwrap();
            assert!((end - point).length() < 0.05 * radius, "{end}");
        }
    }

    /// However flat a ray comes in: f32 moves a surface across itself, and not along the ray.
    #[test]
    fn shadow_rays_that_graze_end_before_the_light() {
        let (centre, normal) = (DVec3::new(100.0, 50.0, 0.0), DVec3::NEG_Y);
        let disk = AreaShape::Disk { centre, normal, radius: 3.0 };
        for cosine in [0.1, 0.01, 0.002] {
            let point = centre + DVec3::new(-1000.0, -1000.0 * cosine, 0.0);
            let end = sample(&disk, Vec3::ONE, point, DVec2::new(0.3, 0.6)).unwrap().end.unwrap();
            let before = (end - centre).dot(normal);
            assert!(before > 1e-3 && before < 1e-2, "{cosine}: {before}");
        }
    }

    #[test]
    fn shadow_rays_end_short_of_the_light() {
        let centre = DVec3::new(100.0, 50.0, 0.0);
        for shape in [
            AreaShape::Sphere { centre, radius: 3.0 },
            AreaShape::Disk { centre, normal: DVec3::new(-2.0, -1.0, 0.0).normalize(), radius: 3.0 },
        ] {
            for k in 0..100 {
                let xi = DVec2::new(f64::from(k % 10) + 0.5, f64::from(k / 10) + 0.5) / 10.0;
                let arriving = sample(&shape, Vec3::ONE, DVec3::ZERO, xi).unwrap();
                let end = arriving.end.unwrap();
                let beyond = match shape {
                    AreaShape::Sphere { .. } => (end - centre).length() - 3.0,
                    _ => (centre - end).dot(centre.normalize()),
                };
                assert!(beyond > 1e-5 && beyond < 2e-2, "{shape:?}: {beyond}");
                assert!((end.normalize() - arriving.to_light).length() < 1e-12);
            }
        }
    }
}
