//! A curve with a toe and a shoulder like film's (Hable 2010, *Uncharted 2: HDR lighting*, Game Developers Conference;
//! constants as in his *Filmic tonemapping operators* of that year).

/// Strength of the shoulder.
const A: f32 = 0.15;
/// Strength and angle of the part that is nearly straight.
const B: f32 = 0.50;
const C: f32 = 0.10;
/// Strength, numerator and denominator of the toe.
const D: f32 = 0.20;
const E: f32 = 0.02;
const F: f32 = 0.30;
/// The light that becomes white.
const WHITE: f32 = 11.2;
/// What light is multiplied by first.
const BIAS: f32 = 2.0;

/// From light of 0 up to what is shown, linear; beyond 1 from 5.6 on.
pub(super) fn curve(light: f32) -> f32 {
    film(light * BIAS) / film(WHITE)
}

fn film(x: f32) -> f32 {
    (x * (A * x + C * B) + D * E) / (x * (A * x + B) + D * F) - E / F
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // 1 / f(11.2), the white scale that implementations have as a constant.
        assert!((1.0 / film(WHITE) - 1.379_064_2).abs() < 1e-5, "{}", 1.0 / film(WHITE));
        assert!(curve(0.0).abs() < 1e-7);
        assert!((curve(WHITE / BIAS) - 1.0).abs() < 1e-6);
        // By hand for 0.18: x = 0.36; (0.36 * 0.104 + 0.004) / (0.36 * 0.554 + 0.06) - 1/15.
        let by_hand = (0.041_44 / 0.259_44 - 1.0 / 15.0) * 1.379_064_2;
        assert!((curve(0.18) - by_hand).abs() < 1e-6, "{}", curve(0.18));
    }
}
