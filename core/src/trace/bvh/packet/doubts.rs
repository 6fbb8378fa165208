//! Rays of a packet of which bounds left in doubt what they hit: decided as single rays, at once.

use super::octet::{Met, Octet};
use super::{MAX, Packet, PacketHits, RAYS};
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::hits::coplanar::Spot;
use crate::trace::bvh::hits::found::Found;
use crate::trace::bvh::levels::placements::FIXED;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::simd::{Array, Vector};

/// What was decided of up to [`MAX`] packets.
pub(super) struct Doubts<'a> {
    found: &'a mut [Found; MAX * RAYS],
    /// A bit for each ray of which anything was.
    known: u32,
}

impl<'a> Doubts<'a> {
    /// Nothing yet.
    #[inline(always)]
    pub fn new(found: &'a mut [Found; MAX * RAYS]) -> Self {
        Self { found, known: 0 }
    }

    /// Decides of the rays of packet `number` that `met` leaves open whether they hit triangle `id` of a block.
    #[cold]
    #[inline(never)]
    #[expect(clippy::too_many_arguments, reason = "a triangle, and what is known of eight rays")]
    pub fn decide<Q: Query, V: Vector + Array<RAYS>>(
        &mut self,
        bvh: &Bvh,
        number: usize,
        packet: &Packet,
        octet: &mut Octet<V>,
        met: &Met,
        block: &Block,
        id: u32,
    ) {
        for lane in super::each(met.open) {
            if octet.limit[lane] < 0.0 {
                continue;
            }
            let noted = Spot { place: FIXED, id: octet.noted(lane) };
            if met.sure >> lane & 1 != 0
                && let Some(first) = bvh.first_of_plane(noted, Spot { place: FIXED, id })
            {
                octet.note(lane, first.id);
                continue;
            }
            let ray = packet.ray(lane);
            let (at, bit) = (number * RAYS + lane, 1 << (number * RAYS + lane));
            let found = &mut self.found[at];
            if self.known & bit == 0 {
                found.start([ray.tmax, octet.limit[lane]]);
                self.known |= bit;
            }
            let (index, triangle) = (id / LANES as u32, id as usize % LANES);
            found.resume([octet.sure[lane], octet.limit[lane]], octet.noted(lane), FIXED);
            found.decide(bvh, FIXED, index, block, triangle, &ray);
            octet.forget(lane);
            if Q::ANY && found.is_hit() {
                octet.hit |= 1 << lane;
                octet.finish(lane);
            } else {
                [octet.sure[lane], octet.limit[lane]] = found.range();
            }
        }
    }

    /// Tells of those hits that were decided of the rays of the bit mask `lanes`.
    #[inline(always)]
    pub fn tell(&self, bvh: &Bvh, number: usize, lanes: u32, hits: &mut PacketHits) {
        let mut open = self.known >> (number * RAYS) & lanes;
        while open != 0 {
            let lane = open.trailing_zeros() as usize % RAYS;
            open &= open - 1;
            if let Some(found) = bvh.computed_triangle(&self.found[(number * RAYS + lane) % (MAX * RAYS)]) {
                hits.put(lane, &found);
            }
        }
    }
}
