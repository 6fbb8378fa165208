//! Pixels, what a camera makes of them, and how two pictures differ.

mod compare;
pub mod flip;
mod response;
pub mod srgb;

pub use compare::Difference;
pub use response::{Curve, Developer, MAX_STOPS, Response, TEMPERATURES};

use crate::error::{Error, Result};
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

    /// Whether there are as many pixels as width and height say.
    ///
    /// # Errors
    /// [`Error::Usage`] where there are not.
    pub fn check(&self) -> Result<()> {
        let Self { width, height, pixels } = self;
        if pixels.len() as u64 == u64::from(*width) * u64::from(*height) {
            return Ok(());
        }
        Err(Error::Usage(format!("an image of {width} x {height} pixels with {} of them in memory", pixels.len())))
    }
}
