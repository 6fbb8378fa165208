//! What a tracer's answers to a case's rays are worth.

use serde::Serialize;

use crate::lab::tree::Exact;
use crate::ray::{Hit, Ray};

/// What of an answer is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// What is hit was passed: nothing was found, or something well behind. On a closed surface, a leak.
    FalseMiss,
    /// Something was found where there is nothing, or well before what is hit.
    FalseHit,
    /// Something else was found at about the same distance: a neighbour, or what lies just behind.
    WrongPrimitive,
    /// Of several at exactly the same distance, not the one with the lowest id.
    SwappedTie,
    /// NaN, or weights outside of the triangle by more than rounding.
    NotANumber,
    /// Whether there is any hit was answered otherwise than by the nearest one.
    Inconsistent,
}

impl Fault {
    /// As in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FalseMiss => "false miss",
            Self::FalseHit => "false hit",
            Self::WrongPrimitive => "wrong primitive",
            Self::SwappedTie => "swapped tie",
            Self::NotANumber => "not a number",
            Self::Inconsistent => "inconsistent",
        }
    }
}

/// What must not happen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// Nothing is missed, nothing is made up: a neighbour at about the same distance will do. This is what f32 may be
    /// asked for.
    Hits,
    /// The primitive of exact arithmetic, and of several at exactly the same t the one with the lowest id.
    Exact,
}

impl Gate {
    /// As in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hits => "hits",
            Self::Exact => "exact",
        }
    }

    /// Whether a fault counts.
    pub const fn forbids(self, fault: Fault) -> bool {
        !matches!((self, fault), (Self::Hits, Fault::SwappedTie | Fault::WrongPrimitive))
    }
}

/// What is wrong with an answer; None where nothing is.
pub fn fault(ray: &Ray, exact: &Exact, found: Option<Hit>) -> Option<Fault> {
    let Some(hit) = found else {
        return (!exact.nearest.is_empty()).then_some(Fault::FalseMiss);
    };
    if !(hit.t.is_finite() && hit.u.is_finite() && hit.v.is_finite()) {
        return Some(Fault::NotANumber);
    }
    match exact.nearest.iter().position(|&id| id == hit.id()) {
        Some(0) => None,
        Some(_) => Some(Fault::SwappedTie),
        None if exact.nearest.is_empty() => Some(Fault::FalseHit),
        None => {
            let t = f64::from(hit.t);
            // The last term: how far apart neighbouring points of f32 are where the ray begins.
            let slack = 1e-3 * exact.t + 1e-6 * f64::from(ray.origin.length()) / f64::from(ray.direction.length());
            Some(if t > exact.t + slack {
                Fault::FalseMiss
            } else if t < exact.t - slack {
                Fault::FalseHit
            } else {
                Fault::WrongPrimitive
            })
        }
    }
}

/// Counts over rays. They add up.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Rays that were asked.
    pub rays: u64,
    /// Of each fault, in the order of [`Fault`].
    counts: [u64; 6],
    /// Rays with a fault that the gate forbids.
    pub failing: u64,
    /// Errors of t in steps of f32, where the right primitive was hit: of the first [`SAMPLES`].
    steps: Vec<f64>,
    /// The largest of all.
    most_steps: f64,
    /// The largest, relative to t.
    most_relative: f64,
}

/// Errors that are kept, of which the median and the like are taken: a million rays would take as many.
const SAMPLES: usize = 1 << 16;

/// A [`Tally`], in figures. The errors are those of rays on which the right primitive was hit, at a t that is a number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// Rays that were asked.
    pub rays: u64,
    /// [`Fault::FalseMiss`].
    pub false_misses: u64,
    /// [`Fault::FalseHit`].
    pub false_hits: u64,
    /// [`Fault::WrongPrimitive`].
    pub wrong_primitives: u64,
    /// [`Fault::SwappedTie`].
    pub swapped_ties: u64,
    /// [`Fault::NotANumber`].
    pub not_numbers: u64,
    /// [`Fault::Inconsistent`].
    pub inconsistent: u64,
    /// Rays with a fault that the gate forbids.
    pub failing: u64,
    /// Error of t in steps of f32 that half of the rays do not exceed.
    pub t_ulp_median: f64,
    /// That 99 of 100 do not exceed.
    pub t_ulp_p99: f64,
    /// That none exceeds.
    pub t_ulp_max: f64,
    /// The largest error of t, relative to t.
    pub t_relative_max: f64,
}

impl Tally {
    /// Adds the answers to rays; the numbers of those that fail.
    pub fn add(
        &mut self,
        gate: Gate,
        rays: &[Ray],
        exact: &[Exact],
        found: &[Option<Hit>],
        occluded: &[bool],
    ) -> Vec<(usize, Fault)> {
        let mut failing = Vec::new();
        for (i, (ray, exact)) in rays.iter().zip(exact).enumerate() {
            self.rays += 1;
            let inconsistent = (occluded[i] != found[i].is_some()).then_some(Fault::Inconsistent);
            let faults = [fault(ray, exact, found[i]), inconsistent];
            let mut fails = None;
            for fault in faults.into_iter().flatten() {
                self.counts[fault as usize] += 1;
                if fails.is_none() && gate.forbids(fault) {
                    fails = Some(fault);
                }
            }
            failing.extend(fails.map(|fault| (i, fault)));
            if let Some(hit) = found[i].filter(|hit| exact.nearest.contains(&hit.id()) && !hit.t.is_nan()) {
                let nearest = exact.t as f32;
                let step = f64::from(nearest.next_up()) - f64::from(nearest);
                let error = (f64::from(hit.t) - exact.t).abs();
                let relative = if error == 0.0 { 0.0 } else { error / exact.t.abs() };
                if self.steps.len() < SAMPLES {
                    self.steps.push(error / step);
                }
                self.most_steps = self.most_steps.max(error / step);
                self.most_relative = self.most_relative.max(relative);
            }
        }
        self.failing += failing.len() as u64;
        failing
    }

    /// In figures.
    pub fn verdict(&self) -> Verdict {
        let mut steps = self.steps.clone();
        steps.sort_by(f64::total_cmp);
        let at = |part: f64| steps.get((part * steps.len() as f64) as usize).or(steps.last()).copied().unwrap_or(0.0);
        let [false_misses, false_hits, wrong_primitives, swapped_ties, not_numbers, inconsistent] = self.counts;
        Verdict {
            rays: self.rays,
            false_misses,
            false_hits,
            wrong_primitives,
            swapped_ties,
            not_numbers,
            inconsistent,
            failing: self.failing,
            t_ulp_median: at(0.5),
            t_ulp_p99: at(0.99),
            t_ulp_max: self.most_steps,
            t_relative_max: self.most_relative,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    const RAY: Ray = Ray::new(Vec3::ZERO, Vec3::Z);

    fn hit(primitive: u32, t: f32) -> Option<Hit> {
        Some(Hit { t, u: 0.0, v: 0.0, primitive, geometry: 0, instance: 0 })
    }

    fn exact(ids: &[u32], t: f64) -> Exact {
        let nearest = ids.iter().map(|&id| (0, 0, id)).collect();
        Exact { nearest, t, touches: false, at_range_end: false }
    }

    #[test]
    fn each_fault_by_its_name() {
        let of = |exact: &Exact, found| fault(&RAY, exact, found);
        let (one, two, none) = (exact(&[3], 2.0), exact(&[3, 5], 2.0), exact(&[], f64::INFINITY));
        assert_eq!(of(&none, None), None);
        assert_eq!(of(&one, hit(3, 2.0)), None);
        assert_eq!(of(&one, None), Some(Fault::FalseMiss));
        assert_eq!(of(&one, hit(4, 3.0)), Some(Fault::FalseMiss));
        assert_eq!(of(&one, hit(4, 2.001)), Some(Fault::WrongPrimitive));
        assert_eq!(of(&one, hit(4, 1.0)), Some(Fault::FalseHit));
        assert_eq!(of(&none, hit(4, 1.0)), Some(Fault::FalseHit));
        assert_eq!(of(&two, hit(3, 2.0)), None);
        assert_eq!(of(&two, hit(5, 2.0)), Some(Fault::SwappedTie));
        assert_eq!(of(&one, hit(3, f32::NAN)), Some(Fault::NotANumber));
    }

    #[test]
    fn a_gate_forbids_what_it_says_and_errors_are_in_steps() {
        let mut tally = Tally::default();
        let (rays, exact) = ([RAY; 3], [exact(&[3], 2.0), exact(&[3], 2.0), exact(&[3], 2.0)]);
        let found = [hit(3, 2.0f32.next_up()), hit(4, 2.0), None];
        let failing = tally.add(Gate::Hits, &rays, &exact, &found, &[true, true, true]);
        assert_eq!(failing, [(2, Fault::FalseMiss)]);
        let verdict = tally.verdict();
        assert_eq!((verdict.false_misses, verdict.wrong_primitives, verdict.inconsistent), (1, 1, 1));
        assert_eq!((verdict.failing, verdict.t_ulp_max), (1, 1.0));
        // An error that is no number is no error of t, but a fault.
        let mut tally = Tally::default();
        tally.add(Gate::Hits, &rays, &exact, &[hit(3, f32::NAN), hit(3, 2.0f32.next_up()), hit(3, 2.0)], &[true; 3]);
        let verdict = tally.verdict();
        assert_eq!((verdict.not_numbers, verdict.t_ulp_p99, verdict.t_ulp_max), (1, 1.0, 1.0));
        assert_eq!(Tally::default().add(Gate::Exact, &rays, &exact, &found, &[true, true, false]).len(), 2);
    }
}
