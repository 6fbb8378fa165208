//! Scene files: one file a format. A loader fills a [`Scene`] and never sees an accelerator.
//!
//! A loader is a function of the file's path (for messages and for the files it refers to) and bytes. Counts in a file
//! are promises, and are compared with the bytes that are there before anything is allocated for them; indices are
//! compared with what they point into before they reach a [`Scene`]. What all formats share is done once, afterwards:
//! normals on request, axes and units, and a last check of the whole scene.

mod compact;
mod course;
mod gltf;
mod local_origin;
mod nff;
mod number;
mod obj;
mod parts;
mod ply;
mod polygon;
mod promised;
mod records;
mod save;
mod statement;
mod stl;
mod suggest;
mod text;
mod texture;
mod toml;
mod weld;

use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

pub use self::promised::{Promised, promised};
pub use self::save::{SAVE_SUFFIXES, save};

use self::weld::weld;
use crate::error::{Error, Result, Warning};
use crate::math::{DAffine3, DMat3, DVec3, Vec2};
use crate::memory::Mapped;
use crate::scene::{Geometry, Material, Mesh, Scene, fault};

/// How a file is understood.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Which axis of the file points up; by default the format's own (+y).
    pub up_axis: UpAxis,
    /// Metres in one unit of the file.
    pub unit: Unit,
    /// Where shading normals come from.
    pub normals: Normals,
    /// In which pose things are; glTF alone.
    pub animation: Animation,
    /// Which of the sets of materials that a file offers things have; glTF alone. None is what they have by themselves.
    pub variant: Option<String>,
}

/// In which pose things are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Of the file's animations, the one with this name, or this number, counted from 0. None where the file has only one.
    pub name: Option<String>,
    /// When, in seconds from the animation's start; before its first key and after its last one all stands still. None, and no
    /// name, is the pose that the file stores.
    pub time: Option<f64>,
    /// Seconds from `time` on in which things go from where they are at time 0 of a picture to where they are at its time 1; 0 where
    /// nothing is to move. What is deformed by a skin or morph targets keeps its shape.
    pub exposure: f64,
}

/// The axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum UpAxis {
    /// +y, as in glTF.
    #[default]
    Y,
    /// +z, as in CAD and scans: turned so that z becomes y and y becomes -z.
    Z,
}

/// The length unit of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Unit {
    /// 1 m.
    #[default]
    Metre,
    /// 0.01 m.
    Centimetre,
    /// 0.001 m.
    Millimetre,
    /// 0.0254 m.
    Inch,
}

/// Where shading normals come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Normals {
    /// The file's; flat where it has none (and, in OBJ, smooth where it has smoothing groups).
    #[default]
    File,
    /// Flat everywhere.
    Flat,
    /// Smooth everywhere, computed.
    Smooth,
}

/// A result whose error is a message that has no file and no place yet.
type Placeless<T> = std::result::Result<T, String>;

/// The suffixes that [`load`] knows.
pub const SUFFIXES: [&str; 8] = ["glb", "gltf", "nff", "obj", "ply", "stl", "test", "toml"];

/// Whether a file of this name may say where its picture is to be written ([`Request::output`](crate::scene::Request)).
pub(crate) fn may_name_a_picture(path: &Path) -> bool {
    matches!(suffix(path).as_str(), "test" | "toml")
}

/// What decides the format, in lower case.
fn suffix(path: &Path) -> String {
    path.extension().and_then(|s| s.to_str()).unwrap_or_default().to_ascii_lowercase()
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

/// Reads a scene. The suffix, in any case, decides the format: one of [`SUFFIXES`].
///
/// What is odd but can be rendered comes back as warnings: a missing texture, triangles with corners that are not
/// finite (they stay in their mesh and are never hit), features that the renderer does not have.
///
/// # Errors
/// [`Error::Input`] for anything that is wrong with the file or with what it refers to.
pub fn load(path: &Path, options: &LoadOptions) -> Result<(Scene, Vec<Warning>)> {
    load_watched(path, options, None)
}

/// The same, and tells of the bytes of the file as they are read: their number, from any thread. Bytes may be skipped, or
/// read more than once, so that the sum may differ from the file's length.
///
/// # Errors
/// As [`load`].
pub fn load_watched(
    path: &Path,
    options: &LoadOptions,
    on_bytes: Option<&(dyn Fn(u64) + Sync)>,
) -> Result<(Scene, Vec<Warning>)> {
    let suffix = suffix(path);
    // First, so that a directory, a missing or an empty file is called that, whatever its name.
    let file = Mapped::open(path).map_err(|e| Error::input(path, "", system_message(&e)))?.watched(on_bytes);
    if file.is_empty() {
        return Err(Error::input(path, "", "is empty, where a scene is needed"));
    }
    let is_gltf = matches!(suffix.as_str(), "glb" | "gltf");
    if !is_gltf && (options.animation != Animation::default() || options.variant.is_some()) {
        let message = "animations (--animation, --time, --frames) and variants of materials (--variant) are asked for, which only glTF and GLB have; leave them out";
        return Err(Error::input(path, "", message));
    }
    let mut warnings = Vec::new();
    let mut scene = match suffix.as_str() {
        "glb" | "gltf" => gltf::load(path, &file, options, &mut warnings)?,
        "nff" => nff::load(path, &file, &mut warnings)?,
        "obj" => obj::load(path, &file, &mut warnings)?,
        "ply" => ply::load(path, &file, &mut warnings)?,
        "stl" => stl::load(path, &file, &mut warnings)?,
        "test" => course::load(path, &file)?,
        "toml" => toml::load(path, &file, &mut warnings)?,
        _ => {
            let message = format!("unknown suffix {suffix:?}; known are {}", SUFFIXES.join(", "));
            return Err(Error::input(path, "", message));
        }
    };
    drop(file);
    scene.files.insert(0, path.to_owned());
    scene.transform(&options.transform());
    // At some time of an animation there may be nothing to see.
    let may_be_empty = options.animation.time.is_some();
    fault(&scene).map_err(|message| Error::input(path, "", message))?;
    if scene.primitive_count() == 0 && !may_be_empty {
        return Err(nothing_to_render(path, &warnings));
    }
    scene.bake_turns();
    for geometry in &mut scene.geometries {
        if let Geometry::Mesh(mesh) = geometry {
            options.normals.apply(mesh);
        }
    }
    let vague: usize = scene.geometries.iter_mut().map(make_finite).sum();
    if vague > 0 {
        let message = format!(
            "{vague} colours or texture coordinates are not finite; what is not counts as 0, and as 1 where it is alpha"
        );
        warnings.push(Warning::new(path, "", message));
    }
    // glTF's reader knows of sets of coordinates, and that of scenes which meshes are its own: they tell themselves.
    if !is_gltf && suffix != "toml" {
        warnings.extend(doubt_bare(path, bare(&scene.geometries, &scene.materials)));
    }
    let bad: usize = meshes(&scene).map(Mesh::untraceable_triangles).sum();
    if bad > 0 {
        let message = format!("{bad} triangles have corners that are NaN, infinite or too far away; no ray hits them");
        warnings.push(Warning::new(path, "", message));
    }
    Ok((scene, warnings))
}

/// Has components of colours and of texture coordinates that are not finite be 0, and 1 where they are alpha; and tells of how many colours and coordinates.
fn make_finite(geometry: &mut Geometry) -> usize {
    fn each<T: AsMut<[f32; N]> + Send, const N: usize>(values: &mut [T], instead: [f32; N]) -> usize {
        let mend = |value: &mut T| {
            let components = value.as_mut().iter_mut().zip(instead).filter(|(component, _)| !component.is_finite());
            components.map(|(component, instead)| *component = instead).count() > 0
        };
        values.par_iter_mut().with_min_len(1 << 14).map(mend).filter(|is_mended| *is_mended).count()
    }
    let Geometry::Mesh(mesh) = geometry else { return 0 };
    let uvs = |uvs: &mut [Vec2]| each(uvs, [0.0; 2]);
    each(&mut mesh.colors, [0.0, 0.0, 0.0, 1.0]) + uvs(&mut mesh.uvs) + uvs(&mut mesh.second_uvs)
}

impl LoadOptions {
    /// From the file's coordinates to the scene's.
    fn transform(&self) -> DAffine3 {
        let turn = match self.up_axis {
            UpAxis::Y => DMat3::IDENTITY,
            UpAxis::Z => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        };
        DAffine3::from_mat3(turn * self.unit.metres())
    }
}

impl Unit {
    /// How many metres it is.
    pub const fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 0.01,
            Self::Millimetre => 0.001,
            Self::Inch => 0.0254,
        }
    }
}

impl Normals {
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
fn bare(geometries: &[Geometry], materials: &[Material]) -> usize {
    let has_texture = |material: u32| materials.get(material as usize).is_some_and(|m| m.textures().next().is_some());
    let is_bare = |geometry: &&Geometry| match geometry {
        Geometry::Mesh(mesh) => mesh.uvs.is_empty() && has_texture(mesh.material),
        Geometry::Shapes { .. } => false,
    };
    geometries.iter().filter(is_bare).count()
}

/// What is said of them, if there are any.
fn doubt_bare(path: &Path, bare: usize) -> Option<Warning> {
    let message =
        format!("{bare} meshes lack texture coordinates that their materials want: one point of each texture is seen");
    (bare > 0).then(|| Warning::new(path, "", message))
}

/// What the system says about a file, as a message.
fn system_message(error: &std::io::Error) -> String {
    match error.kind() {
        // These are our own words.
        std::io::ErrorKind::IsADirectory | std::io::ErrorKind::InvalidInput => error.to_string(),
        _ => format!("cannot be read: {error}"),
    }
}
