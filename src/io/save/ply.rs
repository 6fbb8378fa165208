//! Binary PLY, little-endian: one mesh of everything, in scene coordinates, which are doubles where f32 does not hold
//! them. Polygons are divided into triangles; materials, normals, texture coordinates, lights and cameras are left out.

use std::io::{self, Write};

use super::{Unsayable, is_colored, moves, placed, wound};
use crate::io::polygon::triangulate;
use crate::math::DVec3;
use crate::scene::{Geometry, Scene, choose_origin};
use crate::shape::{Polygon, Shape};

/// Whether there is nothing but triangles and polygons, few enough for 32-bit indices.
pub(super) fn check(scene: &Scene) -> Result<(), Unsayable> {
    let other = placed(scene).find_map(|(geometry, _)| match geometry {
        Geometry::Mesh(_) => None,
        Geometry::Shapes { shapes, .. } => shapes.iter().find(|shape| !matches!(shape, Shape::Polygon(_))),
    });
    if let Some(shape) = other {
        return Err(format!("PLY holds triangles, and this scene has a {}; write .nff or .toml", shape.name()));
    }
    if moves(scene) {
        return Err("PLY holds what stands still, and this scene moves; write .toml".to_owned());
    }
    if is_colored(scene) {
        return Err("colours of vertices are not written; keep the file they are in".to_owned());
    }
    let [vertices, triangles] = counts(scene);
    let most = vertices.max(triangles);
    let fits = i32::try_from(most).is_ok();
    if fits { Ok(()) } else { Err(format!("{most} vertices or triangles; PLY's indices go to 2^31")) }
}

/// Vertices and triangles.
fn counts(scene: &Scene) -> [u64; 2] {
    let count = |geometry: &Geometry| match geometry {
        Geometry::Mesh(mesh) => [mesh.positions.len() as u64, mesh.triangles.len() as u64],
        Geometry::Shapes { shapes, .. } => {
            let corners = polygons(shapes).map(|polygon| polygon.corners().len() as u64);
            corners.fold([0, 0], |[v, t], corners| [v + corners, t + corners - 2])
        }
    };
    placed(scene).map(|(geometry, _)| count(geometry)).fold([0, 0], |[a, b], [c, d]| [a + c, b + d])
}

fn polygons(shapes: &[Shape]) -> impl Iterator<Item = &Polygon> {
    shapes.iter().filter_map(|shape| match shape {
        Shape::Polygon(polygon) => Some(polygon.as_ref()),
        _ => None,
    })
}

pub(super) fn write(scene: &Scene, out: &mut dyn Write) -> io::Result<()> {
    let [vertices, triangles] = counts(scene);
    // As loaders decide whether f32 holds it.
    let is_far = choose_origin(&scene.bounds()) != DVec3::ZERO;
    let real = if is_far { "double" } else { "float" };
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty {real} x\nproperty {real} y\n\
         property {real} z\nelement face {triangles}\nproperty list uchar int vertex_indices\nend_header\n"
    )?;
    for (geometry, transform) in placed(scene) {
        let mut vertex = |p: DVec3| {
            let p = transform.transform_point3(p);
            if is_far {
                return out.write_all(bytemuck::bytes_of(&p.to_array().map(|x| x.to_bits().to_le())));
            }
            out.write_all(bytemuck::bytes_of(&p.as_vec3().to_array().map(|x| x.to_bits().to_le())))
        };
        match geometry {
            Geometry::Mesh(mesh) => {
                mesh.positions.iter().try_for_each(|&p| vertex(mesh.point(p)))?;
            }
            Geometry::Shapes { shapes, .. } => {
                polygons(shapes).flat_map(Polygon::corners).try_for_each(|p| vertex(p.as_dvec3()))?;
            }
        }
    }
    let mut first = 0u32;
    let mut face = |first: u32, corners: &[u32; 3]| {
        out.write_all(&[3])?;
        out.write_all(bytemuck::bytes_of(&corners.map(|i| (first + i).to_le())))
    };
    for (geometry, transform) in placed(scene) {
        match geometry {
            Geometry::Mesh(mesh) => {
                mesh.triangles.iter().try_for_each(|corners| face(first, &wound(*corners, transform)))?;
                first += mesh.positions.len() as u32;
            }
            Geometry::Shapes { shapes, .. } => {
                for polygon in polygons(shapes) {
                    let corners: Vec<DVec3> = polygon.corners().iter().map(|p| p.as_dvec3()).collect();
                    let mut triangles = Vec::new();
                    triangulate(&corners, &mut triangles).map_err(io::Error::other)?;
                    triangles.iter().try_for_each(|corners| face(first, &wound(*corners, transform)))?;
                    first += corners.len() as u32;
                }
            }
        }
    }
    Ok(())
}
