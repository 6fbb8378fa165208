//! Image files without OpenImageIO: OpenEXR by the crate exr, PNG and JPEG by the crate image.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use exr::prelude::{self as openexr, ReadChannels, ReadLayers, WritableImage, f16};
use image::codecs::{jpeg::JpegEncoder, png::PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use openexr::{AttributeValue, FlatSamples, Text};

use super::file::{COMMON, Encoding};
use super::format::Format;
use super::metadata::{Metadata, Placed, Window, is_text, narrow, widen};
use super::samples::{Alpha, Channels, Samples, Values};
use super::{Channel, guarded, picture, pure_channels};

type Result<T> = std::result::Result<T, String>;

// Attributes under the names that OpenImageIO gives them. The crate has a field for the program, but names it
// `software`.
const SOFTWARE: &str = "Software";
const WORLD_TO_SCREEN: &str = "worldToScreen";
const FOVCOT: &str = "fovcot";
const SAMPLES_PER_PIXEL: &str = "samplesPerPixel";
const RENDER_TIME_SECONDS: &str = "renderTimeSeconds";

/// As OpenImageIO is told, too.
const JPEG_QUALITY: u8 = 95;

/// There is nothing to be loaded.
#[cfg(not(feature = "oiio"))]
pub(super) fn prepare() -> crate::error::Result<()> {
    Ok(())
}

/// What is written; the same is read.
pub(super) fn writable_suffixes() -> Result<Vec<String>> {
    Ok(COMMON.iter().flat_map(|format| format.suffixes()).map(|&suffix| suffix.to_owned()).collect())
}

/// Writes a file.
pub(super) fn write(
    path: &Path,
    samples: &Samples,
    channels: &[Channel],
    encoding: Encoding,
    metadata: &Metadata,
) -> Result<()> {
    if !channels.is_empty() {
        return pure_channels::write(path, samples, channels, encoding, metadata);
    }
    match &samples.values {
        Values::U8(bytes) => write_bytes(path, samples, bytes),
        Values::Half(bits) => {
            write_exr(path, samples, encoding, metadata, |i| f16::from_bits(bits[i])).map_err(|e| e.to_string())
        }
        Values::Float(values) => write_exr(path, samples, encoding, metadata, |i| values[i]).map_err(|e| e.to_string()),
        Values::U16(_) => Err("16-bit integers are not written".to_owned()),
    }
}

fn write_bytes(path: &Path, samples: &Samples, bytes: &[u8]) -> Result<()> {
    let mut file = BufWriter::new(File::create(path).map_err(|e| e.to_string())?);
    let (width, height) = (samples.width, samples.height);
    let colour = if samples.channels.alpha.is_some() { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 };
    let written = if Format::of(path) == Some(Format::Png) {
        PngEncoder::new(&mut file).write_image(bytes, width, height, colour)
    } else {
        JpegEncoder::new_with_quality(&mut file, JPEG_QUALITY).write_image(bytes, width, height, colour)
    };
    written.map_err(|e| e.to_string())?;
    file.flush().map_err(|e| e.to_string())
}

fn write_exr<T: exr::image::IntoSample>(
    path: &Path,
    samples: &Samples,
    encoding: Encoding,
    metadata: &Metadata,
    sample: impl Fn(usize) -> T + Sync,
) -> exr::error::UnitResult {
    let (width, height) = (samples.width as usize, samples.height as usize);
    let pixel = |at: openexr::Vec2<usize>| {
        let i = 4 * (at.y() * width + at.x());
        (sample(i), sample(i + 1), sample(i + 2), sample(i + 3))
    };
    let layer = openexr::Layer::new(
        (width, height),
        attributes(metadata),
        tiled(encoding),
        openexr::SpecificChannels::rgba(pixel),
    );
    within(openexr::Image::from_layer(layer), metadata).write().to_file(path)
}

/// The image in the window of the whole picture, where it is a part of one.
pub(super) fn within<L>(mut image: openexr::Image<L>, metadata: &Metadata) -> openexr::Image<L> {
    if let Some(Window { full: [width, height], .. }) = metadata.window {
        let origin = openexr::Vec2(0, 0);
        image.attributes.display_window =
            exr::meta::attribute::IntegerBounds::new(origin, (width as usize, height as usize));
    }
    image
}

/// How a file is packed.
pub(super) fn tiled(encoding: Encoding) -> openexr::Encoding {
    let tile = encoding.tile as usize;
    openexr::Encoding {
        compression: openexr::Compression::ZIP16,
        blocks: openexr::Blocks::Tiles(openexr::Vec2(tile, tile)),
        line_order: openexr::LineOrder::Increasing,
    }
}

/// A text of a file, in UTF-8 as OpenImageIO writes it. The crate's own conversion is to Latin-1, and knows no other
/// letters.
pub(super) fn text(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

/// What a text of a file says.
pub(super) fn string(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}

pub(super) fn attributes(metadata: &Metadata) -> openexr::LayerAttributes {
    let mut attributes = openexr::LayerAttributes {
        world_to_camera: metadata.world_to_camera.as_ref().map(narrow),
        layer_position: metadata.window.map_or(openexr::Vec2(0, 0), |w| openexr::Vec2(w.x as i32, w.y as i32)),
        ..Default::default()
    };
    let mut put = |name: &str, value: Option<AttributeValue>| {
        if let Some(value) = value {
            attributes.other.insert(text(name), value);
        }
    };
    let number = |x: Option<f64>| x.map(|x| AttributeValue::F32(x as f32));
    put(SOFTWARE, Some(AttributeValue::Text(text(&metadata.software))));
    put(WORLD_TO_SCREEN, metadata.world_to_screen.as_ref().map(narrow).map(AttributeValue::Matrix4x4));
    put(FOVCOT, number(metadata.fovcot));
    put(
        SAMPLES_PER_PIXEL,
        metadata.samples_per_pixel.map(|n| AttributeValue::I32(i32::try_from(n).unwrap_or(i32::MAX))),
    );
    put(RENDER_TIME_SECONDS, number(metadata.render_time_seconds));
    for (name, value) in &metadata.texts {
        put(name, Some(AttributeValue::Text(text(value))));
    }
    attributes
}

/// Reads a file, unless `check` refuses its width and height. The format is told by the content.
pub(super) fn read(path: &Path, check: &dyn Fn(u64, u64) -> Result<()>) -> Result<Samples> {
    if openexr_magic(path)? { read_exr(path, check) } else { picture::read(path, check) }
}

fn read_headers(path: &Path) -> Result<exr::meta::MetaData> {
    guarded(|| exr::meta::MetaData::read_from_file(path, false).map_err(|e| e.to_string()))
}

fn openexr_magic(path: &Path) -> Result<bool> {
    let mut file = File::open(path).map_err(|e| e.to_string())?;
    Ok(exr::meta::magic_number::is_exr(&mut file).unwrap_or(false))
}

/// Where a file's pixels lie in the picture that it holds a part of. None where it holds the whole, as every file that
/// is not OpenEXR.
pub(super) fn placed(path: &Path) -> Result<Option<Placed>> {
    if !openexr_magic(path)? {
        return Ok(None);
    }
    let meta = read_headers(path)?;
    let header = meta.headers.first().ok_or("no layers")?;
    let (at, display) = (header.own_attributes.layer_position, header.shared_attributes.display_window);
    let [x, y] =
        [(at.0, display.position.0), (at.1, display.position.1)].map(|(at, full)| i64::from(at) - i64::from(full));
    let full = [display.size.0, display.size.1].map(|side| i64::try_from(side).unwrap_or(0));
    Ok(Placed { x, y, full }.unless_whole(header.layer_size.0 as u32, header.layer_size.1 as u32))
}

/// The channels of a flat OpenEXR file, in the order of their names.
pub(super) struct Planes {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) list: Vec<openexr::AnyChannel<FlatSamples>>,
}

/// Reads them, unless `check` refuses width, height and number.
pub(super) fn read_planes(path: &Path, check: impl FnOnce(u64, u64, u64) -> Result<()>) -> Result<Planes> {
    let meta = read_headers(path)?;
    let header = meta.headers.first().ok_or("no layers")?;
    if header.deep {
        return Err("a deep image; only flat ones are read".to_owned());
    }
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    check(width as u64, height as u64, header.channels.list.len() as u64)?;
    let reader = openexr::read().no_deep_data().largest_resolution_level().all_channels();
    let reader = reader.first_valid_layer().all_attributes().non_parallel();
    let image = guarded(|| reader.from_file(path).map_err(|e| e.to_string()))?;
    let list: Vec<_> = image.layer_data.channel_data.list.into_iter().collect();
    if list.iter().any(|channel| channel.sample_data.len() != width * height) {
        return Err("channels of a lower resolution are not read".to_owned());
    }
    Ok(Planes { width: width as u32, height: height as u32, list })
}

fn read_exr(path: &Path, check: &dyn Fn(u64, u64) -> Result<()>) -> Result<Samples> {
    // Every channel is decoded: many channels count as many pixels.
    let by_pixels = |width, height: u64, count: u64| check(width, height.saturating_mul(count.div_ceil(4)));
    let Planes { width, height, list: planes } = read_planes(path, by_pixels)?;
    let plane = |name: &str| planes.iter().find(|c| c.name == *name).map(|c| &c.sample_data);
    let colours = match (plane("R"), plane("G"), plane("B"), plane("Y")) {
        (Some(r), Some(g), Some(b), _) => vec![r, g, b],
        (_, _, _, Some(y)) => vec![y],
        _ if planes.len() == 1 => vec![&planes[0].sample_data],
        _ => {
            let names: Vec<_> = planes.iter().map(|c| string(&c.name)).collect();
            return Err(format!("no channels R, G and B, or Y; it has {}", names.join(", ")));
        }
    };
    if colours.iter().any(|colour| matches!(colour, FlatSamples::U32(_))) {
        return Err("colours of whole numbers; only floating values are read".to_owned());
    }
    let alpha = plane("A");
    let channels = Channels { colour: colours.len() == 3, alpha: alpha.map(|_| Alpha::Premultiplied) };
    let planes: Vec<&FlatSamples> = colours.into_iter().chain(alpha).collect();
    let count = width as usize * height as usize;
    let values = (0..count).flat_map(|i| planes.iter().map(move |p| p.value_by_flat_index(i).to_f32()));
    Ok(Samples { width, height, channels, values: Values::Float(values.collect()) })
}

/// Reads the attributes that [`write`] writes.
pub(super) fn read_metadata(path: &Path) -> Result<Metadata> {
    let meta = read_headers(path)?;
    let header = meta.headers.first().ok_or("no layers")?;
    let attributes = &header.own_attributes;
    let (at, display) = (attributes.layer_position, header.shared_attributes.display_window);
    let is_whole = at == display.position && header.layer_size == display.size;
    let window = || {
        let [width, height] = [display.size.0, display.size.1].map(|n| i32::try_from(n).unwrap_or(-1));
        (display.position == openexr::Vec2(0, 0)).then(|| Window::of_signed([at.0, at.1], [width, height])).flatten()
    };
    let number = |name: &str| match attributes.other.get(&text(name)) {
        Some(&AttributeValue::F32(x)) => Some(f64::from(x)),
        _ => None,
    };
    Ok(Metadata {
        software: match attributes.other.get(&text(SOFTWARE)) {
            Some(AttributeValue::Text(name)) => string(name),
            _ => attributes.software_name.as_ref().map(string).unwrap_or_default(),
        },
        world_to_camera: attributes.world_to_camera.as_ref().map(widen),
        world_to_screen: match attributes.other.get(&text(WORLD_TO_SCREEN)) {
            Some(AttributeValue::Matrix4x4(m)) => Some(widen(m)),
            _ => None,
        },
        fovcot: number(FOVCOT),
        samples_per_pixel: match attributes.other.get(&text(SAMPLES_PER_PIXEL)) {
            Some(&AttributeValue::I32(n)) => n.try_into().ok(),
            _ => None,
        },
        render_time_seconds: number(RENDER_TIME_SECONDS),
        window: if is_whole { None } else { window() },
        texts: texts(attributes),
    })
}

fn texts(attributes: &openexr::LayerAttributes) -> Vec<(String, String)> {
    let named = attributes.other.iter().filter_map(|(name, value)| match value {
        AttributeValue::Text(text) => Some((string(name), string(text))),
        _ => None,
    });
    let mut texts: Vec<_> = named.filter(|(name, _)| is_text(name)).collect();
    texts.sort();
    texts
}

/// Every channel of a file, unless `check` refuses its width and height.
pub(super) use super::pure_channels::read as read_channels;
