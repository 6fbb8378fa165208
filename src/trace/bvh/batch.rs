//! Many rays: in bundles where they are bundles, else one by one, made ready and computed several at a time.

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

/// One stack for the placements, one for what is below them.
pub(super) struct Stacks {
    pub upper: Stack,
    pub level: Stack,
    pub flight: Flight,
}

impl Bvh {
    /// Answers all rays.
    ///
    /// # Panics
    /// Unless there is one answer a ray.
    pub(super) fn run_batch<Q: Query>(&self, rays: &[Ray], answers: &mut [Q::Answer], batch: Batch) {
        assert_eq!(rays.len(), answers.len(), "one answer a ray");
        isa::dispatch(self.isa, BatchKernel::<Q> { bvh: self, rays, answers, batch });
    }

    /// Placed objects for one ray.
    #[inline(always)]
    fn enter_placements<S: Simd, Q: Query>(
        &self,
        ray: &Ray,
        upper: &mut Stack,
        lower: &mut Stack,
        nearest: &mut Nearest,
    ) {
        if self.placements.is_empty() || Q::ANY && nearest.hit().is_some() {
            return;
        }
        let slab = SlabRay::new(ray, self.placements.reach(), 1.0);
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

    /// Many rays, in flight together; hits are computed several at a time.
    #[inline(always)]
    fn trace_rays<S: Simd, Q: Query>(&self, stacks: &mut Stacks, rays: &[Ray], answers: &mut [Q::Answer]) {
        let triangles = &self.fixed.triangles;
        let is_all = self.has_only_triangles();
        // Rays, and the triangles that they hit for sure.
        let (mut pending, mut ids, mut count) = ([0; 4], [NONE; 4], 0);
        answers.fill(Q::MISS);
        let Stacks { flight, upper, level } = stacks;
        flight::trace::<S, Q>(
            flight,
            triangles,
            rays,
            #[inline(always)]
            |i, found| {
                let is_noted = found.is_noted();
                if is_noted && Q::ANY {
                    answers[i] = Q::answer(Some(SOMETHING));
                } else if is_noted && is_all {
                    (pending[count % 4], ids[count % 4]) = (i, found.noted);
                    count += 1;
                    if count == 4 {
                        count = 0;
                        self.compute_noted::<S, Q>(&pending, &ids, rays, answers);
                    }
                } else if found.is_hit() || !is_all {
                    let ray = &rays[i];
                    let mut nearest = found.nearest(triangles, ray);
                    if !(is_all || Q::ANY && nearest.hit().is_some()) {
                        self.unbounded.offer(ray, &mut nearest);
                        self.fixed.trace_shapes::<S, Q>(ray, None, 1.0, level, &mut nearest);
                        self.enter_placements::<S, Q>(ray, upper, level, &mut nearest);
                    }
                    answers[i] = Q::answer(nearest.hit());
                }
            },
        );
        if count > 0 {
            // The others are computed twice, or again.
            for i in count..4 {
                (pending[i], ids[i]) = (pending[0], ids[0]);
            }
            self.compute_noted::<S, Q>(&pending, &ids, rays, answers);
        }
    }

    /// The hits of four rays, by number, with the triangles that are noted.
    #[inline(always)]
    fn compute_noted<S: Simd, Q: Query>(
        &self,
        pending: &[usize; 4],
        ids: &[u32; 4],
        rays: &[Ray],
        answers: &mut [Q::Answer],
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
        let (_, hits) = self.fixed.triangles.hits::<S>(origin, direction, *ids);
        for (i, hit) in pending.iter().zip(hits) {
            answers[*i] = Q::answer(Some(hit));
        }
    }

    /// Whether there are neither shapes nor placed objects.
    fn has_only_triangles(&self) -> bool {
        self.fixed.shapes.tree().is_empty() && self.placements.is_empty() && self.unbounded.is_empty()
    }

    /// Many rays in bundles of 64 where they are bundles, else ray by ray.
    #[inline(always)]
    fn trace_bundles<S: Simd, Q: Query>(&self, stacks: &mut Stacks, rays: &[Ray], answers: &mut [Q::Answer]) {
        let mut scratch = tile::Scratch::new();
        let triangles = &self.fixed.triangles;
        let is_all = self.has_only_triangles();
        for (rays, answers) in rays.chunks(bundle::RAYS).zip(answers.chunks_mut(bundle::RAYS)) {
            let is_empty = triangles.tree().is_empty();
            let traced = if is_empty { 0 } else { tile::trace::<S, Q>(&mut scratch, triangles, rays, answers) };
            if !is_all {
                for (k, (ray, answer)) in rays.iter().zip(&mut *answers).enumerate() {
                    let mut nearest = Nearest::new(ray);
                    if traced >> k & 1 != 0 && Q::resume(&mut nearest, scratch.t[k], *answer) {
                        self.unbounded.offer(ray, &mut nearest);
                        self.fixed.trace_shapes::<S, Q>(ray, None, 1.0, &mut stacks.level, &mut nearest);
                        self.enter_placements::<S, Q>(ray, &mut stacks.upper, &mut stacks.level, &mut nearest);
                        *answer = Q::answer(nearest.hit());
                    }
                }
            }
            // The others, in runs.
            let mut rest = !traced & u64::MAX >> (bundle::RAYS - rays.len());
            while rest != 0 {
                let first = rest.trailing_zeros() as usize;
                let end = first + (rest >> first).trailing_ones() as usize;
                self.trace_rays::<S, Q>(stacks, &rays[first..end], &mut answers[first..end]);
                rest &= u64::MAX.checked_shl(end as u32).unwrap_or(0);
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
}

impl<Q: Query> isa::Kernel for BatchKernel<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, rays, answers, batch } = self;
        let mut stacks = Stacks { upper: Stack::new(), level: Stack::new(), flight: Flight::new() };
        if batch.coherent {
            bvh.trace_bundles::<S, Q>(&mut stacks, rays, answers);
        } else {
            bvh.trace_rays::<S, Q>(&mut stacks, rays, answers);
        }
    }
}
