//! Many rays: among triangles in bundles where they are bundles, else in flight or alone, and hits computed several at
//! a time; then one by one among everything else, of which there is little.

pub(super) mod arrivals;

use std::cell::Cell;

use self::arrivals::Arrivals;
use super::alone::Doubted;
use super::flight::{self, Flight, Objects};
use super::levels::placements::walk_over;
use super::query::{Closest, Query};
use super::simd::isa::{self, Kernel};
use super::simd::{RAYS, Simd};
use super::walk::Visit;
use super::{Bvh, bundle};
use crate::ray::Ray;
use crate::trace::Batch;
use crate::trace::nearest::Nearest;
use crate::trace::spread::Spread;

/// What a thread needs while it traces; kept from batch to batch, since clearing it costs as much as tracing some
/// dozens of rays.
struct Workspace {
    singles: Singles,
    bundles: bundle::Scratch,
}

/// For rays that make no bundle: those in flight, or what one that walks alone has hit of which there was doubt.
struct Singles {
    flight: Flight,
    doubted: Doubted,
}

/// Placed objects that a bundle of shadow rays may enter before the rest of its batch goes apart: each costs a bundle
/// as much as dozens of rays, most of which pass it by or are in shadow already. Of 2,500 placements a bundle enters
/// two or three, and is faster by a quarter; it takes many more, far away, to get here. Bundles of closest hits are
/// faster with any number.
const MAX_PLACES: u32 = 10;

/// Visits of single rays to placed objects that are kept waiting until they are traced together: enough for a flight.
const DEFERRED: usize = 64;

thread_local! {
    /// Taken while a batch is traced: a batch within a batch gets one of its own.
    static WORKSPACE: Cell<Option<Box<Workspace>>> = const { Cell::new(None) };
}

/// Gets this thread ready for batches: the first use of what it keeps between them takes a lock of the dynamic loader,
/// which is held as long as a library is being loaded.
pub fn prepare_thread() {
    WORKSPACE.with(|_| ());
}

impl Workspace {
    fn new() -> Box<Self> {
        let singles = Singles { flight: Flight::new(), doubted: None };
        Box::new(Self { singles, bundles: bundle::Scratch::new() })
    }
}

impl Bvh {
    /// Answers all rays.
    ///
    /// # Panics
    /// Unless there is one answer a ray.
    pub(super) fn run_batch<Q: Query>(&self, rays: &[Ray], answers: &mut [Q::Answer], batch: Batch) {
        assert_eq!(rays.len(), answers.len(), "one answer a ray");
        let mut workspace = WORKSPACE.take().unwrap_or_else(Workspace::new);
        isa::dispatch(self.isa, BatchKernel::<Q> { bvh: self, rays, answers, batch, workspace: &mut workspace });
        WORKSPACE.set(Some(workspace));
    }

    /// With room for a flight, that of the thread.
    pub(super) fn with_flight(&self, fly: impl FnOnce(&mut Flight)) {
        let mut workspace = WORKSPACE.take().unwrap_or_else(Workspace::new);
        fly(&mut workspace.singles.flight);
        WORKSPACE.set(Some(workspace));
    }

    /// Shapes of placed objects, for one ray.
    #[inline(always)]
    fn enter_placements<S: Simd, Q: Query>(&self, ray: &Ray, nearest: &mut Nearest) {
        if !self.placements.has_shapes() || Q::ANY && nearest.hit().is_some() {
            return;
        }
        walk_over::<S, Q>(
            self.placements.tree(),
            ray,
            self.placements.spread(),
            nearest.limit(),
            #[inline(always)]
            |number| {
                let place = self.placements.at(number);
                let level = &self.objects[place.object as usize];
                level.trace_placed_shapes::<S, Q>(ray, place, nearest);
                Visit::after::<Q>(nearest)
            },
        );
    }

    /// Everything that moves, for one ray.
    #[inline(always)]
    fn enter_moving<S: Simd, Q: Query>(&self, ray: &Ray, nearest: &mut Nearest) {
        if self.moving.is_empty() || Q::ANY && nearest.hit().is_some() {
            return;
        }
        self.moving.walk::<S, Q>(
            &self.objects,
            ray,
            nearest.limit(),
            #[inline(always)]
            |level, place| {
                level.trace_triangles::<S, Q>(ray, Some(place), nearest);
                level.trace_placed_shapes::<S, Q>(ray, place, nearest);
                Visit::after::<Q>(nearest)
            },
        );
    }

    fn has_triangles(&self) -> bool {
        !self.fixed.triangles.tree().is_empty() || self.placements.has_triangles()
    }

    /// Whether there is nothing else, and all of it stands still.
    fn has_only_triangles(&self) -> bool {
        let has_shapes = !self.fixed.shapes.tree().is_empty() || self.placements.has_shapes();
        !has_shapes && self.moving.is_empty() && self.unbounded.is_empty()
    }

    /// Many rays: in bundles of 64 where they are bundles, else apart.
    #[inline(always)]
    fn trace<S: Simd, Q: Query>(
        &self,
        workspace: &mut Workspace,
        rays: &[Ray],
        answers: &mut [Q::Answer],
        coherent: bool,
    ) {
        let Workspace { singles, bundles } = workspace;
        let is_all = self.has_only_triangles();
        let mut in_bundles = coherent && self.has_triangles();
        let mut objects = None;
        let mut start = 0;
        while start < rays.len() {
            let left = rays.len() - start;
            let chunk = start..start + if in_bundles || !is_all { RAYS.min(left) } else { left };
            start = chunk.end;
            let (first, count) = (chunk.start, chunk.len());
            let traced = if in_bundles {
                bundle::trace::<S, Q>(bundles, self, first, &rays[chunk.clone()], &mut answers[chunk.clone()])
            } else {
                0
            };
            // The others, in runs: all of them, where there are no bundles.
            let mut open = if in_bundles { !traced & u64::MAX >> (RAYS - count) } else { 1 };
            while open != 0 {
                let from = open.trailing_zeros() as usize;
                let end = if in_bundles { from + (open >> from).trailing_ones() as usize } else { count };
                let run = first + from..first + end;
                let (rays, answers, t) = (&rays[run.clone()], &mut answers[run], &mut bundles.t);
                Unbundled::<Q> { bvh: self, singles, first: from, rays, answers, t }.trace::<S>();
                open &= u64::MAX.checked_shl(end as u32).unwrap_or(0);
            }
            let is_last = start == rays.len();
            let deferred = &mut bundles.deferred;
            if Q::ANY && !deferred.is_empty() && (is_last || deferred.len() >= DEFERRED) {
                let objects = match &objects {
                    Some(objects) => objects,
                    None => objects.insert(Objects::new::<S>(self)),
                };
                flight::trace_deferred::<S, Q>(&mut singles.flight, self, objects, deferred, rays, answers);
                deferred.clear();
            }
            if !is_all {
                let (rays, answers) = (&rays[chunk.clone()], &mut answers[chunk]);
                S::apart(Others::<Q> { bvh: self, rays, answers, t: &bundles.t });
            }
            in_bundles &= !Q::ANY || bundles.entered <= MAX_PLACES;
        }
    }
}

/// The nearest triangle that stands still, for one ray all by itself, and what its t follows from.
struct TrianglesAgain<'a> {
    bvh: &'a Bvh,
    ray: &'a Ray,
}

impl Kernel for TrianglesAgain<'_> {
    type Output = Nearest;

    #[inline(always)]
    fn run<S: Simd>(self) -> Nearest {
        let Self { bvh, ray } = self;
        let mut nearest = Nearest::new(ray);
        bvh.fixed.trace_triangles::<S, Closest>(ray, None, &mut nearest);
        if bvh.placements.has_triangles() {
            walk_over::<S, Closest>(
                bvh.placements.tree(),
                ray,
                &Spread::NONE,
                nearest.limit(),
                #[inline(always)]
                |number| {
                    let place = bvh.placements.at(number);
                    let level = &bvh.objects[place.object as usize];
                    level.trace_triangles::<S, Closest>(ray, Some(place), &mut nearest);
                    Visit::after::<Closest>(&nearest)
                },
            );
        }
        nearest
    }
}

/// Rays among triangles that make no bundle; hits are computed several at a time. Also tells t in f64, for the last 64
/// of them: that of ray i in the place of `first` + i.
struct Unbundled<'a, Q: Query> {
    bvh: &'a Bvh,
    singles: &'a mut Singles,
    first: usize,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
    t: &'a mut [f64; RAYS],
}

impl<Q: Query> Unbundled<'_, Q> {
    #[inline(always)]
    fn trace<S: Simd>(self) {
        self.answers.fill(Q::MISS);
        if !self.bvh.has_triangles() {
            return;
        }
        if !S::FLIES || self.bvh.travel_alone(self.rays.len()) {
            S::apart(OneByOne(self));
        } else {
            S::apart_narrow(InFlight(self));
        }
    }
}

/// One after the other.
struct OneByOne<'a, Q: Query>(Unbundled<'a, Q>);

impl<Q: Query> Kernel for OneByOne<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Unbundled { bvh, singles, first, rays, answers, t } = self.0;
        let mut arrivals = Arrivals::<Q>::new(bvh, rays, answers, first, t);
        bvh.walk_one_by_one::<S, Q>(
            &mut singles.doubted,
            rays,
            #[inline(always)]
            |i, found| arrivals.take::<S>(i, found),
        );
        arrivals.finish::<S>();
    }
}

/// Together.
struct InFlight<'a, Q: Query>(Unbundled<'a, Q>);

impl<Q: Query> Kernel for InFlight<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Unbundled { bvh, singles, first, rays, answers, t } = self.0;
        let mut arrivals = Arrivals::<Q>::new(bvh, rays, answers, first, t);
        flight::trace::<S, Q>(
            &mut singles.flight,
            bvh,
            rays,
            #[inline(always)]
            |i, found, _| arrivals.take::<S>(i, found),
        );
        arrivals.finish::<S>();
    }
}

/// What there is besides triangles that stand still, for rays that have `answers`, with t in f64, among these.
struct Others<'a, Q: Query> {
    bvh: &'a Bvh,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
    t: &'a [f64; RAYS],
}

impl<Q: Query> Kernel for Others<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, rays, answers, t } = self;
        for ((ray, answer), &t) in rays.iter().zip(answers).zip(t).filter(|((ray, _), _)| ray.is_valid()) {
            let mut nearest = Nearest::new(ray);
            if !Q::resume(&mut nearest, t, *answer) {
                continue;
            }
            loop {
                bvh.unbounded.offer(ray, &mut nearest);
                bvh.fixed.trace_shapes::<S, Q>(ray, ray, None, &mut nearest);
                bvh.enter_placements::<S, Q>(ray, &mut nearest);
                bvh.enter_moving::<S, Q>(ray, &mut nearest);
                if !nearest.is_open() {
                    break;
                }
                nearest = S::apart(TrianglesAgain { bvh, ray });
            }
            *answer = Q::answer(nearest.hit());
        }
    }
}

/// A batch, for one instruction set at a time.
struct BatchKernel<'a, Q: Query> {
    bvh: &'a Bvh,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
    batch: Batch,
    workspace: &'a mut Workspace,
}

impl<Q: Query> Kernel for BatchKernel<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, rays, answers, batch, workspace } = self;
        bvh.trace::<S, Q>(workspace, rays, answers, batch.coherent);
    }
}
