//! What rays hit for sure, in flights, where triangles and rays are rounded from those that are meant.
//!
//! A scene in f64 is traced as a scene in f32 that is a little off, by rays that are a little off. The reject test has bounds for that
//! ([`Blur`]), so nearly always it either leaves out a triangle or knows it to be hit, whatever the rounding. Only the ids of what
//! is hit are told; the caller computes t in f64. As soon as a ray comes to a triangle that is in doubt it is given up, and the caller
//! decides it by [`super::candidates`]. To decide each doubt on the way, as flights in f32 do, would bring the corners in f64
//! into every kernel; a ray in a thousand is in doubt.

use std::marker::PhantomData;

use super::Bvh;
use super::block::{Block, LANES};
use super::filter::Candidates;
use super::flight;
use super::found::{Found, NONE};
use super::isa::{self, Kernel};
use super::place::Blur;
use super::query::Query;
use super::simd::Simd;
use crate::ray::{Hit, Ray};
use crate::trace::nearest::Nearest;

/// What is certain about a ray.
#[derive(Clone, Copy, Debug)]
pub(in crate::trace) enum Certain<'a> {
    /// It hits these triangles and no others; [`Bvh::triangle`] has their names.
    Hits(&'a [u32]),
    /// Nothing.
    Doubt,
}

/// What is wanted of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::trace) enum Wanted {
    /// The nearest hit.
    First,
    /// Any hit.
    Any,
    /// All hits, in no order.
    All,
}

impl Bvh {
    /// Tells `done` of each valid ray what is certain, in no order. For trees over fixed triangles alone.
    pub(in crate::trace) fn certain(
        &self,
        wanted: Wanted,
        rays: &[Ray],
        blur: Blur,
        done: &mut dyn FnMut(usize, Certain<'_>),
    ) {
        match wanted {
            Wanted::First => self.run_certain::<First>(rays, blur, done),
            Wanted::Any => self.run_certain::<Any>(rays, blur, done),
            Wanted::All => self.run_certain::<All>(rays, blur, done),
        }
    }

    fn run_certain<Q: Query>(&self, rays: &[Ray], blur: Blur, done: &mut dyn FnMut(usize, Certain<'_>)) {
        self.with_flight(|flight| {
            isa::dispatch(self.isa, Fly { bvh: self, rays, blur, flight, done, query: PhantomData::<Q> });
        });
    }

    /// The geometry and the primitive that an id names.
    #[inline]
    pub(in crate::trace) fn triangle(&self, id: u32) -> (u32, u32) {
        let triangles = &self.fixed.triangles;
        let (part, primitive) = triangles.leaves().lane(id, &mut None).number();
        (triangles.part(part).geometry, primitive)
    }
}

struct Fly<'a, Q> {
    bvh: &'a Bvh,
    rays: &'a [Ray],
    blur: Blur,
    flight: &'a mut flight::Flight,
    done: &'a mut dyn FnMut(usize, Certain<'_>),
    query: PhantomData<Q>,
}

impl<Q: Query> Kernel for Fly<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, rays, blur, flight, done, .. } = self;
        flight::trace_rounded::<S, Q>(
            flight,
            bvh,
            rays,
            blur,
            #[inline(always)]
            |ray, found| {
                let (noted, is_noted) = ([found.noted], found.noted != NONE);
                let is_open = found.is_in_doubt() && (Q::DOUBTS || !is_noted);
                let hits = if is_noted { &noted[..] } else { found.sure_hits.ids() };
                done(ray, if is_open { Certain::Doubt } else { Certain::Hits(hits) });
            },
        );
    }
}

/// The nearest hit.
enum First {}

/// Any hit.
enum Any {}

/// All hits.
enum All {}

/// The triangles of `candidates`, and a bit for each that is hit for sure.
#[inline(always)]
fn each(index: u32, candidates: &Candidates, mut take: impl FnMut(u32, bool, [f32; 2]) -> bool) {
    let mut open = candidates.lanes;
    while open != 0 {
        let lane = open.trailing_zeros() as usize % LANES;
        open &= open - 1;
        let id = LANES as u32 * index + lane as u32;
        let is_sure = candidates.sure >> lane & 1 != 0;
        if !take(id, is_sure, [candidates.low[lane], candidates.high[lane]]) {
            return;
        }
    }
}

/// What all three say of everything else: the caller never asks for an answer.
macro_rules! query {
    ($name:ident, $any:literal, $take:expr) => {
        impl Query for $name {
            const ANY: bool = $any;
            const DOUBTS: bool = !$any;
            type Answer = ();
            const MISS: () = ();
            #[inline(always)]
            fn answer(_: Option<Hit>) {}
            #[inline(always)]
            fn resume(_: &mut Nearest, _: f64, (): ()) -> bool {
                false
            }
            #[inline(always)]
            fn take(found: &mut Found, _: &Bvh, _: u32, index: u32, _: &Block, candidates: &Candidates, ray: &Ray) {
                let take: fn(&mut Found, u32, bool, [f32; 2], &Ray) -> bool = $take;
                each(
                    index,
                    candidates,
                    #[inline(always)]
                    |id, is_sure, t| take(found, id, is_sure, t, ray),
                );
            }
        }
    };
}

query!(First, false, |found, id, is_sure, t, ray| {
    let is_behind = is_sure && t[0] > found.limit;
    let is_clear = is_behind || is_sure && found.note(id, t, ray.tmin);
    if !is_clear {
        found.sure_hits.doubt();
    }
    is_clear
});

// A doubt matters only if nothing else is hit.
query!(Any, true, |found, id, is_sure, t, ray| {
    let is_hit = is_sure && found.note(id, t, ray.tmin);
    if !is_hit {
        found.sure_hits.doubt();
    }
    !is_hit
});

query!(All, false, |found, id, is_sure, [low, high], ray| {
    let is_outside = is_sure && (high < ray.tmin || ray.tmax < low);
    if is_sure && ray.tmin <= low && high <= ray.tmax {
        found.sure_hits.push(id);
    } else if !is_outside {
        found.sure_hits.doubt();
    }
    !found.is_in_doubt()
});
