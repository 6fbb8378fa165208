//! Pixels, and the files they are kept in.
//!
//! What an [`Image`] becomes in a file is decided by the suffix: linear samples where the format holds floating values
//! (OpenEXR, Radiance), 8-bit codes everywhere else, TIFF included, by what a camera makes of light (`response`). `samples.rs` turns pixels into a file's samples, and a
//! backend moves them: `oiio` (OpenImageIO, feature `oiio`) or `pure.rs` (the crates exr and image). Both write the
//! same pixels, and read PNG by the same decoder (`picture.rs`). What else a pixel has goes into further channels of OpenEXR files (`channels.rs`). Noise is taken out by [`denoise`].

mod channels;
mod compare;
pub mod denoise;
mod file;
pub mod flip;
mod guarded;
mod jpeg;
#[cfg(any(feature = "oiio", feature = "oidn"))]
mod loading;
mod metadata;
#[cfg(feature = "oiio")]
mod oiio;
mod orientation;
#[cfg(all(test, feature = "oiio"))]
mod parity;
mod picture;
#[cfg(any(test, not(feature = "oiio")))]
mod pure;
#[cfg(any(test, not(feature = "oiio")))]
mod pure_channels;
mod reference;
mod response;
mod samples;
pub mod srgb;

pub use channels::{Channel, Channels, Plane};
pub use compare::Difference;
pub use file::{
    Depth, WriteOptions, check_writable, holds_channels, read, read_channels, read_metadata, read_whole, write,
    write_channels,
};
pub(crate) use file::{has_common_suffix, keeps_radiance, prepare};
pub(crate) use guarded::guarded;
pub(crate) use jpeg::is_cut_short;
pub use metadata::{Metadata, Window};
pub use reference::Reference;
pub use response::{Curve, Developer, MOST_STOPS, Response, TEMPERATURES};

use crate::math::Vec4;

/// Linear RGBA pixels (Rec. 709 primaries, alpha premultiplied), first row at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row, `width * height` of them.
    pub pixels: Vec<Vec4>,
}

impl Image {
    /// An image of transparent black.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![Vec4::ZERO; width as usize * height as usize] }
    }
}
