//! Many rays: in bundles where they are bundles, else one by one, made ready and computed several at a time.

use std::cell::Cell;

use super::flight::{self, Flight};
use super::found::NONE;
use super::level::Through;
use super::quad::widen;
use super::query::{Query, SOMETHING};
use super::simd::Simd;
use super::slab::SlabRay;
use super::walk::{self, Stack, Visit};
use super::{Bvh, bundle, isa, tile};
use crate::ray::Ray;
use crate::trace::Batch;
use crate::trace::nearest::Nearest;

/// What a thread needs while it traces; kept from batch to batch, since clearing it costs as much as tracing some dozens of
/// rays.
struct Workspace {
    stacks: Stacks,
    flight: Flight,
    tile: tile::Scratch,
}

/// One stack for the placements, one for what is below them.
struct Stacks {
    upper: Stack,
    level: Stack,
}

thread_local! {
    /// Taken while a batch is traced: a batch within a batch gets one of its own.
    static WORKSPACE: Cell<Option<Box<Workspace>>> = const { Cell::new(None) };
}

impl Workspace {
    fn new() -> Box<Self> {
        let stacks = Stacks { upper: Stack::new(), level: Stack::new() };
        Box::new(Self { stacks, flight: Flight::new(), tile: tile::Scratch::new() })
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

    /// Placed objects for one ray.
    #[inline(always)]
    fn enter_placements<S: Simd, Q: Query>(&self, ray: &Ray, stacks: &mut Stacks, nearest: &mut Nearest) {
        if self.placements.is_empty() || Q::ANY && nearest.hit().is_some() {
            return;
        }
        let slab = SlabRay::new(ray, self.placements.reach(), 1.0);
        let Stacks { upper, level: lower } = stacks;
        walk::single::<S, Q>(
            upper,
            self.placements.tree(),
            &slab,
            nearest.limit(),
            #[inline(always)]
            |leaf| {
                for placement in self.placements.leaf(leaf.blocks()) {
                    let object_ray = placement.object_ray(ray);
                    if object_ray.is_valid() {
                        let through = Through { instance: placement.instance, to_world: &placement.to_world };
                        let level = &self.objects[placement.object as usize];
                        level.trace_placed::<S, Q>(ray, &object_ray, through, lower, nearest);
                    }
                }
                Visit::after::<Q>(nearest)
            },
        );
    }

    /// Many rays among the triangles of the world, in flight together; hits are computed several at a time. Also tells t
    /// in f64, for the last 64 of them: that of ray i in the place of `first` + i.
    #[inline(always)]
    fn fly<S: Simd, Q: Query>(
        &self,
        flight: &mut Flight,
        first: usize,
        rays: &[Ray],
        answers: &mut [Q::Answer],
        t: &mut [f64; bundle::RAYS],
    ) {
        let triangles = &self.fixed.triangles;
        answers.fill(Q::MISS);
        if triangles.tree().is_empty() {
            return;
        }
        // Rays, and the triangles that they hit for sure.
        let (mut pending, mut ids, mut count) = ([0; 4], [NONE; 4], 0);
        flight::trace::<S, Q>(
            flight,
            triangles,
            rays,
            #[inline(always)]
            |i, found| {
                if found.is_noted() && Q::ANY {
                    answers[i] = Q::answer(Some(SOMETHING));
                } else if found.is_noted() {
                    (pending[count % 4], ids[count % 4]) = (i, found.noted);
                    count += 1;
                    if count == 4 {
                        count = 0;
                        self.compute_noted::<S, Q>(&pending, &ids, first, rays, answers, t);
                    }
                } else if found.is_hit() {
                    let nearest = found.nearest(triangles, &rays[i]);
                    (answers[i], t[(first + i) % bundle::RAYS]) = (Q::answer(nearest.hit()), nearest.t());
                }
            },
        );
        if count > 0 {
            // The others are computed twice, or again.
            for i in count..4 {
                (pending[i], ids[i]) = (pending[0], ids[0]);
            }
            self.compute_noted::<S, Q>(&pending, &ids, first, rays, answers, t);
        }
    }

    /// The hits of four rays, by number, with the triangles that are noted.
    #[inline(always)]
    fn compute_noted<S: Simd, Q: Query>(
        &self,
        pending: &[usize; 4],
        ids: &[u32; 4],
        first: usize,
        rays: &[Ray],
        answers: &mut [Q::Answer],
        t: &mut [f64; bundle::RAYS],
    ) {
        let [a, b, c, d] = pending.map(|i| &rays[i]);
        let (oa, ob, oc, od) = (a.origin, b.origin, c.origin, d.origin);
        let origin = [
            widen::<S>(&[oa.x, ob.x, oc.x, od.x]),
            widen::<S>(&[oa.y, ob.y, oc.y, od.y]),
            widen::<S>(&[oa.z, ob.z, oc.z, od.z]),
        ];
        let (da, db, dc, dd) = (a.direction, b.direction, c.direction, d.direction);
        let direction = [
            widen::<S>(&[da.x, db.x, dc.x, dd.x]),
            widen::<S>(&[da.y, db.y, dc.y, dd.y]),
            widen::<S>(&[da.z, db.z, dc.z, dd.z]),
        ];
        let (exact, hits) = self.fixed.triangles.hits::<S>(origin, direction, *ids);
        for ((&i, hit), exact) in pending.iter().zip(hits).zip(exact) {
            (answers[i], t[(first + i) % bundle::RAYS]) = (Q::answer(Some(hit)), exact);
        }
    }

    /// Whether there are neither shapes nor placed objects.
    fn has_only_triangles(&self) -> bool {
        self.fixed.shapes.tree().is_empty() && self.placements.is_empty() && self.unbounded.is_empty()
    }

    /// Many rays: in bundles of 64 where they are bundles, else in flight.
    #[inline(always)]
    fn trace<S: Simd, Q: Query>(
        &self,
        workspace: &mut Workspace,
        rays: &[Ray],
        answers: &mut [Q::Answer],
        coherent: bool,
    ) {
        let Workspace { stacks, flight, tile } = workspace;
        let triangles = &self.fixed.triangles;
        let is_all = self.has_only_triangles();
        let in_bundles = coherent && !triangles.tree().is_empty();
        let chunk = if in_bundles || !is_all { bundle::RAYS } else { rays.len().max(1) };
        for (rays, answers) in rays.chunks(chunk).zip(answers.chunks_mut(chunk)) {
            let traced = if in_bundles { tile::trace::<S, Q>(tile, triangles, rays, answers) } else { 0 };
            // The others, in runs: all of them, where there are no bundles.
            let mut open = if in_bundles { !traced & u64::MAX >> (bundle::RAYS - rays.len()) } else { 1 };
            while open != 0 {
                let first = open.trailing_zeros() as usize;
                let end = if in_bundles { first + (open >> first).trailing_ones() as usize } else { rays.len() };
                let run = first..end;
                self.fly::<S, Q>(flight, first, &rays[run.clone()], &mut answers[run], &mut tile.t);
                open &= u64::MAX.checked_shl(end as u32).unwrap_or(0);
            }
            if !is_all {
                self.trace_others::<S, Q>(stacks, rays, answers, &tile.t);
            }
        }
    }

    /// What there is besides triangles of the world, for rays that have `answers`, with t in f64, among these.
    #[inline(always)]
    fn trace_others<S: Simd, Q: Query>(
        &self,
        stacks: &mut Stacks,
        rays: &[Ray],
        answers: &mut [Q::Answer],
        t: &[f64; bundle::RAYS],
    ) {
        for ((ray, answer), &t) in rays.iter().zip(answers).zip(t).filter(|((ray, _), _)| ray.is_valid()) {
            let mut nearest = Nearest::new(ray);
            if Q::resume(&mut nearest, t, *answer) {
                self.unbounded.offer(ray, &mut nearest);
                self.fixed.trace_shapes::<S, Q>(ray, None, 1.0, &mut stacks.level, &mut nearest);
                self.enter_placements::<S, Q>(ray, stacks, &mut nearest);
                *answer = Q::answer(nearest.hit());
            }
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

impl<Q: Query> isa::Kernel for BatchKernel<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, rays, answers, batch, workspace } = self;
        bvh.trace::<S, Q>(workspace, rays, answers, batch.coherent);
    }
}
