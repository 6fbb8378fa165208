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
    has_negative: bool,
}

impl FilterSampler {
    pub(super) fn new(filter: Filter) -> Self {
        let radius = filter.radius();
        if filter == Filter::Box {
            return Self { radius, share: Vec::new(), negative: Vec::new(), has_negative: false };
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
        Self { radius, share, has_negative: negative.contains(&true), negative }
    }

    /// Whether a weight can be negative.
    pub(super) fn has_negative(&self) -> bool {
        self.has_negative
    }

    /// Where from the pixel's corner a sample lies, and its weight: 1, or -1 where the filter is negative.
    #[inline]
    pub(super) fn place(&self, xi: DVec2) -> (DVec2, f32) {
        if self.share.is_empty() {
            return (xi, 1.0);
        }
        let ((x, a), (y, b)) = (self.along(xi.x), self.along(xi.y));
        (DVec2::new(x, y) + 0.5, if a == b { 1.0 } else { -1.0 })
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

    /// Weighted samples must have the filter's own mean and variance.
    #[test]
    fn samples_follow_the_filter() {
        for filter in Filter::ALL {
            let sampler = FilterSampler::new(filter);
            let n = 4000;
            let (mut mass, mut second, mut expected) = (0.0, 0.0, [0.0; 2]);
            for i in 0..n {
                let xi = (f64::from(i) + 0.5) / f64::from(n);
                let (at, weight) = sampler.place(DVec2::new(xi, 0.5));
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
