//! Scene files: one file a format. A loader fills a [`Scene`] and never sees an accelerator.
//!
//! A loader is a function of the file's path (for messages and for the files it refers to) and bytes. Counts in a file
//! are promises, and are compared with the bytes that are there before anything is allocated for them; indices are
//! compared with what they point into before they reach a [`Scene`]. What all formats share is done once, afterwards:
//! normals on request, axes and units, and a last check of the whole scene.

mod course;
mod dshape;
mod finish;
mod format;
mod gltf;
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

pub(crate) use self::format::Format;
pub use self::format::SUFFIXES;
pub use self::promised::{Promised, promised};
pub use self::save::{SAVE_SUFFIXES, save, save_until};

use self::finish::{bare, doubt_bare, make_finite, meshes};
use crate::error::{Error, Result, Warning, system_message};
use crate::math::{DAffine3, DMat3, DVec3};
use crate::memory::Mapped;
use crate::output::suffix;
use crate::scene::{Geometry, Mesh, Scene, fault};

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
    /// Of the file's animations, those with these names, or these numbers, counted from 0, played at once: of two that move the same, the later one counts. `all` is all
    /// of them, where none has that name. None where the file has only one.
    pub names: Vec<String>,
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

impl UpAxis {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Y, Self::Z];

    /// As flags and scenes have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Y => "y",
            Self::Z => "z",
        }
    }
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

impl Unit {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Metre, Self::Centimetre, Self::Millimetre, Self::Inch];

    /// As flags and scenes have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
            Self::Inch => "in",
        }
    }
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

impl Normals {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::File, Self::Flat, Self::Smooth];

    /// As flags and scenes have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::File => "file",
            Self::Flat => "flat",
            Self::Smooth => "smooth",
        }
    }
}

/// A result whose error is a message that has no file and no place yet.
type Placeless<T> = std::result::Result<T, String>;

/// What compression may make of a colour of full strength: half a code of 256 too much, and some.
const MOST_BY_ROUNDING: f32 = 1.0 + 1.0 / 255.0;

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
/// finite (they keep their numbers, are never hit, and have no other corner left), features that the renderer does not have.
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
    // First, so that a directory, a missing or an empty file is called that, whatever its name.
    let file = Mapped::open(path).map_err(|e| Error::input(path, "", system_message(&e)))?.watched(on_bytes);
    if file.is_empty() {
        return Err(Error::input(path, "", "is empty, where a scene is needed"));
    }
    let format = Format::of(path).ok_or_else(|| {
        let message = format!("unknown suffix {:?}; known are {}", suffix(path), SUFFIXES.join(", "));
        Error::input(path, "", message)
    })?;
    if !format.has_animations() && (options.animation != Animation::default() || options.variant.is_some()) {
        let message = "animations (--animation, --time, --frames) and variants of materials (--variant) are asked for, which only glTF and GLB have; leave them out";
        return Err(Error::input(path, "", message));
    }
    let mut warnings = Vec::new();
    let mut scene = format.load(path, &file, options, &mut warnings)?;
    drop(file);
    scene.files.insert(0, path.to_owned());
    scene.transform(&options.transform());
    let vague: usize = scene.geometries.iter_mut().map(make_finite).sum();
    if vague > 0 {
        let message = format!(
            "{vague} colours or texture coordinates are not finite; what is not counts as 0, and as 1 where it is alpha"
        );
        warnings.push(Warning::new(path, "", message));
    }
    let brightest = meshes(&scene).map(Mesh::brightest_color).fold(0.0, f32::max);
    // Of meshes that a scene includes it has been told.
    if brightest > MOST_BY_ROUNDING && format != Format::Toml {
        let message = format!(
            "colours of vertices go up to {brightest}, where 1 is full strength; bytes have to be divided by 255"
        );
        warnings.push(Warning::new(path, "", message));
    }
    // At some time of an animation there may be nothing to see.
    let may_be_empty = options.animation.time.is_some();
    fault(&scene).map_err(|message| Error::input(path, "", message))?;
    if scene.primitive_count() == 0 && !may_be_empty {
        return Err(nothing_to_render(path, &warnings));
    }
    scene.bake_turns();
    let mut bad = 0;
    for geometry in &mut scene.geometries {
        if let Geometry::Mesh(mesh) = geometry {
            bad += mesh.drop_strays();
            options.normals.apply(mesh);
        }
    }
    if !format.tells_of_bare_meshes() {
        warnings.extend(doubt_bare(path, bare(&scene.geometries, &scene.materials)));
    }
    if bad > 0 {
        let message = format!("{bad} triangles have corners that are NaN, infinite or too far away; no ray hits them");
        warnings.push(Warning::new(path, "", message));
    }
    let is_there = |geometry: &Geometry| match geometry {
        Geometry::Mesh(mesh) => mesh.has_area(),
        Geometry::Shapes { shapes, .. } => !shapes.is_empty(),
    };
    if !may_be_empty && !scene.geometries.iter().any(is_there) {
        let message = "no ray hits anything: none of its triangles has an area, and corners that can be traced";
        warnings.push(Warning::new(path, "", message));
    }
    Ok((scene, warnings))
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
