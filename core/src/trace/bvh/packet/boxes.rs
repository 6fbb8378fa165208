//! A packet among boxes of which the caller knows what is in them, as scenes that are placed in another.

use std::marker::PhantomData;

use super::{Asked, Packet, RAYS, together};
use crate::math::DAffine3;
use crate::trace::bvh::alone::Search;
use crate::trace::bvh::boxes::BoxTree;
use crate::trace::bvh::levels::place::eight_times;
use crate::trace::bvh::query::{Closest, Occluded, Query};
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::simd::isa::{self, Kernel};
use crate::trace::bvh::walk::{self, Visit};

impl BoxTree {
    /// [`BoxTree::visit`] of those rays of a packet that `lanes` has a bit for, as one: names boxes that any of them may enter, up to the t that `visitor` returns
    /// last; one that is alone at once, by whoever is valid. Not where they go different ways, or boxes move: then none is named, and the answer is no.
    pub fn visit_packet(&self, packet: &Packet, lanes: u32, visitor: &mut dyn FnMut(u32, u32) -> Search) -> bool {
        self.visit_packet_as::<Closest>(packet, lanes, visitor)
    }

    /// The same for a visitor to whom it does not matter which are near.
    pub fn visit_packet_any(&self, packet: &Packet, lanes: u32, visitor: &mut dyn FnMut(u32, u32) -> Search) -> bool {
        self.visit_packet_as::<Occluded>(packet, lanes, visitor)
    }

    fn visit_packet_as<Q: Query>(
        &self,
        packet: &Packet,
        lanes: u32,
        visitor: &mut dyn FnMut(u32, u32) -> Search,
    ) -> bool {
        if self.is_empty() || self.moves() {
            return self.is_empty();
        }
        isa::dispatch(self.isa(), VisitBoxes { boxes: self, packet, lanes, visitor, query: PhantomData::<Q> })
    }

    /// A packet where `place` takes it, in f64; its rays end at `tmax`.
    pub fn placed(&self, packet: &Packet, place: &DAffine3, tmax: &[f32; RAYS]) -> Packet {
        let mut placed = Packet { tmin: packet.tmin, time: packet.time, tmax: *tmax, ..Packet::NONE };
        isa::dispatch(self.isa(), Place { packet, place, placed: &mut placed });
        placed
    }
}

struct VisitBoxes<'a, 'v, Q> {
    boxes: &'a BoxTree,
    packet: &'a Packet,
    lanes: u32,
    visitor: &'a mut (dyn FnMut(u32, u32) -> Search + 'v),
    query: PhantomData<Q>,
}

impl<Q: Query> Kernel for VisitBoxes<'_, '_, Q> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { boxes, packet, lanes, visitor, .. } = self;
        if boxes.count() == 1 {
            // What is in it looks where rays go, too.
            let valid = packet.valid::<S>() & lanes;
            if valid != 0 {
                _ = visitor(0, valid);
            }
            return true;
        }
        let mut own = None;
        let asked = Asked { packets: [packet], lanes: [lanes] };
        let Some((asked, beam)) = together::<S, 1>(boxes.tree().bounds(), &asked, &mut own) else { return false };
        let mut limit = beam.limit;
        walk::single::<S, Q>(
            boxes.tree(),
            &beam,
            limit,
            #[inline(always)]
            |leaf| {
                for item in leaf.blocks() {
                    match visitor(item, asked.lanes[0]) {
                        Search::Continue(t) => limit = t,
                        Search::Break(()) => return Visit::Stop,
                    }
                }
                Visit::Until(limit)
            },
        );
        true
    }
}

struct Place<'a> {
    packet: &'a Packet,
    place: &'a DAffine3,
    placed: &'a mut Packet,
}

impl Kernel for Place<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { packet, place, placed } = self;
        let [x, y, z, dx, dy, dz, ..] = packet.rows::<S>();
        let [mx, my, mz] = place.matrix3.to_cols_array_2d();
        let columns = [mx, my, mz, place.translation.to_array()];
        (placed.origin, placed.direction) = eight_times::<S>(&columns, [x, y, z], [dx, dy, dz]);
    }
}
