//! Looking a colour up in an image.
//!
//! Texels are decoded to linear light before they are mixed: mixing sRGB codes would darken every edge between light
//! and dark.

use crate::image::srgb::{srgb_to_linear, srgb16_to_linear, unit_from_8bit, unit_from_16bit};
use crate::math::{Vec2, Vec4};
use crate::scene::{Filter, Pixels, Texture, Wrap};

/// The linear RGBA colour at `uv` (v up). White for an image without pixels and for coordinates that are not finite.
pub fn sample(texture: &Texture, uv: Vec2) -> Vec4 {
    interpolate(texture, uv, srgb_to_linear, srgb16_to_linear)
}

/// The same of an image whose colours are numbers, from 0 to 1, that are not encoded.
pub fn numbers(texture: &Texture, uv: Vec2) -> Vec4 {
    interpolate(texture, uv, unit_from_8bit, unit_from_16bit)
}

/// `of_8` and `of_16` are for colours; alpha is a number always.
fn interpolate(texture: &Texture, uv: Vec2, of_8: impl Fn(u8) -> f32, of_16: impl Fn(u16) -> f32) -> Vec4 {
    match &texture.pixels {
        Pixels::Eight(pixels) => {
            between(texture, pixels, uv, |[r, g, b, a]| Vec4::new(of_8(r), of_8(g), of_8(b), unit_from_8bit(a)))
        }
        Pixels::Sixteen(pixels) => {
            between(texture, pixels, uv, |[r, g, b, a]| Vec4::new(of_16(r), of_16(g), of_16(b), unit_from_16bit(a)))
        }
    }
}

/// What is at `uv`, between texels.
fn between<P: Copy>(texture: &Texture, pixels: &[P], uv: Vec2, decode: impl Fn(P) -> Vec4) -> Vec4 {
    let texel = |x, y| decode(pixels[place(texture, x, y)]);
    let st = texture.transform.transform_point2(uv);
    if pixels.is_empty() || !st.is_finite() {
        return Vec4::ONE;
    }
    // What is farther away than that would not be finite as texels are counted.
    let st = st.clamp(Vec2::splat(-1e30), Vec2::splat(1e30));
    // Texel centres lie at half-integers; the first row is at the top, v = 1.
    let x = st.x * texture.width as f32;
    let y = (1.0 - st.y) * texture.height as f32;
    match texture.filter {
        Filter::Nearest => texel(index(x), index(y)),
        Filter::Linear => {
            let (x, y) = (x - 0.5, y - 0.5);
            let (left, top) = (index(x), index(y));
            let (fx, fy) = (x - x.floor(), y - y.floor());
            let row = |y| texel(left, y) * (1.0 - fx) + texel(left + 1, y) * fx;
            row(top) * (1.0 - fy) + row(top + 1) * fy
        }
    }
}

/// The texel that holds a coordinate. Far outside any image every f32 is an integer, and which one no longer matters.
fn index(x: f32) -> i64 {
    x.floor().clamp(-1e15, 1e15) as i64
}

/// Where a texel is among all.
fn place(texture: &Texture, x: i64, y: i64) -> usize {
    let x = wrap(texture.wrap_u, x, i64::from(texture.width));
    let y = wrap(texture.wrap_v, y, i64::from(texture.height));
    (y * i64::from(texture.width) + x) as usize
}

/// Brings an index into `0..size`.
fn wrap(wrap: Wrap, i: i64, size: i64) -> i64 {
    match wrap {
        Wrap::Repeat => i.rem_euclid(size),
        Wrap::Mirror => {
            let i = i.rem_euclid(2 * size);
            if i < size { i } else { 2 * size - 1 - i }
        }
        Wrap::Clamp => i.clamp(0, size - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2 x 2: black, white / red, half-transparent sRGB 188.
    fn checker(wrap: Wrap, filter: Filter) -> Texture {
        Texture {
            width: 2,
            height: 2,
            pixels: vec![[0u8, 0, 0, 255], [255; 4], [255, 0, 0, 255], [188, 188, 188, 51]].into(),
            wrap_u: wrap,
            wrap_v: wrap,
            filter,
            ..Texture::default()
        }
    }

    #[test]
    fn texel_centres_give_their_own_colour_with_both_filters() {
        for filter in [Filter::Nearest, Filter::Linear] {
            let texture = checker(Wrap::Repeat, filter);
            assert_eq!(sample(&texture, Vec2::new(0.25, 0.75)), Vec4::new(0.0, 0.0, 0.0, 1.0));
            assert_eq!(sample(&texture, Vec2::new(0.75, 0.75)), Vec4::ONE);
            assert_eq!(sample(&texture, Vec2::new(0.25, 0.25)), Vec4::new(1.0, 0.0, 0.0, 1.0));
            let grey = sample(&texture, Vec2::new(0.75, 0.25));
            // sRGB 188 is close to half the light, as everybody's table says.
            assert!((grey.x - 0.502_886_5).abs() < 1e-6, "{grey}");
            assert_eq!(grey.w, 0.2);
        }
    }

    #[test]
    fn coordinates_of_any_size_give_a_colour() {
        for filter in [Filter::Nearest, Filter::Linear] {
            for wrap in [Wrap::Clamp, Wrap::Repeat, Wrap::Mirror] {
                for far in [1e20, 2e38, f32::MAX] {
                    for uv in [Vec2::new(far, 0.3), Vec2::new(-far, far), Vec2::splat(-far)] {
                        let color = sample(&checker(wrap, filter), uv);
                        let is_mixed = color.cmpge(Vec4::ZERO).all() && color.cmple(Vec4::ONE).all();
                        assert!(is_mixed, "{filter:?} {wrap:?} {uv}: {color}");
                    }
                }
            }
        }
    }

    #[test]
    fn filtering_mixes_light_not_codes() {
        let texture = checker(Wrap::Clamp, Filter::Linear);
        assert_eq!(sample(&texture, Vec2::new(0.5, 0.75)), Vec4::new(0.5, 0.5, 0.5, 1.0));
    }

    #[test]
    fn sixteen_bits_are_as_fine_as_they_are() {
        for filter in [Filter::Nearest, Filter::Linear] {
            let eight = checker(Wrap::Mirror, filter);
            let Pixels::Eight(codes) = &eight.pixels else { unreachable!() };
            let codes: Vec<_> = codes.iter().map(|pixel| pixel.map(|code| u16::from(code) * 257)).collect();
            let sixteen = Texture { pixels: codes.into(), ..eight.clone() };
            for uv in [Vec2::new(0.25, 0.25), Vec2::new(0.4, 0.7), Vec2::new(-3.1, 8.6)] {
                assert_eq!(sample(&sixteen, uv), sample(&eight, uv), "{uv}: 0 is 0 and 65535 is 255");
                assert_eq!(numbers(&sixteen, uv), numbers(&eight, uv), "{uv}");
            }
        }
        let fine =
            Texture { width: 1, height: 1, pixels: vec![[1u16, 32_768, 65_534, 100]].into(), ..Texture::default() };
        let expected = Vec4::new(1.0 / 65535.0, 32_768.0 / 65535.0, 65_534.0 / 65535.0, 100.0 / 65535.0);
        assert_eq!(numbers(&fine, Vec2::ZERO), expected);
        let light = sample(&fine, Vec2::ZERO);
        assert_eq!((light.x, light.w), ((1.0 / 65535.0 / 12.92) as f32, expected.w), "the straight part of the curve");
        // By the slope at the end of the curve, 2.4 / 1.055.
        assert!((light.z - (1.0 - 2.4 / 1.055 / 65535.0) as f32).abs() < 1e-7, "{light}");
    }

    #[test]
    fn wraps() {
        let at = |wrap, u| sample(&checker(wrap, Filter::Nearest), Vec2::new(u, 0.75)).x;
        for (wrap, expected) in [
            (Wrap::Repeat, [0.0, 1.0, 0.0, 1.0]),
            (Wrap::Mirror, [1.0, 0.0, 1.0, 0.0]),
            (Wrap::Clamp, [0.0, 0.0, 1.0, 1.0]),
        ] {
            assert_eq!([-0.75, -0.25, 1.25, 1.75].map(|u| at(wrap, u)), expected, "{wrap:?}");
        }
    }

    #[test]
    fn extreme_coordinates_do_not_panic() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for filter in [Filter::Nearest, Filter::Linear] {
                for x in [f32::MAX, f32::MIN, f32::NAN, f32::INFINITY, 1e30, -0.0] {
                    sample(&checker(wrap, filter), Vec2::new(x, -x));
                }
            }
        }
        assert_eq!(sample(&Texture::default(), Vec2::ZERO), Vec4::ONE);
    }
}
