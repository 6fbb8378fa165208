//! Pictures that others are held against.

use std::path::Path;

use exr::prelude::f16;

use super::Image;
use super::compare::Difference;
use super::file;
use super::response::Response;
use super::samples::{self, Type, Values};
use crate::error::Result;

/// A picture that others are held against, as its file would hold them: what codes cut off, and halves round, is no difference.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// As [`read`](super::read) has it.
    pub image: Image,
    kind: Type,
    has_alpha: bool,
}

impl Reference {
    /// Reads it.
    ///
    /// # Errors
    /// Those of [`read`](super::read).
    pub fn read(path: &Path) -> Result<Self> {
        let samples = file::read_samples(path)?;
        // Backends may read halves as longer numbers.
        let is_half = |&value: &f32| f16::from_f32(value).to_f32() == value || value.is_nan();
        let kind = match &samples.values {
            // We write no longer codes, and take away what these have more.
            Values::U8(_) | Values::U16(_) => Type::U8,
            Values::Half(_) => Type::Half,
            Values::Float(values) if values.iter().all(is_half) => Type::Half,
            Values::Float(_) => Type::Float,
        };
        let has_alpha = samples.channels.alpha.is_some();
        Ok(Self { image: samples::decode(samples), kind, has_alpha })
    }

    /// How far `image` is from it, once it is what such a file would hold: of codes, what the `response` makes of light.
    ///
    /// # Errors
    /// [`Error::Check`](crate::Error::Check) where the sizes differ.
    pub fn difference(&self, image: &Image, response: &Response) -> Result<Difference> {
        samples::decode(samples::encode(image, self.kind, self.has_alpha, response)).difference(&self.image)
    }
}
