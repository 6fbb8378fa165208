//! How often something happens in a million cases, and between which bounds that is known.

use crate::lab::bench::Spread;

/// Of the normal distribution, for 95 %.
const Z: f64 = 1.959_964;

/// `count` of `cases` in parts of a million; the ends are those of Wilson's interval for 95 % (Wilson 1927, *Probable
/// inference, the law of succession, and statistical inference*), which says something of no cases as well.
pub(super) fn per_million(count: u64, cases: u64) -> Spread {
    let n = cases.max(1) as f64;
    let p = count as f64 / n;
    let denominator = 1.0 + Z * Z / n;
    let middle = (p + Z * Z / (2.0 * n)) / denominator;
    let half = Z / denominator * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    let min = if count == 0 { 0.0 } else { (middle - half).max(0.0) };
    Spread { min: min * 1e6, median: p * 1e6, max: (middle + half).min(1.0) * 1e6 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_wilsons() {
        let Spread { min, median, max } = per_million(10, 100);
        // Newcombe 1998 tabulates such intervals: 0.0552 to 0.1744.
        assert!((median - 1e5).abs() < 1e-6 && (min - 55_229.0).abs() < 10.0 && (max - 174_366.0).abs() < 10.0);
        // None in n: 3.84 / (n + 3.84) at most.
        let none = per_million(0, 1_000_000);
        assert!(none.min == 0.0 && none.median == 0.0 && (none.max - 3.84).abs() < 0.01);
        let all = per_million(5, 5);
        assert!(all.median == 1e6 && (all.max - 1e6).abs() < 1e-6 && all.min > 5e5);
    }
}
