//! White balance: light of a temperature becomes white.
//!
//! The white of a temperature is daylight's from 4000 K on (CIE 15:2004, *Colorimetry*: phases of daylight), and below
//! that a black body's (Krystek 1985, *An algorithm to calculate correlated colour temperature*, Color Research and
//! Application 10); at 4000 K the two are 0.007 apart in y. Colours are adapted by Bradford's transform (Lam
//! 1985, *Metamerism and colour constancy*), in the linear form that colour management has (ISO 15076-1). Scaling R, G and B
//! by themselves, the simpler way, turns colours that are not grey.

use std::ops::RangeInclusive;

use crate::math::{DMat3, DVec3};

/// Kelvin that white balance knows.
pub const TEMPERATURES: RangeInclusive<f32> = 1000.0..=25_000.0;

/// Chromaticities of red, green and blue (Rec. ITU-R BT.709).
pub(super) const SRGB_PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];
/// D65 as sRGB has it.
pub(super) const SRGB_WHITE: [f64; 2] = [0.3127, 0.3290];

/// Daylight begins here.
const DAYLIGHT: f64 = 4000.0;

/// Rows of Bradford's cone responses.
const BRADFORD: [[f64; 3]; 3] = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

/// Between linear colours of Rec. 709: what light of this temperature lights becomes what white light would.
pub(super) fn balance(kelvin: f64) -> DMat3 {
    let kelvin = kelvin.clamp(f64::from(*TEMPERATURES.start()), f64::from(*TEMPERATURES.end()));
    let to_xyz = rgb_to_xyz(&SRGB_PRIMARIES, SRGB_WHITE);
    to_xyz.inverse() * adaptation(xyz(chromaticity(kelvin)), xyz(SRGB_WHITE)) * to_xyz
}

/// x and y of light of a temperature.
fn chromaticity(t: f64) -> [f64; 2] {
    if t >= DAYLIGHT {
        let x = if t <= 7000.0 {
            0.244_063 + 0.099_11e3 / t + 2.967_8e6 / (t * t) - 4.607_0e9 / (t * t * t)
        } else {
            0.237_040 + 0.247_48e3 / t + 1.901_8e6 / (t * t) - 2.006_4e9 / (t * t * t)
        };
        return [x, -3.0 * x * x + 2.870 * x - 0.275];
    }
    let u = (0.860_117_757 + t * (1.541_182_54e-4 + t * 1.286_412_12e-7))
        / (1.0 + t * (8.424_202_35e-4 + t * 7.081_451_63e-7));
    let v = (0.317_398_726 + t * (4.228_062_45e-5 + t * 4.204_816_91e-8))
        / (1.0 + t * (-2.897_418_16e-5 + t * 1.614_560_53e-7));
    let scale = 2.0 * u - 8.0 * v + 4.0;
    [3.0 * u / scale, 2.0 * v / scale]
}

/// X, Y and Z of a chromaticity at Y = 1.
pub(super) fn xyz([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

/// From linear colours of such primaries and white to XYZ.
pub(super) fn rgb_to_xyz(primaries: &[[f64; 2]; 3], white: [f64; 2]) -> DMat3 {
    let [r, g, b] = primaries.map(|[x, y]| DVec3::new(x, y, 1.0 - x - y));
    let primaries = DMat3::from_cols(r, g, b);
    primaries * DMat3::from_diagonal(primaries.inverse() * xyz(white))
}

/// Of XYZ: from one white to another.
pub(super) fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    let cones = DMat3::from_cols_array_2d(&BRADFORD).transpose();
    cones.inverse() * DMat3::from_diagonal((cones * to) / (cones * from)) * cones
}

#[cfg(test)]
mod tests {
    use super::*;

    const D65: DVec3 = DVec3::new(0.95047, 1.0, 1.08883);

    /// Chromatic adaptation matrices as published by B. Lindbloom, rows.
    #[test]
    fn adaptations_are_those_that_are_published() {
        let of_a = [
            [0.844_696_5, -0.117_922_5, 0.394_810_8],
            [-0.136_630_3, 1.104_122_6, 0.129_171_8],
            [0.079_848_9, -0.134_899_9, 3.192_400_9],
        ];
        let of_d50 = [
            [0.955_576_6, -0.023_039_3, 0.063_163_6],
            [-0.028_289_5, 1.009_941_6, 0.021_007_7],
            [0.012_298_2, -0.020_483_0, 1.329_909_8],
        ];
        for (white, rows) in [(DVec3::new(1.0985, 1.0, 0.35585), of_a), (DVec3::new(0.96422, 1.0, 0.82521), of_d50)] {
            let got = adaptation(white, D65);
            for (i, row) in rows.into_iter().enumerate() {
                assert!((got.row(i) - DVec3::from_array(row)).abs().max_element() < 1e-7, "{got}");
            }
        }
    }

    /// Illuminants of CIE 15:2004: D50, D55, D65, D75 at their temperatures, and A, a black body of 2856 K.
    #[test]
    fn whites_are_the_standard_illuminants() {
        for (kelvin, [x, y], within) in [
            (5003.0, [0.34567, 0.35850], 2e-4),
            (5503.0, [0.33242, 0.34743], 2e-4),
            (6504.0, [0.31271, 0.32902], 2e-4),
            (7504.0, [0.29902, 0.31485], 2e-4),
            (2856.0, [0.44757, 0.40745], 5e-4),
            // Planck's locus (Wyszecki and Stiles 1982, *Color Science*, table 1(5.4)).
            (2000.0, [0.5267, 0.4133], 5e-4),
            (1000.0, [0.6528, 0.3445], 5e-4),
        ] {
            let [got_x, got_y] = chromaticity(kelvin);
            assert!((got_x - x).abs() < within && (got_y - y).abs() < within, "{kelvin}: {got_x} {got_y}");
        }
    }

    #[test]
    fn the_light_of_a_temperature_becomes_white() {
        let to_rgb = rgb_to_xyz(&SRGB_PRIMARIES, SRGB_WHITE).inverse();
        for kelvin in [1000.0, 2856.0, 4000.0, 6500.0, 12_000.0, 25_000.0] {
            let light = to_rgb * xyz(chromaticity(kelvin));
            let white = balance(kelvin) * light;
            assert!((white - 1.0).abs().max_element() < 1e-12, "{kelvin}: {white}");
        }
        let as_it_is = balance(6504.0) - DMat3::IDENTITY;
        assert!(as_it_is.to_cols_array().iter().all(|x| x.abs() < 2e-3), "the white of sRGB: {as_it_is}");
        // A lamp's light is yellow, and white of the shade blue.
        let lamp = balance(2856.0) * DVec3::ONE;
        assert!(lamp.z > lamp.y && lamp.y > lamp.x, "{lamp}");
        assert_eq!(balance(10.0), balance(1000.0));
    }
}
