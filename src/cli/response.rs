//! What a camera makes of radiance where it becomes codes: flags, and what the scene asks for.

use clap::Args;
use clap::builder::TypedValueParser;

use super::named::one_of;
use crate::image::{Curve, Image, MAX_STOPS, Response, TEMPERATURES};
use crate::math::Vec4;
use crate::render::Crop;
use crate::scene::Request;

/// For pictures of 8 bits; OpenEXR and Radiance files keep radiance.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Camera response (PNG, JPEG ...; EXR and HDR keep radiance)")]
pub(super) struct ResponseArgs {
    /// Stops brighter, or darker if below 0 (default: the scene's, else 0)
    #[arg(long, value_name = "STOPS", value_parser = parse_stops, allow_hyphen_values = true)]
    exposure: Option<f32>,

    /// From light to what is shown (default: the scene's, else srgb)
    #[arg(long, value_name = "NAME", value_parser = curves())]
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

/// Where light begins to be cut off: above white, but for the rounding of what is to be just white.
const WHITE: f32 = 1.001;

/// Where most of what is seen is cut off as white: how much, and the exposure that would show it.
pub(super) fn too_bright(image: &Image, response: &Response) -> Option<String> {
    // Filmic curves have no white that light would be cut off at.
    if !matches!(response.curve, Curve::Linear | Curve::Srgb) {
        return None;
    }
    let gain = response.exposure.exp2();
    let covered = || image.pixels.iter().filter(|pixel| pixel.w > 0.0);
    let light = || covered().map(|pixel| pixel.truncate().min_element() * gain);
    let (count, white) = (covered().count(), light().filter(|&light| light > WHITE).count());
    if 2 * white <= count {
        return None;
    }
    // Large pictures are not copied for nothing.
    let median = *light().collect::<Vec<f32>>().select_nth_unstable_by(count / 2, f32::total_cmp).1;
    let share = (100.0 * white as f64 / count as f64).round();
    let exposure = (response.exposure - (median.log2() + 1.0).ceil()).max(-MAX_STOPS);
    let message = "is brighter than white and cut off (OpenEXR and Radiance keep it)";
    Some(format!("{share} % of what is seen {message}; --exposure {exposure} would show it"))
}

/// Where there is light that f32 cannot hold: of how many pixels, and of which first, by its place in the whole
/// picture, of which `window` was rendered.
pub(super) fn beyond_numbers(image: &Image, window: &Crop) -> Option<String> {
    let is_beyond = |pixel: &Vec4| !pixel.is_finite();
    let first = image.pixels.iter().position(is_beyond)?;
    let count = image.pixels.iter().filter(|pixel| is_beyond(pixel)).count();
    let (pixels, are) = if count == 1 { ("pixel", "is") } else { ("pixels", "are") };
    let (row, column) = (first / image.width as usize, first % image.width as usize);
    let (x, y) = (window.x as usize + column, window.y as usize + row);
    Some(format!(
        "{count} {pixels} (first {x},{y}) {are} infinite or no number: lights, pictures of surroundings, colours or a material's shares are so \
         large that their products are not held by f32, which ends at 3.4e38"
    ))
}

fn parse_stops(text: &str) -> Result<f32, String> {
    let stops = text.parse().ok().filter(|stops: &f32| stops.abs() <= MAX_STOPS);
    stops.ok_or_else(|| format!("expected stops from -{MAX_STOPS} to {MAX_STOPS}"))
}

fn curves() -> impl TypedValueParser<Value = Curve> {
    one_of(Curve::ALL, Curve::name, |curve| match curve {
        Curve::Linear => "Codes are the light itself",
        Curve::Srgb => "As screens expect it, cut off at white",
        Curve::Filmic => "With a toe and a shoulder like film's, then as srgb",
        Curve::Aces => "As the Academy's reference rendering, then as srgb",
    })
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
    fn a_picture_that_is_mostly_white_is_told() {
        let image = |values: [f32; 4]| Image {
            width: 2,
            height: 2,
            pixels: values.map(|v| Vec4::new(v, v, v, f32::from(u8::from(v > 0.0)))).to_vec(),
        };
        let told = |values, exposure| too_bright(&image(values), &Response { exposure, ..Response::default() });
        // Not what is not covered.
        let message = told([0.0, 100.0, 200.0, 0.5], 0.0).unwrap();
        assert!(message.starts_with("67 % of what is seen") && message.contains("--exposure -8 would"), "{message}");
        assert_eq!(told([0.0, 100.0, 200.0, 0.5], -8.0), None, "the advice holds");
        assert_eq!(told([2.0, 0.2, 0.3, 2.0], 0.0), None, "half of it is light that is meant to be bright");
        assert_eq!(told([1.0, 1.0, 1.000_000_1, 1.0], 0.0), None, "white is not brighter than white");
        let filmic = Response { curve: Curve::Filmic, ..Response::default() };
        assert_eq!(too_bright(&image([100.0; 4]), &filmic), None);
    }

    #[test]
    fn light_that_is_no_number_is_told() {
        let mut image = Image::new(3, 2);
        let whole = Crop { x: 0, y: 0, width: 3, height: 2 };
        image.pixels[5] = Vec4::MAX;
        assert_eq!(beyond_numbers(&image, &whole), None);
        image.pixels[4].y = f32::INFINITY;
        assert!(beyond_numbers(&image, &whole).unwrap().starts_with("1 pixel (first 1,1) is infinite"));
        image.pixels[2].z = f32::NAN;
        assert!(
            beyond_numbers(&image, &Crop { x: 40, y: 20, ..whole })
                .unwrap()
                .starts_with("2 pixels (first 42,20) are infinite")
        );
    }

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
    }
}
