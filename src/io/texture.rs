//! Pictures for textures: PNG, JPEG and WebP, from files or from bytes within another file.

use std::io::Cursor;
use std::path::Path;

use bytemuck::{Pod, try_cast_vec};
use image::error::ImageError;
use image::{ImageReader, Limits};

use crate::error::{Error, Result, one_line};
use crate::image::is_cut_short;
use crate::io::Placeless;
use crate::memory::Mapped;
use crate::scene::{Pixels, Texture};

/// Longest side, in pixels.
const LONGEST_SIDE: u32 = 16_384;
/// Most pixels of one texture.
const MOST_PIXELS: u64 = 1 << 26;
/// Most memory the decoder may use besides the pixels.
const MOST_MEMORY: u64 = 1 << 29;

/// Reads a picture file. None where there is no such file.
///
/// # Errors
/// [`Error::Input`] that names the picture where it cannot be read, is broken or is too large.
pub(super) fn open(path: &Path) -> Result<Option<Texture>> {
    let bytes = match Mapped::open(path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(Error::input(path, "", super::system_message(&e))),
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    decode(&bytes, &name).map(Some).map_err(|message| Error::input(path, "", message))
}

/// Decodes a picture. The format is told by the first bytes, since suffixes and MIME types lie.
///
/// # Errors
/// A message about what is wrong.
pub(super) fn decode(bytes: &[u8], name: &str) -> Placeless<Texture> {
    let reader = || {
        let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
        reader.limits(limits());
        if reader.format().is_none() { Err("is not a PNG, JPEG or WebP picture".to_string()) } else { Ok(reader) }
    };
    // The size first, and without limits of the library's, whose message would not say it.
    let mut sizing = reader()?;
    sizing.no_limits();
    let (width, height) = sizing.into_dimensions().map_err(|e| broken(&e))?;
    let pixels = u64::from(width) * u64::from(height);
    if width.max(height) > LONGEST_SIDE || pixels > MOST_PIXELS {
        return Err(format!(
            "claims {width} x {height} pixels; at most {LONGEST_SIDE} a side and {MOST_PIXELS} in all are read"
        ));
    }
    if is_cut_short(bytes) {
        return Err("is a broken picture: it is cut short".to_owned());
    }
    let image = reader()?.decode().map_err(|e| broken(&e))?;
    let is_deep = image.color().bytes_per_pixel() > image.color().channel_count();
    let pixels = if is_deep {
        Pixels::from(in_fours(image.into_rgba16().into_raw()))
    } else {
        Pixels::from(in_fours(image.into_rgba8().into_raw()))
    };
    Ok(Texture { name: name.to_string(), width, height, pixels, ..Texture::default() })
}

/// Without a copy, unless there is room for more values than whole pixels take.
fn in_fours<T: Pod>(values: Vec<T>) -> Vec<[T; 4]> {
    try_cast_vec(values).unwrap_or_else(|(_, values)| bytemuck::cast_slice(&values).to_vec())
}

fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_image_width = Some(LONGEST_SIDE);
    limits.max_image_height = Some(LONGEST_SIDE);
    limits.max_alloc = Some(MOST_MEMORY);
    limits
}

fn broken(error: &ImageError) -> String {
    match error {
        ImageError::Unsupported(_) => format!("is not a PNG, JPEG or WebP picture that can be read: {error}"),
        _ => format!("is a broken picture: {}", one_line(&error.to_string())),
    }
}
