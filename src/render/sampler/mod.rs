//! Where on a pixel, on a lens, in time its samples lie.
//!
//! Every number is a function of (pixel, sample, dimension, seed) and of nothing else, so that neither threads nor
//! tiles show in a picture. What is sampled at once (a point of the pixel, of the lens) is a pair of dimensions; each
//! pair is stratified by itself, and pairs are shuffled against one another (padding: Kollig and Keller
//! 2002, *Efficient multidimensional sampling*). Sequences of many dimensions at once, the alternative, have bad pairs among
//! them.

mod blue_noise;
mod dimension;
mod halton;
mod hash;
mod sobol;
mod stratified;

use std::{array, fmt};

use crate::math::DVec2;
pub(super) use dimension::{Choice, Dimension};
pub(crate) use hash::pcg4d;

/// How samples are spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampling {
    /// Sobol's sequence, scrambled by Owen's method: the least noise for most pictures.
    #[default]
    Sobol,
    /// Sobol's sequence over pixels along a curve, so that what noise is left is spread evenly over the picture.
    BlueNoise,
    /// Halton's sequence, scrambled.
    Halton,
    /// One sample in each cell of a grid, with its rows and columns evenly filled.
    Stratified,
    /// The middles of a grid's cells, the same for every pixel, in another order for each choice: shows bands where
    /// others show noise.
    Grid,
    /// Random numbers.
    Independent,
}

impl Sampling {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Sobol, Self::BlueNoise, Self::Halton, Self::Stratified, Self::Grid, Self::Independent];

    /// As flags and scenes have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sobol => "sobol",
            Self::BlueNoise => "blue-noise",
            Self::Halton => "halton",
            Self::Stratified => "stratified",
            Self::Grid => "grid",
            Self::Independent => "independent",
        }
    }
}

impl fmt::Display for Sampling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The sample points of every pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    sampling: Sampling,
    spp: u32,
    seed: u64,
}

/// A pixel, with what its samples on the film have in common.
#[derive(Clone, Copy, Debug)]
pub struct Pattern {
    x: u32,
    y: u32,
    film: [u32; 4],
}

/// What the samples of a pixel have in common where paths are scattered first, which is where most of them are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounces([[[u32; 4]; KEPT_CHOICES]; KEPT_DEPTHS]);

/// Depths and choices of which [`Bounces`] are kept.
const KEPT_DEPTHS: usize = 2;
const KEPT_CHOICES: usize = 3;

impl Pattern {
    /// The pixel's top left corner, pixels from that of the film.
    #[inline]
    pub(super) fn corner(&self) -> DVec2 {
        DVec2::new(f64::from(self.x), f64::from(self.y))
    }
}

impl Sampler {
    /// `spp` samples a pixel, at least 1.
    pub const fn new(sampling: Sampling, spp: u32, seed: u64) -> Self {
        Self { sampling, spp, seed }
    }

    /// What the samples of a pixel have in common, computed once for all of them.
    // Inlined, with `film`: a pattern that came back from a call would be copied by loads wider than the stores that
    // made it, which wait for those.
    #[inline]
    pub fn pattern(&self, x: u32, y: u32) -> Pattern {
        // A single sample is not hashed: every pixel has the same.
        let film = if self.spp == 1 { [0; 4] } else { self.key([x, y], Dimension::FILM) };
        Pattern { x, y, film }
    }

    /// Where in the unit square the pixel's `sample` of the film is; in the middle for a single one.
    #[inline]
    pub(super) fn film(&self, pixel: &Pattern, sample: u32) -> DVec2 {
        if self.spp == 1 { DVec2::splat(0.5) } else { self.spread(pixel, pixel.film, sample, Dimension::FILM) }
    }

    /// Where in the unit square a sample of any other pair of dimensions is. A single one is not in the middle, so that
    /// neighbouring pixels differ.
    pub(super) fn pair(&self, pixel: &Pattern, sample: u32, dimension: Dimension) -> DVec2 {
        self.spread(pixel, self.key([pixel.x, pixel.y], dimension), sample, dimension)
    }

    /// What [`Sampler::bounce`] wants to be computed once for all samples of a pixel.
    pub(super) fn bounces(&self, pixel: &Pattern) -> Bounces {
        let key = |depth: usize, choice: usize| {
            self.key([pixel.x, pixel.y], Dimension::bounce(depth as u32, Choice::ALL[choice]))
        };
        Bounces(array::from_fn(|depth| array::from_fn(|choice| key(depth, choice))))
    }

    /// [`Sampler::pair`] of one of the choices where a path was scattered `depth` times.
    pub(super) fn bounce(&self, pixel: &Pattern, kept: &Bounces, sample: u32, depth: u32, choice: Choice) -> DVec2 {
        let dimension = Dimension::bounce(depth, choice);
        match kept.0.get(depth as usize).and_then(|choices| choices.get(choice as usize)) {
            Some(key) => self.spread(pixel, *key, sample, dimension),
            None => self.pair(pixel, sample, dimension),
        }
    }

    #[inline]
    fn spread(&self, pixel: &Pattern, key: [u32; 4], sample: u32, dimension: Dimension) -> DVec2 {
        if self.sampling == Sampling::Sobol {
            return sobol::point(sample, key);
        }
        self.spread_otherwise(pixel, key, sample, dimension)
    }

    fn spread_otherwise(&self, pixel: &Pattern, key: [u32; 4], sample: u32, dimension: Dimension) -> DVec2 {
        let place = [pixel.x, pixel.y];
        match self.sampling {
            Sampling::Sobol => sobol::point(sample, key),
            Sampling::BlueNoise => blue_noise::point(place, sample, self.spp, self.key([0, 0], dimension)),
            Sampling::Halton => halton::point(sample, key),
            Sampling::Stratified => stratified::point(sample, self.spp, key, self.hash(place, sample, dimension)),
            Sampling::Grid => {
                let order = (dimension != Dimension::FILM).then(|| self.key([0, 0], dimension)[0]);
                stratified::grid(sample, self.spp, order)
            }
            Sampling::Independent => {
                let [x, y, ..] = self.hash(place, sample, dimension);
                DVec2::new(unit(x), unit(y))
            }
        }
    }

    /// Numbers for all samples of a pixel.
    #[inline]
    fn key(&self, pixel: [u32; 2], dimension: Dimension) -> [u32; 4] {
        self.mix(pixel, 0, dimension.stream())
    }

    /// Numbers for one sample of a pixel.
    #[inline]
    fn hash(&self, pixel: [u32; 2], sample: u32, dimension: Dimension) -> [u32; 4] {
        self.mix(pixel, sample, dimension.stream().wrapping_add(1))
    }

    #[inline]
    fn mix(&self, [x, y]: [u32; 2], sample: u32, stream: u32) -> [u32; 4] {
        let [a, b, c, d] = pcg4d([x, y, sample, stream]);
        pcg4d([a ^ self.seed as u32, b ^ (self.seed >> 32) as u32, c, d])
    }
}

/// To [0, 1).
fn unit(bits: u32) -> f64 {
    f64::from(bits) / 4_294_967_296.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All but the grid, which is the same for every pixel and every pair.
    fn scattered() -> impl Iterator<Item = Sampling> {
        Sampling::ALL.into_iter().filter(|&sampling| sampling != Sampling::Grid)
    }

    /// Where on the pixel a sample is says nothing of when it is taken, of whatever sampler: of each quarter of one
    /// half is in each of the other.
    #[test]
    fn choices_for_a_sample_are_not_alike() {
        for sampling in Sampling::ALL {
            let sampler = Sampler::new(sampling, 1024, 3);
            let pixel = sampler.pattern(5, 9);
            let mut counts = [[0; 2]; 2];
            let mut places = Vec::new();
            for sample in 0..1024 {
                let (film, time) = (sampler.film(&pixel, sample), sampler.pair(&pixel, sample, Dimension::TIME));
                counts[usize::from(film.x < 0.5)][usize::from(time.x < 0.5)] += 1;
                places.push(time.to_array().map(f64::to_bits));
            }
            assert!(counts.as_flattened().iter().all(|n| (200..312).contains(n)), "{sampling}: {counts:?}");
            places.sort_unstable();
            places.dedup();
            assert_eq!(places.len(), 1024, "{sampling}");
        }
    }

    #[test]
    fn pixels_samples_dimensions_and_seeds_differ_and_a_single_sample_is_central() {
        for sampling in scattered() {
            let film = |spp, seed, x, y, sample| {
                let sampler = Sampler::new(sampling, spp, seed);
                sampler.film(&sampler.pattern(x, y), sample)
            };
            let place = |seed, x, sample| film(4, seed, x, 0, sample);
            assert_ne!(place(0, 0, 0), place(0, 1, 0), "{sampling}");
            assert_ne!(place(0, 0, 0), place(1, 0, 0), "{sampling}");
            assert_ne!(place(0, 0, 0), place(1 << 40, 0, 0), "{sampling}");
            assert_ne!(place(0, 0, 0), place(0, 0, 1), "{sampling}");
            assert_eq!(film(1, 9, 3, 4, 0), DVec2::splat(0.5), "{sampling}");
            let sampler = Sampler::new(sampling, 4, 0);
            let pixel = sampler.pattern(3, 4);
            let dimensions = [
                Dimension::FILM,
                Dimension::LENS,
                Dimension::light(0, 0),
                Dimension::gloss(0),
                Dimension::alpha(0),
                Dimension::bounce(0, Choice::Which),
                Dimension::bounce(0, Choice::Light),
                Dimension::bounce(1, Choice::Which),
            ];
            let pairs = dimensions.map(|dimension| sampler.pair(&pixel, 0, dimension));
            for (i, pair) in pairs.iter().enumerate() {
                assert!(!pairs[..i].contains(pair), "{sampling}: {:?}", dimensions[i]);
            }
        }
    }

    #[test]
    fn what_is_kept_of_bounces_changes_nothing() {
        for sampling in Sampling::ALL {
            let sampler = Sampler::new(sampling, 16, 3);
            let pixel = sampler.pattern(7, 5);
            let kept = sampler.bounces(&pixel);
            for depth in 0..4 {
                for (choice, number) in Choice::ALL.into_iter().zip(0..) {
                    assert_eq!(choice as usize, number);
                    let expected = sampler.pair(&pixel, 9, Dimension::bounce(depth, choice));
                    assert_eq!(
                        sampler.bounce(&pixel, &kept, 9, depth, choice),
                        expected,
                        "{sampling}, {depth}, {choice:?}"
                    );
                }
            }
        }
    }

    /// Mean and variance of a uniform distribution over many pixels: no corner of the pixel is preferred; and no
    /// correlation between the dimensions of a pair, nor between pairs.
    #[test]
    fn samples_are_uniform_and_independent_between_pairs() {
        for sampling in scattered() {
            for spp in [4, 5] {
                let sampler = Sampler::new(sampling, spp, 0);
                let places = |dimension| -> Vec<DVec2> {
                    let place = |i: u32| sampler.pair(&sampler.pattern(i % 200, i / 200), i % spp, dimension);
                    (0..20_000).map(place).collect()
                };
                let (film, lens) = (places(Dimension::FILM), places(Dimension::LENS));
                let n = film.len() as f64;
                assert!(film.iter().all(|p| p.min_element() >= 0.0 && p.max_element() < 1.0));
                let mean = film.iter().sum::<DVec2>() / n;
                let variance = film.iter().map(|p| (*p - mean) * (*p - mean)).sum::<DVec2>() / n;
                assert!((mean - 0.5).abs().max_element() < 0.01, "{sampling}: {mean}");
                assert!((variance - 1.0 / 12.0).abs().max_element() < 0.002, "{sampling}: {variance}");
                let covariance = |f: &dyn Fn(usize) -> f64| (0..film.len()).map(f).sum::<f64>() / n;
                for covariance in [
                    covariance(&|i| (film[i].x - 0.5) * (film[i].y - 0.5)),
                    covariance(&|i| (film[i].x - 0.5) * (lens[i].x - 0.5)),
                    covariance(&|i| (film[i].y - 0.5) * (lens[i].y - 0.5)),
                ] {
                    assert!(covariance.abs() < 0.003, "{sampling}: {covariance}");
                }
            }
        }
    }

    /// The root mean square error of a disk's area from 64 samples: every method must beat random numbers clearly.
    #[test]
    fn spread_samples_integrate_better_than_random_ones() {
        let error = |sampling| {
            let sampler = Sampler::new(sampling, 64, 1);
            let area = |pixel: &Pattern| {
                let inside = |s: &u32| sampler.film(pixel, *s).length_squared() < 1.0;
                (0..64).filter(inside).count() as f64 / 64.0
            };
            let errors = (0..400).map(|i| area(&sampler.pattern(i % 20, i / 20)) - std::f64::consts::FRAC_PI_4);
            (errors.map(|e| e * e).sum::<f64>() / 400.0).sqrt()
        };
        let random = error(Sampling::Independent);
        for sampling in [Sampling::Sobol, Sampling::BlueNoise, Sampling::Halton, Sampling::Stratified] {
            assert!(error(sampling) < 0.5 * random, "{sampling}: {} against {random}", error(sampling));
        }
    }
}
