//! OpenEXR files with any channels, by the crate exr.

use std::path::Path;

use exr::prelude::{self as openexr, FlatSamples, WritableImage, f16};

use super::file::Encoding;
use super::metadata::Metadata;
use super::pure::{Planes, attributes, read_planes, string, text, tiled, within};
use super::samples::{Samples, Values};
use super::{Channel, Channels, Plane};

type Result<T> = std::result::Result<T, String>;

/// Writes colours and what stands beside them.
pub(super) fn write(
    path: &Path,
    samples: &Samples,
    channels: &[Channel],
    encoding: Encoding,
    metadata: &Metadata,
) -> Result<()> {
    let count = samples.channels.count();
    let mut list = Vec::new();
    for (i, name) in ["R", "G", "B", "A"].into_iter().take(count).enumerate() {
        let plane = match &samples.values {
            Values::Half(bits) => {
                FlatSamples::F16(bits.iter().skip(i).step_by(count).map(|&b| f16::from_bits(b)).collect())
            }
            Values::Float(values) => FlatSamples::F32(values.iter().skip(i).step_by(count).copied().collect()),
            Values::U8(_) | Values::U16(_) => return Err("integer colours are not written beside channels".to_owned()),
        };
        list.push(openexr::AnyChannel::new(name, plane));
    }
    list.extend(channels.iter().map(|Channel { name, plane }| {
        let plane = match plane {
            Plane::Float(values) => FlatSamples::F32(values.clone()),
            Plane::Uint(values) => FlatSamples::U32(values.clone()),
        };
        openexr::AnyChannel::new(text(name), plane)
    }));
    let layer = openexr::Layer::new(
        (samples.width as usize, samples.height as usize),
        attributes(metadata),
        tiled(encoding),
        openexr::AnyChannels::sort(list.into()),
    );
    within(openexr::Image::from_layer(layer), metadata).write().to_file(path).map_err(|e| e.to_string())
}

/// Every channel of a file, unless `check` refuses its width and height.
pub(super) fn read(path: &Path, check: &dyn Fn(u64, u64) -> Result<()>) -> Result<Channels> {
    let Planes { width, height, list } = read_planes(path, |width, height, _| check(width, height))?;
    let channels = list.into_iter().map(|channel| {
        let plane = match channel.sample_data {
            FlatSamples::F16(values) => Plane::Float(values.into_iter().map(f16::to_f32).collect()),
            FlatSamples::F32(values) => Plane::Float(values),
            FlatSamples::U32(values) => Plane::Uint(values),
        };
        Channel { name: string(&channel.name), plane }
    });
    Ok(Channels { width, height, channels: channels.collect() })
}
