//! What is done with what a file of any format held, once it is a scene: normals on request, and numbers that are none.

use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use super::Normals;
use super::compact::{compact, with_vertices};
use super::weld::weld;
use crate::error::Warning;
use crate::math::{Vec2, Vec3};
use crate::scene::{Geometry, Material, Mesh, Scene};

/// Vertices or corners that are worth a task of their own.
const TASK: usize = 1 << 14;

/// Leaves out the vertices that no triangle names, if the outermost are among them: a stray one far away would frame the scene for the camera, and leave f32
/// little of what is seen.
pub(super) fn drop_strays(mesh: &mut Mesh) {
    if mesh.triangles.is_empty() || outermost_are_used(&mesh.positions, mesh.triangles.as_flattened()) {
        return;
    }
    let mut triangles = Arc::unwrap_or_clone(std::mem::take(&mut mesh.triangles));
    *mesh = match compact(triangles.as_flattened_mut(), mesh.positions.len()) {
        Some(used) => with_vertices(mesh, &used, triangles),
        None => Mesh { triangles: Arc::new(triangles), ..std::mem::take(mesh) },
    };
}

/// Whether, of those that are farthest along each axis, one each way is a triangle's corner. Most often all vertices are: to look for six of them among the
/// corners takes a tenth of the time that it takes to mark all.
fn outermost_are_used(positions: &[Vec3], corners: &[u32]) -> bool {
    // Six times an index: of the least coordinates, and of the largest.
    let farther = |a: [u32; 6], b: [u32; 6]| -> [u32; 6] {
        std::array::from_fn(|k| {
            let along = |i: u32| positions[i as usize][k % 3] * if k < 3 { -1.0 } else { 1.0 };
            // Written so that a NaN gives way.
            if along(b[k]) > along(a[k]) || along(a[k]).is_nan() { b[k] } else { a[k] }
        })
    };
    let all = (0..positions.len() as u32).into_par_iter().with_min_len(TASK);
    let Some(outermost) = all.map(|i| [i; 6]).reduce_with(farther) else { return true };
    let seen = corners.par_chunks(TASK).map(|corners| {
        let has = |wanted: u32| corners.iter().fold(false, |found, &corner| found | (corner == wanted));
        outermost.map(has)
    });
    let either = |a: [bool; 6], b: [bool; 6]| std::array::from_fn(|k| a[k] || b[k]);
    seen.reduce(|| [false; 6], either) == [true; 6]
}

/// Has components of colours and of texture coordinates that are not finite be 0, and 1 where they are alpha; and tells of how many colours and coordinates.
pub(super) fn make_finite(geometry: &mut Geometry) -> usize {
    fn each<T: AsMut<[f32; N]> + Send, const N: usize>(values: &mut [T], instead: [f32; N]) -> usize {
        let mend = |value: &mut T| {
            let components = value.as_mut().iter_mut().zip(instead).filter(|(component, _)| !component.is_finite());
            components.map(|(component, instead)| *component = instead).count() > 0
        };
        values.par_iter_mut().with_min_len(TASK).map(mend).filter(|is_mended| *is_mended).count()
    }
    let Geometry::Mesh(mesh) = geometry else { return 0 };
    let uvs = |uvs: &mut [Vec2]| each(uvs, [0.0; 2]);
    each(&mut mesh.colors, [0.0, 0.0, 0.0, 1.0]) + uvs(&mut mesh.uvs) + uvs(&mut mesh.second_uvs)
}

/// The largest component of a vertex's colour.
pub(super) fn brightest_color(mesh: &Mesh) -> f32 {
    mesh.colors.par_iter().with_min_len(TASK).map(|color| color.truncate().max_element()).reduce(|| 0.0, f32::max)
}

impl Normals {
    /// Gives a mesh the normals that are wanted.
    pub(super) fn apply(self, mesh: &mut Mesh) {
        match self {
            Self::File => {}
            Self::Flat => mesh.normals = Vec::new(),
            Self::Smooth => smooth(mesh),
        }
    }
}

/// Smooth normals across vertices that differ in other attributes only, as they do at seams of textures.
fn smooth(mesh: &mut Mesh) {
    // Adding 0 makes one zero of the two.
    let key = |i: usize| [(mesh.positions[i] + 0.0).to_array().map(f32::to_bits)];
    let (welded, keys) = weld(mesh.positions.len(), key, |_| ());
    let positions = keys.into_iter().map(|bits| bits.map(f32::from_bits).into()).collect();
    let triangles = mesh.triangles.iter().map(|corners| corners.map(|i| welded[i as usize][0])).collect();
    let mut joined = Mesh { positions: Arc::new(positions), triangles: Arc::new(triangles), ..Mesh::default() };
    joined.smooth_normals();
    mesh.normals = welded.into_iter().map(|[i]| joined.normals[i as usize]).collect();
}

pub(super) fn meshes(scene: &Scene) -> impl Iterator<Item = &Mesh> {
    scene.geometries.iter().filter_map(|geometry| match geometry {
        Geometry::Mesh(mesh) => Some(mesh),
        Geometry::Shapes { .. } => None,
    })
}

/// How many meshes lack the texture coordinates that their materials want.
pub(super) fn bare(geometries: &[Geometry], materials: &[Material]) -> usize {
    let has_texture = |material: u32| materials.get(material as usize).is_some_and(|m| m.textures().next().is_some());
    let is_bare = |geometry: &&Geometry| match geometry {
        Geometry::Mesh(mesh) => mesh.uvs.is_empty() && has_texture(mesh.material),
        Geometry::Shapes { .. } => false,
    };
    geometries.iter().filter(is_bare).count()
}

/// What is said of them, if there are any.
pub(super) fn doubt_bare(path: &Path, bare: usize) -> Option<Warning> {
    let message =
        format!("{bare} meshes lack texture coordinates that their materials want: one point of each texture is seen");
    (bare > 0).then(|| Warning::new(path, "", message))
}
