//! What a camera makes of radiance where it becomes codes: flags, and what the scene asks for.

use clap::Args;

use super::common::by_name;
use crate::image::{Curve, MOST_STOPS, Response, TEMPERATURES};
use crate::scene::Request;

/// For pictures of 8 bits; OpenEXR and Radiance files keep radiance.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Camera response (PNG, JPEG ...; EXR and HDR keep radiance)")]
pub(super) struct ResponseArgs {
    /// Stops brighter, or darker if below 0 (default: the scene's, else 0)
    #[arg(long, value_name = "STOPS", value_parser = parse_stops, allow_hyphen_values = true)]
    exposure: Option<f32>,

    /// From light to what is shown: linear, srgb, filmic or aces (default: the scene's, else srgb)
    #[arg(long, value_name = "NAME", value_parser = parse_curve)]
    response: Option<Curve>,

    /// Colour temperature of the light that is to look white (default: the scene's, else colours as they are)
    #[arg(long, value_name = "KELVIN", value_parser = parse_kelvin)]
    white_balance: Option<f32>,
}

impl ResponseArgs {
    /// What the flags say, else the scene's file, else sRGB.
    pub(super) fn choose(&self, request: &Request) -> Response {
        let Response { exposure, white_balance, curve } = request.camera_response();
        Response {
            exposure: self.exposure.unwrap_or(exposure),
            white_balance: self.white_balance.or(white_balance),
            curve: self.response.unwrap_or(curve),
        }
    }
}

fn parse_stops(text: &str) -> Result<f32, String> {
    let stops = text.parse().ok().filter(|stops: &f32| stops.abs() <= MOST_STOPS);
    stops.ok_or_else(|| format!("expected stops from -{MOST_STOPS} to {MOST_STOPS}"))
}

fn parse_curve(name: &str) -> Result<Curve, String> {
    by_name(Curve::ALL, Curve::name, name)
}

fn parse_kelvin(text: &str) -> Result<f32, String> {
    let (first, last) = (TEMPERATURES.start(), TEMPERATURES.end());
    let kelvin = text.parse().ok().filter(|kelvin| TEMPERATURES.contains(kelvin));
    kelvin.ok_or_else(|| format!("expected kelvin from {first} to {last}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_win_over_the_scene() {
        let request = Request { exposure: Some(2.0), response: Some(Curve::Aces), ..Request::default() };
        let args = ResponseArgs { exposure: Some(-1.5), response: None, white_balance: Some(3200.0) };
        let expected = Response { exposure: -1.5, white_balance: Some(3200.0), curve: Curve::Aces };
        assert_eq!(args.choose(&request), expected);
        let nothing = ResponseArgs { exposure: None, response: None, white_balance: None };
        assert_eq!(nothing.choose(&Request::default()), Response::default());
        for bad in ["65", "x", "nan", "inf"] {
            assert!(parse_stops(bad).is_err(), "{bad}");
        }
        for bad in ["999", "25001", "warm", "nan"] {
            assert!(parse_kelvin(bad).is_err(), "{bad}");
        }
        assert!(parse_curve("film").unwrap_err().contains("filmic, aces"));
    }
}
