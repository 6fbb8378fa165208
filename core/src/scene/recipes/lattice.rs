//! Teapots on a grid: one mesh, many placements.

use std::f64::consts::TAU;

use super::{Scene, fill, noise, stage, teapot};
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use crate::scene::{Geometry, Group, Instance};

/// From teapot to teapot; one is 5.8 long.
const SPACING: f64 = 7.0;

/// n teapots along each axis, each with a turn and a size of its own.
pub(super) fn make(n: u32) -> Scene {
    let mut instances = Vec::with_capacity((n * n * n) as usize);
    for (x, y, z) in (0..n).flat_map(|x| (0..n).flat_map(move |y| (0..n).map(move |z| (x, y, z)))) {
        let index = (x * n + y) * n + z;
        let at = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) * SPACING;
        let matrix = turn(index) * DMat3::from_diagonal(DVec3::splat(0.7 + 0.5 * noise(index, 3)));
        let transform = DAffine3::from_mat3_translation(matrix, at);
        instances.push(Instance { name: format!("teapot {x} {y} {z}"), group: 0, transform, transform_end: None });
    }
    let mut scene = Scene {
        geometries: vec![Geometry::Mesh(teapot::mesh())],
        groups: vec![Group { name: "teapot".to_owned(), geometries: 0..1 }],
        instances,
        materials: vec![fill([0.75, 0.78, 0.85], 0.75, 0.15, 40.0)],
        ..Scene::default()
    };
    stage(&mut scene, None);
    scene
}

/// A random attitude (Shoemake 1992, *Uniform random rotations*).
fn turn(index: u32) -> DMat3 {
    let [u, v, w] = [0, 1, 2].map(|k| noise(index, k));
    let ((sin_v, cos_v), (sin_w, cos_w)) = (libm::sincos(TAU * v), libm::sincos(TAU * w));
    let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
    DMat3::from_quat(DQuat::from_xyzw(a * sin_v, a * cos_v, b * sin_w, b * cos_w).normalize())
}
