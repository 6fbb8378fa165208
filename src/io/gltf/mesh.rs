//! Meshes: each becomes a group, each of its primitives that has area a geometry.
//!
//! Primitives often share their vertices and index a part of them each; only the vertices that a primitive uses are
//! read, so that sharing costs nothing.

use std::sync::Arc;

use rayon::prelude::*;

use super::Document;
use super::accessor::View;
use super::material::Materials;
use super::schema::Primitive;
use crate::error::{Result, Warning};
use crate::io::compact::{compact, pick};
use crate::math::{DVec3, Vec2, Vec3, Vec4};
use crate::scene::{Geometry, Group, Mesh, Scene};

/// Makes a group of every mesh that has area. Gives the group of each of the document's meshes.
pub(super) fn groups(
    document: &Document<'_>,
    materials: &mut Materials<'_>,
    scene: &mut Scene,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Option<u32>>> {
    let (mut flat, mut morphed) = (0, 0);
    let mut groups = Vec::new();
    for (m, mesh) in document.root.meshes.iter().enumerate() {
        let begin = scene.geometries.len() as u32;
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let pointer = format!("/meshes/{m}/primitives/{p}");
            morphed += usize::from(!primitive.targets.is_empty());
            let mode = primitive.mode.unwrap_or(4);
            match mode {
                0..=3 => flat += 1,
                4..=6 => {
                    let mesh =
                        Mesh { name: mesh.name.clone(), ..read(document, materials, primitive, mode, &pointer)? };
                    scene.geometries.push(Geometry::Mesh(mesh));
                }
                _ => return Err(document.error(format!("{pointer}/mode"), format!("mode {mode} is none of 0 to 6"))),
            }
        }
        let geometries = begin..scene.geometries.len() as u32;
        groups.push((!geometries.is_empty()).then_some(scene.groups.len() as u32));
        if !geometries.is_empty() {
            scene.groups.push(Group { name: mesh.name.clone(), geometries });
        }
    }
    if flat > 0 {
        let message = format!("{flat} primitives are points or lines, which have no area, and are left out");
        warnings.push(document.warning("/meshes", message));
    }
    if morphed > 0 {
        let message = format!("{morphed} primitives have morph targets; they are rendered without");
        warnings.push(document.warning("/meshes", message));
    }
    Ok(groups)
}

/// Corners or vertices that are worth a task of their own.
const TASK: usize = 1 << 14;

fn read(
    document: &Document<'_>,
    materials: &mut Materials<'_>,
    primitive: &Primitive,
    mode: u32,
    pointer: &str,
) -> Result<Mesh> {
    let view =
        |index: usize, kinds: &[&str]| View::new(document, index, kinds).map_err(|(at, m)| document.error(at, m));
    let attributes = format!("{pointer}/attributes");
    let position = primitive.attributes.get("POSITION");
    let position = *position.ok_or_else(|| document.error(&attributes, "POSITION is missing"))?;
    let positions = view(position, &["VEC3"])?;
    let (material, texture_set) = materials.get(primitive.material, pointer)?;
    let attribute = |name: &str, kinds: &[&str]| match primitive.attributes.get(name) {
        None => Ok(None),
        Some(&index) => {
            let view = view(index, kinds)?;
            if view.count < positions.count {
                let message = format!("{name} has {} elements for {} positions", view.count, positions.count);
                return Err(document.error(format!("/accessors/{index}/count"), message));
            }
            Ok(Some(view))
        }
    };
    let normals = attribute("NORMAL", &["VEC3"])?;
    let uvs = attribute(&format!("TEXCOORD_{}", texture_set.unwrap_or(0)), &["VEC2"])?;
    let colors = attribute("COLOR_0", &["VEC3", "VEC4"])?;

    let mut triangles: Vec<[u32; 3]> = match primitive.indices {
        None => {
            document.spend(pointer, positions.count as u64 * 4)?;
            triangles(mode, &(0..positions.count as u32).collect::<Vec<_>>())
        }
        Some(index) => {
            let indices = view(index, &["SCALAR"])?;
            if !indices.is_index() {
                let message = "indices have to be unsigned: component type 5121, 5123 or 5125";
                return Err(document.error(format!("/accessors/{index}/componentType"), message));
            }
            document.spend(pointer, indices.count as u64 * 4)?;
            let triangles = match mode {
                4 => indices.triples(),
                _ => triangles(mode, &(0..indices.count).map(|i| indices.index(i)).collect::<Vec<_>>()),
            };
            let is_past = |&i: &u32| i as usize >= positions.count;
            let tasks = triangles.as_flattened().par_chunks(TASK);
            if let Some(past) = tasks.find_map_first(|part| part.iter().copied().find(is_past)) {
                // Looked for only now, since corners of strips and fans belong to several triangles.
                let at = (0..indices.count).position(|i| is_past(&indices.index(i))).unwrap_or_default();
                let message = format!("index {past} (element {at}) is past the {} vertices", positions.count);
                return Err(document.error(format!("/accessors/{index}"), message));
            }
            triangles
        }
    };
    let used = compact(triangles.as_flattened_mut(), positions.count);
    // Positions 12, normals 12, uvs 8, colours 16, and 12 a triangle.
    let count = used.as_ref().map_or(positions.count, Vec::len);
    document.spend(pointer, count as u64 * 48 + triangles.len() as u64 * 12)?;
    let normal = |n: [f32; 3]| DVec3::from(n.map(f64::from)).normalize_or_zero().as_vec3();
    // glTF's v points down, ours up.
    let uv = |uv: [f32; 2]| Vec2::from(uv) * Vec2::new(1.0, -1.0) + Vec2::new(0.0, 1.0);
    let color = |v: &View<'_>, color: [f32; 4]| {
        if v.components() == 3 { Vec4::from(color).with_w(1.0) } else { Vec4::from(color) }
    };
    Ok(Mesh {
        positions: Arc::new(match &used {
            None => positions.vectors(Vec3::from),
            Some(used) => pick(used, |i| Vec3::from(positions.floats::<3>(i))),
        }),
        normals: normals.map_or(Vec::new(), |v| match &used {
            None => v.collect(count, normal),
            Some(used) => pick(used, |i| normal(v.floats(i))),
        }),
        uvs: uvs.map_or(Vec::new(), |v| match &used {
            None => v.collect(count, uv),
            Some(used) => pick(used, |i| uv(v.floats(i))),
        }),
        colors: colors.map_or(Vec::new(), |v| match &used {
            None => v.collect(count, |c| color(&v, c)),
            Some(used) => pick(used, |i| color(&v, v.floats(i))),
        }),
        triangles: Arc::new(triangles),
        material,
        ..Mesh::default()
    })
}

/// Triangles of a list (4), a strip (5) or a fan (6); corners that do not complete one are dropped, as they are by
/// graphics hardware.
fn triangles(mode: u32, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        5 => {
            // Every other triangle of a strip turns the other way.
            let turned = |(k, w): (usize, &[u32])| [w[0], w[1 + k % 2], w[2 - k % 2]];
            corners.windows(3).enumerate().map(turned).collect()
        }
        6 => match corners {
            [first, rest @ ..] => rest.windows(2).map(|w| [w[0], w[1], *first]).collect(),
            [] => Vec::new(),
        },
        _ => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_make_triangles_as_specified() {
        // Section 3.7.2.1: strips {i, i + (1 + i % 2), i + (2 - i % 2)}, fans {i + 1, i + 2, 0}.
        assert_eq!(triangles(4, &[0, 1, 2, 3, 4]), [[0, 1, 2]]);
        assert_eq!(triangles(5, &[0, 1, 2, 3, 4]), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(triangles(6, &[9, 1, 2, 3]), [[1, 2, 9], [2, 3, 9]]);
        assert!([4, 5, 6].iter().all(|&mode| triangles(mode, &[]).is_empty() && triangles(mode, &[1, 2]).is_empty()));
    }
}
