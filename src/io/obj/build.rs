//! From the lists of an OBJ file to meshes.
//!
//! OBJ gives a corner three indices, a mesh has one: corners that agree in all three (and, where normals are computed,
//! in their smoothing group) become one vertex. They are found by a chain of variants for each position, since almost
//! every position has one or two; a hash table of triples would take thrice as long.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::mtl::Library;
use super::{Corner, Face, NONE, Obj, Section};
use crate::error::{Error, Result, Warning};
use crate::io::polygon;
use crate::math::{DAabb, DVec3, Vec2, Vec3};
use crate::scene::{Geometry, Mesh, Scene, choose_origin};

/// Sums of face normals: by position and smoothing group.
type Smooth = HashMap<(u32, u32), DVec3>;

/// Makes the scene: one mesh for each section that has faces.
pub(super) fn scene(path: &Path, mut obj: Obj, library: Library, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let sections = std::mem::take(&mut obj.sections);
    let mut triangles = Vec::new();
    for section in &sections {
        triangles.push(split(path, &obj, section)?);
    }
    let smooth = smooth_normals(&obj, &sections, &triangles);
    // One origin for all, so that vertices that meshes share stay equal.
    let finite = obj.positions.iter().filter(|p| p.is_finite());
    let origin = choose_origin(&finite.fold(DAabb::EMPTY, |all, &p| all.include(p)));
    let mut chains = Chains::new(obj.positions.len());
    let mut geometries = Vec::new();
    let mut used = Vec::new();
    for (section, triangles) in sections.into_iter().zip(triangles) {
        if section.faces.is_empty() {
            continue;
        }
        let material = geometries.len() as u32;
        let mut mesh = mesh(&obj, &smooth, &section, &triangles, origin, &mut chains);
        mesh.material = material;
        used.push(section.material);
        geometries.push(Geometry::Mesh(mesh));
    }
    let (materials, textures) = library.resolve(path, used, !obj.colors.is_empty(), warnings)?;
    Ok(Scene { textures, ..Scene::from_geometries(geometries, materials) })
}

/// A triangle of a section: three of its corners, and the smoothing group of the face.
struct Triangle {
    corners: [u32; 3],
    smoothing: u32,
}

fn split(path: &Path, obj: &Obj, section: &Section) -> Result<Vec<Triangle>> {
    let mut triangles = Vec::with_capacity(section.faces.len());
    let mut begin = 0;
    let (mut around, mut parts) = (Vec::new(), Vec::new());
    for &Face { corners, smoothing, line } in &section.faces {
        if corners == 3 {
            triangles.push(Triangle { corners: [begin, begin + 1, begin + 2], smoothing });
        } else {
            let polygon = &section.corners[begin as usize..(begin + corners) as usize];
            around.clear();
            around.extend(polygon.iter().map(|c| obj.positions[c.0[0] as usize]));
            parts.clear();
            polygon::triangulate(&around, &mut parts).ok_or_else(|| {
                let message = format!("a face with {corners} corners is too concave to split; write smaller faces");
                Error::input(path, format!("line {line}"), message)
            })?;
            triangles.extend(parts.iter().map(|t| Triangle { corners: t.map(|k| begin + k), smoothing }));
        }
        begin += corners;
    }
    Ok(triangles)
}

/// The normals of corners that have none in the file and lie in a smoothing group: at each position, the mean of the
/// group's face normals, weighted by angle (Thürmer and Wüthrich 1998), over all materials.
fn smooth_normals(obj: &Obj, sections: &[Section], triangles: &[Vec<Triangle>]) -> Smooth {
    let mut sums = Smooth::new();
    for (section, triangles) in sections.iter().zip(triangles) {
        for triangle in triangles.iter().filter(|t| t.smoothing != 0) {
            let corners = triangle.corners.map(|k| section.corners[k as usize]);
            let p = corners.map(|c| obj.positions[c.0[0] as usize]);
            let normal = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
            for k in 0..3 {
                if corners[k].0[2] == NONE {
                    let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
                    let weighted = normal * libm::atan2(a.cross(b).length(), a.dot(b));
                    let sum = sums.entry((corners[k].0[0], triangle.smoothing)).or_default();
                    *sum += if weighted.is_finite() { weighted } else { DVec3::ZERO };
                }
            }
        }
    }
    sums
}

/// For each position the vertices that have been made of it, as lists threaded through one array.
struct Chains {
    /// Of each position: the section it was last used in, and the first of its vertices there.
    first: Vec<(u32, u32)>,
    section: u32,
    /// Of each vertex: what it was made of, and the next one of the same position.
    vertices: Vec<(Corner, u32, u32)>,
}

impl Chains {
    fn new(positions: usize) -> Self {
        Self { first: vec![(0, NONE); positions], section: 0, vertices: Vec::new() }
    }

    fn start_section(&mut self) {
        self.section += 1;
        self.vertices.clear();
    }

    fn vertex(&mut self, corner: Corner, smoothing: u32) -> u32 {
        let first = &mut self.first[corner.0[0] as usize];
        if first.0 != self.section {
            *first = (self.section, NONE);
        }
        let mut at = first.1;
        while at != NONE {
            let (other, group, next) = self.vertices[at as usize];
            if (other, group) == (corner, smoothing) {
                return at;
            }
            at = next;
        }
        self.vertices.push((corner, smoothing, first.1));
        first.1 = self.vertices.len() as u32 - 1;
        first.1
    }
}

fn mesh(
    obj: &Obj,
    smooth: &Smooth,
    section: &Section,
    triangles: &[Triangle],
    origin: DVec3,
    chains: &mut Chains,
) -> Mesh {
    chains.start_section();
    let indices = triangles.iter().map(|triangle| {
        triangle.corners.map(|k| {
            let corner = section.corners[k as usize];
            // A corner with a normal of its own is the same vertex in every smoothing group.
            let smoothing = if corner.0[2] == NONE { triangle.smoothing } else { 0 };
            chains.vertex(corner, smoothing)
        })
    });
    let indices: Vec<[u32; 3]> = indices.collect();
    let vertices = &chains.vertices;
    let position = |c: &Corner| (obj.positions[c.0[0] as usize] - origin).as_vec3();
    let has_normals = vertices.iter().any(|(c, smoothing, _)| c.0[2] != NONE || *smoothing != 0);
    let normal = |&(c, smoothing, _): &(Corner, u32, u32)| match c.0[2] {
        // Zero shades as flat.
        NONE => smooth.get(&(c.0[0], smoothing)).map_or(Vec3::ZERO, |sum| sum.normalize_or_zero().as_vec3()),
        index => obj.normals[index as usize],
    };
    let has_uvs = vertices.iter().any(|(c, ..)| c.0[1] != NONE);
    let uv = |c: &Corner| if c.0[1] == NONE { Vec2::ZERO } else { obj.uvs[c.0[1] as usize] };
    Mesh {
        name: section.name.clone(),
        origin,
        positions: Arc::new(vertices.iter().map(|(c, ..)| position(c)).collect()),
        normals: if has_normals { vertices.iter().map(normal).collect() } else { Vec::new() },
        uvs: if has_uvs { vertices.iter().map(|(c, ..)| uv(c)).collect() } else { Vec::new() },
        colors: if obj.colors.is_empty() {
            Vec::new()
        } else {
            vertices.iter().map(|(c, ..)| obj.colors[c.0[0] as usize].extend(1.0)).collect()
        },
        triangles: Arc::new(indices),
        material: 0,
    }
}
