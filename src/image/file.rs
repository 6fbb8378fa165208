//! Writing and reading image files, whichever backend does it.
//!
//! OpenImageIO is loaded by the first of these functions that needs it. Where it cannot be, [`Error::Unavailable`] says
//! so.

use std::path::Path;

use super::format::Format;
use super::metadata::Placed;
#[cfg(feature = "oiio")]
use super::oiio as backend;
#[cfg(not(feature = "oiio"))]
use super::pure as backend;
use super::samples::{self, Samples, Type};
use super::{Channel, Channels, Curve, Image, Metadata, Response, channels};
use crate::error::{Error, Result, one_line, system_message};
use crate::memory::Mapped;
use crate::output::{self, AtomicWrites, suffix};

/// How an image is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WriteOptions {
    /// The samples of OpenEXR files.
    pub depth: Depth,
    /// Edge of the tiles of OpenEXR files, in pixels. Not 0.
    pub tile: u32,
    /// What becomes of radiance where the format holds codes; formats that hold floating values keep it.
    pub response: Response,
}

/// The samples of OpenEXR files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Depth {
    /// IEEE binary16: 11 significant bits, up to 65504. A picture with more light than that has binary32.
    #[default]
    Half,
    /// IEEE binary32: the pixels as they are.
    Float,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { depth: Depth::Half, tile: 64, response: Response::default() }
    }
}

/// How a backend is to write a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Encoding {
    pub kind: Type,
    pub alpha: bool,
    /// Edge of a tile; 0 for rows, as most formats have them.
    pub tile: u32,
    /// Whether codes are the light itself, without a transfer function. The writers of builds without OpenImageIO say
    /// nothing of it.
    #[cfg_attr(not(feature = "oiio"), expect(dead_code))]
    pub linear: bool,
}

/// The largest finite number of binary16.
const MAX_HALF: f32 = 65504.0;

/// What is written with and without OpenImageIO.
pub(super) const COMMON: [Format; 3] = [Format::OpenExr, Format::Jpeg, Format::Png];

/// The most pixels along a side that a format holds. Those without a number hold all pictures that are rendered, or
/// find out themselves. Checked here because some users of libjpeg end the process where its limit is exceeded.
fn longest_side(format: Format) -> Option<u32> {
    match format {
        Format::Jpeg => Some(65_500),
        Format::WebP => Some(16_383),
        Format::Ico => Some(256),
        Format::Gif | Format::Iff | Format::Rla | Format::Sgi | Format::Targa => Some(65_535),
        _ => None,
    }
}

/// Most pixels in a file that is read: 4 GiB as [`Image`].
const MAX_PIXELS: u64 = 1 << 28;

/// A file that claims more pixels than this must have [`PIXELS_PER_BYTE`] to show for them.
const UNSUSPICIOUS_PIXELS: u64 = 1 << 24;

/// More than the formats' compression gives: deflate's best is 1032 bytes for one.
const PIXELS_PER_BYTE: u64 = 1 << 14;

/// Writes an image. The suffix decides the format: linear for OpenEXR (tiled, zip, channels R, G, B, A) and Radiance;
/// else 8-bit codes as `options.response` has it, with straight alpha in PNG, TIFF and Targa, over black in all others.
///
/// The file appears when it is whole, and on failure the old one stays; see
/// [`write_atomically`](crate::output::write_atomically).
///
/// # Errors
/// [`Error::Output`] for a suffix that this build does not write, and for whatever goes wrong with the file;
/// [`Error::Usage`] for an image without pixels or with too few, for tiles of size 0, and for what [`Metadata::texts`]
/// cannot be.
pub fn write(path: &Path, image: &Image, metadata: &Metadata, options: &WriteOptions) -> Result<()> {
    write_channels(path, image, &[], metadata, options)
}

/// As [`write()`], with further channels beside the colours, which keep all their bits.
///
/// # Errors
/// Those of [`write()`]; [`Error::Output`] where there are channels and the format is not OpenEXR, and [`Error::Usage`]
/// where they do not go with the image, or with each other.
pub fn write_channels(
    path: &Path,
    image: &Image,
    channels: &[Channel],
    metadata: &Metadata,
    options: &WriteOptions,
) -> Result<()> {
    let mut files = AtomicWrites::default();
    write_beside(&mut files, path, image, channels, metadata, options)?;
    files.commit().into_result()
}

/// The same, as one of several files that are put in place together, which know of what goes wrong with the file.
pub(crate) fn write_beside(
    files: &mut AtomicWrites,
    path: &Path,
    image: &Image,
    channels: &[Channel],
    metadata: &Metadata,
    options: &WriteOptions,
) -> Result<()> {
    check_suffix(path)?;
    image.check()?;
    let (width, height) = (image.width, image.height);
    if width == 0 || height == 0 {
        return Err(Error::Usage(format!("an image of {width} x {height} pixels")));
    }
    metadata.check()?;
    if options.tile == 0 || options.tile > 1 << 16 {
        return Err(Error::Usage(format!("tiles of {0} x {0} pixels; 1 to 65536 is possible", options.tile)));
    }
    check_sides(path, [width, height])?;
    if !channels.is_empty() && !holds_channels(path) {
        return Err(Error::output(path, "only OpenEXR files (.exr) hold more channels than colours"));
    }
    channels::check(channels, image.pixels.len())?;
    let encoding = encoding(Format::of(path), options, image);
    let coding = (encoding, &options.response);
    files.write(path, |part| write_part(path, part, image, channels, coding, metadata));
    Ok(())
}

/// Whether a file of this name holds channels beside the colours: the suffix is that of OpenEXR.
pub fn holds_channels(path: &Path) -> bool {
    Format::of(path) == Some(Format::OpenExr)
}

/// Whether the format that the suffix says holds pictures of this width and height.
///
/// # Errors
/// [`Error::Output`] where it does not.
pub(crate) fn check_sides(path: &Path, [width, height]: [u32; 2]) -> Result<()> {
    match Format::of(path).and_then(longest_side) {
        Some(most) if width.max(height) > most => {
            let suffix = suffix(path);
            Err(Error::output(
                path,
                format!(
                    "{width} x {height} pixels are too many for .{suffix}, which ends at {most}; choose another format"
                ),
            ))
        }
        _ => Ok(()),
    }
}

/// Loads what image files take, as the first of them would.
///
/// # Errors
/// [`Error::Unavailable`] where it cannot be loaded.
pub(crate) fn prepare() -> Result<()> {
    backend::prepare()
}

/// Whether every build writes files of this suffix; of the others, OpenImageIO has to be asked.
pub(crate) fn has_common_suffix(path: &Path) -> bool {
    Format::of(path).is_some_and(|format| COMMON.contains(&format))
}

/// Checks, before a long render, that an image can be written to `path`: by writing a small one beside it.
///
/// # Errors
/// [`Error::Output`] for a suffix that this build does not write (it lists those that it does), for a folder that does
/// not exist or takes no file, and for a path that is itself a folder.
pub fn check_writable(path: &Path) -> Result<()> {
    check_suffix(path)?;
    let options = WriteOptions::default();
    output::check_writable(path)?;
    // Not smaller, for JPEG 2000's sake.
    let (image, metadata) = (Image::new(32, 32), Metadata::default());
    let coding = (encoding(Format::of(path), &options, &image), &options.response);
    output::probe(path, |part| write_part(path, part, &image, &[], coding, &metadata))
}

/// Reads an image as it is to be seen. Integer samples are taken for sRGB and linearised, floating samples are taken as
/// they are; gray is spread over R, G and B, and missing alpha is 1. Of files with several images or layers, the first
/// is read; of OpenEXR the channels R, G and B, or Y, and A.
///
/// # Errors
/// [`Error::Input`] for a file that is missing, broken or in a format that this build does not read, and for one that
/// claims more than 2^28 pixels, or more than its size makes plausible.
pub fn read(path: &Path) -> Result<Image> {
    read_samples(path).map(samples::decode)
}

/// As [`read`], but the whole picture where an OpenEXR file holds a part of it: transparent black around that, and
/// nothing of what lies beyond.
///
/// # Errors
/// Those of [`read`].
pub fn read_whole(path: &Path) -> Result<Image> {
    let part = read(path)?;
    let Some(Placed { x, y, full }) = backend::placed(path).map_err(|message| unreadable(path, &message))? else {
        return Ok(part);
    };
    let [width, height] = full.map(|side| u64::try_from(side).unwrap_or(0));
    check_size(width, height, file_size(path)?).map_err(|message| unreadable(path, &message))?;
    let mut whole = Image::new(width as u32, height as u32);
    // What both have of a side: where it begins in the whole and in the part, and how long it is.
    let shared = |at: i64, part: u32, whole: u64| {
        let (first, end) = (at.max(0), (at + i64::from(part)).min(whole as i64));
        (first as usize, (first - at) as usize, (end - first).max(0) as usize)
    };
    let ((left, from_left, columns), (top, from_top, rows)) =
        (shared(x, part.width, width), shared(y, part.height, height));
    if columns > 0 {
        for row in 0..rows {
            let source = &part.pixels[(from_top + row) * part.width as usize + from_left..][..columns];
            whole.pixels[(top + row) * width as usize + left..][..columns].copy_from_slice(source);
        }
    }
    Ok(whole)
}

/// What [`read`] decodes.
pub(super) fn read_samples(path: &Path) -> Result<Samples> {
    let bytes = file_size(path)?;
    if Format::of(path) == Some(Format::Jpeg) {
        let file = Mapped::open(path).map_err(|error| Error::input(path, "", system_message(&error)))?;
        if super::is_cut_short(&file) {
            return Err(Error::input(path, "", "is cut short"));
        }
    }
    prepare()?;
    let check = |width: u64, height: u64| check_size(width, height, bytes);
    backend::read(path, &check).map_err(|message| unreadable(path, &message))
}

/// Reads every channel of an OpenEXR file, those of the colours as well; halves become floating values.
///
/// # Errors
/// As of [`read`]; and for a file in another format.
pub fn read_channels(path: &Path) -> Result<Channels> {
    let bytes = file_size(path)?;
    prepare()?;
    let check = |width: u64, height: u64| check_size(width, height, bytes);
    backend::read_channels(path, &check).map_err(|message| unreadable(path, &message))
}

/// Reads what an OpenEXR file says about how it was made. Fields that it does not have are None, or empty.
///
/// # Errors
/// [`Error::Input`] for a file that is missing, broken or in another format.
pub fn read_metadata(path: &Path) -> Result<Metadata> {
    file_size(path)?;
    prepare()?;
    backend::read_metadata(path).map_err(|message| unreadable(path, &message))
}

/// What a backend says of a file that it cannot read.
fn unreadable(path: &Path, message: &str) -> Error {
    Error::input(path, "", one_line(message))
}

fn write_part(
    path: &Path,
    part: &Path,
    image: &Image,
    channels: &[Channel],
    (encoding, response): (Encoding, &Response),
    metadata: &Metadata,
) -> Result<()> {
    let samples = samples::encode(image, encoding.kind, encoding.alpha, response);
    let written = backend::write(part, &samples, channels, encoding, metadata);
    // Libraries put the name that they were given into their messages.
    written.map_err(|message| {
        Error::output(path, message.replace(&*part.to_string_lossy(), &path.to_string_lossy()).trim())
    })
}

/// Whether the format that the suffix says holds light of any strength.
pub(crate) fn keeps_radiance(path: &Path) -> bool {
    matches!(Format::of(path), Some(Format::OpenExr | Format::Radiance))
}

/// What a file of this format holds: linear floating values in OpenEXR and Radiance, in all others 8-bit codes.
fn encoding(format: Option<Format>, options: &WriteOptions, image: &Image) -> Encoding {
    match format {
        Some(Format::OpenExr) => {
            // What is more would come back as infinite.
            let is_held = |value: f32| !value.is_finite() || value.abs() <= MAX_HALF;
            let fits = || image.pixels.iter().all(|pixel| pixel.to_array().into_iter().all(is_held));
            let kind = if options.depth == Depth::Half && fits() { Type::Half } else { Type::Float };
            Encoding { kind, alpha: true, tile: options.tile, linear: true }
        }
        Some(Format::Radiance) => Encoding { kind: Type::Float, alpha: false, tile: 0, linear: true },
        _ => {
            // These define alpha, and as straight. The others either have none, or leave open what it means to
            // colours, and every reader guesses differently: there the image is laid over black.
            let alpha = matches!(format, Some(Format::Png | Format::Targa | Format::Tiff));
            Encoding { kind: Type::U8, alpha, tile: 0, linear: options.response.curve == Curve::Linear }
        }
    }
}

/// Whether this build writes pictures of such a name.
///
/// # Errors
/// [`Error::Output`] where it does not, and as [`prepare`].
pub(crate) fn check_suffix(path: &Path) -> Result<()> {
    let suffix = suffix(path);
    prepare()?;
    let known = backend::writable_suffixes().map_err(|message| Error::output(path, message))?;
    if known.contains(&suffix) {
        return Ok(());
    }
    let found = if suffix.is_empty() { "no suffix".to_owned() } else { format!("unknown suffix .{suffix}") };
    let without = if cfg!(feature = "oiio") { "" } else { "; more with OpenImageIO (feature oiio)" };
    Err(Error::output(path, format!("{found}; this build writes {}{without}", known.join(", "))))
}

fn file_size(path: &Path) -> Result<u64> {
    let file = std::fs::metadata(path).map_err(|e| Error::input(path, "", system_message(&e)))?;
    if file.is_dir() {
        return Err(Error::input(path, "", "is a folder, not an image file"));
    }
    if file.len() == 0 {
        return Err(Error::input(path, "", "is empty"));
    }
    Ok(file.len())
}

/// Before anything is allocated: whether a file of this size may claim so many pixels.
fn check_size(width: u64, height: u64, bytes: u64) -> std::result::Result<(), String> {
    let claim = format!("claims {width} x {height} pixels");
    if width == 0 || height == 0 {
        return Err(format!("{claim}; there must be at least one"));
    }
    match width.checked_mul(height) {
        Some(n) if n > MAX_PIXELS => Err(format!("{claim}; at most {MAX_PIXELS} are read")),
        None => Err(format!("{claim}; at most {MAX_PIXELS} are read")),
        Some(n) if n > UNSUSPICIOUS_PIXELS && n / PIXELS_PER_BYTE > bytes => {
            Err(format!("{claim}, but has only {bytes} bytes; it is cut short or broken"))
        }
        Some(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn claims_are_checked() {
        assert!(check_size(100_000, 100_000, u64::MAX).unwrap_err().contains("at most"));
        assert!(check_size(u64::MAX, 2, 1 << 40).unwrap_err().contains("at most"));
        assert!(check_size(0, 5, 100).is_err());
        assert!(check_size(16_384, 16_384, 1000).unwrap_err().contains("only 1000 bytes"));
        assert!(check_size(16_384, 16_384, 1 << 14).is_ok());
        assert!(check_size(4096, 4096, 70).is_ok());
    }

    #[test]
    fn texts_that_files_cannot_hold_are_refused() {
        let path = std::env::temp_dir().join("twincast-never-written.exr");
        for (name, is_held) in
            [("a/b", true), ("a", false), ("a\0/b", false), (&format!("a/{}", "b".repeat(254)), false)]
        {
            let metadata = Metadata { texts: vec![(name.to_owned(), "x".to_owned())], ..Metadata::default() };
            assert_eq!(metadata.check().is_ok(), is_held, "{name:?}");
            if !is_held {
                let error = write(&path, &Image::new(2, 2), &metadata, &WriteOptions::default()).unwrap_err();
                assert_eq!(error.exit_code(), 2, "{error}");
                assert!(!path.exists());
            }
        }
    }

    #[test]
    fn suffixes_choose_the_encoding() {
        let options = WriteOptions { depth: Depth::Float, tile: 32, ..WriteOptions::default() };
        let of = |suffix| {
            let e = encoding(Format::of_suffix(suffix), &options, &Image::new(1, 1));
            (e.kind, e.alpha, e.tile)
        };
        assert_eq!(of("exr"), (Type::Float, true, 32));
        assert_eq!(of("hdr"), (Type::Float, false, 0));
        assert_eq!(of("png"), (Type::U8, true, 0));
        assert_eq!(of("dpx"), (Type::U8, false, 0));
        assert_eq!(of("jpg"), (Type::U8, false, 0));
    }

    #[test]
    fn light_that_halves_do_not_hold_is_kept() {
        let infinite = f32::INFINITY;
        let cases = [
            (0.0, 65504.0, Type::Half),
            (0.0, 65505.0, Type::Float),
            (0.0, infinite, Type::Half),
            (infinite, 1e5, Type::Float),
        ];
        for (red, light, kind) in cases {
            let mut image = Image::new(2, 1);
            (image.pixels[1].x, image.pixels[1].y) = (red, light);
            assert_eq!(encoding(Some(Format::OpenExr), &WriteOptions::default(), &image).kind, kind, "{light}");
        }
    }
}
