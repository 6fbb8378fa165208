//! Homogeneous fog (as in Whitted-style renderers since Kajiya and Von Herzen 1984, *Ray tracing volume densities*, for
//! a constant source): of radiance L, T L + (1 - T) C arrives after d metres, T = exp(-a d) by Beer's law, C being the
//! fog's colour.
//!
//! It is closed under composition: two stretches of fog in a row are as one of both lengths, so that what a path adds
//! up does not depend on where it is cut. Scattering by chance, with a phase function, would light the fog by the
//! lights, cast shadows into it, and cost a choice on every stretch.

use crate::math::Vec3;
use crate::scene::Fog;

/// What a stretch of fog does to light that passes through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FogSegment {
    /// The share that is left.
    pub left: Vec3,
    /// Radiance that is added.
    pub added: Vec3,
}

/// Of `length` metres, which may be infinite.
pub fn segment(fog: &Fog, length: f32) -> FogSegment {
    let left = transmittance(fog, length);
    FogSegment { left, added: fog.color * (1.0 - left) }
}

/// The share of light that is left after `length` metres.
pub fn transmittance(fog: &Fog, length: f32) -> Vec3 {
    // Where nothing is absorbed all is left, also of what is infinitely far.
    fog.absorption.to_array().map(|a| if a > 0.0 { libm::expf(-a * length) } else { 1.0 }).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOG: Fog =
        Fog { absorption: Vec3::new(0.5, 0.0, 3.0), color: Vec3::new(1.0, 2.0, 0.25), reach: f32::INFINITY };

    #[test]
    fn light_fades_by_beers_law_into_the_fogs_colour() {
        let FogSegment { left, added } = segment(&FOG, 2.0);
        let expected = [(-1f64).exp(), 1.0, (-6f64).exp()].map(|x| x as f32);
        assert!((left - Vec3::from_array(expected)).abs().max_element() < 1e-7, "{left}");
        assert!((added - Vec3::new(1.0 - expected[0], 0.0, 0.25 * (1.0 - expected[2]))).abs().max_element() < 1e-7);
        let endless = segment(&FOG, f32::INFINITY);
        assert_eq!((endless.left, endless.added), (Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, 0.0, 0.25)));
        assert_eq!(segment(&FOG, 0.0), FogSegment { left: Vec3::ONE, added: Vec3::ZERO });
    }

    #[test]
    fn stretches_in_a_row_are_one() {
        let behind = Vec3::new(3.0, 0.5, 0.0);
        let through = |length, light: Vec3| {
            let FogSegment { left, added } = segment(&FOG, length);
            left * light + added
        };
        let (once, twice) = (through(1.75, behind), through(0.5, through(1.25, behind)));
        assert!((once - twice).abs().max_element() < 1e-6, "{once} {twice}");
    }
}
