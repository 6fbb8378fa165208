//! How different two pictures look to someone who flips between them: LDR-FLIP (Andersson et al. 2020, *FLIP: A
//! difference evaluator for alternating images*).
//!
//! Colours are compared after the eye's contrast sensitivity has blurred them, in a space where equal distances look
//! equally large; edges and points that one picture has and the other lacks make the difference larger. 0 is the same,
//! 1 the largest difference there is. Root mean square errors, the simpler alternative, count a speck that everyone
//! sees like noise that no one does.
//!
//! Light is clamped to 0 .. 1, as a screen shows it; further [`Response`](super::Response) is the caller's. All filters
//! are products of one across and one down, or sums of such products, and are applied so: some 300 products a pixel,
//! where the squares of weights, as the paper has them, take 3000.

use rayon::prelude::*;

use super::Image;
use super::compare::{Extent, check_extents};
use crate::error::{Error, Result};
use crate::math::Vec4;

/// Pixels in a degree of the field of view, for who sits 0.7 m before a screen 0.7 m wide with 3840 pixels, as the
/// paper has it.
pub const PIXELS_PER_DEGREE: f64 = 0.7 * (3840.0 / 0.7) * std::f64::consts::PI / 180.0;

/// Three numbers of a pixel, in whichever space.
type Color = [f64; 3];

/// The exponent of colour differences.
const COLOR_EXPONENT: f64 = 0.7;
/// The exponent of differences of features.
const FEATURE_EXPONENT: f64 = 0.5;
/// Colour differences up to this share of the largest take up to [`BEND_AT`] of the result.
const BEND: f64 = 0.4;
const BEND_AT: f64 = 0.95;
/// The width of an edge or a point, in degrees.
const FEATURE_WIDTH: f64 = 0.082;

/// Contrast sensitivity of achromatic, red-green and blue-yellow: Gaussians by weight and width (Movshon and Kiorpes
/// 1988; Mullen 1985).
const SENSITIVITY: [&[(f64, f64)]; 3] = [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];

/// XYZ of linear Rec. 709 light, row by row.
const XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// A picture as it is seen, for one reference and many tests.
pub struct Seen {
    extent: Extent,
    pixels_per_degree: f64,
    colors: Vec<Color>,
    /// How much of an edge and of a point there is in each pixel.
    features: Vec<[f64; 2]>,
}

impl Image {
    /// The mean of LDR-FLIP over all pixels, 0 to 1, of this picture as the reference; alpha is left out.
    ///
    /// `pixels_per_degree` says how large a pixel is seen, 1 to 1000, usually [`PIXELS_PER_DEGREE`].
    ///
    /// # Errors
    /// [`Error::Check`] where the sizes differ, and those of [`Image::seen`].
    pub fn mean_flip(&self, test: &Self, pixels_per_degree: f64) -> Result<f64> {
        self.seen(pixels_per_degree)?.mean_flip(test)
    }

    /// The picture as it is seen at this size.
    ///
    /// # Errors
    /// [`Error::Usage`] for other pixels a degree than from 1 to 1000, and those of [`Image::check`].
    pub fn seen(&self, pixels_per_degree: f64) -> Result<Seen> {
        if !(1.0..=1000.0).contains(&pixels_per_degree) {
            return Err(Error::Usage(format!("{pixels_per_degree} pixels a degree; 1 to 1000 is possible")));
        }
        self.check()?;
        Ok(self.seen_at(pixels_per_degree))
    }

    fn seen_at(&self, pixels_per_degree: f64) -> Seen {
        let opponent: Vec<Color> = self.pixels.iter().map(|pixel| opponent(xyz(displayed(*pixel)))).collect();
        let size = [self.width as usize, self.height as usize];
        let layer = |value: &dyn Fn(&Color) -> f64| Layer { size, values: opponent.iter().map(value).collect() };
        let blurred: [Layer; 3] =
            std::array::from_fn(|i| layer(&|pixel| pixel[i]).resolved(SENSITIVITY[i], pixels_per_degree));
        let color = |i: usize| {
            let light = linear(unopponent(std::array::from_fn(|k| blurred[k].values[i])));
            hunt(light.map(|x| x.clamp(0.0, 1.0)))
        };
        let features = layer(&|pixel| (pixel[0] + 16.0) / 116.0).features(pixels_per_degree);
        let colors = (0..opponent.len()).into_par_iter().map(color).collect();
        Seen { extent: self.extent(), pixels_per_degree, colors, features }
    }
}

impl Seen {
    /// [`Image::mean_flip`] of the picture that is seen.
    ///
    /// # Errors
    /// [`Error::Check`] where the sizes differ, and those of [`Image::check`].
    pub fn mean_flip(&self, test: &Image) -> Result<f64> {
        test.check()?;
        check_extents(self.extent, test.extent())?;
        let test = test.seen_at(self.pixels_per_degree);
        let largest = distance(&hunt([0.0, 1.0, 0.0]), &hunt([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
        let colors = self.colors.iter().zip(&test.colors);
        let colors = colors.map(|(a, b)| bend(distance(a, b).powf(COLOR_EXPONENT), largest));
        let features = self.features.iter().zip(&test.features).map(|(a, b)| {
            let most = (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
            (most / std::f64::consts::SQRT_2).powf(FEATURE_EXPONENT)
        });
        let sum: f64 = colors.zip(features).map(|(color, feature)| color.powf(1.0 - feature)).sum();
        Ok(sum / self.colors.len().max(1) as f64)
    }
}

/// The part of light that a screen shows.
fn displayed(pixel: Vec4) -> Color {
    [pixel.x, pixel.y, pixel.z].map(|x| if x > 0.0 { f64::from(x.min(1.0)) } else { 0.0 })
}

fn xyz(linear: Color) -> Color {
    XYZ.map(|row| row[0] * linear[0] + row[1] * linear[1] + row[2] * linear[2])
}

/// Linear light of XYZ, by Cramer's rule.
fn linear(xyz: Color) -> Color {
    let [x, y, z] = [0, 1, 2].map(|column| XYZ.map(|row| row[column]));
    let det = |a: Color, b: Color, c: Color| {
        let minor = |i: usize, j: usize| b[i] * c[j] - b[j] * c[i];
        a[0] * minor(1, 2) + a[1] * minor(2, 0) + a[2] * minor(0, 1)
    };
    let whole = det(x, y, z);
    [det(xyz, y, z), det(x, xyz, z), det(x, y, xyz)].map(|d| d / whole)
}

/// XYZ as shares of those of white.
fn of_white(color: Color) -> Color {
    let white = xyz([1.0; 3]);
    std::array::from_fn(|i| color[i] / white[i])
}

/// YCxCz: the eye's opponent colours, linear in light.
fn opponent(xyz: Color) -> Color {
    let [x, y, z] = of_white(xyz);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn unopponent([achromatic, red_green, blue_yellow]: Color) -> Color {
    let y = (achromatic + 16.0) / 116.0;
    let white = xyz([1.0; 3]);
    [white[0] * (y + red_green / 500.0), white[1] * y, white[2] * (y - blue_yellow / 200.0)]
}

/// CIELAB of linear light, with colours paler the darker they are (Hunt 1952).
fn hunt(linear: Color) -> Color {
    const DELTA: f64 = 6.0 / 29.0;
    let root = |t: f64| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = of_white(xyz(linear)).map(root);
    let lightness = 116.0 * y - 16.0;
    let paler = 0.01 * lightness;
    [lightness, paler * 500.0 * (x - y), paler * 200.0 * (y - z)]
}

/// HyAB (Abasi et al. 2020): of lightness and of colour apart, for large differences.
fn distance(a: &Color, b: &Color) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// A colour difference up to `largest` as 0 to 1, most of it for the smaller ones.
fn bend(difference: f64, largest: f64) -> f64 {
    let knee = BEND * largest;
    if difference < knee {
        difference * BEND_AT / knee
    } else {
        BEND_AT + (difference - knee) / (largest - knee) * (1.0 - BEND_AT)
    }
}

/// A number of each pixel, row by row.
struct Layer {
    /// Pixels in a row, and rows.
    size: [usize; 2],
    values: Vec<f64>,
}

impl Layer {
    /// What the eye resolves.
    fn resolved(&self, gaussians: &[(f64, f64)], pixels_per_degree: f64) -> Self {
        use std::f64::consts::PI;
        // One radius for all three.
        let widest = SENSITIVITY.into_iter().flatten().map(|gaussian| gaussian.1).fold(0.0, f64::max);
        let radius = 3.0 * (widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree;
        let (mut sum, mut shares) = (vec![0.0; self.values.len()], 0.0);
        for &(weight, width) in gaussians {
            let gaussian = weights(radius, |x| (-PI * PI * (x / pixels_per_degree).powi(2) / width).exp());
            // Of the sum of all weights, across and down.
            let share = weight * (PI / width).sqrt() * gaussian.iter().sum::<f64>().powi(2);
            let gaussian = normalized(gaussian);
            let filtered = self.filtered(&gaussian, &gaussian);
            sum.iter_mut().zip(filtered.values).for_each(|(sum, value)| *sum += share * value);
            shares += share;
        }
        sum.iter_mut().for_each(|sum| *sum /= shares);
        Self { size: self.size, values: sum }
    }

    /// How much of an edge and of a point there is: by the first and second derivatives of a Gaussian.
    fn features(&self, pixels_per_degree: f64) -> Vec<[f64; 2]> {
        let deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
        let of = |weight: &dyn Fn(f64) -> f64| normalized(weights(3.0 * deviation, weight));
        let along = of(&gaussian);
        let [edge, point] = [of(&|x| -x * gaussian(x)), of(&|x| (x * x / (deviation * deviation) - 1.0) * gaussian(x))];
        let [edges, points] = [edge, point].map(|filter| {
            let (across, down) = (self.filtered(&filter, &along).values, self.filtered(&along, &filter).values);
            across.into_iter().zip(down).map(|(across, down)| across.hypot(down))
        });
        edges.zip(points).map(|(edge, point)| [edge, point]).collect()
    }

    /// By the product of two filters.
    fn filtered(&self, across: &[f64], down: &[f64]) -> Self {
        let [width, height] = self.size;
        let rows = self.summed(across, |i| Line { first: i - i % width, step: 1, length: width, at: i % width });
        rows.summed(down, |i| Line { first: i % width, step: width, length: height, at: i / width })
    }

    /// The weighted sum around each place on its line; beyond the borders, pictures go on as they end.
    fn summed(&self, weights: &[f64], line: impl Fn(usize) -> Line + Sync) -> Self {
        let radius = weights.len() / 2;
        let sum = |i: usize| {
            let Line { first, step, length, at } = line(i);
            let value = |k: usize| self.values[first + step * (at + k).saturating_sub(radius).min(length - 1)];
            weights.iter().enumerate().map(|(k, weight)| weight * value(k)).sum()
        };
        // A sum a pixel: the same for any number of threads.
        Self { size: self.size, values: (0..self.values.len()).into_par_iter().map(sum).collect() }
    }
}

/// A row or a column, and a place in it.
struct Line {
    first: usize,
    step: usize,
    length: usize,
    at: usize,
}

/// The weights of all places up to a radius.
fn weights(radius: f64, weight: impl Fn(f64) -> f64) -> Vec<f64> {
    let radius = radius.ceil() as i32;
    (-radius..=radius).map(|x| weight(x.into())).collect()
}

/// Divided by their sum, those above and those below 0 each by their own.
fn normalized(mut weights: Vec<f64>) -> Vec<f64> {
    let sum = |sign: f64| weights.iter().map(|weight| (weight * sign).max(0.0)).sum::<f64>();
    let (above, below) = (sum(1.0), sum(-1.0));
    for weight in &mut weights {
        *weight /= if *weight < 0.0 { below } else { above };
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, color: impl Fn(u32, u32) -> [f32; 3]) -> Image {
        let mut image = Image::new(width, height);
        for (index, pixel) in (0u32..).zip(&mut image.pixels) {
            let [r, g, b] = color(index % width, index / width);
            *pixel = Vec4::new(r, g, b, 1.0);
        }
        image
    }

    #[test]
    fn means_are_those_of_the_authors_program() {
        // By flip-evaluator 1.7 of Andersson et al. It computes in f32, in which features that are equal differ by
        // 1e-7, of which it then takes the root.
        let of = |color: &dyn Fn(u32, u32) -> [f32; 3]| picture(40, 30, color);
        let ramp = |x: u32, y: u32| [x as f32 / 64.0, y as f32 / 32.0, (x + y) as f32 / 128.0];
        let dots =
            |x: u32, y: u32| [ramp(x, y)[0], ramp(x, y)[1], if (x % 8, y % 8) == (3, 5) { 1.0 } else { ramp(x, y)[2] }];
        let checks = |x: u32, y: u32| if (x / 4 + y / 4) % 2 == 1 { [0.25, 0.5, 0.125] } else { [0.5, 0.25, 0.0625] };
        let pairs = [
            (of(&|_, _| [0.0; 3]), of(&|_, _| [1.0; 3]), 0.967_397),
            (of(&|_, _| [0.0, 1.0, 0.0]), of(&|_, _| [0.0, 0.0, 1.0]), 1.0),
            (of(&ramp), of(&dots), 0.074_584),
            (of(&checks), of(&|x, y| checks(x + 1, y)), 0.188_505),
            (of(&ramp), of(&|x, y| [ramp(x, y)[0] + 0.03125, ramp(x, y)[1], ramp(x, y)[2]]), 0.105_003),
        ];
        for (reference, test, expected) in pairs {
            let mean = reference.mean_flip(&test, PIXELS_PER_DEGREE).unwrap();
            assert!((mean - expected).abs() < 1e-4, "{mean} {expected}");
            assert_eq!(reference.mean_flip(&reference, PIXELS_PER_DEGREE).unwrap(), 0.0);
        }
    }

    #[test]
    fn what_a_screen_cannot_show_does_not_count_and_sizes_must_agree() {
        let [bright, brighter] = [1.0, f32::INFINITY].map(|x| picture(4, 3, |_, _| [x, -1.0, f32::NAN]));
        assert_eq!(bright.mean_flip(&brighter, PIXELS_PER_DEGREE).unwrap(), 0.0);
        assert!(bright.mean_flip(&picture(3, 4, |_, _| [0.0; 3]), PIXELS_PER_DEGREE).is_err());
    }

    #[test]
    fn what_cannot_be_seen_is_refused() {
        let image = picture(4, 3, |x, y| [x as f32 / 4.0, y as f32 / 3.0, 0.5]);
        for size in [1.0, 1000.0] {
            assert_eq!(image.mean_flip(&image, size).unwrap(), 0.0, "{size}");
        }
        for size in [0.0, -1.0, 1e-3, f64::NAN, f64::INFINITY, 1e6] {
            assert!(image.mean_flip(&image, size).is_err(), "{size}");
        }
        let short = Image { pixels: image.pixels[1..].to_vec(), ..image.clone() };
        assert!(
            short.mean_flip(&image, PIXELS_PER_DEGREE).is_err() && image.mean_flip(&short, PIXELS_PER_DEGREE).is_err()
        );
        assert!(short.difference(&short).is_err() && short.difference_image(&short).is_err());
    }
}
