//! What rays hit for sure, in flights, where triangles and rays are rounded from those that are meant.
//!
//! A scene in f64 is traced as a scene in f32 that is a little off, by rays that are a little off. The reject test has
//! bounds for that ([`Blur`]), so nearly always it either leaves out a triangle or knows it to be hit, whatever the
//! rounding. Where it does not, the caller has the corners in f64. Where a hit decides how far the ray looks, the
//! caller is asked at once: to give the ray up and walk it again, tried first, took a quarter of the time. Where all
//! hits are wanted, open triangles are told with the sure ones: to fetch corners one by one, while rays wait, took an
//! eighth. Ids are told, and bounds on t; the caller computes t.
//!
//! What no single triangle can tell is left to the caller: which of several hits at nearly the same t is first, who are
//! told together; and how often a ray crosses at an edge, for which it decides the ray by [`super::alone::candidates`].

use std::marker::PhantomData;

use super::Bvh;
use super::block::{Block, LANES};
use super::flight::{self, Decide};
use super::hits::found::{Found, NONE};
use super::hits::listed::Listed;
use super::query::{Query, Verdict};
use super::reject::Blur;
use super::reject::filter::Candidates;
use super::simd::Simd;
use super::simd::isa::{self, Kernel};
use crate::ray::{Hit, Ray};
use crate::trace::nearest::Nearest;

/// What is certain about a ray.
#[derive(Clone, Copy, Debug)]
pub(in crate::trace) enum Certain<'a> {
    /// It hits the `sure` triangles for sure, may hit the `open` ones, and no others that are wanted: one of the sure
    /// ones is the nearest, or any, or they are all. [`Bvh::triangle`] has their names, `t` bounds on the t of each
    /// that is sure, but where any will do. None is open but where all are wanted.
    Hits { sure: &'a [u32], t: &'a [[f32; 2]], open: &'a [u32] },
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
        decide: Decide<'_>,
        done: &mut dyn FnMut(usize, Certain<'_>),
    ) {
        match wanted {
            Wanted::First => self.run_certain::<First>(rays, blur, decide, done),
            Wanted::Any => self.run_certain::<Any>(rays, blur, decide, done),
            Wanted::All => self.run_certain::<All>(rays, blur, decide, done),
        }
    }

    fn run_certain<Q: Query>(
        &self,
        rays: &[Ray],
        blur: Blur,
        decide: Decide<'_>,
        done: &mut dyn FnMut(usize, Certain<'_>),
    ) {
        self.with_flight(|flight| {
            isa::dispatch_narrow(
                self.isa,
                Fly { bvh: self, rays, blur, flight, decide, done, query: PhantomData::<Q> },
            );
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
    decide: Decide<'a>,
    done: &'a mut dyn FnMut(usize, Certain<'_>),
    query: PhantomData<Q>,
}

impl<Q: Query> Kernel for Fly<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, rays, blur, flight, decide, done, .. } = self;
        flight::trace_rounded::<S, Q>(
            flight,
            bvh,
            rays,
            blur,
            decide,
            #[inline(always)]
            |ray, found, listed| {
                let (noted, is_noted) = ([found.noted], found.noted != NONE);
                let is_open = listed.is_in_doubt() && (Q::DOUBTS || !is_noted);
                let (sure, t) = if is_noted { (&noted[..], &[][..]) } else { (listed.sure(), listed.t()) };
                done(ray, if is_open { Certain::Doubt } else { Certain::Hits { sure, t, open: listed.open() } });
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

/// Calls `take` with the id of each triangle of `candidates` that is hit, with bounds on its t, or about which `decide`
/// leaves a doubt, too; until it says that this is enough.
#[inline(always)]
fn each(
    index: u32,
    candidates: &Candidates,
    decide: impl Fn(usize) -> Verdict,
    mut take: impl FnMut(u32, Option<[f32; 2]>) -> bool,
) {
    let mut open = candidates.lanes;
    while open != 0 {
        let lane = open.trailing_zeros() as usize % LANES;
        open &= open - 1;
        let is_sure = candidates.sure >> lane & 1 != 0;
        let t = if is_sure {
            Some([candidates.low[lane], candidates.high[lane]])
        } else {
            match decide(lane) {
                Verdict::Miss => continue,
                Verdict::Hit(t) => Some(t),
                Verdict::Doubt => None,
            }
        };
        if !take(LANES as u32 * index + lane as u32, t) {
            return;
        }
    }
}

/// What all three say of everything else: the caller never asks for an answer.
macro_rules! query {
    ($name:ident, any: $any:literal, all: $all:literal, $take:expr) => {
        impl Query for $name {
            const ANY: bool = $any;
            const DOUBTS: bool = !$any;
            const LISTS: bool = true;
            const IN_ORDER: bool = !$all;
            type Answer = ();
            const MISS: () = ();
            #[inline(always)]
            fn answer(_: Option<Hit>) {}
            #[inline(always)]
            fn resume(_: &mut Nearest, _: f64, (): ()) -> bool {
                false
            }
            #[inline(always)]
            fn take(
                found: &mut Found,
                listed: &mut Listed,
                _: &Bvh,
                _: u32,
                index: u32,
                _: &Block,
                candidates: &Candidates,
                ray: &Ray,
                decide: impl Fn(usize) -> Verdict,
            ) {
                let take: fn(&mut Found, &mut Listed, u32, Option<[f32; 2]>, &Ray) -> bool = $take;
                each(
                    index,
                    candidates,
                    #[inline(always)]
                    |lane| if $all { Verdict::Doubt } else { decide(lane) },
                    #[inline(always)]
                    |id, t| take(found, listed, id, t, ray),
                );
            }
        }
    };
}

query!(First, any: false, all: false, |found, listed, id, t, ray| {
    let is_clear = t.is_some_and(|t| found.list(listed, id, t, ray));
    if !is_clear {
        listed.doubt();
    }
    is_clear
});

// A doubt matters only if nothing else is hit.
query!(Any, any: true, all: false, |found, listed, id, t, ray| {
    let is_hit = t.is_some_and(|t| found.note(id, t, ray.tmin));
    if !is_hit {
        listed.doubt();
    }
    !is_hit
});

query!(All, any: false, all: true, |_, listed, id, t, ray| {
    match t {
        Some([low, high]) if ray.tmin <= low && high <= ray.tmax => listed.push(id, [low, high]),
        Some([low, high]) if high < ray.tmin || ray.tmax < low => {}
        _ => listed.push_open(id),
    }
    !listed.is_in_doubt()
});
