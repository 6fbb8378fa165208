//! `[environment]`: light from all around.

use std::path::{Path, PathBuf};

use super::Stop;
use super::table::Value;
use crate::image;
use crate::scene::Environment;

/// The environment of a table; `folder` is what its picture's name is relative to, and `files` gets to know it.
pub(super) fn environment(value: Value<'_>, folder: &Path, files: &mut Vec<PathBuf>) -> Result<Environment, Stop> {
    let mut table = value.table("[environment]".to_owned())?;
    let name = table.need("image")?;
    let path = folder.join(name.text()?);
    if !path.is_file() {
        return Err(name.fault(format!("there is no file {}", path.display())).into());
    }
    let image = image::read_whole(&path).map_err(|error| Stop::Elsewhere { at: name.at, error })?;
    files.push(path);
    let intensity = table.optional("intensity", |value| value.share())?.unwrap_or(1.0);
    let rotation = table.optional("rotation", |value| value.number())?.unwrap_or(0.0).to_radians();
    table.finish()?;
    Ok(Environment { intensity, rotation, ..Environment::new(image) })
}
