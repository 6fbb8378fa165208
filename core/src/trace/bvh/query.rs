//! What a ray asks, as types: kernels are compiled once for each. The two questions of every tracer are here, those in
//! f64 in [`certain`](super::certain).

use super::Bvh;
use super::block::Block;
use super::hits::found::Found;
use super::hits::listed::Listed;
use super::reject::filter::Candidates;
use crate::ray::{Hit, Ray};
use crate::trace::nearest::Nearest;

/// A question and its answer.
pub(super) trait Query {
    /// Whether any hit will do.
    const ANY: bool;
    /// Whether a ray that is in doubt stops there, and is left to the caller.
    const DOUBTS: bool = false;
    /// Whether it lists hits or doubts for who asked for the flight.
    const LISTS: bool = false;
    /// Whether what is near is better visited before what is far.
    const IN_ORDER: bool = true;
    type Answer: Copy;
    const MISS: Self::Answer;
    fn answer(hit: Option<Hit>) -> Self::Answer;
    /// Whether no more is wanted of a ray with this answer.
    #[inline(always)]
    fn is_enough(_: Self::Answer) -> bool {
        false
    }
    /// What is found so far, where a hit of another kind of primitive had the exact `t`; none where no more is wanted.
    fn resume(nearest: &mut Nearest, t: f64, answer: Self::Answer) -> bool;
    /// Takes the candidates of block `index` of the triangles at `place`; those in doubt may be decided by, or listed
    /// for, who asked for the flight.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // What a step of a flight has.
    fn take(
        found: &mut Found,
        _listed: &mut Listed,
        bvh: &Bvh,
        place: u32,
        index: u32,
        block: &Block,
        candidates: &Candidates,
        ray: &Ray,
        _decide: impl Fn(usize) -> Verdict,
    ) where
        Self: Sized,
    {
        found.offer::<Self>(bvh, place, index, block, candidates, ray);
    }
}

/// Whether a ray hits a triangle, as who asked for the flight says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::trace) enum Verdict {
    /// It does not, or not within its range.
    Miss,
    /// It does, at a t between these.
    Hit([f32; 2]),
    /// Not by this triangle alone can it be said.
    Doubt,
}

/// The nearest hit.
pub(super) enum Closest {}

/// Whether there is any hit.
pub(super) enum Occluded {}

impl Query for Closest {
    const ANY: bool = false;
    type Answer = Option<Hit>;
    const MISS: Option<Hit> = None;
    #[inline(always)]
    fn answer(hit: Option<Hit>) -> Option<Hit> {
        hit
    }
    #[inline(always)]
    fn resume(nearest: &mut Nearest, t: f64, answer: Option<Hit>) -> bool {
        if let Some(hit) = answer {
            nearest.resume(t, hit);
        }
        true
    }
}

impl Query for Occluded {
    const ANY: bool = true;
    type Answer = bool;
    const MISS: bool = false;
    #[inline(always)]
    fn answer(hit: Option<Hit>) -> bool {
        hit.is_some()
    }
    #[inline(always)]
    fn is_enough(answer: bool) -> bool {
        answer
    }
    #[inline(always)]
    fn resume(_: &mut Nearest, _: f64, answer: bool) -> bool {
        !answer
    }
}

/// That there is a hit, where nobody asks which, or where it is not computed yet.
pub(super) const SOMETHING: Hit = Hit { t: f32::NAN, u: f32::NAN, v: f32::NAN, primitive: 0, geometry: 0, instance: 0 };
