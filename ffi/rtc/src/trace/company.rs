//! Several rays at a time among instances that stand still: as long as they go the same way, they go from one scene
//! into the next together.

use twincast_core::math::Vec3;
use twincast_core::trace::bvh::{Asked, BoxTree, Bvh, Packet, PacketHits};

use super::Query;
use super::cast::{after, cast_others, enter, name_solid, within};
use super::lanes::{Lanes, field};
use super::offer::{Nearest, Target, hit_of};
use super::packet::{any_alone, closest_alone, only_triangles, tell};
use crate::abi::{INVALID_ID, InstanceId, RTCRay, RTCRayHit};
use crate::scene::{Committed, Placed};

/// Rays of a packet.
const RAYS: usize = Packet::RAYS;

/// What packets are traced in by [`closest`] and [`occluded`].
#[derive(Clone, Copy)]
pub struct Crowd<'a> {
    boxes: &'a BoxTree,
    placed: &'a [Placed],
    /// Which rays see the triangles beside the instances.
    mask: u32,
}

impl<'a> Crowd<'a> {
    /// None where there is anything but triangles that stand still and such instances, or where filters are run.
    #[inline(always)]
    pub fn new(committed: &'a Committed, query: &Query, any: bool) -> Option<Self> {
        let heeded = &committed.heeded;
        let has_filter = if any { heeded.occluded_filter } else { heeded.intersect_filter };
        // SAFETY: the context is the caller's, which lives as long as the query, or our own.
        let is_inside = unsafe { (*query.context).instance }.is_inside();
        if has_filter || query.filter.is_some() || is_inside || !committed.smaller.is_empty() {
            return None;
        }
        let mask = if committed.solid.is_some() { heeded.mask? } else { 0 };
        Some(Self { boxes: committed.others.as_ref()?, placed: committed.only_placed()?, mask })
    }
}

/// Rays on their way.
struct Company<'a, L> {
    query: &'a Query,
    lanes: &'a L,
    /// Of these the packet's first.
    first: usize,
    packet: &'a Packet,
    /// Which geometries each ray sees.
    masks: [u32; RAYS],
    /// Where each ends by now; below 0 for those that have found what they wanted.
    tmax: [f32; RAYS],
    nearest: [Nearest; RAYS],
}

/// The nearest hits of those rays from lane `first` on that `asked` has a bit for.
pub fn closest(
    committed: &Committed,
    crowd: &Crowd<'_>,
    query: &Query,
    lanes: &impl Lanes<Record = RTCRayHit>,
    first: usize,
    packet: &Packet,
    asked: u32,
) {
    let mut company = Company::new(query, lanes, first, packet, asked);
    if let Some(solid) = &committed.solid {
        let seeing = company.seeing(asked, crowd.mask);
        // Not seen afterwards, as where there are triangles alone: what then traces the ray anew would trace it through
        // the instances, too.
        let beyond = beyond_start(packet, committed.excludes_start);
        let triangles = Asked { packets: [beyond.as_ref().unwrap_or(packet)], lanes: [seeing] };
        solid.bvh.closest_packets(&triangles, |[hits]| {
            tell(committed, query, lanes, first, hits);
            for lane in each(hits.lanes) {
                (company.tmax[lane], company.nearest[lane]) = (hits.t[lane], Nearest::of(hits.geometry[lane]));
            }
        });
    }
    company.visit::<false>(committed, crowd, asked);
}

/// Whether each of these rays hits anything.
pub fn occluded(
    committed: &Committed,
    crowd: &Crowd<'_>,
    query: &Query,
    lanes: &impl Lanes<Record = RTCRay>,
    first: usize,
    packet: &Packet,
    mut asked: u32,
) {
    let mut company = Company::new(query, lanes, first, packet, asked);
    if let Some(solid) = &committed.solid {
        let seeing = company.seeing(asked, crowd.mask);
        let occluded = company.occluded_by(&solid.bvh, packet, committed.excludes_start, seeing);
        asked &= !occluded;
    }
    if asked != 0 {
        company.visit::<true>(committed, crowd, asked);
    }
}

/// The rays from behind their beginnings, where triangles do not count there.
fn beyond_start(packet: &Packet, excludes_start: bool) -> Option<Packet> {
    excludes_start.then(|| Packet { tmin: packet.tmin.map(after), ..packet.clone() })
}

/// The lanes of a bit mask.
fn each(lanes: u32) -> impl Iterator<Item = usize> {
    (0..RAYS).filter(move |lane| lanes >> lane & 1 != 0)
}

impl<'a, L: Lanes> Company<'a, L> {
    #[inline(always)]
    fn new(query: &'a Query, lanes: &'a L, first: usize, packet: &'a Packet, asked: u32) -> Self {
        let mut masks = [0; RAYS];
        each(asked).for_each(|lane| [masks[lane]] = lanes.row(field::MASK, first + lane));
        Self { query, lanes, first, packet, masks, tmax: packet.tmax, nearest: [Nearest::of(INVALID_ID); RAYS] }
    }

    /// Those of some rays that see geometries with a mask.
    #[inline(always)]
    fn seeing(&self, lanes: u32, mask: u32) -> u32 {
        let mut seeing = 0;
        for (lane, own) in self.masks.iter().enumerate() {
            seeing |= u32::from(own & mask != 0) << lane;
        }
        seeing & lanes
    }

    /// Goes through the instances.
    fn visit<const ANY: bool>(&mut self, committed: &Committed, crowd: &Crowd<'_>, asked: u32) {
        // Triangles may have shortened rays.
        let shortened = committed.solid.is_some().then(|| Packet { tmax: self.tmax, ..self.packet.clone() });
        let packet = shortened.as_ref().unwrap_or(self.packet);
        let Crowd { boxes, placed, .. } = *crowd;
        let mut visitor = |i: u32, lanes: u32, limits: &mut [f32; RAYS]| {
            let placed = &placed[i as usize];
            let open = if ANY { self.open(lanes) } else { lanes };
            let seeing = self.seeing(open, placed.mask);
            if seeing != 0 {
                self.enter::<ANY>(boxes, placed, seeing);
                *limits = self.tmax;
            }
        };
        let are_together = if ANY {
            boxes.visit_packet_any(packet, asked, &mut visitor)
        } else {
            boxes.visit_packet(packet, asked, &mut visitor)
        };
        if !are_together {
            let query = *self.query;
            for lane in each(asked) {
                self.alone::<ANY>(lane, |target, nearest| {
                    nearest.geometry = cast_others::<ANY>(committed, query, *target, nearest.geometry);
                });
            }
        }
    }

    /// Those of some rays that still want something.
    #[inline(always)]
    fn open(&self, lanes: u32) -> u32 {
        let mut open = 0;
        for (lane, tmax) in self.tmax.iter().enumerate() {
            open |= u32::from(*tmax >= 0.0) << lane;
        }
        open & lanes
    }

    /// Takes rays through an instance.
    #[inline(always)]
    fn enter<const ANY: bool>(&mut self, boxes: &BoxTree, placed: &Placed, seeing: u32) {
        let Placed { to_scene, scene, geometry, primitive, .. } = placed;
        // SAFETY: scenes are not committed while rays are traced: the interface's rule.
        let Some(inner) = (unsafe { scene.committed() }) else { return };
        // One that comes alone is better off without a packet.
        let triangles = only_triangles(inner, self.query, ANY).filter(|_| !seeing.is_power_of_two());
        if let Some((solid, mask)) = triangles {
            let seeing = self.seeing(seeing, mask);
            let packet = boxes.placed(self.packet, to_scene, &self.tmax);
            if ANY {
                self.occluded_by(solid, &packet, inner.excludes_start, seeing);
            } else {
                let beyond = beyond_start(&packet, inner.excludes_start);
                let asked = Asked { packets: [beyond.as_ref().unwrap_or(&packet)], lanes: [seeing] };
                within(self.query, InstanceId::new(*geometry, *primitive), || {
                    solid.closest_packets(&asked, |[hits]| self.take(inner, placed, hits));
                });
            }
            return;
        }
        let query = *self.query;
        for lane in each(seeing) {
            self.alone::<ANY>(lane, |target, nearest| enter::<ANY>(&query, target, placed, &target.ray(), nearest));
        }
    }

    /// Has those rays end that triangles are in the way of: a bit for each.
    #[inline(always)]
    fn occluded_by(&mut self, solid: &Bvh, packet: &Packet, excludes_start: bool, seeing: u32) -> u32 {
        let beyond = beyond_start(packet, excludes_start);
        let packet = beyond.as_ref().unwrap_or(packet);
        let [occluded] = solid.occluded_packets(&Asked { packets: [packet], lanes: [seeing] });
        for lane in each(occluded) {
            self.tmax[lane] = f32::NEG_INFINITY;
            self.lanes.set_tfar(self.first + lane, f32::NEG_INFINITY);
        }
        occluded
    }

    /// Takes hits in an instance, those that are nearer, or as near and lower.
    #[inline(always)]
    fn take(&mut self, inner: &Committed, placed: &Placed, hits: &PacketHits) {
        let own = Nearest { geometry: placed.geometry, primitive: placed.primitive };
        for lane in each(hits.lanes) {
            let t = hits.t[lane];
            if t == self.tmax[lane] && self.nearest[lane] <= own {
                continue;
            }
            let ng = Vec3::from(hits.normal.map(|row| row[lane]));
            let (geometry, primitive) = (hits.geometry[lane], hits.primitive[lane]);
            if let Some(named) = name_solid(inner, geometry, primitive, [hits.u[lane], hits.v[lane]], ng) {
                self.lanes.set_hit(self.first + lane, t, &hit_of(self.query, geometry, &named));
                (self.tmax[lane], self.nearest[lane]) = (t, own);
            }
        }
    }

    /// Has `work` trace a ray by itself, told what is as near as where it ends.
    fn alone<const ANY: bool>(&mut self, lane: usize, work: impl FnOnce(&Target, &mut Nearest)) {
        let (at, nearest) = (self.first + lane, &mut self.nearest[lane]);
        let work = |target: &Target| work(target, nearest);
        self.tmax[lane] = if ANY { any_alone(self.lanes, at, work) } else { closest_alone(self.lanes, at, work) };
    }
}
