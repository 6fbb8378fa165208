//! Where finished tiles are gathered.

use std::sync::{Mutex, PoisonError};

use super::tiles::Tile;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::math::Vec4;

/// A picture that threads fill tile by tile.
///
/// A lock for each tile of a thousand pixels costs nothing beside tracing them, and needs no unsafe sharing.
pub(super) struct Film(Mutex<Image>);

impl Film {
    /// A transparent picture.
    ///
    /// # Errors
    /// [`Error::Memory`] where it does not fit into memory.
    pub(super) fn new(width: u32, height: u32) -> Result<Self> {
        let count = width as usize * height as usize;
        let mut pixels = Vec::new();
        pixels.try_reserve_exact(count).map_err(|_| too_large(width, height))?;
        pixels.resize(count, Vec4::ZERO);
        Ok(Self(Mutex::new(Image { width, height, pixels })))
    }

    /// Puts in a tile's pixels, in the order of [`Tile::pixels`].
    pub(super) fn put(&self, tile: &Tile, pixels: &[Vec4]) {
        let mut image = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let width = image.width as usize;
        for ((x, y), pixel) in tile.pixels().zip(pixels) {
            image.pixels[y as usize * width + x as usize] = *pixel;
        }
    }

    /// The picture.
    pub(super) fn into_image(self) -> Image {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The error for a picture that there is no room for.
pub(super) fn too_large(width: u32, height: u32) -> Error {
    Error::Memory(format!(
        "a picture of {width}x{height} pixels does not fit into memory; make it smaller, or render a part of it"
    ))
}
