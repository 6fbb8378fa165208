//! Rays of a packet that go their own ways: made ready together, they walk one after the other.

use super::{Packet, PacketHits, RAYS, each};
use crate::trace::bvh::Bvh;
use crate::trace::bvh::alone::{SingleRay, TriangleFound};
use crate::trace::bvh::reject::Blur;
use crate::trace::bvh::reject::ready::{ReadyRay, ready};
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::simd::isa::Kernel;

/// The nearest hits of those rays that `lanes` has a bit for.
pub(super) struct ClosestAlone<'a> {
    pub bvh: &'a Bvh,
    pub packet: &'a Packet,
    pub lanes: u32,
    pub hits: &'a mut PacketHits,
}

impl Kernel for ClosestAlone<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, packet, lanes, hits } = self;
        let Alone { rays, ready, valid } = Alone::new::<S>(bvh, packet);
        let (mut found, mut doubted) = (TriangleFound::NONE, None);
        hits.lanes = 0;
        for lane in each(lanes & valid) {
            if bvh.closest_ready::<S>(&rays[lane], &ready[lane], &mut doubted, &mut found) {
                hits.put(lane, &found);
            }
        }
    }
}

/// A bit for each of the rays with a bit in `lanes` that is occluded.
pub(super) struct OccludedAlone<'a> {
    pub bvh: &'a Bvh,
    pub packet: &'a Packet,
    pub lanes: u32,
}

impl Kernel for OccludedAlone<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<S: Simd>(self) -> u32 {
        let Self { bvh, packet, lanes } = self;
        let Alone { rays, ready, valid } = Alone::new::<S>(bvh, packet);
        let (mut occluded, mut doubted) = (0, None);
        for lane in each(lanes & valid) {
            occluded |= u32::from(bvh.occluded_ready::<S>(&rays[lane], &ready[lane], &mut doubted)) << lane;
        }
        occluded
    }
}

/// The rays of a packet, each by itself.
struct Alone {
    rays: [SingleRay; RAYS],
    ready: [ReadyRay; RAYS],
    /// A bit for each that is valid.
    valid: u32,
}

impl Alone {
    #[inline(always)]
    fn new<S: Simd>(bvh: &Bvh, packet: &Packet) -> Self {
        let rows = packet.rows::<S>();
        let (ready, valid) = ready::<S>(rows, bvh.fixed.triangles.tree().reach(), Blur::NONE);
        Self { rays: packet.singles::<S>(), ready, valid }
    }
}
