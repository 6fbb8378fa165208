//! Towers of triangles that are as high as the tower and as wide as a window.
//!
//! The boxes of such triangles overlap the boxes of their neighbours; those of
//! [`architecture`](crate::scene::architecture) are slanted as well, and nearly empty.

use std::f32::consts::TAU;

use super::{Scene, fill, noise, staged};
use crate::math::Vec3;
use crate::scene::{Geometry, Mesh};

/// Pleats around a tower; each has two walls of two triangles, and two triangles of the roof.
const PLEATS: u32 = 48;
/// From tower to tower, metres.
const SPACING: f32 = 40.0;

/// n by n towers, from 40 m to 200 m high.
pub(super) fn make(n: u32) -> Scene {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let foot = Vec3::new(i as f32 * SPACING, 0.0, j as f32 * SPACING);
        // Few are high.
        let share = noise(i, j) as f32;
        let height = 40.0 + 160.0 * share * share * share;
        let radius = 9.0 + 6.0 * noise(j, i + 1_000_000) as f32;
        tower(foot, radius, height, &mut positions, &mut triangles);
    }
    let street = fill([0.35, 0.36, 0.4], 1.0, 0.0, 1.0);
    let mesh = Mesh::new(positions, triangles);
    staged(vec![Geometry::Mesh(mesh)], vec![fill([0.8, 0.78, 0.72], 1.0, 0.0, 1.0)], Some(street))
}

/// A star of 48 points, upright, with a roof of slivers around its middle.
fn tower(foot: Vec3, radius: f32, height: f32, positions: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>) {
    let first = positions.len() as u32;
    let edges = 2 * PLEATS;
    for k in 0..edges {
        let (sin, cos) = libm::sincosf(TAU * k as f32 / edges as f32);
        let radius = if k % 2 == 0 { radius } else { radius * 0.94 };
        let rim = foot + Vec3::new(cos, 0.0, -sin) * radius;
        positions.extend([rim, rim + Vec3::Y * height]);
    }
    let top = first + 2 * edges;
    positions.push(foot + Vec3::Y * height);
    for k in 0..edges {
        let [a, b] = [k, (k + 1) % edges].map(|k| first + 2 * k);
        triangles.extend([[a, b, b + 1], [a, b + 1, a + 1], [a + 1, b + 1, top]]);
    }
}
