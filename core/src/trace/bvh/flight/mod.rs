//! Several rays in flight: each takes one step in turn, so that the processor works on one while another waits.
//!
//! A single ray's walk ([`super::walk`]) is bound by latency, not by work: each step needs the node that the one before
//! has chosen, and how many children are entered is anyone's guess, so every other node is mispredicted. Here a round
//! gives every ray of the flight one step, but those that wait at placements. Steps of different rays do not depend on
//! each other, and what can be is told without branches: who is at a node, at a leaf, or has arrived, by masks of what
//! all of them reach next; which child of a node comes first, by minima; and at a leaf all rays look on which sides of
//! edges they pass ([`LeafTest`]) before those that may pass within a triangle are gone through again. A branch there,
//! taken for every other leaf, cost an eighth of the time, for when it turns out to be wrong all that follows has been
//! done in vain. What a ray reaches next is fetched while the others take their turn.
//!
//! Only when a hit shortens the ray is its stack gone through; so what is on it is always to be visited.
//!
//! **Placed objects.** A ray that comes to a placement goes on in the object's tree, in the object's coordinates, on
//! the same stack: t is the same there, so a hit shortens what waits above as well. Walking the object's tree alone,
//! there and then, would be bound by latency again. To make it ready for the object costs as much as several nodes, but
//! eight together, each for an object of its own, not much more than one: so whoever comes to a placement waits until
//! half of the flight does, or nobody else has a step to take.
//!
//! **Deferred rays.** Bundles of rays that look for any hit leave some to placed objects each by itself
//! ([`trace_deferred`]). Those of several bundles set out together, in the objects' coordinates from the beginning.

pub(super) mod addresses;
mod deferred;
mod ray_state;
pub(super) mod set;
mod target;

use std::cell::Cell;
use std::marker::PhantomData;

use self::set::{IN_FLIGHT, Set};
use super::Bvh;
use super::hits::found::Found;
use super::hits::listed::Listed;
use super::levels::leaves::Leaves;
use super::levels::place::{EightRays, Place};
use super::levels::placements::FIXED;
use super::node::Child;
use super::query::{Query, SOMETHING};
use super::reject::Blur;
use super::reject::ready::{MANY, ReadyRay, ReadyRays, ready_blurred};
use super::reject::woop::Sides;
use super::simd::isa::Kernel;
use super::simd::{Array, Simd, Vector};
use crate::math::{Aabb, Vec3};
use crate::ray::Ray;
use deferred::DeferredQueue;
pub(super) use deferred::DeferredRays;
use ray_state::{RayState, Start, TreeId};
pub(in crate::trace) use target::Decide;
pub(super) use target::Objects;
use target::{Placed, Plain, Rounded, TraversalTarget};

/// Rays in flight.
const RAYS: usize = IN_FLIGHT;

/// Room for a flight.
pub(super) struct Flight {
    states: [RayState; RAYS],
    /// What each reaches next; [`Child::NONE`] of one that has arrived, or waits to return from an object or from the
    /// fixed triangles.
    next: [Child; RAYS],
    /// Where it does.
    tree_id: [TreeId; RAYS],
}

impl Flight {
    pub fn new() -> Self {
        Self { states: [RayState::NONE; RAYS], next: [Child::NONE; RAYS], tree_id: [TreeId::UPPER; RAYS] }
    }

    /// Ray `k`'s next step leads to `next`, which is loaded meanwhile.
    #[inline(always)]
    fn send<S: Simd, G: TraversalTarget>(&mut self, k: usize, next: Child, target: &G) {
        self.next[k] = next;
        let tree_id = self.states[k].tree_id;
        if G::HAS_PLACEMENTS {
            self.tree_id[k] = tree_id;
        }
        S::prefetch(target.address(tree_id, next));
    }

    /// Those at placements go into them, made ready eight at a time; of fewer than [`MANY`] each by itself, if
    /// `all_waiting`: no other ray has a step to take.
    #[inline(always)]
    fn descend<S: Simd, G: TraversalTarget>(
        &mut self,
        mut waiting: Set,
        mut all_waiting: bool,
        bvh: &Bvh,
        target: &G,
        rays: &[Ray],
    ) {
        while !waiting.is_empty() {
            let group = waiting.take_eight();
            let are_many = group.len() >= MANY;
            if !are_many && !all_waiting {
                return;
            }
            let (ready, known) =
                if are_many { self.ready_in_places::<S>(group, bvh, rays) } else { ([ReadyRay::NONE; 8], 0) };
            for (i, k) in group.enumerate() {
                let (state, leaf) = (&mut self.states[k], self.next[k]);
                let next = if known >> i & 1 != 0 {
                    let number = leaf.first();
                    state.descend_ready(number, bvh.placements.at(number).object, &ready[i % 8])
                } else {
                    state.descend::<S>(leaf, bvh, rays)
                };
                self.send::<S, G>(k, next, target);
            }
            all_waiting = false;
        }
    }

    /// Up to eight of those at placements made ready for the objects, in their order, and a bit for each for which that
    /// could be done.
    #[inline(always)]
    fn ready_in_places<S: Simd>(&self, group: Set, bvh: &Bvh, rays: &[Ray]) -> ([ReadyRay; 8], u32) {
        let mut others = group;
        let Some(mut k) = others.next() else { return ([ReadyRay::NONE; 8], 0) };
        let (first, _) = bvh.object_at(self.next[k].first());
        let (mut places, mut some) = ([first; 8], [&rays[self.states[k].ray]; 8]);
        let (mut reach, mut has_triangles) = ([[0.0; 8]; 3], 0);
        for i in 0..8 {
            let (place, triangles) = bvh.object_at(self.next[k].first());
            (places[i], some[i]) = (place, &rays[self.states[k].ray]);
            let Vec3 { x, y, z } = triangles.tree().reach();
            (reach[0][i], reach[1][i], reach[2][i]) = (x, y, z);
            has_triangles |= u32::from(!triangles.tree().is_empty()) << i;
            // Where they are fewer than eight, the last again.
            k = others.next().unwrap_or(k);
        }
        let EightRays { columns, off, turn, known } = Place::each::<S>(places, some);
        let reach = [S::V8::load(&reach[0]), S::V8::load(&reach[1]), S::V8::load(&reach[2])];
        let (ready, valid) = ready_blurred::<S>(columns, reach, off, turn);
        (ready, valid & known & has_triangles)
    }

    /// Who of `flying` takes which step.
    #[inline(always)]
    fn steps<S: Simd, G: TraversalTarget>(&self, flying: Set) -> Steps {
        let next = bytemuck::cast_ref(&self.next);
        let (leaf, none) = (S::highest_bits(next), S::equal(next, Child::NONE.0));
        let upper = if G::HAS_PLACEMENTS { S::equal(bytemuck::cast_ref(&self.tree_id), TreeId::UPPER.0) } else { none };
        Steps {
            at_nodes: flying.of(!leaf),
            at_leaves: flying.of(leaf & !none & !upper),
            arrived: flying.of(none & upper),
            at_placements: flying.of(leaf & !none & upper),
            returning: flying.of(none & !upper),
        }
    }
}

/// On which sides of a block's edges a ray passes.
#[derive(Clone, Copy)]
struct LeafTest<V: Vector> {
    state: usize,
    leaf: Child,
    sides: Sides<V>,
    /// The triangles that it may pass within.
    passed: u32,
}

/// Who takes which step in a round.
struct Steps {
    at_nodes: Set,
    at_leaves: Set,
    arrived: Set,
    /// To enter a placement.
    at_placements: Set,
    /// To leave an object, or the fixed triangles, for the placements.
    returning: Set,
}

/// Who is still to set out.
trait RaySource {
    /// The next one.
    fn next<S: Simd>(&mut self) -> Option<Start>;
    /// The one that came last.
    fn ready(&self) -> &ReadyRay;
}

/// Rays that start in the world.
struct WorldRays<'a> {
    rays: ReadyRays<'a>,
    tree_id: TreeId,
}

impl<'a> WorldRays<'a> {
    /// `bounds` are those of all that the rays may meet.
    fn new(bvh: &Bvh, bounds: Aabb, rays: &'a [Ray], blur: Blur) -> Self {
        let tree_id = if bvh.fixed.triangles.tree().is_empty() { TreeId::UPPER } else { TreeId::FIXED };
        Self { rays: ReadyRays::new(rays, bounds.min.abs().max(bounds.max.abs()), blur), tree_id }
    }
}

impl RaySource for WorldRays<'_> {
    #[inline(always)]
    fn next<S: Simd>(&mut self) -> Option<Start> {
        let ray = self.rays.next::<S>()?;
        Some(Start { ray, place: FIXED, tree_id: self.tree_id })
    }

    #[inline(always)]
    fn ready(&self) -> &ReadyRay {
        self.rays.ready()
    }
}

/// Answers all rays among triangles, of which there are some: `done` is told of each valid one what it has found.
#[inline(always)]
pub(super) fn trace<S: Simd, Q: Query>(
    flight: &mut Flight,
    bvh: &Bvh,
    rays: &[Ray],
    done: impl FnMut(usize, &Found, &Listed),
) {
    let fixed = &bvh.fixed.triangles;
    let bounds = fixed.tree().bounds();
    if bvh.placements.has_triangles() {
        let source = WorldRays::new(bvh, bounds.union(bvh.placements.tree().bounds()), rays, Blur::NONE);
        return run::<S, Q, _>(flight, bvh, &Placed::new::<S>(bvh), rays, source, done);
    }
    let source = WorldRays::new(bvh, bounds, rays, Blur::NONE);
    match fixed.leaves() {
        Leaves::Blocks(blocks) => {
            run::<S, Q, _>(flight, bvh, &Plain::new::<S>(fixed, &blocks[..]), rays, source, done);
        }
        Leaves::Numbers(leaves) => run::<S, Q, _>(flight, bvh, &Plain::new::<S>(fixed, leaves), rays, source, done),
    }
}

/// The same among the fixed triangles alone, where they, or the rays, are rounded from those that are meant; `decide`
/// knows these.
#[inline(always)]
pub(super) fn trace_rounded<S: Simd, Q: Query>(
    flight: &mut Flight,
    bvh: &Bvh,
    rays: &[Ray],
    blur: Blur,
    decide: Decide<'_>,
    done: impl FnMut(usize, &Found, &Listed),
) {
    let triangles = &bvh.fixed.triangles;
    if !triangles.tree().is_empty() {
        let target = Rounded::new::<S>(triangles, decide);
        let source = WorldRays::new(bvh, triangles.tree().bounds(), rays, blur);
        run::<S, Q, _>(flight, bvh, &target, rays, source, done);
    }
}

/// Rays that have answers already, and may get others by what they hit in the objects that they visit; any hit will do.
#[inline(always)]
pub(super) fn trace_deferred<S: Simd, Q: Query>(
    flight: &mut Flight,
    bvh: &Bvh,
    objects: &Objects<'_>,
    deferred: &[DeferredRays],
    rays: &[Ray],
    answers: &mut [Q::Answer],
) {
    let answers = Cell::from_mut(answers).as_slice_of_cells();
    run::<S, Q, _>(
        flight,
        bvh,
        objects,
        rays,
        DeferredQueue::<Q>::new(bvh, deferred, rays, answers),
        #[inline(always)]
        |ray, found, _| {
            if found.is_hit() {
                answers[ray].set(Q::answer(Some(SOMETHING)));
            }
        },
    );
}

/// Runs as a function of its own ([`Simd::apart_narrow`]), so `source` and `done` are of no instruction set, or of one
/// that is narrow.
#[inline(always)]
fn run<S: Simd, Q: Query, G: TraversalTarget>(
    flight: &mut Flight,
    bvh: &Bvh,
    target: &G,
    rays: &[Ray],
    source: impl RaySource,
    done: impl FnMut(usize, &Found, &Listed),
) {
    S::apart_narrow(FlightKernel { flight, bvh, target, rays, source, done, query: PhantomData::<Q> });
}

/// A flight from the first departure to the last arrival.
struct FlightKernel<'a, Q, G, D, F> {
    flight: &'a mut Flight,
    bvh: &'a Bvh,
    target: &'a G,
    rays: &'a [Ray],
    source: D,
    done: F,
    query: PhantomData<Q>,
}

impl<Q: Query, G: TraversalTarget, D: RaySource, F: FnMut(usize, &Found, &Listed)> Kernel
    for FlightKernel<'_, Q, G, D, F>
{
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { flight, bvh, target, rays, mut source, mut done, .. } = self;
        let mut flying = Set::EMPTY;
        for k in 0..RAYS {
            let Some(start) = source.next::<S>() else { break };
            let next = flight.states[k].start::<Q, G>(start, source.ready());
            flight.send::<S, G>(k, next, target);
            flying.insert(k);
        }
        let nothing = LeafTest { state: 0, leaf: Child::NONE, sides: Sides::none(), passed: 0 };
        let mut tests: [LeafTest<S::V8>; RAYS] = [nothing; RAYS];
        let far = target.far().filter(|_| S::PREFETCHES);
        while !flying.is_empty() {
            let Steps { mut at_nodes, at_leaves, arrived, at_placements, returning } = flight.steps::<S, G>(flying);
            for k in arrived {
                let state = &mut flight.states[k];
                done(state.ray, &state.found, &state.listed);
                if let Some(start) = source.next::<S>() {
                    flight.next[k] = state.start::<Q, G>(start, source.ready());
                    at_nodes.insert(k);
                } else {
                    flying.remove(k);
                }
            }
            if let Some(numbers) = far {
                for k in at_leaves {
                    numbers.prefetch_triangles::<S>(flight.next[k].first());
                }
            }
            for k in at_nodes {
                let (state, next) = (&mut flight.states[k], flight.next[k]);
                let next = state.enter::<S, Q, G>(target.node(state.tree_id, next));
                flight.send::<S, G>(k, next, target);
            }
            if let Some(numbers) = far {
                for k in at_leaves {
                    numbers.prefetch_vertices::<S>(flight.next[k].first());
                }
            }
            if G::IS_PUT_TOGETHER {
                for k in at_leaves {
                    let (state, leaf) = (&mut flight.states[k], flight.next[k]);
                    let next = state.visit::<S, Q, G>(leaf, bvh, target, rays);
                    flight.send::<S, G>(k, next, target);
                }
            } else {
                let mut count = 0;
                for k in at_leaves {
                    let (state, leaf, mut scratch) = (&mut flight.states[k], flight.next[k], None);
                    let block = target.block::<S>(state.tree_id, leaf.first(), &mut scratch);
                    let (sides, passed) = state.look::<S, G>(block);
                    tests[count % RAYS] = LeafTest { state: k, leaf, sides, passed };
                    count += usize::from(passed != 0);
                    let next = state.pass(leaf);
                    flight.send::<S, G>(k, next, target);
                }
                for LeafTest { state: k, leaf, sides, passed } in &tests[..count.min(RAYS)] {
                    let (state, mut scratch) = (&mut flight.states[*k % RAYS], None);
                    let block = target.block::<S>(state.tree_id, leaf.first(), &mut scratch);
                    if let Some(next) = state.hit::<S, Q, G>(*leaf, block, sides, *passed, bvh, target, rays) {
                        flight.send::<S, G>(*k % RAYS, next, target);
                    }
                }
            }
            if G::HAS_PLACEMENTS {
                for k in returning {
                    let next = flight.states[k].leave();
                    flight.send::<S, G>(k, next, target);
                }
                let all_waiting = at_nodes.is_empty() && at_leaves.is_empty() && returning.is_empty();
                if all_waiting || 2 * at_placements.len() >= flying.len() {
                    flight.descend::<S, G>(at_placements, all_waiting, bvh, target, rays);
                }
            }
        }
    }
}
