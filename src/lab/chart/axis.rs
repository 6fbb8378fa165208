//! Where numbers stand on an axis: by their logarithm, with a place of its own for zero.
//!
//! On a logarithmic axis zero has no place, and leaving it out, or putting it where the smallest number is, would hide
//! the best there is: it gets a bin beyond the axis' end, apart from it.

/// Share of the length that the bin of zero takes.
const ZERO_BIN: f64 = 0.14;
/// Where in the bin zero stands, and where the bin ends, as shares of its length.
const ZERO_AT: f64 = 0.4;
const ZERO_END: f64 = 0.75;

/// A logarithmic axis over whole powers of ten.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    /// Logarithms of its ends.
    low: f64,
    high: f64,
    /// Whether there is a bin for zero.
    zero: bool,
}

/// What is written at an axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    /// From 0 to 1.
    pub at: f64,
    pub label: String,
}

impl Axis {
    /// That shows all of `values`, none of which is negative.
    pub fn over(values: impl IntoIterator<Item = f64>) -> Self {
        let (mut low, mut high, mut zero) = (f64::INFINITY, f64::NEG_INFINITY, false);
        for value in values.into_iter().filter(|value| value.is_finite()) {
            if value > 0.0 {
                (low, high) = (low.min(value.log10()), high.max(value.log10()));
            } else {
                zero = true;
            }
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        // Half a decade will do at an end: whole ones leave too much room.
        let (low, high) = ((low * 2.0 - 0.1).floor() / 2.0, (high * 2.0 + 0.1).ceil() / 2.0);
        Self { low, high: high.max(low + 0.5), zero }
    }

    /// From 0 to 1.
    pub fn at(&self, value: f64) -> f64 {
        let start = if self.zero { ZERO_BIN } else { 0.0 };
        if value > 0.0 {
            let share = (value.log10() - self.low) / (self.high - self.low);
            start + (1.0 - start) * share.clamp(0.0, 1.0)
        } else {
            start * ZERO_AT
        }
    }

    /// Where the bin of zero ends and the axis begins.
    pub fn gap(&self) -> Option<(f64, f64)> {
        self.zero.then_some((ZERO_BIN * ZERO_END, ZERO_BIN))
    }

    /// Round numbers, and zero: powers of ten, with 2 and 5 times those where there are few.
    pub fn ticks(&self) -> Vec<Tick> {
        let factors: &[f64] = if self.high - self.low < 1.6 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let decades = (self.low.floor() as i32)..=(self.high.ceil() as i32);
        let every = ((self.high - self.low) / 7.0).ceil().max(1.0) as i32;
        let values = decades
            .filter(|decade| decade.rem_euclid(every) == 0)
            .flat_map(|decade| factors.iter().map(move |factor| factor * 10f64.powi(decade)));
        let inside = values.filter(|value| (self.low - 1e-9..=self.high + 1e-9).contains(&value.log10()));
        let ticks = inside.map(|value| Tick { at: self.at(value), label: label(value) });
        let zero = self.zero.then(|| Tick { at: self.at(0.0), label: "none".to_owned() });
        zero.into_iter().chain(ticks).collect()
    }
}

/// A round number in few letters.
fn label(value: f64) -> String {
    if (0.001..100_000.0).contains(&value) {
        let digits = (-value.log10().floor()).max(0.0) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{value:.0e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_are_even_and_zero_stands_apart() {
        let axis = Axis::over([0.0, 1.2, 900.0]);
        let at = [0.0, 1.0, 10.0, 100.0, 1000.0].map(|value| axis.at(value));
        assert!(at.windows(2).all(|pair| pair[0] < pair[1]), "{at:?}");
        let steps: Vec<f64> = at[1..].windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(steps.iter().all(|step| (step - steps[0]).abs() < 1e-12), "{steps:?}");
        let (end, begin) = axis.gap().expect("there is a zero");
        assert!(at[0] < end && end < begin && begin <= at[1]);
        let labels: Vec<String> = axis.ticks().into_iter().map(|tick| tick.label).collect();
        assert_eq!(labels, ["none", "1", "10", "100", "1000"]);
    }

    #[test]
    fn narrow_wide_and_empty_axes_have_some_ticks() {
        for values in [vec![3.0], vec![3.0, 7.0], vec![1e-9, 1e9], vec![], vec![0.0], vec![f64::INFINITY, 0.02]] {
            let axis = Axis::over(values.clone());
            let ticks = axis.ticks();
            assert!((2..=10).contains(&ticks.len()), "{values:?}: {ticks:?}");
            assert!(ticks.iter().all(|tick| (0.0..=1.0).contains(&tick.at)));
            assert!(values.iter().all(|&value| (0.0..=1.0).contains(&axis.at(value))));
        }
        assert_eq!([0.02, 5.0, 2000.0, 1e6, 1e-5].map(label), ["0.02", "5", "2000", "1e6", "1e-5"]);
    }
}
