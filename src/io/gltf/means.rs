//! Averages of pictures: what stands for a texture where one value must do for all of a surface.

use crate::image::srgb::{srgb_to_linear, srgb16_to_linear, unit_from_8bit, unit_from_16bit};
use crate::math::{Vec3, Vec4};
use crate::scene::{Pixels, Texture};

/// The mean colour of a picture, linear.
pub(super) fn mean_color(picture: &Texture) -> Vec3 {
    mean(picture, srgb_to_linear, srgb16_to_linear).truncate()
}

/// The mean of a picture of numbers, which are not encoded.
pub(super) fn mean_number(picture: &Texture) -> Vec4 {
    mean(picture, unit_from_8bit, unit_from_16bit)
}

/// Alpha is a number always.
fn mean(picture: &Texture, of_8: fn(u8) -> f32, of_16: fn(u16) -> f32) -> Vec4 {
    match &picture.pixels {
        Pixels::Eight(pixels) => counted(pixels, 0..=u8::MAX, of_8, unit_from_8bit),
        Pixels::Sixteen(pixels) => counted(pixels, 0..=u16::MAX, of_16, unit_from_16bit),
    }
}

/// Counted by code first: the sums are then exact, and each code is decoded once.
fn counted<C: Copy + Into<usize>>(
    pixels: &[[C; 4]],
    codes: impl Iterator<Item = C>,
    color: fn(C) -> f32,
    number: fn(C) -> f32,
) -> Vec4 {
    let codes: Vec<_> = codes.collect();
    let mut counts = vec![[0u64; 4]; codes.len()];
    for pixel in pixels {
        for (channel, &code) in pixel.iter().enumerate() {
            counts[code.into()][channel] += 1;
        }
    }
    let mean = |channel: usize, linear: fn(C) -> f32| {
        let sum: f64 =
            counts.iter().zip(&codes).map(|(count, &code)| count[channel] as f64 * f64::from(linear(code))).sum();
        (sum / pixels.len().max(1) as f64) as f32
    };
    Vec4::new(mean(0, color), mean(1, color), mean(2, color), mean(3, number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_of_light() {
        let pixels = vec![[0u8, 0, 51, 0], [255, 188, 0, 255]];
        let fine: Vec<_> = pixels.iter().map(|pixel| pixel.map(|code| u16::from(code) * 257)).collect();
        let picture = Texture { width: 2, height: 1, pixels: pixels.into(), ..Texture::default() };
        let color = mean_color(&picture);
        // sRGB 188 is 0.5029 of the light, 51 is 0.0331.
        assert!((color - Vec3::new(0.5, 0.25145, 0.01655)).abs().max_element() < 1e-4, "{color}");
        let numbers = mean_number(&picture);
        assert!((numbers - Vec4::new(0.5, 188.0 / 510.0, 0.1, 0.5)).abs().max_element() < 1e-6, "{numbers}");
        let fine = Texture { pixels: fine.into(), ..picture };
        assert_eq!((mean_color(&fine), mean_number(&fine)), (color, numbers), "of 16 bits");
        assert_eq!(mean_color(&Texture::default()), Vec3::ZERO);
    }
}
