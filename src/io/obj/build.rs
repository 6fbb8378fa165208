//! From the lists of an OBJ file to meshes.
//!
//! OBJ gives a corner three indices, a mesh has one: corners that agree in all three (and, where normals are computed,
//! in their smoothing group) become one vertex. They are found by a chain of variants for each position, since almost
//! every position has one or two; a hash table of triples would take thrice as long. Where a material's faces have
//! neither texture coordinates nor normals, as most large files, positions are vertices as they are, and all is done in
//! parallel.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use super::mtl::Library;
use super::statement::{Faces, Polygon};
use super::{NONE, Obj, Piece, Section};
use crate::error::{Error, Result, Warning};
use crate::io::polygon;
use crate::math::{DAabb, DVec3, Vec2, Vec3, Vec4};
use crate::memory;
use crate::scene::compact::{compact, pick};
use crate::scene::{Geometry, Mesh, Scene, bounds_of, choose_origin, is_traceable_f64};

/// Positions that are worth a task of their own.
const TASK: usize = 1 << 14;

/// Indices from 0 into positions, uvs and normals; the latter two may be [`NONE`].
#[derive(Clone, Copy, Debug, PartialEq)]
struct Corner([u32; 3]);

/// The triangles of a section.
enum Triangles {
    /// Indices of positions, for faces that have nothing else.
    Plain(Vec<[u32; 3]>),
    /// By piece.
    Detailed(Vec<Vec<Triangle>>),
}

struct Triangle {
    corners: [Corner; 3],
    smoothing: u32,
}

/// Sums of face normals: by position and smoothing group.
type Smooth = HashMap<(u32, u32), DVec3>;

/// Makes the scene: one mesh for each section.
pub(super) fn scene(path: &Path, mut obj: Obj, library: Library, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let sections = std::mem::take(&mut obj.sections);
    let triangles: Vec<Triangles> = sections.iter().map(|section| split(path, &obj, section)).collect::<Result<_>>()?;
    // One origin for all, so that vertices that meshes share stay equal.
    let origin = choose_origin(&bounds(&obj, &triangles));
    obj.faces = Vec::new();
    let smooth = smooth_normals(&obj, &triangles);
    let is_plain = triangles.iter().all(|triangles| matches!(triangles, Triangles::Plain(_)));
    let mut chains = Chains::new(if is_plain { 0 } else { obj.positions.len() });
    let mut geometries = Vec::new();
    let (mut used, mut numbers) = (Vec::new(), HashMap::new());
    for (section, triangles) in sections.into_iter().zip(triangles) {
        let material = *numbers.entry(section.material).or_insert_with_key(|name: &String| {
            used.push(name.clone());
            used.len() as u32 - 1
        });
        let mesh = match triangles {
            Triangles::Plain(triangles) => plain(&obj, triangles, origin),
            Triangles::Detailed(pieces) => detailed(&obj, &smooth, &pieces, origin, &mut chains),
        };
        geometries.push(Geometry::Mesh(Mesh { name: section.name, material, ..mesh }));
    }
    let mut scene = Scene::from_geometries(geometries, Vec::new());
    library.resolve(path, used, !obj.colors.is_empty(), &mut scene, warnings)?;
    Ok(scene)
}

/// Around what rays can hit: neither vertices that no face uses have a say, nor faces with a corner that cannot be
/// traced.
fn bounds(obj: &Obj, triangles: &[Triangles]) -> DAabb {
    let place = |i: u32| obj.positions.get(i as usize).copied();
    if obj.positions.par_iter().with_min_len(TASK).all(is_traceable_f64) {
        let used = |faces: &Faces| bounds_of(&faces.positions, |&i| place(i));
        return obj.faces.iter().map(used).fold(DAabb::EMPTY, DAabb::union);
    }
    let around = |bounds: DAabb, corners: [u32; 3]| {
        let corners = corners.map(|i| place(i).filter(is_traceable_f64));
        if corners.contains(&None) { bounds } else { corners.into_iter().flatten().fold(bounds, DAabb::include) }
    };
    triangles.iter().fold(DAabb::EMPTY, |bounds, triangles| match triangles {
        Triangles::Plain(triangles) => triangles.iter().copied().fold(bounds, around),
        Triangles::Detailed(pieces) => {
            pieces.iter().flatten().map(|triangle| triangle.corners.map(|c| c.0[0])).fold(bounds, around)
        }
    })
}

impl Piece {
    /// Whether its corners have positions and nothing else.
    fn is_plain(&self, obj: &Obj) -> bool {
        let attributes = &obj.faces[self.stretch].attributes;
        let bare = attributes.is_empty() || attributes[self.corners.clone()].iter().all(|a| *a == [NONE; 2]);
        bare && self.smoothing == 0
    }

    /// Its faces with more than three corners.
    fn polygons<'a>(&self, obj: &'a Obj) -> &'a [Polygon] {
        let polygons = &obj.faces[self.stretch].polygons;
        let until = |corner: usize| polygons.partition_point(|polygon| polygon.first < corner);
        &polygons[until(self.corners.start)..until(self.corners.end)]
    }

    /// How many triangles its faces make.
    fn triangle_count(&self, obj: &Obj) -> usize {
        let polygons = self.polygons(obj);
        let corners: usize = polygons.iter().map(|polygon| polygon.corners).sum();
        (self.corners.len() - corners) / 3 + corners - 2 * polygons.len()
    }

    /// Gives `each` the triangles as indices into the stretch's corners.
    fn triangles(&self, path: &Path, obj: &Obj, mut each: impl FnMut([usize; 3])) -> Result<()> {
        let (mut at, mut around, mut parts) = (self.corners.start, Vec::new(), Vec::new());
        let positions = &obj.faces[self.stretch].positions;
        for &Polygon { first, corners, line } in self.polygons(obj) {
            (at..first).step_by(3).for_each(|k| each([k, k + 1, k + 2]));
            at = first + corners;
            around.clear();
            around.extend(positions[first..at].iter().map(|&i| obj.positions[i as usize]));
            parts.clear();
            let split = polygon::triangulate(&around, &mut parts);
            split.map_err(|message| Error::input(path, format!("line {line}"), message))?;
            parts.iter().for_each(|triangle| each(triangle.map(|k| first + k as usize)));
        }
        (at..self.corners.end).step_by(3).for_each(|k| each([k, k + 1, k + 2]));
        Ok(())
    }
}

fn split(path: &Path, obj: &Obj, section: &Section) -> Result<Triangles> {
    let pieces = &section.pieces;
    if pieces.iter().all(|piece| piece.is_plain(obj)) {
        let counts: Vec<usize> = pieces.iter().map(|piece| piece.triangle_count(obj)).collect();
        let mut triangles: Vec<[u32; 3]> = memory::zeroed(counts.iter().sum());
        let mut rest = &mut triangles[..];
        let slots: Vec<_> = counts.iter().map(|&count| rest.split_off_mut(..count).unwrap_or_default()).collect();
        let tasks = pieces.par_iter().zip(slots).map(|(piece, slots)| {
            let positions = &obj.faces[piece.stretch].positions;
            let mut slots = slots.iter_mut();
            piece.triangles(path, obj, |corners| {
                if let Some(slot) = slots.next() {
                    *slot = corners.map(|k| positions[k]);
                }
            })
        });
        tasks.collect::<Vec<_>>().into_iter().collect::<Result<()>>()?;
        return Ok(Triangles::Plain(triangles));
    }
    let tasks = pieces.par_iter().map(|piece| {
        let faces = &obj.faces[piece.stretch];
        let corner = |k: usize| {
            let [uv, normal] = faces.attributes.get(k).copied().unwrap_or([NONE; 2]);
            Corner([faces.positions[k], uv, normal])
        };
        let mut triangles = Vec::with_capacity(piece.triangle_count(obj));
        let smoothing = piece.smoothing;
        piece.triangles(path, obj, |corners| triangles.push(Triangle { corners: corners.map(corner), smoothing }))?;
        Ok(triangles)
    });
    tasks.collect::<Vec<_>>().into_iter().collect::<Result<_>>().map(Triangles::Detailed)
}

/// The normals of corners that have none in the file and lie in a smoothing group: at each position, the mean of the
/// group's face normals, weighted by angle (Thürmer and Wüthrich 1998), over all materials.
fn smooth_normals(obj: &Obj, triangles: &[Triangles]) -> Smooth {
    let mut sums = Smooth::new();
    let detailed = triangles.iter().filter_map(|triangles| match triangles {
        Triangles::Plain(_) => None,
        Triangles::Detailed(pieces) => Some(pieces),
    });
    for Triangle { corners, smoothing } in detailed.flatten().flatten().filter(|t| t.smoothing != 0) {
        let p = corners.map(|c| obj.positions[c.0[0] as usize]);
        if !p.iter().all(is_traceable_f64) {
            continue;
        }
        let normal = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
        for k in 0..3 {
            if corners[k].0[2] == NONE {
                let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
                let weighted = normal * libm::atan2(a.cross(b).length(), a.dot(b));
                let sum = sums.entry((corners[k].0[0], *smoothing)).or_default();
                *sum += if weighted.is_finite() { weighted } else { DVec3::ZERO };
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

/// A mesh whose vertices are positions.
fn plain(obj: &Obj, mut triangles: Vec<[u32; 3]>, origin: DVec3) -> Mesh {
    let used = compact(triangles.as_flattened_mut(), obj.positions.len());
    let position = |p: &DVec3| (p - origin).as_vec3();
    let color = |c: &Vec3| c.extend(1.0);
    let (positions, colors): (_, Vec<Vec4>) = match &used {
        None => (
            obj.positions.par_iter().with_min_len(TASK).map(position).collect(),
            obj.colors.par_iter().with_min_len(TASK).map(color).collect(),
        ),
        Some(used) => (
            pick(used, |i| position(&obj.positions[i])),
            if obj.colors.is_empty() { Vec::new() } else { pick(used, |i| color(&obj.colors[i])) },
        ),
    };
    Mesh { origin, colors, ..Mesh::new(positions, triangles) }
}

/// A mesh whose vertices are the variants of positions.
fn detailed(obj: &Obj, smooth: &Smooth, pieces: &[Vec<Triangle>], origin: DVec3, chains: &mut Chains) -> Mesh {
    chains.start_section();
    let indices = pieces.iter().flatten().map(|&Triangle { corners, smoothing }| {
        // A corner with a normal of its own is the same vertex in every smoothing group.
        corners.map(|corner| chains.vertex(corner, if corner.0[2] == NONE { smoothing } else { 0 }))
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
        ..Mesh::default()
    }
}
