//! How many samples a pixel gets: as many as bring the picture's error below a threshold with the fewest in all.
//!
//! A pixel gets them in proportion to its deviation: how far a single one of its samples is off. Of all ways to spend a
//! number of samples that one leaves the least mean square error (Neyman 1934, *On the two different aspects of the
//! representative method*). To go on with each pixel until its own error is below the threshold, the usual way, takes
//! samples in proportion to the square of the deviation. Where all of a picture is noisy that is worth no more than the
//! same number for each pixel, for both leave the mean of the squares over the mean number. On `scenes/box`, with 20 to
//! 64 samples a pixel, it left 1.02 to 1.07 of the error of even sampling; this leaves 0.94.
//!
//! The threshold is for those pixels that the fewest samples leave above it: it is their root mean square error, and
//! all others are below it anyway. For the whole picture's error it would mean something else in front of more
//! background.
//!
//! The samples of a pixel are parted into two, and how far the two means differ tells how far the mean of all is off
//! (Dammertz, Hanika, Keller and Lensch 2010, *A hierarchical automatic stopping condition for Monte Carlo global
//! illumination*). The variance of single samples, the alternative, takes well-spread samples for random ones: at every
//! edge it finds many times the error that there is. For the same reason the first part is a power of two, and the
//! second as many or half of that: those are well spread by themselves, where every other sample is not.
//!
//! One such difference is a number drawn at random, and small by chance in many a pixel that is noisy. So what a
//! pixel's tells is averaged with its neighbours', 5 x 5 by binomial weights, which are about as noisy. A path to a
//! small bright light, too, that one pixel has found and the next one not yet, makes both go on.
//!
//! Errors are measured as they are seen: of the square root of the pixel, which is about what a screen shows, 1 being
//! white. So a threshold of 0.01 means two or three steps of 255, in the dark as in the light.
//!
//! Pixels are judged between rounds, all of them at once, so that neither tiles nor threads decide anything. A pixel
//! that has stopped stays so: its samples are those of a render with that many.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::math::Vec4;

/// When a picture has samples enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptive {
    /// Root mean square of the standard error of the pixels' square roots, above 0, over those pixels that the fewest
    /// samples leave above it; 1 is white.
    pub noise: f32,
    /// Samples that no pixel exceeds.
    pub max_spp: u32,
}

/// Samples that every pixel has: fewer tell nothing about their error.
const FEWEST: u32 = 16;
/// Samples of the first round.
const FIRST: u32 = 8;

impl Adaptive {
    /// # Errors
    /// [`Error::Usage`] for a threshold that is not above 0, and fewer samples than tell the error.
    pub(super) fn check(&self, spp: u32) -> Result<()> {
        if !(self.noise > 0.0 && self.noise.is_finite()) {
            return Err(Error::Usage(format!("a noise threshold of {}: it must be above 0", self.noise)));
        }
        let fewest = spp.max(FEWEST);
        if self.max_spp < fewest {
            let why = if spp > FEWEST { "as many as it begins with" } else { "as many as tell the noise" };
            let message =
                format!("at most {} samples a pixel: a noise threshold needs {fewest} at least, {why}", self.max_spp);
            return Err(Error::Usage(message));
        }
        Ok(())
    }

    /// How many samples the pixels have that go on after `done`: a power of two, then half as many more, and so on.
    pub(super) fn next(&self, done: u32) -> u32 {
        let next = match done {
            0 => FIRST,
            FIRST => FEWEST,
            done if done.is_power_of_two() => done + done / 2,
            done => done.next_power_of_two(),
        };
        next.min(self.max_spp)
    }

    /// Whether pixels are judged that have so many samples, of which all have at least `spp`.
    pub(super) fn judges(&self, done: u32, spp: u32) -> bool {
        done >= spp.max(FEWEST)
    }

    /// How many samples a pixel is to have for each unit of its deviation, so that the threshold is met: s samples for
    /// each unit leave a pixel of deviation d with the squared error d / s. 0 where the fewest samples are enough for
    /// all.
    pub(super) fn rate(&self, spp: u32, deviations: &[f32]) -> f64 {
        let enough = self.noise * (spp.max(FEWEST) as f32).sqrt();
        // One after another, so that the sum is the same for any number of threads.
        let noisy = deviations.iter().filter(|&&deviation| deviation > enough);
        let (sum, count) = noisy.fold((0.0, 0u32), |(sum, count), &deviation| (sum + f64::from(deviation), count + 1));
        sum / f64::from(count.max(1)) / f64::from(self.noise).powi(2)
    }
}

/// What is known of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    /// Of all samples.
    pub(super) sum: Vec4,
    /// Of the first ones: the greatest power of two that is less than all of them.
    pub(super) first: Vec4,
    /// Of all samples.
    pub(super) weight: f32,
    /// How many samples, at least 2.
    pub(super) count: u32,
}

impl Estimate {
    /// The square of the error of a single sample, by what the two parts tell.
    fn variance(&self) -> Vec4 {
        let first = self.count.next_power_of_two() / 2;
        let (a, b) = (first as f32, (self.count - first) as f32);
        let scale = self.count as f32 / self.weight.max(1.0);
        let difference = (self.first / a - (self.sum - self.first) / b) * scale;
        // The variance of a difference of means is v / a + v / b.
        difference * difference * (a * b / (a + b))
    }

    /// The error as it is seen, if single samples have this variance.
    fn error(&self, variance: Vec4) -> f32 {
        let deviation = (variance / self.count as f32).map(f32::sqrt);
        let mean = (self.sum / self.weight.max(1.0)).max(Vec4::ZERO);
        // Of a root near 0 the slope says nothing: what one deviation more makes of it does.
        let seen = (mean + deviation).map(f32::sqrt) - mean.map(f32::sqrt);
        seen.truncate().max_element().max(deviation.w)
    }
}

/// Binomial: nearly a normal distribution of standard deviation 1.
const KERNEL: [f32; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];

/// How far a single sample of each pixel is off, as it is seen, of a picture in rows of `width`.
pub(super) fn deviations(width: usize, pixels: usize, estimate: impl Fn(usize) -> Estimate + Sync) -> Vec<f32> {
    let own: Vec<Vec4> = (0..pixels).into_par_iter().map(|i| estimate(i).variance()).collect();
    let height = pixels / width;
    let along = |values: &[Vec4], at: usize, end: usize, place: &dyn Fn(usize) -> usize| {
        let (mut sum, mut weights) = (Vec4::ZERO, 0.0);
        for (k, weight) in KERNEL.into_iter().enumerate() {
            // Not beyond the picture.
            if let Some(neighbour) = (at + k).checked_sub(2).filter(|&neighbour| neighbour < end) {
                sum += values[place(neighbour)] * weight;
                weights += weight;
            }
        }
        sum / weights
    };
    let rows = (0..pixels).into_par_iter().map(|i| along(&own, i % width, width, &|x| i / width * width + x));
    let rows: Vec<Vec4> = rows.collect();
    let deviations = (0..pixels).into_par_iter().map(|i| {
        let variance = along(&rows, i / width, height, &|y| y * width + i % width);
        let estimate = estimate(i);
        estimate.error(variance) * (estimate.count as f32).sqrt()
    });
    deviations.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::sampler::{Sampler, Sampling};

    #[test]
    fn rounds_grow_to_the_most() {
        let adaptive = Adaptive { noise: 0.1, max_spp: 100 };
        let mut counts = vec![0];
        while *counts.last().unwrap() < 100 {
            counts.push(adaptive.next(*counts.last().unwrap()));
        }
        assert_eq!(counts, [0, 8, 16, 24, 32, 48, 64, 96, 100]);
        assert!(
            !adaptive.judges(8, 4) && adaptive.judges(16, 4) && !adaptive.judges(48, 50) && adaptive.judges(64, 50)
        );
        assert!(adaptive.check(4).is_ok() && adaptive.check(101).is_err());
        assert!(Adaptive { noise: 0.0, ..adaptive }.check(4).is_err());
        assert!(Adaptive { max_spp: 15, ..adaptive }.check(4).is_err());
    }

    /// What is compared is well spread by itself: as many samples as cells, one in each, upright, lying or square.
    #[test]
    fn both_parts_are_well_spread() {
        let sampler = Sampler::new(Sampling::Sobol, 64, 3);
        let pattern = sampler.pattern(5, 7);
        for samples in [0..32, 32..64, 32..48, 16..32, 16..24] {
            let n = samples.len();
            for columns in (0..).map(|k| 1 << k).take_while(|&columns| columns <= n) {
                let mut counts = vec![0; n];
                for sample in samples.clone() {
                    let at = sampler.film(&pattern, sample);
                    counts[(at.y * (n / columns) as f64) as usize * columns + (at.x * columns as f64) as usize] += 1;
                }
                assert!(counts.iter().all(|&n| n == 1), "{samples:?} in {columns} columns: {counts:?}");
            }
        }
    }

    /// Random pixels of known variance: the estimate must be near it, for every one of them.
    #[test]
    fn deviations_are_those_of_random_samples() {
        let (side, deviation) = (40usize, 0.05f64);
        for count in [64, 96] {
            let sampler = Sampler::new(Sampling::Independent, count, 1);
            let estimate = |i: usize| {
                let pattern = sampler.pattern((i % side) as u32, (i / side) as u32);
                let (mut sum, mut first) = (Vec4::ZERO, Vec4::ZERO);
                for sample in 0..count {
                    // Even over an interval: its deviation is its width over the root of 12.
                    let x = 0.25 + (sampler.film(&pattern, sample).x - 0.5) * deviation * 12f64.sqrt();
                    let value = Vec4::new(x as f32, 0.0, 0.0, 1.0);
                    sum += value;
                    first += if sample < count.next_power_of_two() / 2 { value } else { Vec4::ZERO };
                }
                Estimate { sum, first, weight: count as f32, count }
            };
            let found = deviations(side, side * side, estimate);
            // d sqrt(x) = dx / (2 sqrt(x)), at 1/4.
            let mean = found.iter().map(|&d| f64::from(d)).sum::<f64>() / found.len() as f64;
            assert!((mean / deviation - 1.0).abs() < 0.06, "{mean} {deviation}");
            for own in found {
                assert!((0.3..2.2).contains(&(f64::from(own) / deviation)), "{own} {deviation}");
            }
        }
    }

    #[test]
    fn darkness_and_full_coverage_have_no_error() {
        let even = |_| Estimate { sum: Vec4::new(0.0, 0.0, 0.0, 8.0), first: Vec4::W * 4.0, weight: 8.0, count: 8 };
        assert!(deviations(3, 9, even).iter().all(|&deviation| deviation == 0.0));
    }

    /// Among random numbers of samples for pixels whose deviations are known, none leaves a smaller error than those of
    /// the rate, for as many samples in all; and the error that these leave is the threshold.
    #[test]
    fn no_other_division_is_better() {
        let adaptive = Adaptive { noise: 0.01, max_spp: u32::MAX };
        // All above 0.04, which 16 samples bring to the threshold; and some that are below.
        let mut deviations: Vec<f32> = (0..40).map(|k| 0.05 * 1.1f32.powi(k)).collect();
        let noisy = deviations.len();
        deviations.extend([0.0, 0.01, 0.039]);
        let rate = adaptive.rate(4, &deviations);
        let numbers: Vec<f64> = deviations[..noisy].iter().map(|&d| f64::from(d) * rate).collect();
        let square = |numbers: &[f64]| {
            let errors = deviations.iter().zip(numbers).map(|(&d, n)| f64::from(d).powi(2) / n);
            errors.sum::<f64>() / noisy as f64
        };
        let own = square(&numbers);
        assert!((own.sqrt() - 0.01).abs() < 1e-8, "{own}");
        let total: f64 = numbers.iter().sum();
        let sampler = Sampler::new(Sampling::Independent, 1000, 5);
        for trial in 0..1000 {
            let factor = |k| 0.2 + sampler.film(&sampler.pattern(k, 0), trial).x;
            let other: Vec<f64> = (0..).zip(&numbers).map(|(k, n)| n * factor(k)).collect();
            let scale = total / other.iter().sum::<f64>();
            assert!(square(&other.iter().map(|n| n * scale).collect::<Vec<_>>()) > own);
        }
        // Where the fewest samples are enough, nobody gets more.
        assert_eq!((adaptive.rate(4, &deviations[noisy..]), adaptive.rate(4, &[])), (0.0, 0.0));
        assert_eq!(adaptive.rate(400_000_000, &deviations), 0.0);
    }
}
