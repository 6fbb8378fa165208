//! Gears that mesh, "gears" of the databases: large concave polygons beside small ones.

use std::f64::consts::TAU;
use std::sync::Arc;

use super::{Scene, fill, staged};
use crate::math::{DVec2, DVec3};
use crate::scene::Geometry;
use crate::shape::{Polygon, Shape};

/// Teeth of a gear. Even, so that neighbours to the left and right mesh alike.
const TEETH: u32 = 24;
/// Mean radius, the height of a tooth above it, and the thickness.
const RADIUS: f64 = 1.0;
const TOOTH: f64 = 0.07;
const THICKNESS: f64 = 0.4;

/// A cube of n gears a side, standing upright; neighbours in a layer mesh, layers have colours in turn.
pub(super) fn make(n: u32) -> Scene {
    let mut layers = vec![Vec::new(); COLORS.len()];
    for layer in 0..n {
        let gears = &mut layers[layer as usize % COLORS.len()];
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let centre = DVec3::new(2.0 * f64::from(i), 2.0 * f64::from(j), -1.5 * THICKNESS * f64::from(layer));
            // Every second gear is half a tooth farther, so that its teeth are in the gaps of the others.
            add_gear(centre, f64::from((i + j) % 2) * 0.5, gears);
        }
    }
    let used = layers.into_iter().zip(0..).filter(|(gears, _)| !gears.is_empty());
    let geometries = used.map(|(shapes, material)| Geometry::Shapes { shapes, material }).collect();
    let floor = fill([0.5, 0.5, 0.5], 0.8, 0.15, 5.0);
    staged(geometries, COLORS.map(|color| fill(color, 0.8, 0.15, 15.0)).to_vec(), Some(floor))
}

const COLORS: [[f32; 3]; 5] =
    [[0.9, 0.3, 0.2], [0.95, 0.75, 0.3], [0.4, 0.75, 0.35], [0.3, 0.55, 0.9], [0.7, 0.4, 0.8]];

/// Two faces of four corners a tooth, and a strip of squares between them.
fn add_gear(centre: DVec3, phase: f64, shapes: &mut Vec<Shape>) {
    let outline: Vec<DVec2> = (0..TEETH).flat_map(|tooth| tooth_outline(f64::from(tooth) + phase)).collect();
    let corner = |p: &DVec2, z: f64| (centre + p.extend(z * THICKNESS / 2.0)).as_vec3();
    let mut add = |corners: Vec<_>| {
        // None of them is degenerate at any size that is made.
        shapes.extend(Polygon::new(corners).map(|polygon| Shape::Polygon(Arc::new(polygon))));
    };
    add(outline.iter().map(|p| corner(p, 1.0)).collect());
    add(outline.iter().rev().map(|p| corner(p, -1.0)).collect());
    for (p, q) in outline.iter().zip(outline.iter().cycle().skip(1)) {
        add(vec![corner(p, -1.0), corner(q, -1.0), corner(q, 1.0), corner(p, 1.0)]);
    }
}

/// From one gap over the tooth to the next: flanks lean by an eighth of a tooth, and leave a little play.
fn tooth_outline(tooth: f64) -> [DVec2; 4] {
    let at = |share: f64, radius: f64| {
        let (sin, cos) = libm::sincos(TAU * (tooth + share) / f64::from(TEETH));
        DVec2::new(cos, sin) * radius
    };
    let (low, high) = (RADIUS - TOOTH, RADIUS + TOOTH * 0.9);
    [at(-0.27, low), at(-0.13, high), at(0.13, high), at(0.27, low)]
}
