//! Pictures for textures: PNG, JPEG, WebP, BMP and Targa, from files or from bytes within another file.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use bytemuck::{Pod, try_cast_vec};
use image::error::ImageError;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::error::{Error, Result, one_line, system_message};
use crate::image::{guarded, is_cut_short};
use crate::io::Placeless;
use crate::memory::{Mapped, process};
use crate::scene::{Pixels, Texture};

/// Longest side, in pixels.
const LONGEST_SIDE: u32 = 16_384;
/// Most pixels of one texture.
const MAX_PIXELS: u64 = 1 << 26;
/// Most memory the decoder may use besides the pixels.
const MAX_MEMORY: u64 = 1 << 29;

/// Of the memory that could be had, the share that pictures may take: what is rendered wants some, too.
const SHARE: f64 = 0.75;

/// The formats that are read, for messages.
const FORMATS: &str = "PNG, JPEG, WebP, BMP or Targa picture";

/// Why a picture is none.
enum Refusal {
    /// It is in a format, or a kind of one, that is not read.
    Unsupported(String),
    /// It is broken, or too large.
    Broken(String),
}

impl From<String> for Refusal {
    fn from(message: String) -> Self {
        Self::Broken(message)
    }
}

impl From<ImageError> for Refusal {
    fn from(error: ImageError) -> Self {
        let message = one_line(&error.to_string());
        match error {
            ImageError::Unsupported(_) => Self::Unsupported(format!("is no {FORMATS} that can be read: {message}")),
            _ => Self::Broken(format!("is a broken picture: {message}")),
        }
    }
}

/// A picture; or why a material that names it may do without: it is missing, or in another format.
pub(super) type Opened = std::result::Result<Texture, String>;

/// Reads a picture file.
///
/// # Errors
/// [`Error::Input`] that names the picture where it cannot be read, is broken or is too large.
pub(super) fn open(path: &Path) -> Result<Opened> {
    let bytes = match Mapped::open(path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return Ok(Err(format!("texture {:?} is missing", path.display())));
        }
        Err(e) => return Err(Error::input(path, "", system_message(&e))),
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    match read(&bytes, &name) {
        Ok(texture) => Ok(Ok(texture)),
        Err(Refusal::Unsupported(why)) => Ok(Err(format!("texture {:?} {why}", path.display()))),
        Err(Refusal::Broken(why)) => Err(Error::input(path, "", why)),
    }
}

/// The file of a name that stands in `file`. Names from Windows have backslashes.
pub(super) fn beside(file: &Path, name: &str) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(name.replace('\\', "/"))
}

/// The format of a picture, if it is one that is read. It is told by the first bytes, since suffixes and MIME types
/// lie; but Targa has none that tell, so that its name has to say it, and its header not to contradict.
fn format(bytes: &[u8], name: &str) -> Option<ImageFormat> {
    match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP | ImageFormat::Bmp)) => Some(format),
        Ok(_) => None,
        Err(_) => {
            let is_named = Path::new(name).extension().is_some_and(|suffix| suffix.eq_ignore_ascii_case("tga"));
            // Whether it has a palette, how it is stored, and the bits of a pixel (Truevision 1991, *TGA File Format
            // Specification*, version 2.0).
            let is_sound =
                matches!(bytes, [_, 0 | 1, 1..=3 | 9..=11, ..]) && matches!(bytes.get(16), Some(8 | 15 | 16 | 24 | 32));
            (is_named && is_sound).then_some(ImageFormat::Tga)
        }
    }
}

/// Decodes a picture.
///
/// # Errors
/// A message about what is wrong, before which the picture's name belongs, where it is broken or too large.
pub(super) fn decode(bytes: &[u8], name: &str) -> Placeless<Opened> {
    match read(bytes, name) {
        Ok(texture) => Ok(Ok(texture)),
        Err(Refusal::Unsupported(why)) => Ok(Err(why)),
        Err(Refusal::Broken(why)) => Err(why),
    }
}

fn read(bytes: &[u8], name: &str) -> std::result::Result<Texture, Refusal> {
    let unsupported = || Refusal::Unsupported(format!("is no {FORMATS}; convert it to one of these"));
    let format = format(bytes, name).ok_or_else(unsupported)?;
    let reader = || {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        reader.limits(limits());
        reader
    };
    // The size first, and without limits of the library's, whose message would not say it.
    let mut sizing = reader();
    sizing.no_limits();
    let sizing = sizing.into_decoder()?;
    let ((width, height), color) = (sizing.dimensions(), sizing.color_type());
    let pixels = u64::from(width) * u64::from(height);
    if width.max(height) > LONGEST_SIDE || pixels > MAX_PIXELS {
        let most = format!("at most {LONGEST_SIDE} a side and {MAX_PIXELS} in all are read");
        return Err(format!("claims {width} x {height} pixels; {most}").into());
    }
    if is_cut_short(bytes) {
        return Err("is a broken picture: it is cut short".to_owned().into());
    }
    let is_deep = color.bytes_per_pixel() > color.channel_count();
    // As it is decoded, and as it stays. Each texture may be small enough, and all of them too many.
    let size = pixels * (u64::from(color.bytes_per_pixel()) + if is_deep { 8 } else { 4 });
    check_memory(size, process::available()).map_err(|m| format!("claims {width} x {height} pixels, {m}"))?;
    let mut image = guarded(|| reader().decode().map_err(Refusal::from))?;
    if let (ImageFormat::Tga, Some(0), DynamicImage::ImageRgba8(image)) =
        (format, bytes.get(17).map(|flags| flags & 15), &mut image)
    {
        // The fourth byte of a pixel is unused where the header counts no bits of alpha.
        image.pixels_mut().for_each(|pixel| pixel.0[3] = 255);
    }
    let pixels = if is_deep {
        Pixels::from(in_fours(image.into_rgba16().into_raw()))
    } else {
        Pixels::from(in_fours(image.into_rgba8().into_raw()))
    };
    Ok(Texture { name: name.to_string(), width, height, pixels, ..Texture::default() })
}

/// Whether so many bytes may be taken of the memory that could be had, as far as that is known.
fn check_memory(bytes: u64, available: Option<u64>) -> Placeless<()> {
    let most = available.map_or(u64::MAX, |available| (available as f64 * SHARE) as u64);
    if bytes <= most {
        return Ok(());
    }
    let [bytes, most] = [bytes, most].map(|bytes| bytes.div_ceil(1_000_000));
    Err(format!(
        "which take {bytes} MB, and of the memory that is left textures may take {most} MB; use fewer or smaller ones"
    ))
}

/// Without a copy, unless there is room for more values than whole pixels take.
fn in_fours<T: Pod>(values: Vec<T>) -> Vec<[T; 4]> {
    try_cast_vec(values).unwrap_or_else(|(_, values)| bytemuck::cast_slice(&values).to_vec())
}

fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_image_width = Some(LONGEST_SIDE);
    limits.max_image_height = Some(LONGEST_SIDE);
    limits.max_alloc = Some(MAX_MEMORY);
    limits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textures_leave_memory_for_the_rest() {
        assert_eq!(check_memory(75, Some(100)), Ok(()));
        assert_eq!(check_memory(u64::MAX, None), Ok(()));
        let message = check_memory(76_000_001, Some(100_000_000)).unwrap_err();
        assert!(message.contains("take 77 MB") && message.contains("may take 75 MB"), "{message}");
    }
}
