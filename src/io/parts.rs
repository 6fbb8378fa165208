//! Primitives of scene files that name a material for each, sorted: one geometry for each material and kind.
//!
//! Such files mix materials freely. A geometry for each run of equal ones, in the order of the file, would give a file
//! that alternates between two colours as many geometries as it has lines, and tracers a part for each.
//!
//! Shapes that have a [local origin](super::dshape::local_origin) are a group of their own.

use std::sync::Arc;

use super::Placeless;
use super::dshape::{self, DShape};
use super::weld::weld;
use crate::math::{DAffine3, DVec3, Vec3};
use crate::scene::{Geometry, Group, Instance, Mesh, Scene};

/// Primitives in the coordinates of one group, by material.
#[derive(Default)]
pub(super) struct Parts(Vec<Part>);

/// Primitives, sorted.
pub(super) struct Sorted {
    /// What stands in the group's own coordinates, by rising material.
    pub(super) near: Vec<Geometry>,
    /// What is to be placed at local origins, likewise.
    pub(super) far: Vec<(DVec3, Vec<Geometry>)>,
}

/// Those of one material.
#[derive(Default)]
struct Part {
    /// Corners of triangles without normals, three after three.
    flat: Vec<DVec3>,
    smooth: Vec<DVec3>,
    /// One for each corner in `smooth`.
    normals: Vec<Vec3>,
    shapes: Vec<DShape>,
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
    ///
    /// # Errors
    /// Those of [`DShape::check`].
    pub(super) fn shape(&mut self, material: u32, shape: DShape) -> Placeless<()> {
        shape.check()?;
        self.of(material).shapes.push(shape);
        Ok(())
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
    pub(super) fn sorted(self) -> Sorted {
        let origin = dshape::local_origin(self.0.iter().flat_map(|part| &part.shapes));
        let (mut geometries, mut far, mut alone) = (Vec::new(), Vec::new(), Vec::new());
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
            let mut together = Vec::with_capacity(part.shapes.len());
            for (place, shape) in part.shapes.iter().map(|shape| shape.local(origin).expect("it was checked")) {
                if place == origin {
                    together.push(shape);
                } else {
                    alone.push((place, vec![Geometry::Shapes { shapes: vec![shape], material }]));
                }
            }
            if !together.is_empty() {
                let list = if origin == DVec3::ZERO { &mut geometries } else { &mut far };
                list.push(Geometry::Shapes { shapes: together, material });
            }
        }
        let far = (!far.is_empty()).then_some((origin, far));
        Sorted { near: geometries, far: far.into_iter().chain(alone).collect() }
    }

    /// Adds everything to a scene whose coordinates these are.
    pub(super) fn show(self, scene: &mut Scene) {
        let Sorted { near, far } = self.sorted();
        let near = (!near.is_empty()).then_some((DVec3::ZERO, near));
        for (origin, geometries) in near.into_iter().chain(far) {
            let group = add_group(scene, "", geometries);
            let transform = DAffine3::from_translation(origin);
            scene.instances.push(Instance { name: String::new(), group, transform, transform_end: None });
        }
    }
}

/// Adds a group of these to the scene, and gives its index.
pub(super) fn add_group(scene: &mut Scene, name: &str, geometries: Vec<Geometry>) -> u32 {
    let first = scene.geometries.len() as u32;
    scene.geometries.extend(geometries);
    scene.groups.push(Group { name: name.to_owned(), geometries: first..scene.geometries.len() as u32 });
    scene.groups.len() as u32 - 1
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
