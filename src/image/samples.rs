//! Between an [`Image`] and the samples that a file holds.
//!
//! Every conversion (transfer function, alpha, rounding) is done here, once, and the backends only move samples in and
//! out of files. So both write the same pixels, to the bit. Leaving it to each library was rejected: OpenImageIO
//! multiplies 8-bit colours by alpha in encoded form, and libraries round in different ways.

use exr::prelude::f16;

use super::{Developer, Image, Response, srgb};
use crate::math::Vec4;

/// Samples as they are in a file: row by row from the top, the channels of a pixel side by side.
#[derive(Debug, PartialEq)]
pub(super) struct Samples {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// What there is for each pixel.
    pub channels: Channels,
    /// `width * height * channels.count()` of them.
    pub values: Values,
}

/// The channels of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Channels {
    /// Red, green and blue; else one gray.
    pub colour: bool,
    /// Whether alpha follows.
    pub alpha: Option<Alpha>,
}

/// How colours relate to alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Alpha {
    /// Already multiplied by it (EXR).
    Premultiplied,
    /// Still to be multiplied by it (PNG).
    Straight,
}

/// Integers are sRGB-encoded, but for alpha; floating values are linear.
#[derive(Debug, PartialEq)]
#[cfg_attr(not(feature = "oiio"), allow(dead_code))]
pub(super) enum Values {
    U8(Vec<u8>),
    U16(Vec<u16>),
    /// Bits of IEEE binary16.
    Half(Vec<u16>),
    Float(Vec<f32>),
}

/// The type of a sample to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    U8,
    Half,
    Float,
}

impl Channels {
    /// Samples a pixel, 1 to 4.
    pub fn count(self) -> usize {
        (if self.colour { 3 } else { 1 }) + usize::from(self.alpha.is_some())
    }
}

/// What a file of this type holds for the image: of codes, what the `response` makes of it. Without alpha the image is
/// laid over black.
pub(super) fn encode(image: &Image, kind: Type, alpha: bool, response: &Response) -> Samples {
    let alpha = alpha.then_some(if kind == Type::U8 { Alpha::Straight } else { Alpha::Premultiplied });
    let channels = Channels { colour: true, alpha };
    let count = channels.count();
    let linear = || image.pixels.iter().flat_map(move |p| p.to_array().into_iter().take(count));
    let values = match kind {
        Type::U8 => {
            let developer = response.developer();
            let codes = |&p: &Vec4| encode8(p, alpha, &developer).into_iter().take(count);
            Values::U8(image.pixels.iter().flat_map(codes).collect())
        }
        Type::Half => Values::Half(linear().map(|v| f16::from_f32(v).to_bits()).collect()),
        Type::Float => Values::Float(linear().collect()),
    };
    Samples { width: image.width, height: image.height, channels, values }
}

fn encode8(pixel: Vec4, alpha: Option<Alpha>, developer: &Developer) -> [u8; 4] {
    // Light without coverage (alpha 0) has no straight colour; files with straight alpha cannot hold it.
    let scale = match alpha {
        None | Some(Alpha::Premultiplied) => 1.0,
        Some(Alpha::Straight) if pixel.w > 0.0 => 1.0 / pixel.w.min(1.0),
        Some(Alpha::Straight) => 0.0,
    };
    let colour = developer.develop(pixel.truncate() * scale).to_array().map(srgb::unit_to_8bit);
    [colour[0], colour[1], colour[2], srgb::unit_to_8bit(pixel.w)]
}

/// The image that a file's samples stand for. Gray becomes R = G = B; alpha is 1 where there is none.
///
/// # Panics
/// Where `values` are fewer than there should be: the backends' duty.
pub(super) fn decode(samples: Samples) -> Image {
    let Samples { width, height, channels, values } = samples;
    let pixels = match values {
        Values::U8(v) => decode_integers(&v, channels, 255.0, srgb::srgb_to_linear),
        Values::U16(v) => decode_integers(&v, channels, 65535.0, srgb::srgb16_to_linear),
        Values::Half(v) => {
            decode_linear(&v.iter().map(|&bits| f16::from_bits(bits).to_f32()).collect::<Vec<_>>(), channels)
        }
        Values::Float(v) => decode_linear(&v, channels),
    };
    assert_eq!(pixels.len(), width as usize * height as usize);
    Image { width, height, pixels }
}

fn decode_linear(values: &[f32], channels: Channels) -> Vec<Vec4> {
    let count = channels.count();
    let pixel = |v: &[f32]| {
        let (colour, alpha) = split(v, channels, 1.0);
        let scale = if channels.alpha == Some(Alpha::Straight) { alpha } else { 1.0 };
        Vec4::new(colour[0] * scale, colour[1] * scale, colour[2] * scale, alpha)
    };
    values.chunks_exact(count).map(pixel).collect()
}

fn decode_integers<T: Copy + Into<f64>>(
    values: &[T],
    channels: Channels,
    one: f64,
    to_linear: impl Fn(T) -> f32,
) -> Vec<Vec4> {
    let count = channels.count();
    let pixel = |v: &[T]| {
        let (colour, alpha) = split(v, channels, v[0]);
        let alpha = if channels.alpha.is_some() { (alpha.into() / one) as f32 } else { 1.0 };
        let [r, g, b] = match channels.alpha {
            None | Some(Alpha::Straight) => colour.map(&to_linear),
            // Multiplied in encoded form, as files with 8-bit premultiplied alpha are.
            Some(Alpha::Premultiplied) if alpha > 0.0 => {
                colour.map(|c| srgb::decode((c.into() / one / f64::from(alpha)).min(1.0)) as f32)
            }
            Some(Alpha::Premultiplied) => [0.0; 3],
        };
        Vec4::new(r * alpha, g * alpha, b * alpha, alpha)
    };
    values.chunks_exact(count).map(pixel).collect()
}

fn split<T: Copy>(v: &[T], channels: Channels, opaque: T) -> ([T; 3], T) {
    let (colour, rest) = if channels.colour { ([v[0], v[1], v[2]], &v[3..]) } else { ([v[0]; 3], &v[1..]) };
    (colour, rest.first().copied().unwrap_or(opaque))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(pixels: &[[f32; 4]]) -> Image {
        Image { width: pixels.len() as u32, height: 1, pixels: pixels.iter().map(|&p| p.into()).collect() }
    }

    const RGBA: Channels = Channels { colour: true, alpha: Some(Alpha::Straight) };

    #[test]
    fn eight_bits_are_straight_encoded_and_clamped() {
        let odd = f32::NAN;
        let samples = encode(
            &image(&[
                [0.215_860_5 * 0.5, 0.0, 0.5, 0.5], // straight 0.2158605 is code 128, 1 is code 255
                [odd, -1.0, 7.0, 1.0],
                [0.3, 0.3, 0.3, 0.0],
                [1.0, 0.5, 0.25, odd],
                [0.502_886_5, 1.0, 2.0, 3.0], // alpha clamps before colours are divided by it
            ]),
            Type::U8,
            true,
            &Response::default(),
        );
        let expected = [[128, 0, 255, 128], [0, 0, 255, 255], [0, 0, 0, 0], [0, 0, 0, 0], [188, 255, 255, 255]];
        assert_eq!(samples.channels, RGBA);
        assert_eq!(samples.values, Values::U8(expected.concat()));
    }

    #[test]
    fn without_alpha_it_lies_over_black() {
        let samples = encode(&image(&[[0.215_860_5, 0.0, 1.0, 0.5]]), Type::U8, false, &Response::default());
        assert_eq!(samples.values, Values::U8(vec![128, 0, 255]));
    }

    #[test]
    fn floating_values_are_kept() {
        let original = image(&[[0.1, -2.0, 1e30, 0.5], [f32::INFINITY, 1e-30, 0.0, 1.0]]);
        let samples = encode(&original, Type::Float, true, &Response { exposure: 3.0, ..Response::default() });
        assert_eq!(decode(samples), original);
        // 0.1 is 0x2e66 in binary16, 1e30 overflows, 1e-30 vanishes.
        let Values::Half(bits) = encode(&original, Type::Half, true, &Response::default()).values else { panic!() };
        assert_eq!(bits, [0x2e66, 0xc000, 0x7c00, 0x3800, 0x7c00, 0, 0, 0x3c00]);
    }

    #[test]
    fn channels_expand() {
        let decode = |colour, alpha, values| {
            decode(Samples { width: 1, height: 1, channels: Channels { colour, alpha }, values }).pixels[0].to_array()
        };
        let c = 0.215_860_5;
        let half = 128.0 / 255.0;
        assert_eq!(decode(false, None, Values::U8(vec![128])), [c, c, c, 1.0]);
        assert_eq!(
            decode(false, Some(Alpha::Straight), Values::U8(vec![128, 128])),
            [c * half, c * half, c * half, half]
        );
        assert_eq!(decode(true, None, Values::U16(vec![0, 32896, 65535])), [0.0, c, 1.0, 1.0]);
        assert_eq!(decode(false, Some(Alpha::Straight), Values::Float(vec![4.0, 0.5])), [2.0, 2.0, 2.0, 0.5]);
        assert_eq!(decode(true, Some(Alpha::Premultiplied), Values::U8(vec![64, 255, 0, 128]))[1], half);
    }
}
