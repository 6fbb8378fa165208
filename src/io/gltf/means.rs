//! Averages of pictures: what stands for a texture where one value must do for all of a surface.

use crate::image::srgb::srgb_to_linear;
use crate::math::{Vec3, Vec4};
use crate::scene::Texture;

/// The mean colour of a picture, linear.
pub(super) fn mean_color(picture: &Texture) -> Vec3 {
    mean(picture, srgb_to_linear).truncate()
}

/// The mean of a picture of numbers, which are not encoded.
pub(super) fn mean_number(picture: &Texture) -> Vec4 {
    mean(picture, |code| f32::from(code) / 255.0)
}

/// Alpha is a number always.
fn mean(picture: &Texture, linear: fn(u8) -> f32) -> Vec4 {
    // Counted by code first: the sums are then exact, and a decoding costs 256 calls.
    let mut counts = [[0u64; 256]; 4];
    for pixel in picture.pixels.iter() {
        for (counts, code) in counts.iter_mut().zip(pixel) {
            counts[usize::from(*code)] += 1;
        }
    }
    let pixels = picture.pixels.len().max(1) as f64;
    let mean = |counts: &[u64; 256], linear: &dyn Fn(u8) -> f32| {
        let sum: f64 = counts.iter().zip(0..=255).map(|(&count, code)| count as f64 * f64::from(linear(code))).sum();
        (sum / pixels) as f32
    };
    let [r, g, b, a] = &counts;
    Vec4::new(mean(r, &linear), mean(g, &linear), mean(b, &linear), mean(a, &|code| f32::from(code) / 255.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_of_light() {
        let pixels = vec![[0, 0, 51, 0], [255, 188, 0, 255]];
        let picture = Texture { width: 2, height: 1, pixels: pixels.into(), ..Texture::default() };
        let color = mean_color(&picture);
        // sRGB 188 is 0.5029 of the light, 51 is 0.0331.
        assert!((color - Vec3::new(0.5, 0.25145, 0.01655)).abs().max_element() < 1e-4, "{color}");
        let numbers = mean_number(&picture);
        assert!((numbers - Vec4::new(0.5, 188.0 / 510.0, 0.1, 0.5)).abs().max_element() < 1e-6, "{numbers}");
        assert_eq!(mean_color(&Texture::default()), Vec3::ZERO);
    }
}
