//! The sRGB transfer function (IEC 61966-2-1:1999): between linear light and the codes that files hold, of 8 or 16
//! bits.
//!
//! The piecewise function itself, not the power 2.2 that is often put in its place: that is off by as much as 8 of 255
//! in the shadows. Powers come from the libm crate, so that files are the same on every machine.

use std::sync::LazyLock;

/// Linear light for each of the 256 codes: [0, 1], rounded from f64.
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|code| decode(code as f64 / 255.0) as f32));

/// The same for each of the 65,536 codes of 16 bits.
static LINEAR16: LazyLock<Box<[f32]>> =
    LazyLock::new(|| (0..=u16::MAX).map(|code| decode(f64::from(code) / 65535.0) as f32).collect());

/// The linear light of an encoded value, both 0 to 1.
pub fn decode(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

/// The linear light, 0 to 1, that an 8-bit code stands for.
#[inline]
pub fn srgb_to_linear(code: u8) -> f32 {
    LINEAR[usize::from(code)]
}

/// The linear light, 0 to 1, that a 16-bit code stands for.
#[inline]
pub fn srgb16_to_linear(code: u16) -> f32 {
    LINEAR16[usize::from(code)]
}

/// The number, 0 to 1, that an 8-bit code stands for where nothing is encoded.
#[inline]
pub fn unit_from_8bit(code: u8) -> f32 {
    f32::from(code) / 255.0
}

/// The number, 0 to 1, that a 16-bit code stands for where nothing is encoded.
#[inline]
pub fn unit_from_16bit(code: u16) -> f32 {
    f32::from(code) / 65535.0
}

/// The encoded value, 0 to 1, of a linear one. Below 0 counts as 0, above 1 as 1, and NaN as 0.
pub fn linear_to_srgb(linear: f32) -> f32 {
    let linear = clamp_to_unit(linear);
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * libm::powf(linear, 1.0 / 2.4) - 0.055 }
}

/// The 8-bit code nearest to the encoded value of a linear one; clamped as in [`linear_to_srgb`].
pub fn linear_to_srgb8(linear: f32) -> u8 {
    unit_to_8bit(linear_to_srgb(linear))
}

/// The nearest of 256 codes for 0 to 1, without a transfer function (alpha). Clamps; NaN is 0.
pub fn unit_to_8bit(value: f32) -> u8 {
    (clamp_to_unit(value) * 255.0).round() as u8
}

/// As `clamp(0, 1)`, but NaN becomes 0.
fn clamp_to_unit(value: f32) -> f32 {
    if value > 0.0 { value.min(1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // Computed with 50 decimal digits from the standard's formula.
        for (code, linear) in [
            (0, 0.0),
            (1, 0.000_303_526_983_548_837_5),
            (10, 0.003_035_269_835_488_375),
            (11, 0.003_346_535_763_899_161),
            (55, 0.038_204_371_595_346_51),
            (128, 0.215_860_500_113_899_26),
            (188, 0.502_886_458_032_568_7),
            (254, 0.991_102_097_113_829_8),
            (255, 1.0),
        ] {
            assert_eq!(srgb_to_linear(code), linear as f32, "{code}");
            assert_eq!(srgb16_to_linear(u16::from(code) * 257), linear as f32, "{code}");
        }
    }

    #[test]
    fn codes_survive_the_round_trip() {
        for code in 0..=255 {
            assert_eq!(linear_to_srgb8(srgb_to_linear(code)), code);
        }
    }

    #[test]
    fn rounds_to_nearest() {
        // Half a code between 127 and 128, in f64, a hair to either side.
        for code in 0..255 {
            let middle = decode((f64::from(code) + 0.5) / 255.0) as f32;
            assert_eq!(linear_to_srgb8(middle * (1.0 - 1e-5)), code);
            assert_eq!(linear_to_srgb8(middle * (1.0 + 1e-5)), code + 1);
        }
    }

    #[test]
    fn odd_values_clamp() {
        for (value, code) in [
            (f32::NAN, 0),
            (-f32::NAN, 0),
            (f32::NEG_INFINITY, 0),
            (-1.0, 0),
            (-0.0, 0),
            (f32::MIN_POSITIVE / 2.0, 0),
            (1.000_001, 255),
            (1e30, 255),
            (f32::INFINITY, 255),
        ] {
            assert_eq!(linear_to_srgb8(value), code, "{value}");
            assert_eq!(unit_to_8bit(value), code, "{value}");
        }
    }

    #[test]
    fn never_decreases() {
        let codes: Vec<_> = (0..=100_000).map(|i| linear_to_srgb(i as f32 * 1e-5)).collect();
        assert!(codes.windows(2).all(|w| w[0] <= w[1]));
    }
}
