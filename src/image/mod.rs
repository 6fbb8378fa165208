//! Pixels, and the files they are kept in.
//!
//! Pixels themselves, what a camera makes of them ([`Response`]) and how two pictures differ are the core's; what reads
//! and writes files is here.
//!
//! What an [`Image`] becomes in a file is decided by the suffix: linear samples where the format holds floating values
//! (OpenEXR, Radiance), 8-bit codes everywhere else, TIFF included, by what a camera makes of light. `samples.rs` turns
//! pixels into a file's samples, and a backend moves them: `oiio` (OpenImageIO, feature `oiio`) or `pure.rs` (the
//! crates exr and image). Both write the same pixels, and read PNG by the same decoder (`picture.rs`). What else a
//! pixel has goes into further channels of OpenEXR files (`channels.rs`). Noise is taken out by [`denoise`].

mod channels;
pub mod denoise;
mod file;
mod format;
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
mod samples;

#[doc(inline)]
pub use twincast_core::image::{Curve, Developer, Difference, Image, MAX_STOPS, Response, TEMPERATURES, flip, srgb};

pub use channels::{Channel, Channels, Plane};
pub use file::{
    Depth, WriteOptions, check_writable, holds_channels, read, read_channels, read_metadata, read_whole, write,
    write_channels,
};
pub(crate) use file::{check_sides, check_suffix, has_common_suffix, keeps_radiance, prepare, write_beside};
pub(crate) use guarded::guarded;
pub(crate) use jpeg::is_cut_short;
pub use metadata::{Metadata, Window};
pub use reference::Reference;
