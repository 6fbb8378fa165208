//! `EXT_meshopt_compression` (Kapoulkine and St. Pierre 2022, *EXT_meshopt_compression*, with its bitstream in appendix
//! A and its filters in appendix B), and what came after it, `KHR_meshopt_compression` (Kapoulkine, St. Pierre, Knyazev
//! and McCurdy 2025), which has a second version of the stream for elements, and one more filter.
//!
//! Three streams, one file each: [`attributes`](mod@attributes) for elements of any size, [`triangles`](mod@triangles)
//! and [`indices`](mod@indices) for indices; and [`filters`], which elements may pass through after that. A stream does
//! not say how much it holds, so the caller does. The crate meshopt, the alternative, compiles meshoptimizer's C++ and
//! needs its own `unsafe`; the streams are four pages.

mod attributes;
mod filters;
mod indices;
mod stream;
mod triangles;

use serde::Deserialize;

use super::schema::Extensions;
use crate::io::Placeless;

/// What a buffer view says about its compressed contents.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Compressed {
    /// The extension.
    #[serde(skip)]
    name: &'static str,
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: String,
    filter: Option<String>,
}

const NAMES: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// What a buffer view's extensions say about its compressed contents; none where they are not compressed.
///
/// # Errors
/// What is wrong with the extension.
pub(super) fn compressed(extensions: &Extensions) -> Placeless<Option<Compressed>> {
    let named = NAMES.into_iter().find_map(|name| Some((name, extensions.get(name)?)));
    let Some((name, value)) = named else { return Ok(None) };
    let compressed = Compressed::deserialize(value).map_err(|error| format!("{name}: {error}"))?;
    Ok(Some(Compressed { name, ..compressed }))
}

/// Whether a buffer only stands in for readers that cannot decompress.
pub(super) fn is_fallback(extensions: &Extensions) -> bool {
    let fallback = |name| extensions.get(name).and_then(|extension| extension.get("fallback")?.as_bool());
    NAMES.into_iter().any(|name| fallback(name).unwrap_or(false))
}

impl Compressed {
    /// How many bytes the contents are; `length` is what the buffer view says.
    ///
    /// # Errors
    /// Where the two differ, or the stride does not suit the mode.
    pub(super) fn size(&self, length: u64) -> Placeless<u64> {
        let Self { name, byte_stride: stride, count, mode, filter, .. } = self;
        let filter = filter.as_deref().unwrap_or("NONE");
        let suits = match (mode.as_str(), filter) {
            ("ATTRIBUTES", "NONE" | "EXPONENTIAL") => (4..=256).contains(stride) && stride % 4 == 0,
            ("ATTRIBUTES", "OCTAHEDRAL" | "COLOR") => matches!(stride, 4 | 8),
            ("ATTRIBUTES", "QUATERNION") => *stride == 8,
            ("TRIANGLES", "NONE") => matches!(stride, 2 | 4) && count % 3 == 0,
            ("INDICES", "NONE") => matches!(stride, 2 | 4),
            _ => return Err(format!("{name}: mode {mode:?} with filter {filter:?} is not known")),
        };
        if !suits {
            return Err(format!("{name}: {count} elements of {stride} bytes do not suit {mode} with filter {filter}"));
        }
        let size = stride.saturating_mul(*count);
        if size != length || u32::try_from(*count).is_err() {
            return Err(format!("{name}: {count} elements of {stride} bytes, in a buffer view of {length} bytes"));
        }
        Ok(size)
    }

    /// The contents of `source`, for which [`Compressed::size`] holds.
    ///
    /// # Errors
    /// What is wrong with the stream.
    pub(super) fn decode(&self, source: &[u8]) -> Placeless<Vec<u8>> {
        let (count, stride) = (self.count as usize, self.byte_stride as usize);
        let decoded = match self.mode.as_str() {
            "ATTRIBUTES" => attributes::decode(source, count, stride).map(|mut bytes| {
                match self.filter.as_deref() {
                    Some("OCTAHEDRAL") => filters::octahedral(&mut bytes, stride),
                    Some("QUATERNION") => filters::quaternion(&mut bytes),
                    Some("EXPONENTIAL") => filters::exponential(&mut bytes),
                    Some("COLOR") => filters::color(&mut bytes, stride),
                    _ => {}
                }
                bytes
            }),
            "TRIANGLES" => triangles::decode(source, count).map(|indices| packed(&indices, stride)),
            _ => indices::decode(source, count).map(|indices| packed(&indices, stride)),
        };
        decoded.map_err(|message| format!("{}: {message}", self.name))
    }
}

/// Indices of two or four bytes.
fn packed(indices: &[u32], stride: usize) -> Vec<u8> {
    match stride {
        2 => indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect(),
        _ => indices.iter().flat_map(|&i| i.to_le_bytes()).collect(),
    }
}
