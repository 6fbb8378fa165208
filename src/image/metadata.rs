//! What a picture's file says about how it was made.

use crate::error::{Error, Result};

/// How a picture was made. In OpenEXR files each field is an attribute; other formats keep what they can.
///
/// Matrices are written as the field does it, for row vectors: `[x y z 1] M`, translation in the last four elements.
/// That is also the order of glam's `to_cols_array` for a matrix that multiplies column vectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Metadata {
    /// The program, with its version (`Software`).
    pub software: String,
    /// From world space to the camera's (`worldToCamera`); this camera looks along its -z, +y is up.
    pub world_to_camera: Option<[f64; 16]>,
    /// From world space to the screen (`worldToScreen`): after the division by w, x and y are -1 to 1 in the picture.
    pub world_to_screen: Option<[f64; 16]>,
    /// "The cotangent (x/y) of the field of view" in OpenImageIO's words; as there, the picture's width over its height
    /// (`fovcot`).
    pub fovcot: Option<f64>,
    /// Camera rays for each pixel (`samplesPerPixel`).
    pub samples_per_pixel: Option<u32>,
    /// Wall clock time of the render (`renderTimeSeconds`).
    pub render_time_seconds: Option<f64>,
    /// Of which larger picture this is a part; none for a whole one. OpenEXR's data window in its display window.
    pub window: Option<Window>,
    /// Texts under names of their own, which have a slash in them (`cryptomatte/5e4b1a2/name`) and 255 bytes at most;
    /// in the order of the names when read. OpenEXR alone.
    pub texts: Vec<(String, String)>,
}

/// Where a part of a picture belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Columns of the whole picture to the left of it.
    pub x: u32,
    /// Rows of the whole picture above it.
    pub y: u32,
    /// Width and height of the whole picture.
    pub full: [u32; 2],
}

/// Where the pixels of a file lie in the picture that it holds a part of, which they may also reach beyond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Placed {
    pub x: i64,
    pub y: i64,
    /// Width and height of the whole picture.
    pub full: [i64; 2],
}

impl Placed {
    /// None where a file of this width and height is the whole picture.
    pub(super) fn unless_whole(self, width: u32, height: u32) -> Option<Self> {
        (self != Self { x: 0, y: 0, full: [width.into(), height.into()] }).then_some(self)
    }
}

impl Default for Metadata {
    /// This program, and nothing else.
    fn default() -> Self {
        Self {
            software: concat!("twincast ", env!("CARGO_PKG_VERSION")).to_owned(),
            world_to_camera: None,
            world_to_screen: None,
            fovcot: None,
            samples_per_pixel: None,
            render_time_seconds: None,
            window: None,
            texts: Vec::new(),
        }
    }
}

impl Metadata {
    /// Whether files can hold it.
    pub(super) fn check(&self) -> Result<()> {
        let texts = self.texts.iter().map(|(name, _)| name);
        let is_wrong = |name: &&String| !is_text(name) || name.len() > 255 || name.contains('\0');
        texts.clone().find(is_wrong).map_or(Ok(()), |name| {
            Err(Error::Usage(format!("text {name:?}: names have a slash, and 255 bytes at most, none of which is 0")))
        })
    }
}

impl Window {
    /// None for numbers that no picture of ours has.
    pub(super) fn of_signed([x, y]: [i32; 2], [width, height]: [i32; 2]) -> Option<Self> {
        let number = |n: i32| u32::try_from(n).ok();
        Some(Self { x: number(x)?, y: number(y)?, full: [number(width)?, number(height)?] })
    }
}

/// Whether an attribute of a file is one of [`Metadata::texts`].
pub(super) fn is_text(name: &str) -> bool {
    name.contains('/')
}

/// Files hold f32.
pub(super) fn narrow(matrix: &[f64; 16]) -> [f32; 16] {
    matrix.map(|x| x as f32)
}

/// Back from what files hold.
pub(super) fn widen(matrix: &[f32; 16]) -> [f64; 16] {
    matrix.map(f64::from)
}
