//! How a file is understood: what its own numbers do not say.

use crate::math::{DAffine3, DMat3, DVec3};

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

impl LoadOptions {
    /// From the file's coordinates to the scene's.
    pub(super) fn transform(&self) -> DAffine3 {
        let turn = match self.up_axis {
            UpAxis::Y => DMat3::IDENTITY,
            UpAxis::Z => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        };
        DAffine3::from_mat3(turn * self.unit.metres())
    }
}

/// In which pose things are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Of the file's animations, those with these names, or these numbers, counted from 0, played at once: of two that
    /// move the same, the later one counts. `all` is all of them, where none has that name. None where the file has
    /// only one.
    pub names: Vec<String>,
    /// When, in seconds from the animation's start; before its first key and after its last one all stands still. None,
    /// and no name, is the pose that the file stores.
    pub time: Option<f64>,
    /// Seconds from `time` on in which things go from where they are at time 0 of a picture to where they are at its
    /// time 1; 0 where nothing is to move. What is deformed by a skin or morph targets keeps its shape.
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
