//! Images on surfaces.

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

/// What a picture shows, row by row, the first at the top: sRGB-encoded colour, or numbers, and linear alpha; in as
/// many bits as its file has. Shared by textures that show the same picture in other places. All in 16 bits would be
/// one way through the code, and twice the memory for most.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pixels {
    /// Channels of 8 bits.
    Eight(Arc<Vec<[u8; 4]>>),
    /// Channels of 16 bits.
    Sixteen(Arc<Vec<[u16; 4]>>),
}

impl Default for Pixels {
    fn default() -> Self {
        Self::Eight(Arc::default())
    }
}

impl From<Vec<[u8; 4]>> for Pixels {
    fn from(pixels: Vec<[u8; 4]>) -> Self {
        Self::Eight(pixels.into())
    }
}

impl From<Vec<[u16; 4]>> for Pixels {
    fn from(pixels: Vec<[u16; 4]>) -> Self {
        Self::Sixteen(pixels.into())
    }
}

impl Pixels {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Eight(pixels) => pixels.len(),
            Self::Sixteen(pixels) => pixels.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// As they lie in memory.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::Eight(pixels) => pixels.as_flattened(),
            Self::Sixteen(pixels) => bytemuck::cast_slice(pixels),
        }
    }

    /// A number that is the same for those that are shared, and for no others.
    #[doc(hidden)]
    pub fn address(&self) -> usize {
        match self {
            Self::Eight(pixels) => Arc::as_ptr(pixels).addr(),
            Self::Sixteen(pixels) => Arc::as_ptr(pixels).addr(),
        }
    }
}

/// An image on a surface.
#[derive(Clone, Debug, Default)]
pub struct Texture {
    /// File name or name in the file, for messages.
    pub name: String,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` of them.
    pub pixels: Pixels,
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
