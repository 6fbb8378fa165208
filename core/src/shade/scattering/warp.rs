//! From the unit square to directions.

use std::f64::consts::{PI, TAU};

use crate::math::{DVec2, DVec3, tangents};

/// A direction with the pdf cos / pi about `normal` (Malley's method: Pharr, Jakob, Humphreys 2016, *Physically Based
/// Rendering* 13.6.3).
pub(super) fn cosine(normal: DVec3, xi: DVec2) -> DVec3 {
    around(normal, (1.0 - xi.x).sqrt(), xi.y)
}

/// The pdf of [`cosine`], for a direction on the side of the normal.
pub(super) fn cosine_pdf(cosine: f64) -> f64 {
    cosine.max(0.0) / PI
}

/// A direction with the pdf (n + 1) / (2 pi) cos^n about `axis` (Lafortune and Willems 1994, *Using the modified Phong
/// reflectance model for physically based rendering*).
pub(super) fn power(axis: DVec3, n: f64, xi: DVec2) -> DVec3 {
    around(axis, libm::pow(1.0 - xi.x, 1.0 / (n + 1.0)), xi.y)
}

/// The pdf of [`power`] where the cosine to the axis is `cosine`.
pub(super) fn power_pdf(cosine: f64, n: f64) -> f64 {
    if cosine <= 0.0 { 0.0 } else { (n + 1.0) / TAU * libm::pow(cosine.min(1.0), n) }
}

fn around(axis: DVec3, cosine: f64, turn: f64) -> DVec3 {
    let [x, y] = tangents(axis);
    let (sine, angle) = ((1.0 - cosine * cosine).max(0.0).sqrt(), turn * TAU);
    axis * cosine + (x * libm::cos(angle) + y * libm::sin(angle)) * sine
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of g(cos) over samples is its integral against the pdf, done by hand for g = cos^2.
    #[test]
    fn samples_have_their_pdf() {
        let axis = DVec3::new(1.0, -2.0, 0.5).normalize();
        let side = 200;
        let xi = |k: i32| (DVec2::new(f64::from(k % side), f64::from(k / side)) + 0.5) / f64::from(side);
        let mean = |sample: &dyn Fn(DVec2) -> DVec3| {
            let squares = (0..side * side).map(|k| sample(xi(k)).dot(axis).powi(2));
            squares.sum::<f64>() / f64::from(side * side)
        };
        // The integral of 2 c^3 over c from 0 to 1, and of (n + 1) c^(n + 2).
        assert!((mean(&|e| cosine(axis, e)) - 0.5).abs() < 1e-4);
        for n in [0.0, 1.0, 20.0, 1000.0] {
            assert!((mean(&|e| power(axis, n, e)) - (n + 1.0) / (n + 3.0)).abs() < 1e-4, "{n}");
            // The pdf integrates to 1.
            let steps = 100_000;
            let each = |k: i32| power_pdf((f64::from(k) + 0.5) / f64::from(steps), n) * TAU / f64::from(steps);
            assert!(((0..steps).map(each).sum::<f64>() - 1.0).abs() < 1e-4, "{n}");
        }
        assert_eq!((cosine_pdf(-0.5), power_pdf(-0.5, 2.0)), (0.0, 0.0));
    }
}
