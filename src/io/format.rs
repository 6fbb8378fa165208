//! The formats of scene files, and what is known of each: a new one is a variant here, which the compiler then asks
//! for.

use std::path::Path;

use super::{LoadOptions, Promised, course, gltf, nff, obj, ply, stl, toml};
use crate::error::{Error, Result, Warning};
use crate::io::text::without_mark;
use crate::memory::Mapped;
use crate::output::suffix;
use crate::scene::Scene;

/// A format of scene files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// glTF 2.0, as text or packed.
    Gltf,
    /// Haines's neutral file format.
    Nff,
    /// Wavefront OBJ.
    Obj,
    /// The polygon file format.
    Ply,
    /// Stereolithography.
    Stl,
    /// The ray tracer course's.
    Course,
    /// Our own.
    Toml,
}

/// What files are named by, in the order of the alphabet.
const TABLE: [(&str, Format); 8] = [
    ("glb", Format::Gltf),
    ("gltf", Format::Gltf),
    ("nff", Format::Nff),
    ("obj", Format::Obj),
    ("ply", Format::Ply),
    ("stl", Format::Stl),
    ("test", Format::Course),
    ("toml", Format::Toml),
];

/// The suffixes that [`load`](super::load) knows.
pub const SUFFIXES: [&str; TABLE.len()] = {
    let mut suffixes = [""; TABLE.len()];
    let mut i = 0;
    while i < TABLE.len() {
        suffixes[i] = TABLE[i].0;
        i += 1;
    }
    suffixes
};

/// The suffixes of formats that hold meshes and not a scene, which would bring a second camera and other light where it
/// is included.
pub(super) fn mesh_suffixes() -> impl Iterator<Item = &'static str> {
    TABLE.iter().filter(|(_, format)| format.holds_meshes()).map(|(suffix, _)| *suffix)
}

impl Format {
    /// That of a file of this name, if it is one of ours.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        let suffix = suffix(path);
        TABLE.iter().find(|(known, _)| *known == suffix).map(|(_, format)| *format)
    }

    /// Reads a file, as far as that differs from format to format; `path` is for messages, and for the files that it
    /// refers to.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) for anything that is wrong with the file or with what it refers to.
    pub(super) fn load(
        self,
        path: &Path,
        file: &Mapped<'_>,
        options: &LoadOptions,
        warnings: &mut Vec<Warning>,
    ) -> Result<Scene> {
        let told = Self::told_by(file).filter(|(format, _)| *format != self);
        if let Some((_, suffix)) = told {
            return Err(Error::input(path, "", format!("by its first bytes this is a .{suffix} file; name it so")));
        }
        match self {
            Self::Gltf => gltf::load(path, file, options, warnings),
            Self::Nff => nff::load(path, file, warnings),
            Self::Obj => obj::load(path, file, warnings),
            Self::Ply => ply::load(path, file, warnings),
            Self::Stl => stl::load(path, file, warnings),
            Self::Course => course::load(path, file),
            Self::Toml => toml::load(path, file, warnings),
        }
    }

    /// The format that the first bytes of a file tell, and its suffix, where no other format may begin so.
    fn told_by(bytes: &[u8]) -> Option<(Self, &'static str)> {
        let text = without_mark(bytes);
        let is_ply = text.starts_with(b"ply\n") || text.starts_with(b"ply\r");
        if bytes.starts_with(b"glTF") { Some((Self::Gltf, "glb")) } else { is_ply.then_some((Self::Ply, "ply")) }
    }

    /// What the head of a file promises, of formats whose heads are no work to read.
    pub(super) fn promised(self, path: &Path, file: &Mapped<'_>) -> Option<Promised> {
        match self {
            Self::Ply => ply::promised(path, file),
            Self::Stl => stl::promised_mesh(file),
            Self::Gltf | Self::Nff | Self::Obj | Self::Course | Self::Toml => None,
        }
    }

    /// Whether a file may say where its picture is to be written ([`Request::output`](crate::scene::Request)).
    pub(crate) const fn may_name_a_picture(self) -> bool {
        match self {
            Self::Course | Self::Toml => true,
            Self::Gltf | Self::Nff | Self::Obj | Self::Ply | Self::Stl => false,
        }
    }

    /// Whether it has animations and variants of materials.
    pub(super) const fn has_animations(self) -> bool {
        match self {
            Self::Gltf => true,
            Self::Nff | Self::Obj | Self::Ply | Self::Stl | Self::Course | Self::Toml => false,
        }
    }

    /// Whether it holds meshes alone, which scenes may include.
    const fn holds_meshes(self) -> bool {
        match self {
            Self::Gltf | Self::Obj | Self::Ply | Self::Stl => true,
            Self::Nff | Self::Course | Self::Toml => false,
        }
    }

    /// Whether its reader says itself which meshes lack texture coordinates: glTF's knows of sets of them, and that of
    /// scenes which meshes are its own.
    pub(super) const fn tells_of_bare_meshes(self) -> bool {
        match self {
            Self::Gltf | Self::Toml => true,
            Self::Nff | Self::Obj | Self::Ply | Self::Stl | Self::Course => false,
        }
    }
}
