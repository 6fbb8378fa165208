//! Scene files: one file a format. A loader fills a [`Scene`] and never sees an accelerator.

use std::path::Path;

use crate::error::{Result, Warning};
use crate::scene::Scene;

/// How a file is understood.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoadOptions {
    /// Which axis of the file points up; by default the format's own (+y).
    pub up_axis: UpAxis,
    /// Metres in one unit of the file.
    pub unit: Unit,
    /// Where shading normals come from.
    pub normals: Normals,
}

/// The axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// +y, as in glTF.
    #[default]
    Y,
    /// +z, as in CAD and scans: turned so that z becomes y and y becomes -z.
    Z,
}

/// The length unit of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normals {
    /// The file's; flat where it has none (and, in OBJ, smooth where it has smoothing groups).
    #[default]
    File,
    /// Flat everywhere.
    Flat,
    /// Smooth everywhere, computed.
    Smooth,
}

/// Reads a scene. The suffix decides the format: glb, gltf, obj, ply, stl.
///
/// # Errors
/// [`Error::Input`](crate::Error::Input) for anything that is wrong with the file or with what it refers to.
pub fn load(_path: &Path, _options: &LoadOptions) -> Result<(Scene, Vec<Warning>)> {
    todo!()
}
