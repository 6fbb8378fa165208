//! A pyramid of rings, "rings" of the databases: dodecahedra of which only edges and corners are there.

use super::{Scene, fill, staged};
use crate::math::DVec3;
use crate::scene::Geometry;
use crate::shape::{Cylinder, Shape, Sphere};

/// Radius of corners and of edges; the corners of a dodecahedron are sqrt(3) from its middle.
const CORNER: f32 = 0.26;
const EDGE: f32 = 0.16;

/// One dodecahedron at the top, four below it, nine below them.
pub(super) fn make(storeys: u32) -> Scene {
    let corners = corners();
    let edges = edges(&corners);
    let (mut balls, mut bars) = (Vec::new(), Vec::new());
    for storey in 0..storeys {
        let (y, middle) = (-3.4 * f64::from(storey), f64::from(storey) / 2.0);
        for (i, j) in (0..=storey).flat_map(|i| (0..=storey).map(move |j| (i, j))) {
            let centre = DVec3::new(f64::from(i) - middle, 0.0, f64::from(j) - middle) * 3.6 + DVec3::Y * y;
            let at = |k: usize| (centre + corners[k]).as_vec3();
            balls.extend((0..20).map(|k| Shape::Sphere(Sphere { centre: at(k), radius: CORNER })));
            bars.extend(
                edges
                    .iter()
                    .map(|&[a, b]| Shape::Cylinder(Cylinder { base: at(a), apex: at(b), radius: EDGE, capped: false })),
            );
        }
    }
    let materials = vec![fill([0.95, 0.8, 0.4], 0.6, 0.3, 40.0), fill([0.35, 0.5, 0.8], 0.7, 0.2, 20.0)];
    let floor = fill([0.8, 0.8, 0.8], 0.8, 0.1, 5.0);
    let geometry = |(shapes, material)| Geometry::Shapes { shapes, material };
    staged([(balls, 0), (bars, 1)].map(geometry).to_vec(), materials, Some(floor))
}

/// Those of a cube, and of three rectangles whose sides are in the golden ratio's square.
fn corners() -> Vec<DVec3> {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let signs = [-1.0, 1.0];
    let pairs = || signs.into_iter().flat_map(move |a| signs.map(|b| (a, b)));
    let cube = pairs().flat_map(|(x, y)| signs.map(|z| DVec3::new(x, y, z)));
    let (short, long) = (1.0 / golden, golden);
    let rectangles = pairs().flat_map(|(a, b)| {
        let p = DVec3::new(0.0, a * short, b * long);
        [p, DVec3::new(p.y, p.z, p.x), DVec3::new(p.z, p.x, p.y)]
    });
    cube.chain(rectangles).collect()
}

/// The pairs of corners that are nearest to each other, 2 / golden ratio apart.
fn edges(corners: &[DVec3]) -> Vec<[usize; 2]> {
    let length = 5f64.sqrt() - 1.0;
    let pairs = (0..corners.len()).flat_map(|a| (0..a).map(move |b| [a, b]));
    pairs.filter(|&[a, b]| (corners[a].distance(corners[b]) - length).abs() < 1e-9).collect()
}
