//! Colours as files have them.

use crate::math::Vec3;

/// sRGB to linear, per channel over [0, 1] (IEC 61966-2-1:1999).
pub(super) fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { libm::powf((encoded + 0.055) / 1.055, 2.4) }
}

/// The same for all three channels.
pub(super) fn linear(encoded: Vec3) -> Vec3 {
    Vec3::from_array(encoded.to_array().map(srgb_to_linear))
}

/// Linear values of the 256 8-bit sRGB codes.
pub(super) fn srgb_table() -> [f32; 256] {
    std::array::from_fn(|code| srgb_to_linear(code as f32 / 255.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_has_its_known_values() {
        let table = srgb_table();
        assert_eq!((table[0], table[255]), (0.0, 1.0));
        // Middle grey: 18.4 % is code 119 (118.7).
        assert!((table[119] - 0.1845).abs() < 1e-3, "{}", table[119]);
        assert!((srgb_to_linear(0.5) - 0.214_041).abs() < 1e-6);
        assert_eq!(linear(Vec3::new(0.0, 1.0, 0.5)).y, 1.0);
    }
}
