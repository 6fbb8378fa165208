//! The Academy Color Encoding System's rendering of a scene for sRGB displays, as S. Hill's fit of 2016 has it (in M.
//! Pettineo's *BakingLab*): linear Rec. 709 to the working primaries AP1, less saturated as the reference rendering
//! transform makes them; one rational curve in place of the rendering's and the display's; back again.
//!
//! The transforms themselves, the alternative, are splines of many pieces in logarithms, and hardly look different.

use crate::math::Vec3;

/// Rows: Rec. 709, adapted from D65 to the Academy's white, to AP1, at 96 % of its saturation.
const INPUT: [[f32; 3]; 3] =
    [[0.597_19, 0.354_58, 0.048_23], [0.076_00, 0.908_34, 0.015_66], [0.028_40, 0.133_83, 0.837_77]];
/// Rows: AP1 at 93 % of its saturation, adapted to D65, to Rec. 709.
const OUTPUT: [[f32; 3]; 3] =
    [[1.604_75, -0.531_08, -0.073_67], [-0.102_08, 1.108_13, -0.006_05], [-0.003_27, -0.072_76, 1.076_02]];

/// From light of 0 up to what is shown, linear; may be beyond 0 to 1 a little.
pub(super) fn curve(light: Vec3) -> Vec3 {
    times(&OUTPUT, times(&INPUT, light).to_array().map(fit).into())
}

/// The rendering transform and the display's, of one channel.
fn fit(v: f32) -> f32 {
    // From here on the curve is flat, and squares would cost what precision is left.
    let v = v.min(1e6);
    (v * (v + 0.024_578_6) - 0.000_090_537) / (v * (0.983_729 * v + 0.432_951) + 0.238_081)
}

fn times(rows: &[[f32; 3]; 3], v: Vec3) -> Vec3 {
    rows.map(|row| row[0] * v.x + row[1] * v.y + row[2] * v.z).into()
}

#[cfg(test)]
mod tests {
    use super::super::white::{SRGB_PRIMARIES, SRGB_WHITE, adaptation, rgb_to_xyz, xyz};
    use super::*;
    use crate::math::{DMat3, DVec3};

    /// The matrices from the standards: primaries and white of AP1 (SMPTE ST 2065-1, Academy S-2014-004), Bradford's
    /// adaptation, and the factors of saturation of the transforms (RRT_SAT_FACTOR, ODT_SAT_FACTOR).
    #[test]
    fn matrices_follow_from_the_primaries() {
        let white = [0.32168, 0.33767];
        let ap1 = rgb_to_xyz(&[[0.713, 0.293], [0.165, 0.830], [0.128, 0.044]], white);
        let luminance = ap1.transpose().y_axis;
        let saturation = |s: f64| DMat3::from_diagonal(DVec3::splat(s)) + outer(DVec3::splat(1.0 - s), luminance);
        let rec709 = rgb_to_xyz(&SRGB_PRIMARIES, SRGB_WHITE);
        let (d65, aces) = (xyz(SRGB_WHITE), xyz(white));
        let input = saturation(0.96) * ap1.inverse() * adaptation(d65, aces) * rec709;
        let output = rec709.inverse() * adaptation(aces, d65) * ap1 * saturation(0.93);
        for (expected, rows) in [(input, INPUT), (output, OUTPUT)] {
            for (i, row) in rows.iter().enumerate() {
                let off = expected.row(i).as_vec3() - Vec3::from_array(*row);
                assert!(off.abs().max_element() < 1e-5, "{expected} against {rows:?}");
            }
        }
    }

    /// a b^T.
    fn outer(a: DVec3, b: DVec3) -> DMat3 {
        DMat3::from_cols(a * b.x, a * b.y, a * b.z)
    }

    #[test]
    fn known_values() {
        // The transforms put 18 % grey at 4.8 of 48 cd/m^2 (ACES 1.0, midPoint of ODT_48nits); the fit is within 6 %.
        assert!((curve(Vec3::splat(0.18)) - 0.1).abs().max_element() < 0.006, "{}", curve(Vec3::splat(0.18)));
        // By hand: (0.2045786 v - ...) with v = 0.18 is 0.036734 / 0.347885.
        assert!((fit(0.18) - 0.105_592).abs() < 2e-5, "{}", fit(0.18));
        // Bright light of one colour turns white, as on film.
        let red = curve(Vec3::new(100.0, 0.0, 0.0));
        assert!(red.x > 0.99 && red.y > 0.7, "{red}");
    }
}
