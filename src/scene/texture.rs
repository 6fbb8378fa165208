//! An image on a surface.

use std::sync::Arc;

use crate::math::Affine2;

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
    /// Shared by textures that show the same picture in other places.
    pub pixels: Arc<Vec<[u8; 4]>>,
    /// Outside the unit square, along u.
    pub wrap_u: Wrap,
    /// Outside the unit square, along v.
    pub wrap_v: Wrap,
    /// Between pixels.
    pub filter: Filter,
    /// Whether it lies on the mesh by the second set of coordinates.
    pub on_second_uvs: bool,
    /// From the mesh's texture coordinates to those of the picture, both with v up: OBJ's `-s` and `-o`, glTF's
    /// `KHR_texture_transform`.
    pub transform: Affine2,
}
