//! Image files through OpenImageIO 2.4 or later, by a C++ shim of our own.
//!
//! | file | what |
//! | --- | --- |
//! | `shim` | opens the shim, and OpenImageIO with it, when the first image file is read or written |
//! | `bridge` | its functions and types |
//! | `formats` | which formats are read |
//! | `unheard` | formats whose writers do not tell what goes wrong |
//! | `unnamed` | files that are in memory alone |
//!
//! The crate `oiio` was rejected: it needs OpenImageIO 3.1, and Debian 12 and 13 have 2.4 and 2.5.

mod bridge;
mod formats;
mod shim;
mod unheard;
#[cfg(target_os = "linux")]
mod unnamed;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use exr::prelude::f16;

use self::bridge::{Attributes, Input, Kind, Layout, Named, Result, Slice, Text};
use self::shim::functions;
use super::file::Encoding;
use super::format::Format;
use super::jpeg::{self, Plain};
use super::metadata::{Metadata, Placed, Window, is_text, narrow, widen};
use super::orientation::upright;
use super::samples::{Alpha, Channels, Samples, Values};
use super::{Channel, Channels as AllChannels, Plane, picture};
use crate::error::Error;
use crate::memory::Mapped;

/// Loads OpenImageIO unless it is there.
///
/// # Errors
/// [`Error::Unavailable`] where it cannot be loaded, with the remedy.
pub(super) fn prepare() -> std::result::Result<(), Error> {
    functions().map(|_| ()).map_err(Error::Unavailable)
}

/// What OpenImageIO would write as colours, whatever the suffix says: grey and black-and-white pictures of netpbm.
const MISNAMED: [&str; 2] = ["pbm", "pgm"];

/// Suffixes that the installed OpenImageIO writes, in lower case, sorted.
pub(super) fn writable_suffixes() -> Result<Vec<String>> {
    // To ask takes milliseconds, for each format makes a writer.
    static SUFFIXES: OnceLock<Result<Vec<String>>> = OnceLock::new();
    let ask = || {
        let mut suffixes: Vec<_> = functions()?.suffixes()?.split(',').map(str::to_owned).collect();
        suffixes.sort();
        suffixes.dedup();
        suffixes.retain(|suffix| !MISNAMED.contains(&suffix.as_str()));
        Ok(suffixes)
    };
    SUFFIXES.get_or_init(ask).clone()
}

/// Writes a file.
pub(super) fn write(
    path: &Path,
    samples: &Samples,
    channels: &[Channel],
    encoding: Encoding,
    metadata: &Metadata,
) -> Result<()> {
    let (kind, values): (_, &[u8]) = match &samples.values {
        Values::U8(v) => (Kind::U8, v.as_slice()),
        Values::U16(v) => (Kind::U16, bytemuck::cast_slice(v)),
        Values::Half(v) => (Kind::Half, bytemuck::cast_slice(v)),
        Values::Float(v) => (Kind::Float, bytemuck::cast_slice(v)),
    };
    let beside: Vec<_> = channels.iter().map(named).collect();
    let layout = Layout {
        width: samples.width,
        height: samples.height,
        channels: samples.channels.count() as u32,
        kind,
        tile: encoding.tile,
        alpha: samples.channels.alpha.is_some(),
        straight: samples.channels.alpha == Some(Alpha::Straight),
        linear: encoding.linear,
        beside: beside[..].into(),
        ..Layout::default()
    };
    let [camera, screen] = [&metadata.world_to_camera, &metadata.world_to_screen].map(|m| m.as_ref().map(narrow));
    let [fovcot, seconds] = [metadata.fovcot, metadata.render_time_seconds].map(|x| x.map(|x| x as f32));
    let integer = |n| i32::try_from(n).unwrap_or(i32::MAX);
    let spp = metadata.samples_per_pixel.map(integer);
    let window = metadata.window.map(|Window { x, y, full: [width, height] }| [x, y, width, height].map(integer));
    let texts = metadata.texts.iter().map(|(name, value)| Text { name: name[..].into(), value: value[..].into() });
    let texts: Vec<_> = texts.collect();
    let attributes = Attributes {
        software: metadata.software[..].into(),
        world_to_camera: matrix(&camera),
        world_to_screen: matrix(&screen),
        fovcot: fovcot.as_slice().into(),
        samples_per_pixel: spp.as_slice().into(),
        render_time_seconds: seconds.as_slice().into(),
        window: window.as_ref().map_or_else(Slice::default, |window| window[..].into()),
        texts: texts[..].into(),
    };
    if !channels.is_empty() {
        return functions()?.write(path, &layout, &attributes, &interleaved(samples, values, channels));
    }
    let write = |path: &Path| functions()?.write(path, &layout, &attributes, values);
    if unheard::are_written_to(path) { unheard::write(path, [layout.width, layout.height], write) } else { write(path) }
}

fn matrix(matrix: &Option<[f32; 16]>) -> Slice<'_, f32> {
    matrix.as_ref().map_or_else(Slice::default, |matrix| matrix[..].into())
}

fn named(Channel { name, plane }: &Channel) -> Named<'_> {
    let kind = match plane {
        Plane::Float(_) => Kind::Float,
        Plane::Uint(_) => Kind::U32,
    };
    Named { name: name[..].into(), kind }
}

/// Pixel by pixel the colours and what stands beside them.
fn interleaved(samples: &Samples, colours: &[u8], channels: &[Channel]) -> Vec<u8> {
    let pixels = samples.width as usize * samples.height as usize;
    let colour = colours.len() / pixels;
    let mut bytes = Vec::with_capacity(colours.len() + 4 * channels.len() * pixels);
    for (i, colours) in colours.chunks_exact(colour).enumerate() {
        bytes.extend_from_slice(colours);
        channels.iter().for_each(|channel| bytes.extend_from_slice(&channel.plane.bytes()[4 * i..4 * i + 4]));
    }
    bytes
}

/// Every channel of a file, unless `check` refuses its width and height.
pub(super) fn read_channels(path: &Path, check: &dyn Fn(u64, u64) -> Result<()>) -> Result<AllChannels> {
    let mut input = open_exr(path)?;
    let [width, height] = input.size()?;
    check(width.into(), height.into())?;
    let named: Vec<_> = input.channels()?.iter().map(|channel| (channel.name.text(), channel.kind)).collect();
    let size = |kind| if kind == Kind::Half { 2 } else { 4 };
    let pixel: usize = named.iter().map(|&(_, kind)| size(kind)).sum();
    let pixels = width as usize * height as usize;
    let mut samples = vec![0u8; pixels * pixel];
    input.read_all(&mut samples)?;
    let mut at = 0;
    let channels = named.into_iter().map(|(name, kind)| {
        let first = at;
        at += size(kind);
        let word = |pixel: &[u8]| [pixel[first], pixel[first + 1], pixel[first + 2], pixel[first + 3]];
        let each = samples.chunks_exact(pixel);
        let plane = match kind {
            Kind::Half => {
                let half = |pixel: &[u8]| f16::from_bits(u16::from_ne_bytes([pixel[first], pixel[first + 1]])).to_f32();
                Plane::Float(each.map(half).collect())
            }
            Kind::U32 => Plane::Uint(each.map(|pixel| u32::from_ne_bytes(word(pixel))).collect()),
            _ => Plane::Float(each.map(|pixel| f32::from_ne_bytes(word(pixel))).collect()),
        };
        Channel { name, plane }
    });
    Ok(AllChannels { width, height, channels: channels.collect() })
}

/// Reads a file as it is to be seen, unless `check` refuses its width and height.
pub(super) fn read(path: &Path, check: &dyn Fn(u64, u64) -> Result<()>) -> Result<Samples> {
    match formats::of(path)? {
        // To the same bits, and libpng writes to where errors belong by itself.
        (Format::Png, _) => picture::read(path, check),
        (Format::Jpeg, name) => read_jpeg(path, name, check),
        (Format::Radiance, name) => read_radiance(path, name, check),
        (_, name) => read_as(path, name, check),
    }
}

/// Of a JPEG file the picture alone: what OpenImageIO makes of the words that cameras and programs leave beside it
/// reads past their end where they are damaged.
fn read_jpeg(path: &Path, name: &str, check: &dyn Fn(u64, u64) -> Result<()>) -> Result<Samples> {
    let file = Mapped::open(path).map_err(|error| error.to_string())?;
    let Plain { bytes, orientation } = jpeg::plain(&file).ok_or("a broken JPEG file: there is no picture in it")?;
    let Some((_memory, place)) = in_memory(&bytes) else { return read_as(path, name, check) };
    let samples = read_as(&place, name, check);
    let samples = samples.map_err(|message| message.replace(&*place.to_string_lossy(), &path.to_string_lossy()))?;
    Ok(upright(samples, orientation))
}

/// A file in memory of these bytes, as long as it is open, and its name; none where there are no such files.
#[cfg(target_os = "linux")]
fn in_memory(bytes: &[u8]) -> Option<(std::fs::File, PathBuf)> {
    use std::io::Write;

    let (mut file, place) = unnamed::create(c"twincast-picture").ok()?;
    file.write_all(bytes).ok()?;
    std::fs::metadata(&place).ok()?;
    Some((file, place))
}

#[cfg(not(target_os = "linux"))]
fn in_memory(_: &[u8]) -> Option<(std::fs::File, PathBuf)> {
    None
}

/// A Radiance file, unless its lines are columns of the picture.
fn read_radiance(path: &Path, name: &str, check: &dyn Fn(u64, u64) -> Result<()>) -> Result<Samples> {
    if functions()?.open(path, name)?.layout()?.orientation > 4 {
        // Of such lines OpenImageIO takes two for each other.
        return Err("its lines are columns of the picture (the line of its sizes begins with X); only those with rows are read, of which the line begins with -Y or +Y".to_owned());
    }
    read_as(path, name, check)
}

/// Reads a file by the reader of a format, which is told by OpenImageIO's name of it or by a suffix of its files.
pub(super) fn read_as(path: &Path, format: &str, check: &dyn Fn(u64, u64) -> Result<()>) -> Result<Samples> {
    let mut input = functions()?.open(path, format)?;
    let layout = input.layout()?;
    check(layout.width.into(), layout.height.into())?;
    let alpha = layout.alpha.then_some(if layout.straight { Alpha::Straight } else { Alpha::Premultiplied });
    let channels = Channels { colour: layout.channels >= 3, alpha };
    let count = layout.width as usize * layout.height as usize * channels.count();
    let values = match layout.kind {
        Kind::U8 => Values::U8(fill(&mut input, count)?),
        Kind::U16 => Values::U16(fill(&mut input, count)?),
        _ => Values::Float(fill(&mut input, count)?),
    };
    Ok(upright(Samples { width: layout.width, height: layout.height, channels, values }, layout.orientation))
}

/// An OpenEXR file, opened.
fn open_exr(path: &Path) -> Result<Input<'static>> {
    match formats::of(path) {
        Ok((Format::OpenExr, name)) => functions()?.open(path, name),
        _ => Err("not an OpenEXR file".to_owned()),
    }
}

/// Where a file's pixels lie in the picture that it holds a part of. None where it holds the whole, as every file that
/// is not OpenEXR.
pub(super) fn placed(path: &Path) -> Result<Option<Placed>> {
    if formats::of(path)?.0 != Format::OpenExr {
        return Ok(None);
    }
    let layout = open_exr(path)?.layout()?;
    let [x, y, full_x, full_y, full_width, full_height] = layout.window.map(i64::from);
    Ok(Placed { x: x - full_x, y: y - full_y, full: [full_width, full_height] }
        .unless_whole(layout.width, layout.height))
}

fn fill<T: bytemuck::Pod>(input: &mut Input, count: usize) -> Result<Vec<T>> {
    let mut values = vec![T::zeroed(); count];
    input.read(bytemuck::cast_slice_mut(&mut values))?;
    Ok(values)
}

/// Reads the attributes that [`write`] writes.
pub(super) fn read_metadata(path: &Path) -> Result<Metadata> {
    let mut input = open_exr(path)?;
    let found = input.attributes()?;
    let matrix = |m: Slice<f32>| m.get().try_into().ok().map(|m: &[f32; 16]| widen(m));
    let number = |x: Slice<f32>| x.get().first().copied().map(f64::from);
    let texts = found.texts.get().iter().map(|text| (text.name.text(), text.value.text()));
    let mut texts: Vec<_> = texts.filter(|(name, _)| is_text(name)).collect();
    texts.sort();
    Ok(Metadata {
        world_to_camera: matrix(found.world_to_camera),
        world_to_screen: matrix(found.world_to_screen),
        fovcot: number(found.fovcot),
        samples_per_pixel: found.samples_per_pixel.get().first().and_then(|&n| n.try_into().ok()),
        render_time_seconds: number(found.render_time_seconds),
        window: match *found.window.get() {
            [x, y, width, height] => Window::of_signed([x, y], [width, height]),
            _ => None,
        },
        software: found.software.text(),
        texts,
    })
}
