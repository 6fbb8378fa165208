//! A packet on its way through the fixed triangles: boxes for all rays at once, triangles for eight of them.

use super::beam::Beam;
use super::octet::Octet;
use super::party::Party;
use super::{Asked, Doubts, RAYS};
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::LANES;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::simd::{Array, Simd, Vector};
use crate::trace::bvh::walk::{self, Visit};

/// Walks, and notes in `octets` what is hit; what is decided at once is in `doubts`.
#[inline(always)]
pub(super) fn trace<S: Simd, Q: Query, const N: usize>(
    bvh: &Bvh,
    asked: &Asked<'_, N>,
    beam: &Beam,
    doubts: &mut Doubts<'_>,
    octets: &mut [Octet<S::V8>; N],
) {
    let triangles = &bvh.fixed.triangles;
    for (number, octet) in octets.iter_mut().enumerate() {
        octet.fill(asked.packets[number], asked.lanes[number], beam.axes);
    }
    let mut most = beam.limit;
    let party = Party::<Q, S::V8, N>::new(beam, asked, triangles.tree().reach(), Q::ANY);
    party.shorten(octets);
    walk::single::<S, Q>(
        triangles.tree(),
        &party,
        most,
        #[inline(always)]
        |leaf| {
            for index in leaf.blocks() {
                let mut scratch = None;
                let block = triangles.block::<S>(index, &mut scratch);
                let mut open = beam.triangles::<S>(block, most);
                let mut changed = false;
                while open != 0 {
                    let lane = open.trailing_zeros() as usize % LANES;
                    open &= open - 1;
                    let id = LANES as u32 * index + lane as u32;
                    for (number, octet) in octets.iter_mut().enumerate() {
                        let met = octet.meet::<Q>(beam.axes, block, lane, id);
                        changed |= met.changed;
                        if met.open != 0 {
                            let packet = asked.packets[number % N];
                            doubts.decide::<Q, S::V8>(bvh, number, packet, octet, &met, block, id);
                            changed = true;
                        }
                    }
                }
                if changed {
                    party.shorten(octets);
                    most = farthest::<S, N>(octets);
                    if Q::ANY && most < 0.0 {
                        return Visit::Stop;
                    }
                }
            }
            Visit::Until(most)
        },
    );
}

/// The farthest t that any ray wants.
#[inline(always)]
fn farthest<S: Simd, const N: usize>(octets: &[Octet<S::V8>; N]) -> f32 {
    let mut most = limit::<S>(&octets[0].limit);
    for octet in &octets[1..] {
        most = most.max(limit::<S>(&octet.limit));
    }
    most.largest()
}

#[inline(always)]
fn limit<S: Simd>(limit: &[f32; RAYS]) -> S::V8 {
    S::V8::load(limit)
}
