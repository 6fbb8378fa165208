//! Several rays at a time.
//!
//! Among triangles of which each counts, they are asked together, eight or sixteen at a time, in the caller's own
//! layout: rows of words are copied into a [`Packet`] and back. All else goes ray by ray, through a ray of our own:
//! callbacks are given one ray at a time.

use twincast_core::Ray;
use twincast_core::math::Vec3;
use twincast_core::trace::bvh::{Asked, Bvh, Packet, PacketHits};

use super::Query;
use super::cast::{Sight, after, cast_one, name_solid, native, sight};
use super::company::{self, Crowd};
use super::lanes::{Lanes, field};
use super::offer::{Target, hit_of};
use crate::abi::{RTCRay, RTCRayHit};
use crate::scene::Committed;

/// Rays of a packet.
const RAYS: usize = Packet::RAYS;

/// The lanes of a query, and which of them are asked for.
struct Called<'a, L, V> {
    lanes: &'a L,
    /// Whether triangles do not count where rays begin.
    excludes_start: bool,
    is_valid: V,
}

impl<L: Lanes, V: Fn(usize) -> bool> Called<'_, L, V> {
    /// Calls `two` and `one` with packets of rays, which ask for triangles with this mask and nothing else, and their
    /// first lane.
    #[inline(always)]
    fn each_packet(
        &self,
        (solid, mask): (&Bvh, u32),
        two: impl Fn(&Bvh, &Asked<'_, 2>, usize),
        one: impl Fn(&Bvh, &Asked<'_, 1>, usize),
    ) {
        let (count, mut first) = (self.lanes.count(), 0);
        while first + 2 * RAYS <= count {
            // Not an array that is taken apart: it would be copied.
            let low = self.packet(first);
            let high = self.packet(first + RAYS);
            let lanes = [self.seeing(first, mask), self.seeing(first + RAYS, mask)];
            two(solid, &Asked { packets: [&low, &high], lanes }, first);
            first += 2 * RAYS;
        }
        while first < count {
            let lanes = [self.seeing(first, mask)];
            // SAFETY: nobody writes to them before it is answered.
            let in_place = unsafe { self.lanes.packet() };
            match in_place.filter(|_| !self.excludes_start) {
                Some(packet) => one(solid, &Asked { packets: [packet], lanes }, first),
                None => one(solid, &Asked { packets: [&self.packet(first)], lanes }, first),
            }
            first += RAYS;
        }
    }

    /// Calls `among` with each packet, its first lane and a bit for each of its rays that is asked for, for what is not
    /// triangles alone; `alone` where that is one ray.
    fn each_company(&self, alone: impl Fn(usize), among: impl Fn(&Packet, usize, u32)) {
        for first in (0..self.lanes.count()).step_by(RAYS) {
            let asked = self.seeing(first, u32::MAX);
            match asked.count_ones() {
                0 => {}
                1 => alone(first + asked.trailing_zeros() as usize),
                _ => among(&self.packet_from(first, false), first, asked),
            }
        }
    }

    /// Calls `alone` with each lane that is asked for.
    fn each_lane(&self, alone: impl Fn(usize)) {
        (0..self.lanes.count()).filter(|&lane| (self.is_valid)(lane)).for_each(alone);
    }

    /// The rays from lane `first` on, for triangles.
    #[inline(always)]
    fn packet(&self, first: usize) -> Packet {
        self.packet_from(first, self.excludes_start)
    }

    /// The same; where wanted, from behind their beginnings.
    #[inline(always)]
    fn packet_from(&self, first: usize, excludes_start: bool) -> Packet {
        let lanes = self.lanes;
        match lanes.count() - first {
            RAYS.. => packet_of(|word| lanes.row::<RAYS>(word, first), excludes_start),
            4 => {
                let row = |word| {
                    let [a, b, c, d] = lanes.row::<4>(word, first);
                    [a, b, c, d, a, b, c, d]
                };
                packet_of(row, excludes_start)
            }
            _ => self.rest(first, excludes_start),
        }
    }

    /// The rays from lane `first` on, which are fewer than a packet.
    #[inline(always)]
    fn rest(&self, first: usize, excludes_start: bool) -> Packet {
        let mut packet = Packet::NONE;
        for lane in first..self.lanes.count() {
            let own = self.lanes.ray(lane);
            let tmin = if excludes_start { after(own.tnear) } else { own.tnear };
            let ray = Ray { tmin, ..native(&own) };
            packet.set(lane - first, &ray);
        }
        packet
    }

    /// A bit for each of these rays that is valid and has a bit in common with `mask`.
    #[inline(always)]
    fn seeing(&self, first: usize, mask: u32) -> u32 {
        let Self { lanes, is_valid, .. } = self;
        let (count, mut seeing) = (lanes.count(), 0);
        if first + RAYS > count {
            for lane in first..count {
                let [own] = lanes.row(field::MASK, lane);
                seeing |= u32::from(is_valid(lane) && own & mask != 0) << (lane - first);
            }
            return seeing;
        }
        for (lane, own) in lanes.row::<RAYS>(field::MASK, first).into_iter().enumerate() {
            seeing |= u32::from(is_valid(first + lane) && own & mask != 0) << lane;
        }
        seeing
    }
}

/// A packet of rows of words; where wanted, of rays from behind their beginnings.
#[inline(always)]
fn packet_of(row: impl Fn(usize) -> [u32; RAYS], excludes_start: bool) -> Packet {
    let row = |word| row(word).map(f32::from_bits);
    let start = row(field::TNEAR);
    // Where it is wanted, at once: what is changed afterwards may be copied.
    Packet {
        origin: [row(field::ORIGIN), row(field::ORIGIN + 1), row(field::ORIGIN + 2)],
        tmin: if excludes_start { start.map(after) } else { start },
        direction: [row(field::DIRECTION), row(field::DIRECTION + 1), row(field::DIRECTION + 2)],
        tmax: row(field::TFAR),
        ..Packet::NONE
    }
}

/// The triangles, where there is nothing else and no filter is run, and the mask with which rays must have a bit in
/// common to see all of them; the others see none.
#[inline(always)]
pub fn only_triangles<'a>(committed: &'a Committed, query: &Query, any: bool) -> Option<(&'a Bvh, u32)> {
    let mask = committed.heeded.mask?;
    let solid = &committed.solid.as_ref().filter(|_| committed.smaller.is_empty() && committed.others.is_none())?.bvh;
    (sight(committed, query, mask, any) == Sight::Everything).then_some((solid, mask))
}

/// Nearest hits of rays, of those that are valid.
#[inline(always)]
pub fn intersect_lanes(
    committed: &Committed,
    query: &Query,
    lanes: &impl Lanes<Record = RTCRayHit>,
    is_valid: impl Fn(usize) -> bool,
) {
    // Hits where rays begin are seen afterwards: there are none, nearly always.
    let called = Called { lanes, excludes_start: false, is_valid };
    if let Some(triangles) = only_triangles(committed, query, false) {
        let two = |solid: &Bvh, asked: &Asked<'_, 2>, first: usize| {
            solid.closest_packets(asked, |[low, high]| {
                tell(committed, query, lanes, first, low);
                tell(committed, query, lanes, first + RAYS, high);
            });
        };
        let one = |solid: &Bvh, asked: &Asked<'_, 1>, first: usize| {
            solid.closest_packets(asked, |[hits]| tell(committed, query, lanes, first, hits));
        };
        called.each_packet(triangles, two, one);
    } else if let Some(crowd) = Crowd::new(committed, query, false) {
        let alone = |lane| intersect_lane(committed, query, lanes, lane);
        called.each_company(alone, |packet, first, asked| {
            company::closest(committed, &crowd, query, lanes, first, packet, asked);
        });
    } else {
        called.each_lane(|lane| intersect_lane(committed, query, lanes, lane));
    }
}

/// The nearest hit of one ray.
#[inline(always)]
fn intersect_lane(committed: &Committed, query: &Query, lanes: &impl Lanes, lane: usize) {
    closest_alone(lanes, lane, |target| cast_one::<false>(committed, query, target));
}

/// Has `work` look for the nearest hit of a ray by itself, and writes what it finds; where the ray ends then.
#[inline(always)]
pub fn closest_alone(lanes: &impl Lanes, lane: usize, work: impl FnOnce(&Target)) -> f32 {
    // Together, as user geometry wants them.
    let mut own = RTCRayHit { ray: lanes.ray(lane), hit: lanes.hit(lane) };
    let own = &raw mut own;
    // SAFETY: it is ours, and used through this pointer alone.
    let target = unsafe { Target::closest(own) };
    work(&target);
    // SAFETY: as above.
    lanes.set_hit(lane, target.tfar(), unsafe { &(*own).hit });
    target.tfar()
}

/// The same for any hit.
#[inline(always)]
pub fn any_alone(lanes: &impl Lanes, lane: usize, work: impl FnOnce(&Target)) -> f32 {
    let mut ray = lanes.ray(lane);
    // SAFETY: it is ours.
    let target = unsafe { Target::any(&raw mut ray) };
    work(&target);
    lanes.set_tfar(lane, target.tfar());
    target.tfar()
}

/// Writes the hits of the rays from lane `first` on.
#[inline(always)]
pub fn tell(committed: &Committed, query: &Query, lanes: &impl Lanes, first: usize, hits: &PacketHits) {
    if hits.lanes == 0 {
        return;
    }
    if committed.excludes_start {
        let at_start = at_start(lanes, first, hits);
        if at_start != 0 {
            return tell_beyond_start(committed, query, lanes, first, hits, at_start);
        }
    }
    if !committed.is_plain || hits.lanes != 0xff {
        return tell_some(committed, query, lanes, first, hits, hits.lanes);
    }
    let PacketHits { t, u, v, normal, primitive, geometry, .. } = hits;
    let [nx, ny, nz] = normal;
    lanes.set_row(field::TFAR, first, t.map(f32::to_bits));
    let [x, y, z] = [field::NORMAL, field::NORMAL + 1, field::NORMAL + 2];
    for (word, row) in [(x, nx), (y, ny), (z, nz), (field::U, u), (field::V, v)] {
        lanes.set_row(word, first, row.map(f32::to_bits));
    }
    lanes.set_row(field::PRIMITIVE, first, *primitive);
    lanes.set_row(field::GEOMETRY, first, *geometry);
    // SAFETY: the context is the caller's, which lives as long as the query, or our own.
    let context = unsafe { query.context.read() };
    for (word, value) in context.instance.words().into_iter().enumerate() {
        lanes.set_row(field::INSTANCE + word, first, [value; RAYS]);
    }
}

/// A bit for each ray that was hit where it begins.
#[inline(always)]
fn at_start(lanes: &impl Lanes, first: usize, hits: &PacketHits) -> u32 {
    let mut at_start = 0;
    if hits.lanes == 0xff {
        for (lane, (t, tnear)) in hits.t.iter().zip(lanes.row::<RAYS>(field::TNEAR, first)).enumerate() {
            at_start |= u32::from(*t == f32::from_bits(tnear)) << lane;
        }
        return at_start;
    }
    let mut open = hits.lanes;
    while open != 0 {
        let lane = open.trailing_zeros() as usize % RAYS;
        open &= open - 1;
        at_start |= u32::from(hits.t[lane] == lanes.ray(first + lane).tnear) << lane;
    }
    at_start
}

/// Has rays look farther that were hit where they begin.
#[cold]
fn tell_beyond_start(
    committed: &Committed,
    query: &Query,
    lanes: &impl Lanes,
    first: usize,
    hits: &PacketHits,
    at_start: u32,
) {
    tell_some(committed, query, lanes, first, hits, hits.lanes & !at_start);
    (0..RAYS)
        .filter(|lane| at_start >> lane & 1 != 0)
        .for_each(|lane| intersect_lane(committed, query, lanes, first + lane));
}

/// Writes the hits of the lanes in `open`, one by one: where some rays miss, and where triangles are parts of other
/// primitives.
#[inline(always)]
fn tell_some(committed: &Committed, query: &Query, lanes: &impl Lanes, first: usize, hits: &PacketHits, mut open: u32) {
    let PacketHits { t, u, v, normal: [nx, ny, nz], primitive, geometry, .. } = hits;
    while open != 0 {
        let i = open.trailing_zeros() as usize % RAYS;
        open &= open - 1;
        let ng = Vec3::new(nx[i], ny[i], nz[i]);
        if let Some(named) = name_solid(committed, geometry[i], primitive[i], [u[i], v[i]], ng) {
            lanes.set_hit(first + i, t[i], &hit_of(query, geometry[i], &named));
        }
    }
}

/// Whether each ray hits anything, of those that are valid.
#[inline(always)]
pub fn occluded_lanes(
    committed: &Committed,
    query: &Query,
    lanes: &impl Lanes<Record = RTCRay>,
    is_valid: impl Fn(usize) -> bool,
) {
    let called = Called { lanes, excludes_start: committed.excludes_start, is_valid };
    if let Some(triangles) = only_triangles(committed, query, true) {
        let end = |first: usize, mut occluded: u32| {
            while occluded != 0 {
                lanes.set_tfar(first + occluded.trailing_zeros() as usize, f32::NEG_INFINITY);
                occluded &= occluded - 1;
            }
        };
        let two = |solid: &Bvh, asked: &Asked<'_, 2>, first: usize| {
            let [low, high] = solid.occluded_packets(asked);
            end(first, low | high << RAYS);
        };
        let one = |solid: &Bvh, asked: &Asked<'_, 1>, first: usize| {
            let [occluded] = solid.occluded_packets(asked);
            end(first, occluded);
        };
        called.each_packet(triangles, two, one);
    } else if let Some(crowd) = Crowd::new(committed, query, true) {
        let alone = |lane| occluded_lane(committed, query, lanes, lane);
        called.each_company(alone, |packet, first, asked| {
            company::occluded(committed, &crowd, query, lanes, first, packet, asked);
        });
    } else {
        called.each_lane(|lane| occluded_lane(committed, query, lanes, lane));
    }
}

/// Whether one ray hits anything.
#[inline(always)]
fn occluded_lane(committed: &Committed, query: &Query, lanes: &impl Lanes, lane: usize) {
    any_alone(lanes, lane, |target| cast_one::<true>(committed, query, target));
}
