//! How many rays a render will trace, before any is: what a tree is worth depends on it.
//!
//! It is a guess from counts: every ray is taken to hit, and materials to be seen as often as they have primitives.
//! Tracing a small picture first would tell better, and needs the tree whose quality is to be chosen.

use serde::Serialize;

use crate::scene::Integrator;

/// How many rays follow from one that the camera sends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Work {
    /// Mirrored, refracted and scattered ones.
    pub sent_on: f64,
    /// Shadow rays to lights without a surface.
    pub shadow: f64,
    /// Questions to lights with a surface, each of which is as many shadow rays as are wished.
    pub area_shadow: f64,
}

/// Rays by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Rays {
    /// From the camera.
    pub camera: u64,
    /// Mirrored, refracted and scattered.
    pub sent_on: u64,
    /// To lights.
    pub shadow: u64,
}

impl Rays {
    /// All of them.
    pub const fn total(&self) -> u64 {
        self.camera.saturating_add(self.sent_on).saturating_add(self.shadow)
    }
}

/// What rays depend on.
pub(super) struct WorkInputs {
    pub(super) integrator: Integrator,
    pub(super) depth: u32,
    /// Ways on from a surface by mirrors and glass, on average.
    pub(super) ways: f64,
    /// The share of light that a surface sends on, on average.
    pub(super) albedo: f64,
    /// Lights that cast shadows, without and with a surface; surfaces that glow are one of these.
    pub(super) lights: [usize; 2],
}

/// How often a path is scattered before it may end by chance.
pub const ROULETTE_MIN_DEPTH: u32 = 3;

impl Work {
    pub(super) fn new(means: &WorkInputs) -> Self {
        let WorkInputs { integrator, depth, ways, albedo, lights: [bare, extended] } = *means;
        match integrator {
            Integrator::RayCast | Integrator::Whitted => {
                let sent_on: f64 = (1..=depth.min(1000)).map(|k| ways.powi(k as i32)).sum();
                let hits = 1.0 + sent_on;
                Self { sent_on, shadow: hits * bare as f64, area_shadow: hits * extended as f64 }
            }
            Integrator::Path => {
                let chance = albedo.clamp(0.0, 1.0);
                let sent_on = (f64::from(ROULETTE_MIN_DEPTH) + chance / (1.0 - chance)).min(depth.into());
                // One light is asked at each surface, once.
                let asks = if bare + extended > 0 { 1.0 + sent_on } else { 0.0 };
                Self { sent_on, shadow: asks, area_shadow: 0.0 }
            }
        }
    }

    /// Of a render of so many samples in all.
    pub fn rays(&self, samples: u64, light_samples: u32) -> Rays {
        let each = |count: f64| (count * samples as f64) as u64;
        let shadow = each(self.shadow + self.area_shadow * f64::from(light_samples));
        Rays { camera: samples, sent_on: each(self.sent_on), shadow }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAST: WorkInputs =
        WorkInputs { integrator: Integrator::RayCast, depth: 0, ways: 0.0, albedo: 0.5, lights: [2, 1] };

    #[test]
    fn each_hit_asks_each_light() {
        let rays = Work::new(&CAST).rays(1000, 4);
        assert_eq!(rays, Rays { camera: 1000, sent_on: 0, shadow: 6000 });
        // Half of what is seen is glass: one way on, on average, at each of five depths.
        let glass = WorkInputs { integrator: Integrator::Whitted, depth: 5, ways: 1.0, ..CAST };
        assert_eq!(Work::new(&glass).rays(1000, 4), Rays { camera: 1000, sent_on: 5000, shadow: 36_000 });
    }

    #[test]
    fn paths_go_on_by_what_surfaces_send_on_and_ask_one_light() {
        let path = WorkInputs { integrator: Integrator::Path, depth: 64, ..CAST };
        assert_eq!(Work::new(&path).rays(1000, 4), Rays { camera: 1000, sent_on: 4000, shadow: 5000 });
        let short = WorkInputs { depth: 2, lights: [0, 0], ..path };
        assert_eq!(Work::new(&short).rays(1000, 4), Rays { camera: 1000, sent_on: 2000, shadow: 0 });
        let white = WorkInputs { albedo: f64::INFINITY, depth: 1000, ..CAST };
        assert_eq!(
            Work::new(&WorkInputs { integrator: Integrator::Path, ..white }).sent_on,
            1000.0,
            "nothing ends them"
        );
        assert_eq!(Rays { camera: u64::MAX, sent_on: 1, shadow: 1 }.total(), u64::MAX);
    }
}
