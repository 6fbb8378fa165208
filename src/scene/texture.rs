//! An image on a surface.

use crate::math::Vec2;

/// What lies outside the unit square.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image mirrored.
    Mirror,
    /// The edge's colour.
    Clamp,
}

/// How a colour between pixel centres is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The nearest pixel.
    Nearest,
    /// Between the four nearest.
    #[default]
    Linear,
}

/// An 8-bit sRGB image with alpha, first row at the top.
#[derive(Clone, Debug, Default)]
pub struct Texture {
    /// File name or name in the file, for messages.
    pub name: String,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// sRGB-encoded colour, linear alpha; row by row; `width * height` of them.
    pub pixels: Vec<[u8; 4]>,
    /// Outside the unit square, along u.
    pub wrap_u: Wrap,
    /// Outside the unit square, along v.
    pub wrap_v: Wrap,
    /// Between pixels.
    pub filter: Filter,
    /// Texture coordinates are multiplied by this (OBJ's `-s`; 1 elsewhere)...
    pub scale: Vec2,
    /// ...and this is added (OBJ's `-o`).
    pub offset: Vec2,
}
