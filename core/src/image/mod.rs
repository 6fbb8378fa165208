//! Pixels, what a camera makes of them, and how two pictures differ.

mod compare;
pub mod flip;
mod response;
pub mod srgb;

pub use compare::Difference;
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
