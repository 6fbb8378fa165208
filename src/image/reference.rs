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
    /// As [`read`](super::read) has it; of codes of 16 bits, what eight of them hold.
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
        let has_alpha = samples.channels.alpha.is_some();
        // Backends may read halves as longer numbers.
        let is_half = |&value: &f32| f16::from_f32(value).to_f32() == value || value.is_nan();
        let (kind, is_long) = match &samples.values {
            Values::U8(_) => (Type::U8, false),
            Values::U16(_) => (Type::U8, true),
            Values::Half(_) => (Type::Half, false),
            Values::Float(values) if values.iter().all(is_half) => (Type::Half, false),
            Values::Float(_) => (Type::Float, false),
        };
        let image = samples::decode(samples);
        // No longer codes are written here.
        let image = if is_long { through(&image, Type::U8, has_alpha, &Response::default()) } else { image };
        Ok(Self { image, kind, has_alpha })
    }

    /// How far `image` is from it, once it is what such a file would hold: of codes, what the `response` makes of light.
    ///
    /// # Errors
    /// [`Error::Check`](crate::Error::Check) where the sizes differ.
    pub fn difference(&self, image: &Image, response: &Response) -> Result<Difference> {
        let held = |kind| through(image, kind, self.has_alpha, response).difference(&self.image);
        let difference = held(self.kind)?;
        if self.kind != Type::Half {
            return Ok(difference);
        }
        // What halves hold may stand in longer numbers, to which nothing is rounded.
        let longer = held(Type::Float)?;
        Ok(if longer.rmse < difference.rmse || difference.rmse.is_nan() { longer } else { difference })
    }
}

/// What is left of an image in a file of this type.
fn through(image: &Image, kind: Type, alpha: bool, response: &Response) -> Image {
    samples::decode(samples::encode(image, kind, alpha, response))
}
