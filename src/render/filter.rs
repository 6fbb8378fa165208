//! How samples become a pixel.
//!
//! Samples are placed with the filter's own density around the pixel's middle and then count alike (Ernst, Stamminger,
//! Greiner 2006, *Filter importance sampling*). Spreading each sample over the pixels that its filter reaches, the
//! alternative, would make a pixel depend on its neighbours' samples and on the order in which threads add them.

use std::fmt;

use crate::math::DVec2;

/// The shape of a pixel. All are products of a function along x and one along y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// Every point of the pixel alike, and none of its neighbours: radius 1/2.
    #[default]
    Box,
    /// Falls off linearly; radius 1.
    Tent,
    /// A normal distribution of standard deviation 1/2, less its value at the radius, 3/2.
    Gaussian,
    /// Mitchell and Netravali (1988, *Reconstruction filters in computer graphics*), B = C = 1/3: sharper, since it is
    /// negative in parts; radius 2.
    Mitchell,
    /// Harris (1978, *On the use of windows for harmonic analysis with the discrete Fourier transform*), four terms;
    /// radius 3/2: next to nothing leaks from one frequency into another.
    BlackmanHarris,
}

impl Filter {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Box, Self::Tent, Self::Gaussian, Self::Mitchell, Self::BlackmanHarris];

    /// As flags and scenes have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Tent => "tent",
            Self::Gaussian => "gaussian",
            Self::Mitchell => "mitchell",
            Self::BlackmanHarris => "blackman-harris",
        }
    }

    /// How far it reaches along each axis, pixels.
    pub const fn radius(self) -> f64 {
        match self {
            Self::Box => 0.5,
            Self::Tent => 1.0,
            Self::Gaussian | Self::BlackmanHarris => 1.5,
            Self::Mitchell => 2.0,
        }
    }

    /// Its value at a distance from the middle along one axis, up to a factor.
    pub fn value(self, x: f64) -> f64 {
        let (x, radius) = (x.abs(), self.radius());
        if x > radius {
            return 0.0;
        }
        match self {
            Self::Box => 1.0,
            Self::Tent => 1.0 - x,
            Self::Gaussian => libm::exp(-2.0 * x * x) - libm::exp(-2.0 * radius * radius),
            Self::Mitchell if x < 1.0 => (7.0 * x - 12.0) * x * x + 16.0 / 3.0,
            Self::Mitchell => ((-7.0 / 3.0 * x + 12.0) * x - 20.0) * x + 32.0 / 3.0,
            Self::BlackmanHarris => {
                let turn = std::f64::consts::PI * (x / radius + 1.0);
                let wave = |k: f64| libm::cos(k * turn);
                0.35875 - 0.48829 * wave(1.0) + 0.14128 * wave(2.0) - 0.01168 * wave(3.0)
            }
        }
    }
}

impl fmt::Display for Filter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Steps of the table; the filter is taken as constant within each.
const STEPS: usize = 1024;

/// Turns even points of the unit square into points of a filter's density.
#[derive(Clone, Debug)]
pub(super) struct FilterSampler {
    radius: f64,
    /// The share of the filter's magnitude to the left of each step's end, rising to 1. Empty for the box.
    share: Vec<f64>,
    /// Whether the filter is negative at a step.
    negative: Vec<bool>,
    /// The share of the magnitude, over both axes, where the filter is negative.
    negative_share: f64,
}

/// What each sample of a pixel counts where the filter is positive and where it is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Balance {
    positive: f32,
    negative: f32,
}

impl Balance {
    /// Of samples that follow the filter's magnitude, however few of them came to where it is negative.
    pub(super) const SIGNS: Self = Self { positive: 1.0, negative: -1.0 };

    pub(super) fn of(&self, is_negative: bool) -> f32 {
        if is_negative { self.negative } else { self.positive }
    }
}

impl FilterSampler {
    pub(super) fn new(filter: Filter) -> Self {
        let radius = filter.radius();
        if filter == Filter::Box {
            return Self { radius, share: Vec::new(), negative: Vec::new(), negative_share: 0.0 };
        }
        let middle = |step: usize| ((step as f64 + 0.5) / STEPS as f64 * 2.0 - 1.0) * radius;
        let values: Vec<f64> = (0..STEPS).map(|step| filter.value(middle(step))).collect();
        let total: f64 = values.iter().map(|value| value.abs()).sum();
        let mut sum = 0.0;
        let share = values.iter().map(|value| {
            sum += value.abs() / total;
            sum
        });
        let share = share.collect();
        let negative: Vec<bool> = values.iter().map(|&value| value < 0.0).collect();
        // Where one of both factors is.
        let along: f64 = values.iter().map(|value| (-value).max(0.0)).sum::<f64>() / total;
        Self { radius, share, negative_share: 2.0 * along * (1.0 - along), negative }
    }

    /// Whether it is negative anywhere.
    pub(super) fn has_negative(&self) -> bool {
        self.negative_share > 0.0
    }

    /// Where from the pixel's corner a sample lies, and whether the filter is negative there.
    #[inline]
    pub(super) fn place(&self, xi: DVec2) -> (DVec2, bool) {
        if self.share.is_empty() {
            return (xi, false);
        }
        let ((x, a), (y, b)) = (self.along(xi.x), self.along(xi.y));
        (DVec2::new(x, y) + 0.5, a != b)
    }

    /// What the samples of a pixel count of which so many lie where the filter is positive, and where it is negative.
    /// All together those of either kind count as much as that part of the filter does, so that few samples cannot have
    /// the one outweigh the other; without any of one kind all count alike. The weights add up to the number of
    /// samples.
    pub(super) fn balance(&self, positive: u32, negative: u32) -> Balance {
        if positive == 0 || negative == 0 {
            return Balance { positive: 1.0, negative: 1.0 };
        }
        let count = f64::from(positive + negative) / (1.0 - 2.0 * self.negative_share);
        Balance {
            positive: (count * (1.0 - self.negative_share) / f64::from(positive)) as f32,
            negative: (-count * self.negative_share / f64::from(negative)) as f32,
        }
    }

    /// From the middle along one axis, and whether the filter is negative there.
    fn along(&self, xi: f64) -> (f64, bool) {
        let step = self.share.partition_point(|&share| share <= xi).min(STEPS - 1);
        let before = if step == 0 { 0.0 } else { self.share[step - 1] };
        let within = ((xi - before) / (self.share[step] - before)).clamp(0.0, 1.0);
        (((step as f64 + within) / STEPS as f64 * 2.0 - 1.0) * self.radius, self.negative[step])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_those_of_their_sources() {
        // Mitchell and Netravali's formula, times 6: (12 - 9B - 6C) x^3 + (-18 + 12B + 6C) x^2 + (6 - 2B), and so on.
        assert!((Filter::Mitchell.value(0.0) - 16.0 / 3.0).abs() < 1e-15);
        assert!((Filter::Mitchell.value(1.0) - 1.0 / 3.0).abs() < 1e-14, "{}", Filter::Mitchell.value(1.0));
        assert!(Filter::Mitchell.value(1.5) < 0.0 && Filter::Mitchell.value(2.0).abs() < 1e-14);
        assert!((Filter::BlackmanHarris.value(0.0) - 1.0).abs() < 1e-12, "the four terms add up to 1");
        assert!((Filter::BlackmanHarris.value(1.5) - 6e-5).abs() < 1e-12, "and to 0.00006 at the end");
        for filter in Filter::ALL {
            assert!(filter.value(filter.radius() + 1e-9) == 0.0 && filter.value(0.0) > 0.0);
            assert_eq!(filter.value(0.3), filter.value(-0.3));
        }
    }

    /// However many samples there are of either kind, what they count adds up, and each kind counts as its part of the
    /// filter does.
    #[test]
    fn few_samples_are_balanced() {
        let sampler = FilterSampler::new(Filter::Mitchell);
        // By Simpson's rule, on lobes that the polynomials change at.
        let integral = |from: f64, to: f64| {
            let (n, mut sum) = (1000, 0.0);
            for i in 0..n {
                let [a, b] = [i, i + 1].map(|i| from + (to - from) * f64::from(i) / f64::from(n));
                sum += (Filter::Mitchell.value(a)
                    + 4.0 * Filter::Mitchell.value((a + b) / 2.0)
                    + Filter::Mitchell.value(b))
                    / 6.0;
            }
            sum * (to - from) / f64::from(n)
        };
        // Its zero between 1 and 2 is at 8 / 7.
        let (above, below) = (integral(0.0, 1.0) + integral(1.0, 8.0 / 7.0), -integral(8.0 / 7.0, 2.0));
        let share = 2.0 * above * below / (above + below).powi(2);
        assert!((sampler.negative_share - share).abs() < 1e-4, "{} {share}", sampler.negative_share);
        for (positive, negative) in [(1, 1), (1, 3), (3, 1), (14, 2), (60, 4)] {
            let balance = sampler.balance(positive, negative);
            let [p, n] = [positive as f32 * balance.positive, negative as f32 * balance.negative];
            let count = (positive + negative) as f32;
            assert!((p + n - count).abs() < 1e-5 * count, "{balance:?}");
            assert!((f64::from(-n / p) - share / (1.0 - share)).abs() < 1e-4, "{balance:?}");
        }
        for (positive, negative) in [(5, 0), (0, 2)] {
            assert_eq!(sampler.balance(positive, negative), Balance { positive: 1.0, negative: 1.0 });
        }
    }

    /// Weighted samples must have the filter's own mean and variance.
    #[test]
    fn samples_follow_the_filter() {
        for filter in Filter::ALL {
            let sampler = FilterSampler::new(filter);
            let n = 4000;
            let (mut mass, mut second, mut expected) = (0.0, 0.0, [0.0; 2]);
            for i in 0..n {
                let xi = (f64::from(i) + 0.5) / f64::from(n);
                let (at, is_negative) = sampler.place(DVec2::new(xi, 0.5));
                let weight = Balance::SIGNS.of(is_negative);
                let from_middle = at.x - 0.5;
                assert!(from_middle.abs() <= filter.radius() && (at.y - 0.5).abs() < 2e-3, "{filter}: {at}");
                mass += f64::from(weight);
                second += f64::from(weight) * from_middle * from_middle;
                let x = (xi * 2.0 - 1.0) * filter.radius();
                expected[0] += filter.value(x);
                expected[1] += filter.value(x) * x * x;
            }
            let (got, expected) = (second / mass, expected[1] / expected[0]);
            assert!((got - expected).abs() < 2e-3, "{filter}: variance {got} against {expected}");
        }
    }
}
