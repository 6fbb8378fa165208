//! Pixels, and the files they are kept in.

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
