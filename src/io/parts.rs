//! Primitives of scene files that name a material for each, sorted: one geometry for each material and kind.
//!
//! Such files mix materials freely. A geometry for each run of equal ones, in the order of the file, would give a file that
//! alternates between two colours as many geometries as it has lines, and tracers a part for each.

use std::sync::Arc;

use super::Placeless;
use super::weld::weld;
use crate::math::{DVec3, Vec3};
use crate::scene::{Geometry, Mesh};
use crate::shape::Shape;

/// Primitives in the coordinates of one group.
#[derive(Default)]
pub(super) struct Parts(Vec<Part>);

/// Those of one material.
#[derive(Default)]
struct Part {
    /// Corners of triangles without normals, three after three.
    flat: Vec<DVec3>,
    smooth: Vec<DVec3>,
    /// One for each corner in `smooth`.
    normals: Vec<Vec3>,
    shapes: Vec<Shape>,
}

impl Parts {
    fn of(&mut self, material: u32) -> &mut Part {
        let index = material as usize;
        if self.0.len() <= index {
            self.0.resize_with(index + 1, Part::default);
        }
        &mut self.0[index]
    }

    /// Adds a shape of the material with this index.
    pub(super) fn shape(&mut self, material: u32, shape: Shape) {
        self.of(material).shapes.push(shape);
    }

    /// Adds a flat triangle.
    pub(super) fn triangle(&mut self, material: u32, corners: [DVec3; 3]) -> Placeless<()> {
        let flat = &mut self.of(material).flat;
        flat.extend(corners);
        check_count(flat.len())
    }

    /// Adds a triangle with shading normals of any length; where one is zero or not finite, the triangle is flat there.
    pub(super) fn smooth_triangle(&mut self, material: u32, corners: [DVec3; 3], normals: [DVec3; 3]) -> Placeless<()> {
        let part = self.of(material);
        part.smooth.extend(corners);
        part.normals.extend(normals.map(|normal| normal.normalize_or_zero().as_vec3()));
        check_count(part.smooth.len())
    }

    /// Everything, by rising material.
    pub(super) fn into_geometries(self) -> Vec<Geometry> {
        let mut geometries = Vec::new();
        for (part, material) in self.0.into_iter().zip(0..) {
            if !part.flat.is_empty() {
                geometries.push(Geometry::Mesh(Mesh { material, ..flat_mesh(&part.flat) }));
            }
            if !part.smooth.is_empty() {
                let triangles = (0..part.smooth.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
                let mut mesh =
                    Mesh { normals: part.normals, triangles: Arc::new(triangles), material, ..Mesh::default() };
                mesh.set_positions(&part.smooth);
                geometries.push(Geometry::Mesh(mesh));
            }
            if !part.shapes.is_empty() {
                geometries.push(Geometry::Shapes { shapes: part.shapes, material });
            }
        }
        geometries
    }
}

fn check_count(corners: usize) -> Placeless<()> {
    let fits = u32::try_from(corners).is_ok();
    if fits { Ok(()) } else { Err("more than 2^32 corners of triangles of one material; divide the file".into()) }
}

/// A mesh of triangles whose equal corners are one vertex.
fn flat_mesh(corners: &[DVec3]) -> Mesh {
    // Adding 0 makes one zero of the two.
    let key = |i: usize| [0, 1, 2].map(|k| (corners[3 * i + k] + 0.0).to_array().map(f64::to_bits));
    let (triangles, keys) = weld(corners.len() / 3, key, |_| ());
    let positions: Vec<DVec3> = keys.into_iter().map(|bits| bits.map(f64::from_bits).into()).collect();
    let mut mesh = Mesh { triangles: Arc::new(triangles), ..Mesh::default() };
    mesh.set_positions(&positions);
    mesh
}
