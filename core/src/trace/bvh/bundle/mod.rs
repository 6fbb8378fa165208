//! A bundle of up to 64 rays against a tree at once: the fastest way for camera rays, and for shadow rays of a light.
//!
//! Its rays have a point in common, or a direction ([`pencil`]). What follows is of those with a point, and so is what
//! each file says; [`parallel`] says what is otherwise with a direction.
//!
//! - **Nodes**: eight boxes are tested against the rectangle of all slopes, an interval test that rejects for all rays
//!   (Wald, Boulos, Shirley 2007, *Ray tracing deformable scenes using dynamic bounding volume hierarchies*). What
//!   remains is tested against all rays; where they are three or fewer, each of them against all boxes ([`way`]).
//! - **Triangles**: with a common origin, the edge function of a ray is the scalar product of its direction with a
//!   normal that belongs to the edge. Eight triangles are rejected at once by the rectangle of slopes, and by rows of
//!   rays; of the others each group of rays takes four scalar products ([`meeting`]). Leaves that few rays enter are
//!   tested ray by ray instead, against eight triangles at once ([`single`]).
//! - **Decisions**: edge functions and t' carry bounds on their rounding errors. Where these leave no doubt, a hit is
//!   only noted; where they do, it is decided by [`triangle::intersect`](crate::shape::triangle::intersect). In the end
//!   t, u and v of what was noted are computed four rays at a time
//!   ([`TriangleTree::hits`](super::levels::triangles::TriangleTree::hits)), with the bits that a single ray would get.
//! - **Placed objects**: a bundle with a point in common is one in their coordinates, too. It is brought there when it
//!   comes to a placement, and goes on as in the world. Where it crosses an octant there, which in the world would
//!   divide it, its rays go on one by one ([`alone`]). Shadow rays, and those that are much farther apart than
//!   triangles are wide, wait there for those of other bundles instead, and fly ([`super::flight`]).

mod alone;
mod edges;
mod footprint;
mod found;
mod meeting;
mod octants;
mod parallel;
mod pencil;
mod placed;
mod range;
mod rays;
mod rows;
mod single;
mod slab;
mod walk;
mod way;

use std::marker::PhantomData;

use super::Bvh;
use super::build::MAX_DEPTH;
use super::flight::DeferredRays;
use super::levels::placements::FIXED;
use super::node::WIDTH;
use super::query::{Query, SOMETHING};
use super::simd::isa::Kernel;
use super::simd::{RAYS, Simd};
use crate::ray::Ray;
use found::{BundleFound, Finish};
use octants::{Octants, Part};
use parallel::{FillParallel, Parallel, may_be_parallel};
use pencil::{Central, Pencil};
use placed::Tour;
use range::RayIntervals;
use rays::{Bundle, Fill, Fit};
use walk::{Walk, few};
use way::{Entry, Way};

/// Working memory, made once a batch.
pub(super) struct Scratch {
    one: One,
    /// t of the closest hits of the last bundle, where there are any.
    pub t: [f64; RAYS],
    /// How many placed objects the last bundles entered.
    pub entered: u32,
    /// Rays that look for any hit, and are still to go through placed objects each by itself.
    pub deferred: Vec<DeferredRays>,
    /// Rays of one octant.
    part: Part,
}

/// As many of a placed object's triangles fit between shadow rays that go through it each by itself. With 1 to 20
/// shadow rays of 2,500 placements take as long. Closest hits gain nothing by going alone, however many there are.
const GRAINS: f32 = 20.0;

/// Places on a stack.
const STACK: usize = MAX_DEPTH * (WIDTH - 1) + WIDTH;

/// One bundle and its way.
struct One {
    /// In the tree of placements, and in one of triangles.
    upper: [Entry; STACK],
    stack: [Entry; STACK],
    /// In the world, and in the coordinates of a placed object.
    bundle: Bundle,
    local: Bundle,
    range: RayIntervals,
    found: BundleFound,
}

impl Scratch {
    pub fn new() -> Self {
        let found = BundleFound::new();
        let stack = [Entry::root(!0); STACK];
        let (bundle, local, range) = (Bundle::new(), Bundle::new(), RayIntervals::new());
        let one = One { upper: stack, stack, bundle, local, range, found };
        Self { one, t: [0.0; RAYS], entered: 0, deferred: Vec::new(), part: Part::new() }
    }
}

/// Traces up to 64 rays that start in one point (or, for any hit, that end in one), or run the same way, through all
/// triangles, into `answers` of the same length and, for closest hits, `scratch.t`. A bit is set in the result for
/// every ray that was traced; the others have too little in common. Of any hit some may have to be asked of placed
/// objects yet: `scratch.deferred`, among whom ray 0 is called `first`.
#[inline(always)]
pub(super) fn trace<S: Simd, Q: Query>(
    scratch: &mut Scratch,
    bvh: &Bvh,
    first: usize,
    rays: &[Ray],
    answers: &mut [Q::Answer],
) -> u64 {
    let Scratch { one, t, entered, deferred, part } = scratch;
    *entered = 0;
    // Of a part; filled only where there is one.
    let mut parted = None;
    // All of them, if they fill a bundle. If they do not, or make none, those of one octant after the other. In one
    // loop, so that what is called here, of which most of the kernel consists, is compiled once.
    let mut octants = if rays.len() == RAYS { None } else { Some(Octants::new(rays)) };
    let mut done = 0;
    loop {
        let members = match &mut octants {
            None => u64::MAX,
            Some(octants) => match octants.next() {
                Some(members) => members,
                None => return done,
            },
        };
        let whole = (<&[Ray; RAYS]>::try_from(rays), <&mut [Q::Answer; RAYS]>::try_from(&mut *answers));
        let (group, count, group_answers, group_t) = match (whole, &octants) {
            ((Ok(rays), Ok(answers)), None) => (rays, RAYS, answers, &mut *t),
            _ => {
                part.gather(rays, members);
                let (answers, t) = parted.insert(([Q::MISS; RAYS], [0.0; RAYS]));
                (&part.rays, part.count, answers, t)
            }
        };
        let (bundle, range) = (&mut one.bundle, &mut one.range);
        let is_parallel = may_be_parallel(group);
        let fit = if is_parallel {
            S::apart(FillParallel { bundle, rays: group, range })
        } else {
            S::apart(Fill::<Q> { bundle, rays: group, range, query: PhantomData })
        };
        let before = deferred.len();
        let those = Members { rays: group, count };
        let is_traced = fit == Fit::Whole
            && if is_parallel {
                let (answers, t) = (group_answers, group_t);
                S::apart(OfParallel::<Q> { one, bvh, rays: those, answers, t, entered, deferred })
            } else {
                one.trace::<S, Q, Central>(bvh, &those, group_answers, group_t, entered, deferred)
            };
        // Until here their bits are of the part, if there is one.
        for some in &mut deferred[before..] {
            some.first = first;
            if octants.is_some() {
                some.rays = part.members(some.rays);
            }
        }
        if is_traced {
            done |= members;
        }
        if let Some((part_answers, part_t)) = &parted {
            if is_traced {
                part.scatter(part_answers, answers);
                part.scatter(part_t, t);
            }
        } else if fit == Fit::Parts {
            octants = Some(Octants::new(rays));
        } else {
            return done;
        }
    }
}

/// Rays of a bundle, of which the first `count` matter.
struct Members<'a> {
    rays: &'a [Ray; RAYS],
    count: usize,
}

/// A parallel bundle traced, in a function of its own: bundles with a common point are what the kernel is for.
struct OfParallel<'a, Q: Query> {
    one: &'a mut One,
    bvh: &'a Bvh,
    rays: Members<'a>,
    answers: &'a mut [Q::Answer; RAYS],
    t: &'a mut [f64; RAYS],
    entered: &'a mut u32,
    deferred: &'a mut Vec<DeferredRays>,
}

impl<Q: Query> Kernel for OfParallel<'_, Q> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { one, bvh, rays, answers, t, entered, deferred } = self;
        one.trace::<S, Q, Parallel>(bvh, &rays, answers, t, entered, deferred)
    }
}

impl One {
    /// Traces the bundle, which is made of these rays; the first `count` of them matter. False, and nothing done, where
    /// it is too steep for a tree.
    #[inline(always)]
    fn trace<S: Simd, Q: Query, P: Pencil>(
        &mut self,
        bvh: &Bvh,
        &Members { rays, count }: &Members<'_>,
        answers: &mut [Q::Answer; RAYS],
        t: &mut [f64; RAYS],
        entered: &mut u32,
        deferred: &mut Vec<DeferredRays>,
    ) -> bool {
        let Self { upper, stack, bundle, local, range, found } = self;
        let Some(mut tour) = Tour::<P>::new(bvh, bundle, count, upper) else { return false };
        found.start();
        while let Some((place, seeing, near)) = tour.next::<S>(range) {
            let (tree, _) = bvh.triangles_at(place);
            if tree.tree().is_empty() {
                continue;
            }
            let seeing = if Q::ANY { seeing & !range.done::<S>() } else { seeing };
            if Q::ANY && seeing == 0 {
                continue;
            }
            let is_apart =
                |place: u32| P::IS_PARALLEL || bvh.placements.at(place).grain * GRAINS < bundle.grain(near, count);
            if Q::ANY && place != FIXED && is_apart(place) {
                deferred.push(DeferredRays { place, first: 0, rays: seeing });
                continue;
            }
            *entered += u32::from(place != FIXED);
            let is_bundle =
                place == FIXED || !P::IS_PARALLEL && local.place::<S>(bundle, bvh.placements.at(place), range);
            let bundle = if place == FIXED { &*bundle } else { &*local };
            let reach = tree.tree().reach();
            let Some(slab) = (if is_bundle { P::slab(bundle, reach) } else { None }) else {
                if Q::ANY {
                    deferred.push(DeferredRays { place, first: 0, rays: seeing });
                } else {
                    alone::trace::<S>(bvh, place, rays, seeing & !range.done::<S>(), range, found);
                }
                continue;
            };
            let way = Way::<P>::new(bundle, slab, count);
            let few = few::<P>(bundle, reach);
            let walk = Walk { bvh, place, tree, rays, bundle, found, few, query: PhantomData::<(Q, P)> };
            walk.run::<S>(stack, way, seeing);
            if Q::ANY || tour.has_placements() {
                range.shorten::<S, P>(bundle, &found.sure, &found.limit);
            }
        }
        if Q::ANY {
            for (answer, limit) in answers.iter_mut().zip(&range.limit.0) {
                *answer = Q::answer((*limit < 0.0).then_some(SOMETHING));
            }
        } else {
            let pencil = PhantomData::<P>;
            S::apart(Finish::<Q, P> { bvh, found, bundle, rays, count, answers, t, pencil });
        }
        true
    }
}
