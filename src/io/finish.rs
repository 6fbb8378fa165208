//! What is done with what a file of any format held, once it is a scene: normals on request, and numbers that are none.

use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use super::format::Format;
use super::options::{LoadOptions, Normals};
use super::weld::weld;
use crate::error::{Error, Result, Warning};
use crate::math::Vec2;
use crate::scene::{Geometry, Material, Mesh, Scene, fault};

/// Vertices or corners that are worth a task of their own.
const TASK: usize = 1 << 14;

/// What compression may make of a colour of full strength: half a code of 256 too much, and some.
const MAX_BY_ROUNDING: f32 = 1.0 + 1.0 / 255.0;

/// Makes a scene of a file ready, whatever its format: numbers that are none, a last check of all indices, axes and
/// normals; and says what is odd about it.
///
/// # Errors
/// [`Error::Input`] for an index that is out of range, and for a scene without a primitive.
pub(super) fn finish(
    scene: &mut Scene,
    path: &Path,
    format: Format,
    options: &LoadOptions,
    warnings: &mut Vec<Warning>,
) -> Result<()> {
    // At some time of an animation there may be nothing to see.
    let may_be_empty = options.animation.time.is_some();
    warnings.extend(mend_numbers(scene, path));
    // Of meshes that a scene includes it has been told.
    if format != Format::Toml {
        warnings.extend(doubt_colors(scene, path));
    }
    fault(scene).map_err(|message| Error::input(path, "", message))?;
    if scene.primitive_count() == 0 && !may_be_empty {
        return Err(nothing_to_render(path, warnings));
    }
    scene.bake_turns();
    let strays = finish_meshes(scene, options.normals);
    if !format.tells_of_bare_meshes() {
        warnings.extend(doubt_bare(path, bare(&scene.geometries, &scene.materials)));
    }
    if strays > 0 {
        let message =
            format!("{strays} triangles have corners that are NaN, infinite or too far away; no ray hits them");
        warnings.push(Warning::new(path, "", message));
    }
    if !may_be_empty && !scene.geometries.iter().any(Geometry::has_area) {
        let message = "no ray hits anything: none of its triangles has an area, and corners that can be traced";
        warnings.push(Warning::new(path, "", message));
    }
    Ok(())
}

/// Has colours and texture coordinates be finite, and tells of those that were not.
fn mend_numbers(scene: &mut Scene, path: &Path) -> Option<Warning> {
    let vague: usize = scene.geometries.iter_mut().map(make_finite).sum();
    let message = format!(
        "{vague} colours or texture coordinates are not finite; what is not counts as 0, and as 1 where it is alpha"
    );
    (vague > 0).then(|| Warning::new(path, "", message))
}

/// Tells of colours of vertices that were meant to be bytes.
fn doubt_colors(scene: &Scene, path: &Path) -> Option<Warning> {
    let brightest = meshes(scene).map(Mesh::brightest_color).fold(0.0, f32::max);
    let message =
        format!("colours of vertices go up to {brightest}, where 1 is full strength; bytes have to be divided by 255");
    (brightest > MAX_BY_ROUNDING).then(|| Warning::new(path, "", message))
}

/// Drops stray corners of meshes, and gives them their normals; how many triangles have such corners.
fn finish_meshes(scene: &mut Scene, normals: Normals) -> usize {
    let mut strays = 0;
    for geometry in &mut scene.geometries {
        if let Geometry::Mesh(mesh) = geometry {
            strays += mesh.drop_strays();
            normals.apply(mesh);
        }
    }
    strays
}

/// Of a file without a primitive; with what was left out of it, which may be why.
fn nothing_to_render(path: &Path, warnings: &[Warning]) -> Error {
    let mut message =
        "nothing to render: no ray could hit anything; give a file with at least one triangle or shape".to_owned();
    if let Some(first) = warnings.first() {
        let more = if warnings.len() > 1 { format!(" ({} more)", warnings.len() - 1) } else { String::new() };
        message += &format!(". What was left out: {first}{more}");
    }
    Error::input(path, "", message)
}

/// Has components of colours and of texture coordinates that are not finite be 0, and 1 where they are alpha; and tells
/// of how many colours and coordinates.
fn make_finite(geometry: &mut Geometry) -> usize {
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
    fn apply(self, mesh: &mut Mesh) {
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

fn meshes(scene: &Scene) -> impl Iterator<Item = &Mesh> {
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
