//! Which glowing surface stands in the place of a light.
//!
//! Lights with a surface cannot be seen, so scenes put a shape that glows where they are. Every corner of it then lies
//! on the light's surface, and the middles of its triangles close to it, which no other surface does by chance. To have
//! the file say so would leave out all files that cannot.

use crate::math::DVec3;
use crate::scene::{AreaShape, Light};

/// How far a corner may be off, as a share of the light's size: what files round.
const CORNER: f64 = 1e-3;
/// How far the middle of a triangle may be off: a ball is seldom round.
const MIDDLE: f64 = 0.1;

/// Whether a light has a surface that something may stand in the place of.
pub(super) const fn may_have(light: &Light) -> bool {
    match light {
        Light::Directional { .. } | Light::Spot { .. } => false,
        Light::Point { radius, .. } => *radius > 0.0,
        Light::Area { .. } => true,
    }
}

/// Whether a triangle lies on the surface of `light`.
pub(super) fn has_triangle(light: &Light, corners: [DVec3; 3]) -> bool {
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    corners.iter().all(|&corner| has_point(light, corner, CORNER)) && has_point(light, middle, MIDDLE)
}

/// Whether a light shines from a surface in one plane.
pub(super) const fn is_flat(light: &Light) -> bool {
    matches!(light, Light::Area { shape: AreaShape::Disk { .. } | AreaShape::Rectangle { .. }, .. })
}

/// Whether a polygon lies on the surface of `light`, which is flat.
pub(super) fn has_polygon(light: &Light, corners: &[DVec3]) -> bool {
    corners.iter().all(|&corner| has_point(light, corner, CORNER))
}

/// Whether a sphere is the surface of `light`.
pub(super) fn has_sphere(light: &Light, centre: DVec3, radius: f64) -> bool {
    let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    axes.iter().all(|&axis| has_point(light, centre + axis * radius, CORNER))
}

/// Whether a disk lies on the surface of `light`; `across` are two of its radii that are perpendicular.
pub(super) fn has_disk(light: &Light, centre: DVec3, across: [DVec3; 2]) -> bool {
    let [x, y] = across;
    [DVec3::ZERO, x, -x, y, -y].iter().all(|&offset| has_point(light, centre + offset, CORNER))
}

fn has_point(light: &Light, point: DVec3, tolerance: f64) -> bool {
    let on_sphere = |centre: DVec3, radius: f64| ((point - centre).length() - radius).abs() <= tolerance * radius;
    match light {
        Light::Directional { .. } | Light::Spot { .. } => false,
        Light::Point { position, radius, .. } => *radius > 0.0 && on_sphere(*position, *radius),
        Light::Area { shape: AreaShape::Sphere { centre, radius }, .. } => on_sphere(*centre, *radius),
        Light::Area { shape: AreaShape::Disk { centre, normal, radius }, .. } => {
            let offset = point - centre;
            let limit = tolerance * radius;
            offset.dot(*normal).abs() <= limit && offset.length() <= radius + limit
        }
        Light::Area { shape: AreaShape::Rectangle { centre, half_edges: [a, b] }, .. } => {
            let (offset, across) = (point - centre, a.cross(*b));
            let area = across.length_squared();
            // Coordinates along the half edges, by Cramer's rule in the plane.
            let along = [offset.cross(*b).dot(across) / area, a.cross(offset).dot(across) / area];
            let height = (offset.dot(across) / area.sqrt()).abs();
            height <= tolerance * a.length().max(b.length()) && along.iter().all(|x| x.abs() <= 1.0 + tolerance)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    fn area(shape: AreaShape) -> Light {
        Light::Area { shape, radiance: Vec3::ONE }
    }

    #[test]
    fn what_covers_a_part_of_the_light_is_its_body_and_nothing_else() {
        let centre = DVec3::new(1.0, 2.0, 3.0);
        let panel = area(AreaShape::Rectangle { centre, half_edges: [DVec3::X * 2.0, DVec3::Z] });
        let at = |x: f64, y: f64, z: f64| centre + DVec3::new(x, y, z);
        assert!(has_triangle(&panel, [at(-2.0, 0.0, -1.0), at(2.0, 0.0, -1.0), at(2.0, 0.0, 1.0)]));
        assert!(!has_triangle(&panel, [at(-2.0, 0.0, -1.0), at(2.5, 0.0, -1.0), at(2.0, 0.0, 1.0)]), "beyond the edge");
        assert!(!has_triangle(&panel, [at(-2.0, 0.1, -1.0), at(2.0, 0.1, -1.0), at(2.0, 0.1, 1.0)]), "below");
        let square = [at(-2.0, 0.0, -1.0), at(2.0, 0.0, -1.0), at(2.0, 0.0, 1.0), at(-2.0, 0.0, 1.0)];
        assert!(has_polygon(&panel, &square));
        assert!(!has_polygon(&panel, &square.map(|corner| centre + (corner - centre) * 1.1)));
        let ball = area(AreaShape::Sphere { centre, radius: 2.0 });
        assert!(has_sphere(&ball, centre, 2.0) && !has_sphere(&ball, centre, 1.9) && !has_sphere(&panel, centre, 1.0));
        let cube = 2.0 / 3f64.sqrt();
        assert!(!has_triangle(&ball, [at(cube, cube, cube), at(-cube, cube, cube), at(cube, -cube, cube)]));
        let disk = area(AreaShape::Disk { centre, normal: DVec3::Y, radius: 1.0 });
        assert!(has_disk(&disk, centre, [DVec3::X, DVec3::Z]) && !has_disk(&disk, centre, [DVec3::X, DVec3::Y]));
        assert!(!has_disk(&disk, centre, [DVec3::X * 1.1, DVec3::Z * 1.1]));
    }
}
