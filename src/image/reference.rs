//! Pictures that others are held against.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use exr::prelude::f16;

use super::samples::{self, Type, Values};
use super::{Difference, Image, Response, file};
use crate::error::Result;
use crate::math::Vec3;

/// A picture that others are held against, as its file would hold them: what codes cut off, and halves round, is no
/// difference.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// As [`read`](super::read) has it; of codes of 16 bits, what eight of them hold.
    pub image: Image,
    kind: Type,
    has_alpha: bool,
    /// Whether it is in Radiance's format.
    is_radiance: bool,
}

impl Reference {
    /// Reads it.
    ///
    /// # Errors
    /// Those of [`read`](super::read).
    pub fn read(path: &Path) -> Result<Self> {
        let samples = file::read_samples(path)?;
        let is_radiance = starts_with(path, b"#?");
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
        Ok(Self { image, kind, has_alpha, is_radiance })
    }

    /// How far `image` is from it, once it is what such a file would hold: of codes, what the `response` makes of
    /// light.
    ///
    /// # Errors
    /// [`Error::Check`](crate::Error::Check) where the sizes differ, and those of [`Image::check`].
    pub fn difference(&self, image: &Image, response: &Response) -> Result<Difference> {
        image.check()?;
        let held = |kind| through(image, kind, self.has_alpha, response).difference(&self.image);
        let difference = if self.is_radiance {
            let mut shared = through(image, Type::Float, self.has_alpha, response);
            shared.pixels.iter_mut().for_each(|pixel| *pixel = shared_exponent(pixel.truncate()).extend(pixel.w));
            shared.difference(&self.image)?
        } else {
            held(self.kind)?
        };
        if self.kind != Type::Half && !self.is_radiance {
            return Ok(difference);
        }
        // What halves hold may stand in longer numbers, to which nothing is rounded; and other programs round to
        // Radiance's steps where this one's cuts off.
        let longer = held(Type::Float)?;
        Ok(if longer.rmse < difference.rmse || difference.rmse.is_nan() { longer } else { difference })
    }
}

/// What is left of an image in a file of this type.
fn through(image: &Image, kind: Type, alpha: bool, response: &Response) -> Image {
    samples::decode(samples::encode(image, kind, alpha, response))
}

/// What Radiance's format holds of a colour: of each channel eight bits, cut off, under the exponent of the largest
/// (Ward 1991, *Real pixels*).
fn shared_exponent(color: Vec3) -> Vec3 {
    let largest = color.max_element();
    // Below, as for what is NaN, all is black.
    if largest.is_nan() || largest < 1e-32 {
        return Vec3::ZERO;
    }
    let (_, exponent) = libm::frexpf(largest);
    let step = libm::ldexpf(1.0, exponent - 8);
    (color.max(Vec3::ZERO) / step).floor() * step
}

fn starts_with(path: &Path, first: &[u8]) -> bool {
    let mut bytes = vec![0; first.len()];
    File::open(path).and_then(|mut file| file.read_exact(&mut bytes)).is_ok() && bytes == first
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes by Ward's own routine, `setcolr` of ray/src/common/color.c: d = frexp(largest, &e) * 256 / largest, each
    /// byte the whole part of channel times d, the fourth e + 128; and back with ldexp(byte, e - 8).
    #[test]
    fn colours_under_a_shared_exponent() {
        for (color, bytes, exponent) in [
            ([1.0, 0.5, 0.25], [128.0, 64.0, 32.0], 1),
            ([0.999, 0.3, 1e-4], [255.0, 76.0, 0.0], 0),
            ([30.0, 29.0, 27.3], [240.0, 232.0, 218.0], 5),
            ([0.0, -1.0, 3e-5], [0.0, 0.0, 251.0], -15),
        ] {
            let expected = Vec3::from(bytes.map(|byte| libm::ldexpf(byte, exponent - 8)));
            assert_eq!(shared_exponent(Vec3::from(color)), expected, "{color:?}");
        }
        assert_eq!(shared_exponent(Vec3::splat(1e-33)), Vec3::ZERO);
    }
}
