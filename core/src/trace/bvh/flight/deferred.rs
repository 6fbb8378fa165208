//! Rays that bundles leave to placed objects each by itself: a few of them of many a bundle make a flight, where each
//! bundle's own would be too few.

use std::cell::Cell;

use super::RaySource;
use super::ray_state::{Start, TreeId};
use crate::ray::Ray;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::reject::ready::{MANY, ReadyRay, eight, lowest_eight};
use crate::trace::bvh::simd::Simd;

/// Rays that are to go through one placed object, which has triangles.
#[derive(Clone, Copy, Debug)]
pub(in crate::trace::bvh) struct DeferredRays {
    /// The number of the placement.
    pub place: u32,
    /// The ray whose bit is the lowest.
    pub first: usize,
    /// A bit for each of them.
    pub rays: u64,
}

/// Deferred rays that wait for their turn.
pub(super) struct DeferredQueue<'a, Q: Query> {
    bvh: &'a Bvh,
    rays: &'a [Ray],
    answers: &'a [Cell<Q::Answer>],
    waiting: std::slice::Iter<'a, DeferredRays>,
    /// Those of one object who are not ready yet.
    current: DeferredRays,
    /// Those who are, a bit each, and where the first of them is among `ready`.
    group: u64,
    slot: usize,
    ready: [ReadyRay; 8],
}

impl<'a, Q: Query> DeferredQueue<'a, Q> {
    pub fn new(bvh: &'a Bvh, all: &'a [DeferredRays], rays: &'a [Ray], answers: &'a [Cell<Q::Answer>]) -> Self {
        let nobody = DeferredRays { place: 0, first: 0, rays: 0 };
        let (waiting, ready) = (all.iter(), [ReadyRay::NONE; 8]);
        Self { bvh, rays, answers, waiting, current: nobody, group: 0, slot: 0, ready }
    }

    /// Those who have not got what they want from other objects meanwhile.
    #[inline(always)]
    fn open(&self, &DeferredRays { first, rays, .. }: &DeferredRays) -> u64 {
        let (mut open, mut rest) = (rays, rays);
        while rest != 0 {
            let ray = rest.trailing_zeros();
            rest &= rest - 1;
            open &= !(u64::from(Q::is_enough(self.answers[first + ray as usize].get())) << ray);
        }
        open
    }

    /// Up to eight more.
    #[inline(always)]
    fn prepare<S: Simd>(&mut self) {
        let DeferredRays { place, first, rays: open } = self.current;
        (self.group, self.slot) = (lowest_eight(open), 0);
        self.current.rays &= !self.group;
        let rays = &self.rays[first..];
        let mut known = 0;
        if self.group.count_ones() >= MANY {
            (self.ready, known) = self.bvh.ready_at::<S>(place, eight(rays, self.group));
        }
        let mut rest = self.group;
        for (k, ready) in self.ready[..self.group.count_ones() as usize].iter_mut().enumerate() {
            if known >> k & 1 == 0 {
                let (object, triangles) = self.bvh.object_at(place);
                let (local, blur) = object.local::<S>(&rays[rest.trailing_zeros() as usize]);
                *ready = ReadyRay::new::<S>(&local, triangles.tree().reach(), blur);
            }
            rest &= rest.wrapping_sub(1);
        }
    }
}

impl<Q: Query> RaySource for DeferredQueue<'_, Q> {
    #[inline(always)]
    fn next<S: Simd>(&mut self) -> Option<Start> {
        loop {
            if self.group == 0 {
                if self.current.rays == 0 {
                    let next = *self.waiting.next()?;
                    self.current = DeferredRays { rays: self.open(&next), ..next };
                    continue;
                }
                self.prepare::<S>();
                continue;
            }
            let DeferredRays { place, first, .. } = self.current;
            let ray = first + self.group.trailing_zeros() as usize;
            self.group &= self.group - 1;
            self.slot += 1;
            if !Q::is_enough(self.answers[ray].get()) {
                let object = self.bvh.placements.at(place).object;
                return Some(Start { ray, place, tree_id: TreeId::object(object) });
            }
        }
    }

    #[inline(always)]
    fn ready(&self) -> &ReadyRay {
        &self.ready[self.slot.wrapping_sub(1) % 8]
    }
}
