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
mod options;
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
pub use self::options::{Animation, LoadOptions, Normals, Unit, UpAxis};
pub use self::promised::{Promised, promised};
pub use self::save::{SAVE_SUFFIXES, save, save_until};

use self::finish::finish;
use crate::error::{Error, Result, Warning, system_message};
use crate::memory::Mapped;
use crate::output::suffix;
use crate::scene::Scene;

/// A result whose error is a message that has no file and no place yet.
type Placeless<T> = std::result::Result<T, String>;

/// Reads a scene. The suffix, in any case, decides the format: one of [`SUFFIXES`].
///
/// What is odd but can be rendered comes back as warnings: a missing texture, triangles with corners that are not
/// finite (they keep their numbers, are never hit, and have no other corner left), features that the renderer does not
/// have.
///
/// # Errors
/// [`Error::Input`] for anything that is wrong with the file or with what it refers to.
pub fn load(path: &Path, options: &LoadOptions) -> Result<(Scene, Vec<Warning>)> {
    load_watched(path, options, None)
}

/// Reads a scene as [`load`] does, and calls `on_bytes` with the number of bytes of the file that were read since, from
/// any thread. Bytes may be skipped, or read more than once, so that the sum may differ from the file's length.
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
        let message =
            "an animation, a time or a variant of materials is asked for, which only glTF and GLB have; leave them out";
        return Err(Error::input(path, "", message));
    }
    let mut warnings = Vec::new();
    let mut scene = format.load(path, &file, options, &mut warnings)?;
    drop(file);
    scene.files.insert(0, path.to_owned());
    scene.transform(&options.transform());
    finish(&mut scene, path, format, options, &mut warnings)?;
    Ok((scene, warnings))
}
