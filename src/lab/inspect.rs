//! What a scene holds, and what about it looks like a mistake.
//!
//! A mesh's vertices are first merged by position, since files repeat a vertex for each normal and texture coordinate:
//! two triangles are neighbours where their edges join the same two points. Vertices, triangles and edges are sorted
//! and then read in runs. Hash maps would do the same, with a random access for each of the three edges of a triangle;
//! sorting runs on all cores and reads memory in order.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use rayon::prelude::*;
use serde::Serialize;

use super::exact::{Approx, Dyadic, Ring, cross, vector, zip};
use crate::math::{DAabb, Vec3, is_traceable};
use crate::scene::{Geometry, Light, Mesh, Scene};
use crate::shape::Shape;

/// What a scene holds. Serialises as the document of `info --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Inspection {
    /// Triangles as stored: those of an instanced mesh count once.
    pub triangles: u64,
    /// Primitives as placed: those of an instanced mesh count once for each instance.
    pub placed_primitives: u64,
    /// Vertices as stored.
    pub vertices: u64,
    /// Shapes that are not meshes, as stored.
    pub shapes: u64,
    /// How many of each kind.
    pub shape_kinds: BTreeMap<&'static str, u64>,
    /// Meshes and lists of shapes.
    pub geometries: u64,
    /// Placements of groups of geometries.
    pub instances: u64,
    /// Smallest and largest coordinates in the scene, metres; None where nothing can be hit.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Names of the materials.
    pub materials: Vec<String>,
    /// The textures.
    pub textures: Vec<TextureInfo>,
    /// Kinds of the lights: `directional`, `point` or `spot`.
    pub lights: Vec<&'static str>,
    /// Names of the cameras.
    pub cameras: Vec<String>,
    /// Memory of the scene's own data, without any engine's.
    pub bytes: u64,
    /// The meshes, in the order of the scene's geometries.
    pub meshes: Vec<MeshInfo>,
}

/// A texture.
#[derive(Clone, Debug, Serialize)]
pub struct TextureInfo {
    /// Its name.
    pub name: String,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// A mesh.
#[derive(Clone, Debug, Serialize)]
pub struct MeshInfo {
    /// Its name; may be empty.
    pub name: String,
    /// Index of its geometry.
    pub geometry: u32,
    /// How many triangles.
    pub triangles: u64,
    /// How many vertices.
    pub vertices: u64,
    /// What looks like a mistake.
    pub suspicious: Suspicious,
}

/// Counts of what looks like a mistake in a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Suspicious {
    /// Triangles with an area of exactly zero.
    pub degenerate: u64,
    /// Triangles with a corner that is NaN, infinite or too large to trace.
    pub not_finite: u64,
    /// Triangles at the same three points as another one, beyond the first; in any order of the corners.
    pub duplicate: u64,
    /// Edges of one triangle only.
    pub open_edges: u64,
    /// Edges of three or more triangles.
    pub non_manifold_edges: u64,
    /// Edges that their two triangles run along in the same direction, so that one of them faces the wrong way.
    pub flipped_edges: u64,
}

impl Suspicious {
    /// Counts with what they count, in the order of the reports.
    pub fn rows(&self) -> [(&'static str, u64); 6] {
        [
            ("degenerate triangles", self.degenerate),
            ("NaN or infinite triangles", self.not_finite),
            ("duplicate triangles", self.duplicate),
            ("open edges", self.open_edges),
            ("non-manifold edges", self.non_manifold_edges),
            ("edges with flipped winding", self.flipped_edges),
        ]
    }
}

impl Inspection {
    /// Looks through the whole scene, in parallel on rayon's current thread pool.
    pub fn new(scene: &Scene) -> Self {
        let meshes = scene.geometries.iter().enumerate().filter_map(|(i, geometry)| match geometry {
            Geometry::Mesh(mesh) => Some(MeshInfo::new(i as u32, mesh)),
            Geometry::Shapes { .. } => None,
        });
        let meshes: Vec<MeshInfo> = meshes.collect();
        let shapes = scene.geometries.iter().flat_map(|geometry| match geometry {
            Geometry::Mesh(_) => &[][..],
            Geometry::Shapes { shapes, .. } => &shapes[..],
        });
        let mut shape_kinds = BTreeMap::new();
        shapes.for_each(|shape| *shape_kinds.entry(shape.name()).or_default() += 1);
        let bounds: DAabb = scene.bounds();
        let textures = scene.textures.iter();
        let textures = textures.map(|t| TextureInfo { name: t.name.clone(), width: t.width, height: t.height });
        let lights = scene.lights.iter().map(|light| match light {
            Light::Directional { .. } => "directional",
            Light::Point { .. } => "point",
            Light::Spot { .. } => "spot",
            Light::Area { .. } => "area",
        });
        Self {
            triangles: meshes.iter().map(|m| m.triangles).sum(),
            placed_primitives: scene.primitive_count(),
            vertices: meshes.iter().map(|m| m.vertices).sum(),
            shapes: shape_kinds.values().sum(),
            shape_kinds,
            geometries: scene.geometries.len() as u64,
            instances: scene.instances.len() as u64,
            bounds: (!bounds.is_empty()).then(|| [bounds.min.to_array(), bounds.max.to_array()]),
            materials: scene.materials.iter().map(|m| m.name.clone()).collect(),
            textures: textures.collect(),
            lights: lights.collect(),
            cameras: scene.cameras.iter().map(|c| c.name.clone()).collect(),
            bytes: bytes(scene),
            meshes,
        }
    }
}

fn bytes(scene: &Scene) -> u64 {
    let geometries = scene.geometries.iter().map(|geometry| match geometry {
        Geometry::Mesh(mesh) => {
            size_of_val(&mesh.positions[..])
                + size_of_val(&mesh.triangles[..])
                + size_of_val(&mesh.normals[..])
                + size_of_val(&mesh.uvs[..])
                + size_of_val(&mesh.second_uvs[..])
                + size_of_val(&mesh.colors[..])
        }
        Geometry::Shapes { shapes, .. } => shapes.iter().map(Shape::bytes).sum(),
    });
    // Textures may share a picture.
    let mut pictures: Vec<_> = scene.textures.iter().map(|texture| &texture.pixels).collect();
    pictures.sort_by_key(|pixels| Arc::as_ptr(pixels));
    pictures.dedup_by(|a, b| Arc::ptr_eq(a, b));
    let textures = pictures.into_iter().map(|pixels| size_of_val(&pixels[..]));
    let instances = size_of_val(&scene.instances[..]);
    (geometries.sum::<usize>() + textures.sum::<usize>() + instances) as u64
}

impl MeshInfo {
    fn new(geometry: u32, mesh: &Mesh) -> Self {
        Self {
            name: mesh.name.clone(),
            geometry,
            triangles: mesh.triangles.len() as u64,
            vertices: mesh.positions.len() as u64,
            suspicious: suspicious(mesh),
        }
    }
}

/// Counts what looks like a mistake.
pub fn suspicious(mesh: &Mesh) -> Suspicious {
    let points = merge(&mesh.positions);
    let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize]);
    let is_finite = |t: &&[u32; 3]| corners(t).into_iter().all(is_traceable);
    let finite: Vec<[u32; 3]> = mesh.triangles.par_iter().filter(is_finite).copied().collect();
    // Distinct points: a triangle that repeats one has no third edge, and its neighbours share the other two.
    let merged: Vec<[u32; 3]> = (finite.par_iter().map(|t| t.map(|i| points[i as usize])))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    let mut result = Suspicious {
        degenerate: finite.par_iter().filter(|t| !has_area(corners(t))).count() as u64,
        not_finite: (mesh.triangles.len() - finite.len()) as u64,
        duplicate: count_duplicates(&merged),
        ..Suspicious::default()
    };
    count_edges(&merged, &mut result);
    result
}

/// For each vertex the number of its point: vertices at the same position have the same.
fn merge(positions: &[Vec3]) -> Vec<u32> {
    // Adding zero makes one of the two zeros.
    let key = |i: &u32| positions[*i as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(key);
    let mut points = vec![0; positions.len()];
    for (point, run) in order.chunk_by(|a, b| key(a) == key(b)).enumerate() {
        for &vertex in run {
            points[vertex as usize] = point as u32;
        }
    }
    points
}

/// Whether the area is not zero, exactly.
fn has_area(corners: [Vec3; 3]) -> bool {
    fn normal<R: Ring>(corners: [Vec3; 3]) -> [R; 3] {
        let [a, b, c] = corners.map(vector::<R>);
        cross(&zip(&b, &a, R::sub), &zip(&c, &a, R::sub))
    }
    let signs = normal::<Approx>(corners).map(|x| x.signum());
    let certain = signs.iter().any(|sign| matches!(sign, Some(1 | -1)));
    certain || normal::<Dyadic>(corners).iter().any(|x| x.signum() != 0)
}

fn count_duplicates(triangles: &[[u32; 3]]) -> u64 {
    let sorted = triangles.par_iter().map(|t| {
        let mut t = *t;
        t.sort_unstable();
        t
    });
    let mut keys: Vec<[u32; 3]> = sorted.collect();
    keys.par_sort_unstable();
    keys.chunk_by(|a, b| a == b).map(|run| run.len() as u64 - 1).sum()
}

fn count_edges(triangles: &[[u32; 3]], result: &mut Suspicious) {
    // The two points in rising order, and whether the triangle runs from the higher to the lower.
    let edge = |a: u32, b: u32| (a.min(b), a.max(b), a > b);
    let edges = triangles.par_iter().flat_map_iter(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]);
    let mut edges: Vec<(u32, u32, bool)> = edges.collect();
    edges.par_sort_unstable();
    for run in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        match run {
            [_] => result.open_edges += 1,
            [one, other] => result.flipped_edges += u64::from(one.2 == other.2),
            _ => result.non_manifold_edges += 1,
        }
    }
}

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut row = |name: &str, value: &dyn fmt::Display| writeln!(f, "{name:<12}{value}");
        row("triangles", &self.triangles)?;
        row("vertices", &self.vertices)?;
        if self.shapes > 0 {
            let kinds: Vec<_> = self.shape_kinds.iter().map(|(kind, count)| format!("{kind} {count}")).collect();
            row("shapes", &format!("{} ({})", self.shapes, kinds.join(", ")))?;
        }
        row("geometries", &self.geometries)?;
        row("instances", &format!("{} ({} primitives as placed)", self.instances, self.placed_primitives))?;
        match self.bounds {
            Some([min, max]) => {
                let size = [0, 1, 2].map(|i| max[i] - min[i]);
                row("bounds", &format!("{min:?} to {max:?} m"))?;
                row("size", &format!("{size:?} m"))?;
            }
            None => row("bounds", &"nothing can be hit")?,
        }
        row("materials", &list(&self.materials))?;
        let textures: Vec<_> =
            self.textures.iter().map(|t| format!("{} ({} x {})", or_unnamed(&t.name), t.width, t.height)).collect();
        row("textures", &list(&textures))?;
        row("lights", &list(&self.lights))?;
        row("cameras", &list(&self.cameras))?;
        row("memory", &format!("{:.1} MiB", self.bytes as f64 / f64::from(1 << 20)))?;
        let mut clean = true;
        for mesh in &self.meshes {
            let found: Vec<_> = mesh.suspicious.rows().into_iter().filter(|(_, count)| *count > 0).collect();
            if !found.is_empty() {
                clean = false;
                writeln!(f, "geometry {} {:?}, {} triangles:", mesh.geometry, mesh.name, mesh.triangles)?;
                for (what, count) in found {
                    writeln!(f, "  {count:>10} {what}")?;
                }
            }
        }
        write!(f, "{}", if clean { "nothing suspicious\n" } else { "" })
    }
}

/// How many, and the first few by name.
fn list<S: AsRef<str>>(names: &[S]) -> String {
    const SHOWN: usize = 8;
    let shown: Vec<&str> = names.iter().take(SHOWN).map(|name| or_unnamed(name.as_ref())).collect();
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    if names.is_empty() { "0".to_owned() } else { format!("{}: {}{more}", names.len(), shown.join(", ")) }
}

fn or_unnamed(name: &str) -> &str {
    if name.is_empty() { "(unnamed)" } else { name }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Mesh {
        Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z], vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    }

    fn with(change: impl FnOnce(&mut Vec<Vec3>, &mut Vec<[u32; 3]>)) -> Suspicious {
        let Mesh { positions, triangles, .. } = tetrahedron();
        let (mut positions, mut triangles) = (positions.to_vec(), triangles.to_vec());
        change(&mut positions, &mut triangles);
        suspicious(&Mesh::new(positions, triangles))
    }

    #[test]
    fn a_closed_mesh_is_clean_and_each_fault_is_found_alone() {
        let clean = Suspicious::default();
        assert_eq!(with(|_, _| ()), clean);
        assert_eq!(with(|_, t| t.truncate(3)), Suspicious { open_edges: 3, ..clean });
        assert_eq!(with(|_, t| t[3] = [1, 3, 2]), Suspicious { flipped_edges: 3, ..clean });
        // Again, with other corners first: its three edges now have three triangles each.
        assert_eq!(with(|_, t| t.push([2, 3, 1])), Suspicious { duplicate: 1, non_manifold_edges: 3, ..clean });
        assert_eq!(with(|_, t| t.push([1, 1, 2])), Suspicious { degenerate: 1, ..clean });
    }

    #[test]
    fn faces_that_cannot_be_hit_leave_holes() {
        let found = with(|p, _| p[3].x = f32::NAN);
        assert_eq!(found, Suspicious { not_finite: 3, open_edges: 3, ..Suspicious::default() });
    }

    #[test]
    fn vertices_are_merged_by_position_and_both_zeros_are_one() {
        let split = with(|p, t| {
            p.push(Vec3::new(-0.0, 0.0, -0.0));
            t[0][0] = 4;
        });
        assert_eq!(split, Suspicious::default());
    }

    #[test]
    fn area_is_judged_exactly() {
        let line = |k: f32| Vec3::new(1.0, 3.0, 5.0) * k;
        assert!(!has_area([line(1.0), line(3.0), line(7.0)]));
        assert!(has_area([line(1.0), line(3.0), line(7.0) + Vec3::X * 1e-6]));
        assert!(has_area([Vec3::ZERO, Vec3::X * 1e-40, Vec3::Y * 1e-40]));
        assert!(!has_area([Vec3::ZERO, Vec3::X * 1e-40, Vec3::X * 1e18]));
    }

    #[test]
    fn scenes_are_counted() {
        let scene = Scene::from_geometries(vec![Geometry::Mesh(tetrahedron())], vec![Default::default()]);
        let info = Inspection::new(&scene);
        assert_eq!((info.triangles, info.vertices, info.placed_primitives, info.instances), (4, 4, 4, 1));
        assert_eq!(info.bounds, Some([[0.0; 3], [1.0; 3]]));
        assert!(info.bytes >= 4 * 12 * 2 && info.to_string().ends_with("nothing suspicious\n"));
        let empty = Inspection::new(&Scene::default());
        assert!(empty.bounds.is_none() && empty.to_string().contains("nothing can be hit"));
    }
}
