//! What a camera makes of radiance, where it becomes codes: exposure, white balance and a response curve, in this
//! order.
//!
//! Files of floating values (OpenEXR, Radiance) keep radiance: what was developed cannot be undone, and whoever reads
//! them has a camera of their own. So none of this is done to an [`Image`](crate::Image), but on the way to 8 bits.
//! Developing the image first, the simpler way, would need a second one in memory, and a rule of who must not develop
//! it again.

mod aces;
mod filmic;
mod white;

use std::fmt;

use super::srgb::linear_to_srgb;
use crate::math::{Mat3, Vec3};

pub use white::TEMPERATURES;

/// Stops that exposure takes, up and down.
pub const MAX_STOPS: f32 = 64.0;

/// What a camera makes of radiance. By default nothing but the sRGB transfer function.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Response {
    /// Stops, at most [`MAX_STOPS`] up or down: radiance counts 2^exposure times.
    pub exposure: f32,
    /// Kelvin, within [`TEMPERATURES`] (what is beyond counts as its end): light of this temperature becomes white.
    /// None leaves colours as they are.
    pub white_balance: Option<f32>,
    /// From there to what is shown.
    pub curve: Curve,
}

/// From light, of which 1 is white, to what a file holds, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Curve {
    /// The light itself, cut off at 1, for programs that expect no transfer function.
    Linear,
    /// Cut off at 1, by the transfer function of sRGB (IEC 61966-2-1:1999).
    #[default]
    Srgb,
    /// With a toe and a shoulder like film's (Hable 2010, *Uncharted 2: HDR lighting*), then as sRGB.
    Filmic,
    /// As the Academy's reference rendering and its output for sRGB show a scene (Hill 2016, a fit of the *Academy
    /// Color Encoding System* 1.0), then as sRGB.
    Aces,
}

impl Curve {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Linear, Self::Srgb, Self::Filmic, Self::Aces];

    /// As flags and scenes have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Srgb => "srgb",
            Self::Filmic => "filmic",
            Self::Aces => "aces",
        }
    }
}

impl fmt::Display for Curve {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// More light than any curve tells from infinitely much, and little enough for its arithmetic.
const BLINDING: f32 = 1e9;

/// A response made ready for many pixels.
#[derive(Clone, Copy, Debug)]
pub struct Developer {
    /// None where radiance is taken as it is.
    exposed: Option<Exposed>,
    curve: Curve,
}

#[derive(Clone, Copy, Debug)]
struct Exposed {
    gain: f32,
    /// Between linear colours of Rec. 709.
    balance: Mat3,
}

impl Response {
    /// For pixels.
    pub fn developer(&self) -> Developer {
        let exposed = (self.exposure != 0.0 || self.white_balance.is_some()).then(|| Exposed {
            gain: libm::exp2f(self.exposure),
            balance: self.white_balance.map_or(Mat3::IDENTITY, |kelvin| white::balance(f64::from(kelvin)).as_mat3()),
        });
        Developer { exposed, curve: self.curve }
    }
}

impl Developer {
    /// What is shown of linear RGB: each 0 to 1, to be multiplied by the largest code. NaN is black.
    pub fn develop(&self, linear: Vec3) -> Vec3 {
        let light = match &self.exposed {
            None => linear,
            Some(Exposed { gain, balance }) => *balance * bounded(linear * *gain, -BLINDING),
        };
        let shown = match self.curve {
            Curve::Linear => return light.to_array().map(|x| if x > 0.0 { x.min(1.0) } else { 0.0 }).into(),
            Curve::Srgb => light,
            Curve::Filmic => bounded(light, 0.0).to_array().map(filmic::curve).into(),
            Curve::Aces => aces::curve(bounded(light, 0.0)),
        };
        shown.to_array().map(linear_to_srgb).into()
    }
}

/// What arithmetic can be done with; NaN is 0.
fn bounded(light: Vec3, least: f32) -> Vec3 {
    light.to_array().map(|x| if x.is_nan() { 0.0 } else { x.clamp(least, BLINDING) }).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::srgb::{linear_to_srgb8, unit_to_8bit};

    fn shown(response: Response, linear: f32) -> f32 {
        response.developer().develop(Vec3::splat(linear)).x
    }

    #[test]
    fn by_default_it_is_srgb_to_the_bit() {
        let developer = Response::default().developer();
        for i in 0..4000 {
            let linear = (i as f32 / 2000.0 - 0.3) * 1.001;
            let code = unit_to_8bit(developer.develop(Vec3::splat(linear)).y);
            assert_eq!(code, linear_to_srgb8(linear), "{linear}");
        }
    }

    #[test]
    fn a_stop_doubles_the_light() {
        for curve in Curve::ALL {
            for (exposure, factor) in [(1.0, 2.0), (-3.0, 0.125), (0.5, std::f32::consts::SQRT_2)] {
                let exposed = shown(Response { exposure, curve, ..Response::default() }, 0.2);
                let brighter = shown(Response { curve, ..Response::default() }, 0.2 * factor);
                assert!((exposed - brighter).abs() < 1e-6, "{curve} {exposure}: {exposed} {brighter}");
            }
        }
        let linear = Response { curve: Curve::Linear, exposure: 1.0, ..Response::default() };
        assert_eq!([0.25, 0.5, 0.75, -1.0].map(|x| shown(linear, x)), [0.5, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn every_curve_rises_from_black_to_white_and_bears_odd_numbers() {
        for curve in Curve::ALL {
            for white_balance in [None, Some(3000.0)] {
                let developer = Response { curve, white_balance, exposure: 0.5 }.developer();
                let values: Vec<f32> = (0..=4000).map(|i| developer.develop(Vec3::splat(i as f32 * 0.01)).y).collect();
                assert!(values[0] < 1e-3 && values.is_sorted(), "{curve}");
                assert!(values[4000] > 0.9 && values[4000] <= 1.0, "{curve}: {}", values[4000]);
                for odd in [f32::INFINITY, f32::MAX, 1e30] {
                    let white = developer.develop(Vec3::splat(odd));
                    assert!(white.max_element() <= 1.0 && white.min_element() > 0.9, "{curve} {odd}: {white}");
                }
                for odd in [f32::NAN, f32::NEG_INFINITY, -5.0] {
                    let black = developer.develop(Vec3::splat(odd));
                    assert!(black.abs().max_element() < 1e-3, "{curve} {odd}: {black}");
                }
            }
        }
    }
}
