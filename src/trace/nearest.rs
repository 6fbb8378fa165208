//! The best hit so far, and the rule by which a better one replaces it.

use crate::ray::{Hit, Ray};

/// The nearest hit found so far. Keeps t in f64, so that surfaces closer than one f32 step are told apart, and breaks
/// ties by ids, so that the outcome does not depend on the order of the offers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    t: f64,
    limit: f32,
    hit: Option<Hit>,
}

impl Nearest {
    /// Nothing, within no range.
    pub const NONE: Self = Self { t: f64::INFINITY, limit: 0.0, hit: None };

    /// Nothing yet, within the ray's range.
    pub fn new(ray: &Ray) -> Self {
        // One step on: t is rounded to f32 before it is held against tmax.
        Self { t: f64::INFINITY, limit: ray.tmax.next_up(), hit: None }
    }

    /// The farthest t, in f32 and rounded up, that could still be better.
    #[inline]
    pub fn limit(&self) -> f32 {
        self.limit
    }

    /// t of the hit; infinite for none.
    #[inline]
    pub fn t(&self) -> f64 {
        self.t
    }

    /// What was found.
    #[inline]
    pub fn hit(&self) -> Option<Hit> {
        self.hit
    }

    /// Whether a hit at `t` with this [id](Hit::id) is nearer, or as near with a lower id.
    #[inline]
    pub fn takes(&self, t: f64, id: (u32, u32, u32)) -> bool {
        t < self.t || (t == self.t && self.hit.is_some_and(|best| id < best.id())) || self.hit.is_none()
    }

    /// Takes the hit if it is better. `hit.t` is set from `t`.
    #[inline]
    pub fn offer(&mut self, t: f64, hit: Hit) {
        if self.takes(t, hit.id()) {
            self.t = t;
            self.hit = Some(Hit { t: t as f32, ..hit });
            self.limit = (t as f32).next_up();
        }
    }
}
