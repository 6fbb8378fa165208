//! How much of the light an interface mirrors: Fresnel's equations (1823) for light that is not polarised.

/// The share that is mirrored where light arrives at `cosine` to the normal, `ior` being the index of what is behind
/// the interface relative to where the light is. 1 under total internal reflection.
pub(super) fn reflectance(cosine: f64, ior: f64) -> f64 {
    let behind = 1.0 - (1.0 - cosine * cosine) / (ior * ior);
    if cosine <= 0.0 || behind <= 0.0 {
        return 1.0;
    }
    let behind = behind.sqrt();
    let parallel = (ior * cosine - behind) / (ior * cosine + behind);
    let across = (cosine - ior * behind) / (cosine + ior * behind);
    (parallel * parallel + across * across) / 2.0
}

/// That of a pane: the sum over all ways between its two sides, r + (1 - r)^2 r (1 + r^2 + ...) = 2 r / (1 + r).
pub(super) fn pane_reflectance(cosine: f64, ior: f64) -> f64 {
    let r = reflectance(cosine, ior);
    2.0 * r / (1.0 + r)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cos(degrees: f64) -> f64 {
        degrees.to_radians().cos()
    }

    #[test]
    fn known_values() {
        assert!((reflectance(1.0, 1.5) - 0.04).abs() < 1e-15, "((1.5 - 1) / (1.5 + 1))^2");
        assert!((reflectance(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-15);
        // Hecht, Optics, 4.6: glass of 1.5 at 60 degrees mirrors 0.4202^2 across and 0.0425^2 parallel.
        let (across, parallel) = (0.4202f64, 0.0425f64);
        assert!((reflectance(cos(60.0), 1.5) - (across * across + parallel * parallel) / 2.0).abs() < 1e-4);
        // Under Brewster's angle nothing polarised in the plane is mirrored: half of ((1 - n^2) / (1 + n^2))^2 is left.
        let brewster = 1.5f64.atan().to_degrees();
        assert!((reflectance(cos(brewster), 1.5) - 0.5 * (1.25f64 / 3.25).powi(2)).abs() < 1e-12);
        assert!(reflectance(0.0, 1.5) == 1.0 && reflectance(0.3, 1.0) < 1e-30);
    }

    #[test]
    fn the_way_out_mirrors_as_the_way_in_and_beyond_the_critical_angle_everything() {
        for degrees in [0.0, 20.0, 50.0, 85.0f64] {
            let inside = (degrees.to_radians().sin() / 1.5).asin().cos();
            assert!((reflectance(cos(degrees), 1.5) - reflectance(inside, 1.0 / 1.5)).abs() < 1e-12);
        }
        let critical = (1.0f64 / 1.5).asin().to_degrees();
        assert!(reflectance(cos(critical - 0.5), 1.0 / 1.5) < 0.9);
        assert_eq!(reflectance(cos(critical + 1e-6), 1.0 / 1.5), 1.0);
    }

    /// 50 steps of f32 to both sides of the critical cosine, with the light that is let through by its own formula.
    #[test]
    fn at_the_critical_angle_nothing_is_lost_and_nothing_is_nan() {
        let (inside, outside) = (1.5f64, 1.0f64);
        let critical = (1.0 - (outside / inside).powi(2)).sqrt() as f32;
        let mut let_through = 0;
        for step in -50i32..=50 {
            let cosine = f64::from(f32::from_bits(critical.to_bits().wrapping_add_signed(step)));
            let mirrored = reflectance(cosine, outside / inside);
            let behind = 1.0 - (1.0 - cosine * cosine) * (inside / outside).powi(2);
            let passed = if behind > 0.0 {
                let behind = behind.sqrt();
                let across = 2.0 * inside * cosine / (inside * cosine + outside * behind);
                let parallel = 2.0 * inside * cosine / (outside * cosine + inside * behind);
                let_through += 1;
                outside * behind / (inside * cosine) * (across * across + parallel * parallel) / 2.0
            } else {
                0.0
            };
            assert!((0.0..=1.0).contains(&mirrored), "step {step}: {mirrored}");
            assert!((mirrored + passed - 1.0).abs() < 1e-6, "step {step}: {mirrored} + {passed}");
        }
        assert!((40..=60).contains(&let_through), "{let_through} of 101");
    }

    /// Against the sum over bounces, one by one.
    #[test]
    fn a_pane_sums_up_all_bounces() {
        let r = reflectance(cos(40.0), 1.5);
        let bounces: f64 = (0..40).map(|k| (1.0 - r) * (1.0 - r) * r * r.powi(2 * k)).sum();
        assert!((pane_reflectance(cos(40.0), 1.5) - (r + bounces)).abs() < 1e-12);
    }
}
