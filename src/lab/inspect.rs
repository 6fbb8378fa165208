//! What a scene holds, and what about it looks like a mistake.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use rayon::prelude::*;
use serde::Serialize;

use super::suspicious::{Suspicious, suspicious};
use crate::math::DAabb;
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
    /// Kinds of the lights: `directional`, `point`, `spot` or `area`.
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

impl Inspection {
    /// Looks through the whole scene, in parallel on rayon's current thread pool.
    pub fn new(scene: &Scene) -> Self {
        // Side by side, for of many small meshes each is too little to be shared out.
        let meshes = scene.geometries.par_iter().enumerate().filter_map(|(i, geometry)| match geometry {
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
    pictures.sort_by_key(|pixels| pixels.address());
    pictures.dedup_by_key(|pixels| pixels.address());
    let textures = pictures.into_iter().map(|pixels| pixels.bytes().len());
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
        let rows = |f: &mut fmt::Formatter<'_>, suspicious: &Suspicious| {
            let mut found = suspicious.rows().into_iter().filter(|(_, count)| *count > 0);
            found.try_for_each(|(what, count)| writeln!(f, "  {count:>10} {what}"))
        };
        let faulty: Vec<_> = self.meshes.iter().filter(|mesh| mesh.suspicious != Suspicious::default()).collect();
        for mesh in faulty.iter().take(MESHES_SHOWN) {
            writeln!(f, "geometry {} {:?}, {} triangles:", mesh.geometry, mesh.name, mesh.triangles)?;
            rows(f, &mesh.suspicious)?;
        }
        if let Some(others) = faulty.get(MESHES_SHOWN..).filter(|others| !others.is_empty()) {
            writeln!(f, "{} other geometries (--json has each):", others.len())?;
            rows(f, &others.iter().map(|mesh| mesh.suspicious).fold(Suspicious::default(), Suspicious::plus))?;
        }
        write!(f, "{}", if faulty.is_empty() { "nothing suspicious\n" } else { "" })
    }
}

/// Meshes of which each is told what looks like a mistake.
const MESHES_SHOWN: usize = 20;

/// How many, and the first few by name.
fn list<S: AsRef<str>>(names: &[S]) -> String {
    const SHOWN: usize = 8;
    let shown: Vec<_> = names.iter().take(SHOWN).map(|name| or_unnamed(name.as_ref())).collect();
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    if names.is_empty() { "0".to_owned() } else { format!("{}: {}{more}", names.len(), shown.join(", ")) }
}

/// A name as a terminal may be given it.
fn or_unnamed(name: &str) -> Cow<'_, str> {
    if name.is_empty() {
        "(unnamed)".into()
    } else if name.contains(char::is_control) {
        name.escape_debug().to_string().into()
    } else {
        name.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn scenes_are_counted() {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let tetrahedron = Mesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
        let scene = Scene::from_geometries(vec![Geometry::Mesh(tetrahedron)], vec![Default::default()]);
        let info = Inspection::new(&scene);
        assert_eq!((info.triangles, info.vertices, info.placed_primitives, info.instances), (4, 4, 4, 1));
        assert_eq!(info.bounds, Some([[0.0; 3], [1.0; 3]]));
        let beep = Inspection { materials: vec!["\u{1b}]0;x\u{7}".to_owned()], ..info.clone() };
        assert!(!beep.to_string().contains(|c: char| c.is_control() && c != '\n'), "{beep}");
        assert!(info.bytes >= 4 * 12 * 2 && info.to_string().ends_with("nothing suspicious\n"));
        let empty = Inspection::new(&Scene::default());
        assert!(empty.bounds.is_none() && empty.to_string().contains("nothing can be hit"));
    }
}
