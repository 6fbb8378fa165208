//! Whether a light can reach anything: by its range, its cone and the side it shines to, against the box around the
//! scene.
//!
//! What is refused here gives exactly nothing at every point of the box, so that no picture of recursive ray tracing
//! changes; path tracing chooses among fewer lights, and is less noisy. Whether something stands in between is not
//! asked: that is what rays are for.

use crate::math::{DAabb, DVec3};
use crate::scene::{AreaShape, Light};

/// How far a point of a surface may lie outside of the box, in its radius: far more than any rounding.
const SLACK: f64 = 1e-4;
/// Radians that are granted to a cone.
const ANGLE_SLACK: f64 = 1e-3;

/// Whether `light` gives anything to any point of the box; both in the same coordinates.
pub(super) fn reaches(light: &Light, bounds: &DAabb) -> bool {
    if bounds.is_empty() {
        return true;
    }
    let slack = SLACK * bounds.radius();
    let within = |position: DVec3, range: f64| {
        let nearest = position.clamp(bounds.min, bounds.max);
        (nearest - position).length() <= range + slack
    };
    match light {
        Light::Directional { .. } => true,
        Light::Point { position, range, .. } => within(*position, *range),
        Light::Spot { position, direction, range, outer_angle, .. } => {
            within(*position, *range) && cone_meets(*position, *direction, f64::from(*outer_angle), bounds)
        }
        Light::Area { shape, .. } => match *shape {
            AreaShape::Rectangle { centre, half_edges: [a, b] } => faces(centre, a.cross(b), bounds, slack),
            AreaShape::Disk { centre, normal, .. } => faces(centre, normal, bounds, slack),
            AreaShape::Sphere { .. } => true,
        },
    }
}

/// Whether the cone meets the ball around the box.
fn cone_meets(apex: DVec3, axis: DVec3, half_angle: f64, bounds: &DAabb) -> bool {
    let (offset, radius) = (bounds.centre() - apex, bounds.radius() * (1.0 + SLACK));
    let distance = offset.length();
    if distance <= radius {
        return true;
    }
    let off_axis = libm::acos((offset.dot(axis) / distance).clamp(-1.0, 1.0));
    off_axis <= half_angle + libm::asin(radius / distance) + ANGLE_SLACK
}

/// Whether any of the box is in front of a flat light.
fn faces(centre: DVec3, normal: DVec3, bounds: &DAabb, slack: f64) -> bool {
    let farthest = DVec3::select(normal.cmpge(DVec3::ZERO), bounds.max, bounds.min);
    (farthest - centre).dot(normal) >= -slack * normal.length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DVec2, Random, Vec3};
    use crate::scene::Attenuation;
    use crate::shade::light::LightSource;

    /// Against the lights themselves: none that is refused gives anything to any of many points of the box.
    #[test]
    fn what_is_refused_gives_nothing_and_much_is_refused() {
        let bounds = DAabb { min: DVec3::new(-1.0, 0.0, -2.0), max: DVec3::new(1.0, 0.5, 2.0) };
        let mut random = Random::new(3, 0);
        let (attenuation, color) = (Attenuation::NONE, Vec3::ONE);
        let (mut refused, mut of_no_use) = ([0; 4], [0; 4]);
        for i in 0..2000 {
            let position = random.vector().as_dvec3() * 6.0;
            let direction = random.direction().as_dvec3();
            let range = f64::from(random.unit()) * 6.0;
            let kind = i % 4;
            let light = match kind {
                0 => Light::Point { position, color, attenuation, range, radius: 0.0 },
                1 => Light::Spot {
                    position,
                    direction,
                    color,
                    attenuation,
                    range: f64::INFINITY,
                    inner_angle: 0.0,
                    outer_angle: 0.1 + random.unit(),
                },
                2 => {
                    let shape = AreaShape::Disk { centre: position, normal: direction, radius: 0.5 };
                    Light::Area { shape, radiance: color }
                }
                _ => {
                    let half_edges = [direction, direction.any_orthogonal_vector()];
                    Light::Area { shape: AreaShape::Rectangle { centre: position, half_edges }, radiance: color }
                }
            };
            let source = LightSource::new(&light, DVec3::ZERO);
            let gives = (0..200).any(|_| {
                let share = (random.vector().as_dvec3() + 1.0) / 2.0;
                let point = bounds.min + (bounds.max - bounds.min) * share;
                let xi = DVec2::new(random.unit().into(), random.unit().into());
                source.sample(point, xi).is_some_and(|arriving| arriving.color != Vec3::ZERO)
            });
            let reached = reaches(&light, &bounds);
            assert!(reached || !gives, "{light:?}");
            refused[kind] += usize::from(!reached);
            of_no_use[kind] += usize::from(!gives);
        }
        for (refused, of_no_use) in refused.into_iter().zip(of_no_use) {
            assert!(refused > 50 && 3 * refused > 2 * of_no_use, "{refused} of {of_no_use}");
        }
    }

    #[test]
    fn a_light_inside_or_without_an_end_reaches() {
        let bounds = DAabb { min: DVec3::ZERO, max: DVec3::ONE };
        let point = |position, range| {
            let (color, attenuation) = (Vec3::ONE, Attenuation::NONE);
            reaches(&Light::Point { position, color, attenuation, range, radius: 0.0 }, &bounds)
        };
        assert!(point(DVec3::splat(0.5), 0.0) && point(DVec3::splat(1e9), f64::INFINITY));
        assert!(point(DVec3::X * 3.0, 2.0) && !point(DVec3::X * 3.0, 1.99));
        assert!(reaches(&Light::Directional { direction: DVec3::X, color: Vec3::ONE }, &bounds));
    }
}
