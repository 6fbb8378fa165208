//! Image files through OpenImageIO 2.4 or later, by a C++ shim of our own (`ffi/oiio.cpp`) and cxx.
//!
//! The crate `oiio` was rejected: it needs OpenImageIO 3.1, and Debian 12 and 13 have 2.4 and 2.5.
#![allow(unsafe_code)] // What cxx generates for the bridge; there is no other unsafe code here.

use std::path::Path;

use exr::prelude::f16;

use super::file::Encoding;
use super::metadata::{Metadata, Window, is_text, narrow, widen};
use super::samples::{Alpha, Channels, Samples, Values};
use super::{Channel, Channels as AllChannels, Plane};

#[cxx::bridge(namespace = "twincast::oiio")]
mod ffi {
    /// The type of a sample.
    enum Kind {
        U8,
        U16,
        U32,
        Half,
        Float,
    }

    /// One of the channels of a file.
    struct Named {
        name: String,
        kind: Kind,
    }

    /// An attribute.
    struct Text {
        name: String,
        value: String,
    }

    /// What a file holds.
    struct Layout {
        width: u32,
        height: u32,
        /// 1 to 4: gray or RGB, then alpha.
        channels: u32,
        kind: Kind,
        /// Whether the last channel is alpha, and if so, whether colours are not multiplied by it.
        alpha: bool,
        straight: bool,
        /// Edge of a tile; 0 for rows.
        tile: u32,
        /// What follows the colours in each pixel, of four bytes each.
        beside: Vec<Named>,
    }

    /// Attributes, as far as they are there: vectors of length 0 or 1, matrices 0 or 16.
    #[derive(Default)]
    struct Attributes {
        software: String,
        world_to_camera: Vec<f32>,
        world_to_screen: Vec<f32>,
        fovcot: Vec<f32>,
        samples_per_pixel: Vec<i32>,
        render_time_seconds: Vec<f32>,
        /// x, y, and the width and height of the whole picture; or nothing.
        window: Vec<i32>,
        texts: Vec<Text>,
    }

    // SAFETY: the functions take references and slices and keep none of them; the shim checks that a slice is as long as
    // the layout says before OpenImageIO gets its address. Exceptions do not cross: cxx catches what `Result` functions
    // throw, and the others are noexcept.
    unsafe extern "C++" {
        include!("twincast/ffi/oiio.h");

        /// Suffixes of the formats that can be written.
        fn suffixes() -> Result<Vec<String>>;
        fn write(path: &[u8], layout: &Layout, attributes: &Attributes, samples: &[u8]) -> Result<()>;

        /// A file opened for reading.
        type Input;
        fn open(path: &[u8]) -> Result<UniquePtr<Input>>;
        fn layout(self: &Input) -> Result<Layout>;
        fn attributes(self: &Input) -> Result<Attributes>;
        /// Reads all samples of the colours.
        fn read(self: &Input, samples: &mut [u8]) -> Result<()>;
        /// Every channel, in the order of the file.
        fn channels(self: &Input) -> Result<Vec<Named>>;
        /// Reads all samples of all channels, side by side as they are in the file.
        fn read_all(self: &Input, samples: &mut [u8]) -> Result<()>;
    }
}

type Result<T> = std::result::Result<T, String>;

/// On Unix a path is bytes to OpenImageIO, too.
fn bytes(path: &Path) -> &[u8] {
    path.as_os_str().as_encoded_bytes()
}

fn message(error: cxx::Exception) -> String {
    // One line: some of OpenImageIO's messages have several.
    error.what().split('\n').map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
}

/// Suffixes that the installed OpenImageIO writes, in lower case, sorted.
pub(super) fn writable_suffixes() -> Result<Vec<String>> {
    let mut suffixes = ffi::suffixes().map_err(message)?;
    suffixes.sort();
    suffixes.dedup();
    Ok(suffixes)
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
        Values::U8(v) => (ffi::Kind::U8, v.as_slice()),
        Values::U16(v) => (ffi::Kind::U16, bytemuck::cast_slice(v)),
        Values::Half(v) => (ffi::Kind::Half, bytemuck::cast_slice(v)),
        Values::Float(v) => (ffi::Kind::Float, bytemuck::cast_slice(v)),
    };
    let layout = ffi::Layout {
        width: samples.width,
        height: samples.height,
        channels: samples.channels.count() as u32,
        kind,
        alpha: samples.channels.alpha.is_some(),
        straight: samples.channels.alpha == Some(Alpha::Straight),
        tile: encoding.tile,
        beside: channels.iter().map(named).collect(),
    };
    let matrix = |m: &Option<[f64; 16]>| m.as_ref().map(|m| narrow(m).to_vec()).unwrap_or_default();
    let number = |x: Option<f64>| x.map(|x| x as f32).into_iter().collect();
    let attributes = ffi::Attributes {
        software: metadata.software.clone(),
        world_to_camera: matrix(&metadata.world_to_camera),
        world_to_screen: matrix(&metadata.world_to_screen),
        fovcot: number(metadata.fovcot),
        samples_per_pixel: metadata
            .samples_per_pixel
            .map(|n| i32::try_from(n).unwrap_or(i32::MAX))
            .into_iter()
            .collect(),
        render_time_seconds: number(metadata.render_time_seconds),
        window: metadata.window.map_or_else(Vec::new, |Window { x, y, full: [width, height] }| {
            [x, y, width, height].map(|n| i32::try_from(n).unwrap_or(i32::MAX)).to_vec()
        }),
        texts: metadata
            .texts
            .iter()
            .map(|(name, value)| ffi::Text { name: name.clone(), value: value.clone() })
            .collect(),
    };
    if channels.is_empty() {
        return ffi::write(bytes(path), &layout, &attributes, values).map_err(message);
    }
    ffi::write(bytes(path), &layout, &attributes, &interleaved(samples, values, channels)).map_err(message)
}

fn named(Channel { name, plane }: &Channel) -> ffi::Named {
    let kind = match plane {
        Plane::Float(_) => ffi::Kind::Float,
        Plane::Uint(_) => ffi::Kind::U32,
    };
    ffi::Named { name: name.clone(), kind }
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
    let input = ffi::open(bytes(path)).map_err(message)?;
    let layout = input.layout().map_err(message)?;
    check(layout.width.into(), layout.height.into())?;
    let named = input.channels().map_err(message)?;
    let size = |kind: ffi::Kind| if kind == ffi::Kind::Half { 2 } else { 4 };
    let pixel: usize = named.iter().map(|channel| size(channel.kind)).sum();
    let pixels = layout.width as usize * layout.height as usize;
    let mut samples = vec![0u8; pixels * pixel];
    input.read_all(&mut samples).map_err(message)?;
    let mut at = 0;
    let channels = named.into_iter().map(|ffi::Named { name, kind }| {
        let first = at;
        at += size(kind);
        let word = |pixel: &[u8]| [pixel[first], pixel[first + 1], pixel[first + 2], pixel[first + 3]];
        let each = samples.chunks_exact(pixel);
        let plane = match kind {
            ffi::Kind::Half => {
                let half = |pixel: &[u8]| f16::from_bits(u16::from_ne_bytes([pixel[first], pixel[first + 1]])).to_f32();
                Plane::Float(each.map(half).collect())
            }
            ffi::Kind::U32 => Plane::Uint(each.map(|pixel| u32::from_ne_bytes(word(pixel))).collect()),
            _ => Plane::Float(each.map(|pixel| f32::from_ne_bytes(word(pixel))).collect()),
        };
        Channel { name, plane }
    });
    Ok(AllChannels { width: layout.width, height: layout.height, channels: channels.collect() })
}

/// Reads a file, unless `check` refuses its width and height.
pub(super) fn read(path: &Path, check: &dyn Fn(u64, u64) -> Result<()>) -> Result<Samples> {
    let input = ffi::open(bytes(path)).map_err(message)?;
    let layout = input.layout().map_err(message)?;
    check(layout.width.into(), layout.height.into())?;
    let alpha = layout.alpha.then_some(if layout.straight { Alpha::Straight } else { Alpha::Premultiplied });
    let channels = Channels { colour: layout.channels >= 3, alpha };
    let count = layout.width as usize * layout.height as usize * channels.count();
    let values = match layout.kind {
        ffi::Kind::U8 => Values::U8(fill(&input, count)?),
        ffi::Kind::U16 => Values::U16(fill(&input, count)?),
        _ => Values::Float(fill(&input, count)?),
    };
    Ok(Samples { width: layout.width, height: layout.height, channels, values })
}

fn fill<T: bytemuck::Pod>(input: &ffi::Input, count: usize) -> Result<Vec<T>> {
    let mut values = vec![T::zeroed(); count];
    input.read(bytemuck::cast_slice_mut(&mut values)).map_err(message)?;
    Ok(values)
}

/// Reads the attributes that [`write`] writes.
pub(super) fn read_metadata(path: &Path) -> Result<Metadata> {
    let input = ffi::open(bytes(path)).map_err(message)?;
    let found = input.attributes().map_err(message)?;
    let matrix = |m: &[f32]| m.try_into().ok().map(|m: &[f32; 16]| widen(m));
    let number = |x: &[f32]| x.first().copied().map(f64::from);
    let texts = found.texts.into_iter().map(|ffi::Text { name, value }| (name, value));
    let mut texts: Vec<_> = texts.filter(|(name, _)| is_text(name)).collect();
    texts.sort();
    Ok(Metadata {
        world_to_camera: matrix(&found.world_to_camera),
        world_to_screen: matrix(&found.world_to_screen),
        fovcot: number(&found.fovcot),
        samples_per_pixel: found.samples_per_pixel.first().and_then(|&n| n.try_into().ok()),
        render_time_seconds: number(&found.render_time_seconds),
        window: match found.window[..] {
            [x, y, width, height] => Window::of_signed([x, y], [width, height]),
            _ => None,
        },
        software: found.software,
        texts,
    })
}
