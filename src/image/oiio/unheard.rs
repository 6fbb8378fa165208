//! Formats whose writers do not tell what goes wrong.
//!
//! OpenImageIO's writers of these take no notice of a disk that is full, nor of sizes that a format does not hold, and
//! say that the file is written. So they write to memory, where there is room; what they wrote is read again, and
//! copied to its place by ourselves.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use super::bridge::Result;
use crate::image::format::Format;
use crate::output::suffix;

const UNHEARD: [Format; 8] =
    [Format::Bmp, Format::Fits, Format::Gif, Format::Heif, Format::Jpeg2000, Format::Sgi, Format::Targa, Format::WebP];

/// Whether a file of this name is written so.
pub(super) fn are_written_to(path: &Path) -> bool {
    Format::of(path).is_some_and(|format| UNHEARD.contains(&format))
}

/// Has `write` make a file of a picture of this size, and holds it against that.
pub(super) fn write(path: &Path, size: [u32; 2], write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    // A device or a pipe is what it is, and gets it at once.
    if fs::symlink_metadata(path).is_ok() {
        return write(path);
    }
    let Some(mut memory) = memory(path) else {
        return write(path).and_then(|()| check(path, size));
    };
    let cannot = |error: io::Error| format!("cannot write the file: {error}");
    let written = write(path).and_then(|()| check(path, size));
    // The name was that of the memory.
    fs::remove_file(path).map_err(cannot)?;
    written?;
    let mut place = File::create_new(path).map_err(cannot)?;
    io::copy(&mut memory, &mut place).map(drop).map_err(cannot)
}

/// A file in memory, and `path` as a name of it; none where there are no such files, or no links to them.
#[cfg(target_os = "linux")]
fn memory(path: &Path) -> Option<File> {
    let (file, place) = super::unnamed::create(c"twincast-picture").ok()?;
    fs::metadata(&place).ok()?;
    std::os::unix::fs::symlink(place, path).ok()?;
    Some(file)
}

#[cfg(not(target_os = "linux"))]
fn memory(_: &Path) -> Option<File> {
    None
}

/// Reads what was written.
fn check(path: &Path, size: [u32; 2]) -> Result<()> {
    let [width, height] = size;
    let useless = |what: &str| {
        format!(
            "what was written of {width} x {height} pixels cannot be read again: {what}; choose another format, as .png, or another size"
        )
    };
    if fs::metadata(path).is_ok_and(|file| file.len() == 0) {
        return Err(useless("the file is empty"));
    }
    let is_right = |found_width: u64, found_height: u64| {
        let is_right = [found_width, found_height] == size.map(u64::from);
        is_right.then_some(()).ok_or_else(|| format!("the file says {found_width} x {found_height}"))
    };
    // What it has written itself is not damaged by others, in whichever format.
    super::read_as(path, &suffix(path), &is_right).map(drop).map_err(|message| useless(message.trim()))
}
