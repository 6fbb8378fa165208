//! The best hit so far, and the rule by which a better one replaces it.

use std::cmp::Ordering;

use crate::ray::{Hit, Ray};
use crate::shape::distance::{Distance, Support};

/// The nearest hit found so far. What is nearer is decided exactly ([`Distance::order`]) and ties by ids, so that the
/// outcome does not depend on the order of the offers.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    distance: Distance,
    limit: f32,
    hit: Option<Hit>,
    is_open: bool,
}

impl Nearest {
    /// Nothing, within no range.
    pub const NONE: Self = Self { distance: Distance::itself(f64::INFINITY), limit: 0.0, hit: None, is_open: false };

    /// Nothing yet, within the ray's range.
    pub fn new(ray: &Ray) -> Self {
        // One step on: t is rounded to f32 before it is held against tmax.
        Self { limit: ray.tmax.next_up(), ..Self::NONE }
    }

    /// The farthest t, in f32 and rounded up, that could still be better.
    #[inline]
    pub fn limit(&self) -> f32 {
        self.limit
    }

    /// t of the hit; infinite for none.
    #[inline]
    pub fn t(&self) -> f64 {
        self.distance.t
    }

    /// What was found.
    #[inline]
    pub fn hit(&self) -> Option<Hit> {
        self.hit
    }

    /// Whether an order could not be told, since a t was offered [by itself](Support::Unknown): then all must be
    /// offered again with what their t follow from.
    #[inline]
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// Whether a hit of `ray` with this [id](Hit::id) is nearer, or as near with a lower id.
    #[inline]
    pub fn takes(&mut self, ray: &Ray, distance: &Distance, id: (u32, u32, u32)) -> bool {
        let Some(best) = self.hit else { return true };
        let order = if id == best.id() {
            // The same primitive again, or its other side.
            distance.t.total_cmp(&self.distance.t)
        } else {
            distance.order(&self.distance, ray).unwrap_or_else(|| {
                self.is_open = true;
                distance.t.total_cmp(&self.distance.t)
            })
        };
        order.then_with(|| id.cmp(&best.id())) == Ordering::Less
    }

    /// Takes a hit. `hit.t` is set from the distance.
    #[inline]
    pub fn take(&mut self, distance: Distance, hit: Hit) {
        let t = distance.t as f32;
        self.distance = distance;
        self.hit = Some(Hit { t, ..hit });
        self.limit = t.next_up();
    }

    /// Takes a hit of `ray` if it is better. `hit.t` is set from the distance.
    #[inline]
    pub fn offer(&mut self, ray: &Ray, distance: Distance, hit: Hit) {
        if self.takes(ray, &distance, hit.id()) {
            self.take(distance, hit);
        }
    }

    /// Begins with a hit of which nothing but t is known here.
    #[inline]
    pub fn resume(&mut self, t: f64, hit: Hit) {
        self.take(Distance { t, support: Support::Unknown }, hit);
    }
}
