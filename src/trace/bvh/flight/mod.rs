//! Several rays in flight: each takes one step in turn, so that the processor works on one while another waits.
//!
//! A single ray's walk ([`super::walk`]) is bound by latency, not by work: each step needs the node that the one before
//! has chosen, and how many children are entered is anyone's guess, so every other node is mispredicted. Here a round
//! gives every ray of the flight one step. Steps of different rays do not depend on each other, and a step at a
//! node has no branch: all eight children are sorted by a network, and stored behind each other; those that are not entered
//! end beyond the top of the stack. Rays at leaves are put on a list of their own for the same reason. What a ray
//! reaches next is fetched while the others take their turn.
//!
//! Only when a hit shortens the ray is its stack gone through; so what is on it is always to be visited.
//!
//! **Placed objects.** A ray that comes to a placement goes on in the object's tree, in the object's coordinates, on the same
//! stack: t is the same there, so a hit shortens what waits above as well. Walking the object's tree alone, there and
//! then, would be bound by latency again.

mod ground;
mod list;
mod traveller;

use super::Bvh;
use super::found::Found;
use super::leaves::Leaves;
use super::node::Child;
use super::place::Blur;
use super::query::Query;
use super::ready::ReadyRays;
use super::simd::Simd;
use crate::ray::Ray;
pub(in crate::trace) use ground::Decide;
use ground::{Ground, Placed, Plain, Rounded};
use list::List;
use std::hint::select_unpredictable;
use traveller::{Step, Traveller};

/// Rays in flight.
const RAYS: usize = 32;

/// Room for a flight.
pub(super) struct Flight([Traveller; RAYS]);

impl Flight {
    pub fn new() -> Self {
        Self([Traveller::NONE; RAYS])
    }

    #[inline(always)]
    fn at(&mut self, k: u8) -> &mut Traveller {
        &mut self.0[usize::from(k) % RAYS]
    }
}

/// Answers all rays among triangles, of which there are some: `done` is told of each valid one what it has found.
#[inline(always)]
pub(super) fn trace<S: Simd, Q: Query>(flight: &mut Flight, bvh: &Bvh, rays: &[Ray], done: impl FnMut(usize, &Found)) {
    let fixed = &bvh.fixed.triangles;
    let tree = fixed.tree();
    if bvh.placements.has_triangles() {
        return run::<S, Q, _>(flight, bvh, &Placed::new::<S>(bvh), rays, Blur::NONE, done);
    }
    match fixed.leaves() {
        Leaves::Blocks(blocks) => {
            run::<S, Q, _>(flight, bvh, &Plain { tree, leaves: &blocks[..] }, rays, Blur::NONE, done);
        }
        Leaves::Numbers(leaves) => run::<S, Q, _>(flight, bvh, &Plain { tree, leaves }, rays, Blur::NONE, done),
    }
}

/// The same among the fixed triangles alone, where they, or the rays, are rounded from those that are meant; `decide` knows these.
#[inline(always)]
pub(super) fn trace_rounded<S: Simd, Q: Query>(
    flight: &mut Flight,
    bvh: &Bvh,
    rays: &[Ray],
    blur: Blur,
    decide: Decide<'_>,
    done: impl FnMut(usize, &Found),
) {
    let triangles = &bvh.fixed.triangles;
    if !triangles.tree().is_empty() {
        let ground = Rounded { triangles, decide };
        run::<S, Q, _>(flight, bvh, &ground, rays, blur, done);
    }
}

/// Has what will be needed soon loaded; without a branch, which nobody could predict.
#[inline(always)]
fn prefetch<S: Simd>(traveller: &Traveller, ground: &impl Ground) {
    // A ray that has arrived has no next; an address outside of what is there would be looked up in vain, which holds up all that follows.
    let (space, next) =
        (traveller.space, select_unpredictable(traveller.next == Child::NONE, Child::ROOT, traveller.next));
    let (node, leaf) = (ground.node_address::<S>(space, next), ground.leaf_address::<S>(space, next));
    S::prefetch(select_unpredictable(next.is_leaf(), leaf, node));
}

#[inline(always)]
fn run<S: Simd, Q: Query, G: Ground>(
    flight: &mut Flight,
    bvh: &Bvh,
    ground: &G,
    rays: &[Ray],
    blur: Blur,
    mut done: impl FnMut(usize, &Found),
) {
    let fixed = bvh.fixed.triangles.tree();
    let has_fixed = !fixed.is_empty();
    let mut bounds = fixed.bounds();
    if G::HAS_PLACEMENTS {
        bounds = bounds.union(bvh.placements.tree().bounds());
    }
    let mut waiting = ReadyRays::new(rays, bounds.min.abs().max(bounds.max.abs()), blur);
    let mut lists = [List::EMPTY; Step::COUNT];
    for k in 0..RAYS {
        let Some(ray) = waiting.next::<S>() else { break };
        flight.at(k as u8).start::<G>(ray, waiting.ready(), has_fixed);
        lists[Step::Node as usize].push(k as u8);
    }
    while lists.iter().any(|list| !list.is_empty()) {
        let [mut at_nodes, at_leaves, arrived, at_placements, returning] =
            std::mem::replace(&mut lists, [List::EMPTY; Step::COUNT]);
        for k in arrived.iter() {
            let traveller = flight.at(k);
            done(traveller.ray, &traveller.found);
            if let Some(ray) = waiting.next::<S>() {
                traveller.start::<G>(ray, waiting.ready(), has_fixed);
                at_nodes.push(k);
            }
        }
        for k in at_nodes.iter() {
            let traveller = flight.at(k);
            traveller.enter::<S, Q, G>(ground.node(traveller.space, traveller.next));
            prefetch::<S>(traveller, ground);
            lists[traveller.step::<G>()].push(k);
        }
        for k in at_leaves.iter() {
            let traveller = flight.at(k);
            traveller.visit::<S, Q, G>(bvh, ground, rays);
            prefetch::<S>(traveller, ground);
            lists[traveller.step::<G>()].push(k);
        }
        if G::HAS_PLACEMENTS {
            for k in returning.iter() {
                let traveller = flight.at(k);
                traveller.leave();
                prefetch::<S>(traveller, ground);
                lists[traveller.step::<G>()].push(k);
            }
            for k in at_placements.iter() {
                let traveller = flight.at(k);
                traveller.descend::<S>(bvh, rays);
                prefetch::<S>(traveller, ground);
                lists[traveller.step::<G>()].push(k);
            }
        }
    }
}
