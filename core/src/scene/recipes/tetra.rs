//! The tetrahedral pyramid, "tetra" of the databases.

use super::{Scene, fill, staged};
use crate::math::Vec3;
use crate::scene::{Geometry, Mesh};

/// Four tetrahedra of half the size in the corners of each, 4^n in the end.
pub(super) fn make(generations: u32) -> Scene {
    // Regular, on its base, with edges of sqrt(8/3).
    let (r, h) = (8f32.sqrt() / 3.0, -1.0 / 3.0);
    let corner = |x: f32, z: f32| Vec3::new(r * x, h, r * z);
    let half = 0.75f32.sqrt();
    let corners = [Vec3::Y, corner(1.0, 0.0), corner(-0.5, half), corner(-0.5, -half)];
    let mut mesh = Mesh::default();
    let mut positions = Vec::new();
    divide(corners, generations, &mut positions);
    mesh.triangles = std::sync::Arc::new(
        (0..positions.len() as u32 / 4)
            .flat_map(|k| [[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]].map(|t: [u32; 3]| t.map(|i| 4 * k + i)))
            .collect(),
    );
    mesh.positions = std::sync::Arc::new(positions);
    let floor = fill([0.45, 0.45, 0.5], 1.0, 0.0, 1.0);
    staged(vec![Geometry::Mesh(mesh)], vec![fill([1.0, 0.7, 0.25], 0.9, 0.0, 1.0)], Some(floor))
}

fn divide(corners: [Vec3; 4], generations: u32, positions: &mut Vec<Vec3>) {
    if generations == 0 {
        positions.extend(corners);
        return;
    }
    for corner in corners {
        divide(corners.map(|p| (p + corner) / 2.0), generations - 1, positions);
    }
}
