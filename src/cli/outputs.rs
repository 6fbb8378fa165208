//! The files a command writes: checked before the work, written whole after it.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::error::{Error, Result};
use crate::image::{self, Image, Metadata, WriteOptions};
use crate::output;

/// Whether every picture and the other files can be written, before anything is done for them.
pub(super) fn check<'a>(pictures: &[PathBuf], others: impl IntoIterator<Item = &'a PathBuf>) -> Result<()> {
    pictures.iter().try_for_each(|path| image::check_writable(path))?;
    others.into_iter().try_for_each(|path| output::check_writable(path))
}

/// Writes one picture to each path, in the format its suffix says.
pub(super) fn write_pictures(paths: &[PathBuf], picture: &Image, metadata: &Metadata) -> Result<()> {
    paths.iter().try_for_each(|path| image::write(path, picture, metadata, &WriteOptions::default()))
}

/// Writes a JSON document.
pub(super) fn write_json(path: &Path, document: &impl Serialize) -> Result<()> {
    let failed = |error: &dyn std::fmt::Display| Error::output(path, error.to_string());
    let mut text = serde_json::to_string_pretty(document).map_err(|error| failed(&error))?;
    text.push('\n');
    output::write_atomically(path, |part| std::fs::write(part, &text).map_err(|error| failed(&error)))
}
