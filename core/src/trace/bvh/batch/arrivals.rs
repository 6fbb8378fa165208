//! Rays that have gone through the triangles by themselves, in flight or alone: what most of them hit is only noted,
//! and computed for four at a time.

use std::hint::select_unpredictable;

use crate::ray::{Hit, Ray};
use crate::trace::bvh::Bvh;
use crate::trace::bvh::hits::found::{Found, NONE};
use crate::trace::bvh::hits::noted::Rays;
use crate::trace::bvh::levels::placements::FIXED;
use crate::trace::bvh::query::{Query, SOMETHING};
use crate::trace::bvh::simd::{RAYS, Simd};

/// Rays that have arrived, whose hits are computed four at a time.
pub(super) struct Arrivals<'a, Q: Query> {
    answers: Answers<'a, Q>,
    fixed: Pending,
    placed: Pending,
}

impl<'a, Q: Query> Arrivals<'a, Q> {
    /// None yet. An answer goes where its ray's is, and t in f64, of the last 64 of them, into `t`: that of ray i in
    /// the place of `first` + i.
    #[inline(always)]
    pub fn new(
        bvh: &'a Bvh,
        rays: &'a [Ray],
        answers: &'a mut [Q::Answer],
        first: usize,
        t: &'a mut [f64; RAYS],
    ) -> Self {
        let answers = Answers { bvh, rays, answers, first, t };
        Self { answers, fixed: Pending::NONE, placed: Pending::NONE }
    }

    /// What ray `i` has found.
    #[inline(always)]
    pub fn take<S: Simd>(&mut self, i: usize, found: &Found) {
        let Self { answers, fixed, placed } = self;
        if Q::ANY {
            let answer = &mut answers.answers[i];
            *answer = select_unpredictable(found.is_noted(), Q::answer(Some(SOMETHING)), *answer);
        } else {
            let pending = if found.place == FIXED { fixed } else { placed };
            if pending.push(i, found) {
                answers.compute::<S>(pending);
            }
        }
        if found.has_only_computed() {
            let nearest = found.nearest(answers.bvh, &answers.rays[i]);
            answers.take(i, nearest.t(), nearest.hit());
        }
    }

    /// Those that are no four.
    #[inline(always)]
    pub fn finish<S: Simd>(&mut self) {
        let Self { answers, fixed, placed } = self;
        for pending in [fixed, placed] {
            if pending.count > 0 {
                pending.fill_up();
                answers.compute::<S>(pending);
            }
        }
    }
}

/// Where answers go.
struct Answers<'a, Q: Query> {
    bvh: &'a Bvh,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
    first: usize,
    t: &'a mut [f64; RAYS],
}

impl<Q: Query> Answers<'_, Q> {
    #[inline(always)]
    fn take(&mut self, ray: usize, t: f64, hit: Option<Hit>) {
        (self.answers[ray], self.t[(self.first + ray) % RAYS]) = (Q::answer(hit), t);
    }

    /// Answers for four rays, of which all hits are fixed, or all are placed.
    #[inline(always)]
    fn compute<S: Simd>(&mut self, pending: &mut Pending) {
        let Pending { rays: [a, b, c, d], ids, places, count } = pending;
        let each = [&self.rays[*a], &self.rays[*b], &self.rays[*c], &self.rays[*d]];
        let rays = Rays::new::<S>(each);
        let (t, hits) = if places[0] == FIXED {
            let four = self.bvh.fixed.triangles.hits::<S>(&rays, *ids);
            (four.quad.t, [Some(four.hit(0)), Some(four.hit(1)), Some(four.hit(2)), Some(four.hit(3))])
        } else {
            self.bvh.placed_hits::<S>(each, 0b1111, &rays, *ids, *places)
        };
        *count = 0;
        for ((ray, t), hit) in [*a, *b, *c, *d].into_iter().zip(t).zip(hits) {
            self.take(ray, t, hit);
        }
    }
}

/// Four rays, by number, whose hits are noted.
struct Pending {
    rays: [usize; 4],
    ids: [u32; 4],
    places: [u32; 4],
    count: usize,
}

impl Pending {
    const NONE: Self = Self { rays: [0; 4], ids: [NONE; 4], places: [FIXED; 4], count: 0 };

    /// One more, if a hit of it is noted: told without a branch, for whether a ray hits anything is anyone's guess.
    /// Whether they are four now.
    #[inline(always)]
    fn push(&mut self, ray: usize, found: &Found) -> bool {
        let i = self.count % 4;
        (self.rays[i], self.ids[i], self.places[i]) = (ray, found.noted, found.place);
        self.count += usize::from(found.is_noted());
        self.count == 4
    }

    /// Those that are missing are the first: that is computed twice, or again.
    fn fill_up(&mut self) {
        for i in self.count..4 {
            (self.rays[i], self.ids[i], self.places[i]) = (self.rays[0], self.ids[0], self.places[0]);
        }
    }
}
