//! The sphereflake, "balls" of the databases.

use super::{Scene, fill, staged};
use crate::math::DVec3;
use crate::scene::Geometry;
use crate::shape::{Shape, Sphere};

/// A sphere; on every sphere, but those of the last generation, nine of a third of its radius: six around its equator,
/// three above, which are nine of the twelve neighbours in a close packing of spheres.
pub(super) fn make(generations: u32) -> Scene {
    let mut spheres = Vec::new();
    grow(DVec3::ZERO, DVec3::Y, 1.0, generations, &mut spheres);
    let gold = fill([1.0, 0.85, 0.6], 0.6, 0.35, 20.0);
    let floor = fill([0.9, 0.75, 0.5], 1.0, 0.0, 1.0);
    staged(vec![Geometry::Shapes { shapes: spheres, material: 0 }], vec![gold], Some(floor))
}

/// Adds a sphere that stands on its parent along `axis`, and those that stand on it.
fn grow(centre: DVec3, axis: DVec3, radius: f64, generations: u32, spheres: &mut Vec<Shape>) {
    spheres.push(Shape::Sphere(Sphere { centre: centre.as_vec3(), radius: radius as f32 }));
    if generations == 0 {
        return;
    }
    let (x, z) = axis.any_orthonormal_pair();
    let direction = |elevation: f64, degrees: f64| {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        (x * cos + z * sin) * (1.0 - elevation * elevation).sqrt() + axis * elevation
    };
    let around = (0..6u8).map(|k| direction(0.0, 60.0 * f64::from(k)));
    // The upper layer of the packing is sqrt(2/3) of a diameter above.
    let above = (0..3u8).map(|k| direction((2.0f64 / 3.0).sqrt(), 120.0 * f64::from(k) + 30.0));
    for direction in around.chain(above) {
        grow(centre + direction * (radius * 4.0 / 3.0), direction, radius / 3.0, generations - 1, spheres);
    }
}
