//! `[environment]`: light from all around.

use std::path::Path;

use super::Stop;
use super::table::Value;
use crate::image;
use crate::scene::Environment;

/// The environment of a table; `folder` is what its picture's name is relative to.
pub(super) fn environment(value: Value<'_>, folder: &Path) -> Result<Environment, Stop> {
    let mut table = value.table("[environment]".to_owned())?;
    let name = table.need("image")?;
    let path = folder.join(name.text()?);
    if !path.is_file() {
        return Err(name.fault(format!("there is no file {}", path.display())).into());
    }
    let image = image::read(&path).map_err(Stop::Elsewhere)?;
    let intensity = table.optional("intensity", |value| value.share())?.unwrap_or(1.0);
    let rotation = table.optional("rotation", |value| value.number())?.unwrap_or(0.0).to_radians();
    table.finish()?;
    Ok(Environment { intensity, rotation, ..Environment::new(image) })
}
