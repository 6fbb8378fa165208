//! PNG, JPEG and WebP files by the crate image, which is written in Rust: a damaged file does no harm.

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageReader};

use super::guarded;
use super::orientation::upright;
use super::samples::{Alpha, Channels, Samples, Values};
use crate::memory::Mapped;

/// Reads a file as it is to be seen, unless `check` refuses its width and height. The format is told by the content.
pub(super) fn read(path: &Path, check: &dyn Fn(u64, u64) -> Result<(), String>) -> Result<Samples, String> {
    guarded(|| decoded(path, check))
}

fn decoded(path: &Path, check: &dyn Fn(u64, u64) -> Result<(), String>) -> Result<Samples, String> {
    // Mapped, as textures are, so that decoders are compiled once.
    let bytes = Mapped::open(path).map_err(|e| e.to_string())?;
    let mut reader = ImageReader::new(Cursor::new(&bytes[..])).with_guessed_format().map_err(|e| e.to_string())?;
    reader.no_limits(); // ours follow, before anything is allocated
    let mut decoder = reader.into_decoder().map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions();
    check(width.into(), height.into())?;
    let orientation = decoder.orientation().map_err(|e| e.to_string())?.to_exif();
    let decoded = DynamicImage::from_decoder(decoder).map_err(|e| e.to_string())?;
    let color = decoded.color();
    let is_deep = color.bytes_per_pixel() > color.channel_count();
    let values = match (is_deep, color.has_alpha()) {
        (false, false) => Values::U8(decoded.into_rgb8().into_raw()),
        (false, true) => Values::U8(decoded.into_rgba8().into_raw()),
        (true, false) => Values::U16(decoded.into_rgb16().into_raw()),
        (true, true) => Values::U16(decoded.into_rgba16().into_raw()),
    };
    let channels = Channels { colour: true, alpha: color.has_alpha().then_some(Alpha::Straight) };
    Ok(upright(Samples { width, height, channels, values }, orientation.into()))
}
