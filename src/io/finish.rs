//! What is done with what a file of any format held, once it is a scene: normals on request, and numbers that are none.

use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use super::Normals;
use super::weld::weld;
use crate::error::Warning;
use crate::math::Vec2;
use crate::scene::{Geometry, Material, Mesh, Scene};

/// Vertices or corners that are worth a task of their own.
const TASK: usize = 1 << 14;

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
