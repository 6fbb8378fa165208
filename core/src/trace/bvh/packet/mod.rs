//! Eight or sixteen rays of a caller's that go the same way: they walk as one, and meet triangles eight at a time.
//!
//! Interfaces that hand over packets (Embree's C functions) do so for speed, and have not enough rays at once for a
//! bundle of 64 ([`super::bundle`]), whose making takes longer than eight rays do. So as little as possible is made
//! ready:
//!
//! - **Nodes** are tested against the [`Beam`] of all rays, an interval for each component of origins and reciprocal
//!   directions, at little more than what a single ray costs. Rays are asked only if any hit will do, and at leaves
//!   ([`Party`](party::Party)).
//! - **Triangles**: the beam rejects most of a block by their boxes. Of the others each is tested against eight rays, a
//!   lane a ray ([`Octet`]), by the test and with the bounds of single rays ([`super::reject::woop`]).
//! - **Decisions**: what bounds leave no doubt about is noted, and computed at the end, four rays at a time; what they
//!   do is decided at once ([`Doubts`]). So the bits are those of single rays.
//!
//! Boxes of which callers know what is in them are walked by the beam as well, and each ray is asked at them
//! ([`BoxTree::visit_packet`](super::boxes::BoxTree::visit_packet)).
//!
//! Rays that run both ways along an axis make no beam, and those that are far apart make a wide one, which would enter
//! most of the tree: they walk alone. Asking each ray at each node, as a packet traversal does, would keep them
//! together, but costs the others more.

mod alone;
mod beam;
mod boxes;
mod doubts;
mod finish;
mod octet;
mod party;
mod scratch;
mod way;

use super::Bvh;
use super::alone::{SingleRay, TriangleFound};
use super::query::{Closest, Occluded};
use super::simd::isa::{self, Kernel};
use super::simd::{Array, Mask, Simd, Vector, size};
use crate::math::{Aabb, Vec3};
use crate::ray::Ray;
use alone::{ClosestAlone, OccludedAlone};
use beam::{Beam, WIDE};
use doubts::Doubts;
use octet::Octet;
use scratch::{Scratch, with_scratch};

/// Rays of a packet.
const RAYS: usize = Packet::RAYS;

/// Packets that travel together at most.
const MAX: usize = 2;

/// Eight rays, component by component, in the order in which Embree's `RTCRay8` begins: a caller's can be read where it
/// is.
#[repr(C, align(32))]
#[derive(Clone, Debug, PartialEq)]
pub struct Packet {
    /// Where they start: all x, all y, all z.
    pub origin: [[f32; Packet::RAYS]; 3],
    /// Nearest valid t of each; what is below 0 counts as 0.
    pub tmin: [f32; Packet::RAYS],
    /// Directions, as origins; not of unit length necessarily.
    pub direction: [[f32; Packet::RAYS]; 3],
    /// Nothing depends on it: triangles stand still.
    pub time: [f32; Packet::RAYS],
    /// Farthest valid t of each.
    pub tmax: [f32; Packet::RAYS],
}

/// Packets that go together, of each a bit for every ray that is asked for; the others may be anything.
#[derive(Clone, Copy)]
pub struct Asked<'a, const N: usize> {
    /// The rays.
    pub packets: [&'a Packet; N],
    /// The bits.
    pub lanes: [u32; N],
}

/// What the rays of a packet hit.
#[repr(C, align(32))]
#[derive(Clone, Debug, PartialEq)]
pub struct PacketHits {
    /// A bit for each ray that hits anything; the numbers of the others mean nothing.
    pub lanes: u32,
    /// Distance in units of the ray's direction.
    pub t: [f32; Packet::RAYS],
    /// Weight of the triangle's second corner.
    pub u: [f32; Packet::RAYS],
    /// Weight of the triangle's third corner.
    pub v: [f32; Packet::RAYS],
    /// [`TriangleFound::normal`] of the triangle: all x, all y, all z.
    pub normal: [[f32; Packet::RAYS]; 3],
    /// Ids as of [`Hit`](crate::Hit).
    pub primitive: [u32; Packet::RAYS],
    /// Likewise.
    pub geometry: [u32; Packet::RAYS],
    /// Likewise.
    pub instance: [u32; Packet::RAYS],
}

impl Packet {
    /// Rays of a packet.
    pub const RAYS: usize = 8;

    /// The ray of a lane, at time 0.
    #[inline]
    pub fn ray(&self, lane: usize) -> Ray {
        let at = |v: &[[f32; RAYS]; 3]| Vec3::new(v[0][lane], v[1][lane], v[2][lane]);
        let (origin, direction) = (at(&self.origin), at(&self.direction));
        SingleRay { origin, tmin: self.tmin[lane], direction, time: 0.0, tmax: self.tmax[lane] }.ray()
    }

    /// Sets the ray of a lane.
    pub fn set(&mut self, lane: usize, ray: &Ray) {
        for axis in 0..3 {
            (self.origin[axis][lane], self.direction[axis][lane]) = (ray.origin[axis], ray.direction[axis]);
        }
        (self.tmin[lane], self.tmax[lane]) = (ray.tmin, ray.tmax);
    }

    /// Room for rays.
    pub const NONE: Self = Self {
        origin: [[0.0; RAYS]; 3],
        tmin: [0.0; RAYS],
        direction: [[0.0; RAYS]; 3],
        time: [0.0; RAYS],
        tmax: [0.0; RAYS],
    };

    /// Origins, directions, tmin and tmax.
    #[inline(always)]
    fn rows<S: Simd>(&self) -> [S::V8; 8] {
        let ([x, y, z], [dx, dy, dz]) = (&self.origin, &self.direction);
        let (x, y, z) = (S::V8::load(x), S::V8::load(y), S::V8::load(z));
        let (dx, dy, dz) = (S::V8::load(dx), S::V8::load(dy), S::V8::load(dz));
        let (zero, tmin) = (S::V8::splat(0.0), S::V8::load(&self.tmin));
        [x, y, z, dx, dy, dz, S::V8::select(tmin.less(zero), zero, tmin), S::V8::load(&self.tmax)]
    }

    /// The rays for walks by themselves.
    #[inline(always)]
    fn singles<S: Simd>(&self) -> [SingleRay; RAYS] {
        let [x, y, z, dx, dy, dz, tmin, tmax] = self.rows::<S>();
        let rays = S::transpose([x, y, z, tmin, dx, dy, dz, tmax]);
        let [a, b, c, d, e, f, g, h] = rays;
        // Written out: a closure mapped over the array may miss the instruction set.
        [single(a), single(b), single(c), single(d), single(e), single(f), single(g), single(h)]
    }

    /// A bit for each ray that [is valid](Ray::is_valid).
    #[inline(always)]
    fn valid<S: Simd>(&self) -> u32 {
        let [x, y, z, dx, dy, dz, tmin, tmax] = self.rows::<S>();
        let zero = S::V8::splat(0.0);
        // Zero for finite numbers, else none.
        let finite = x.mul_add(zero, y.mul_add(zero, z.mul(zero)));
        let finite = dx.mul_add(zero, dy.mul_add(zero, dz.mul_add(zero, finite)));
        let largest = size([dx, dy, dz]);
        let directed = S::V8::splat(f32::MIN_POSITIVE).at_most(largest).and(finite.at_most(zero));
        directed.and(tmin.at_most(tmax)).bits()
    }
}

/// The lanes of a bit mask.
fn each(lanes: u32) -> impl Iterator<Item = usize> {
    (0..RAYS).filter(move |lane| lanes >> lane & 1 != 0)
}

impl PacketHits {
    /// None.
    pub const NONE: Self = Self {
        lanes: 0,
        t: [0.0; RAYS],
        u: [0.0; RAYS],
        v: [0.0; RAYS],
        normal: [[0.0; RAYS]; 3],
        primitive: [0; RAYS],
        geometry: [0; RAYS],
        instance: [0; RAYS],
    };

    /// The hit of one ray.
    #[inline(always)]
    fn put(&mut self, lane: usize, found: &TriangleFound) {
        let hit = &found.hit;
        (self.t[lane], self.u[lane], self.v[lane]) = (hit.t, hit.u, hit.v);
        let normal = found.normal;
        for axis in 0..3 {
            self.normal[axis][lane] = normal[axis];
        }
        (self.primitive[lane], self.geometry[lane], self.instance[lane]) = (hit.primitive, hit.geometry, hit.instance);
        self.lanes |= 1 << lane;
    }
}

impl Bvh {
    /// [`Bvh::closest_triangle`] of each ray of a packet, or of two that go together, with the same bits: `tell` reads
    /// them where they lie, in the thread's own memory, and calls none of these functions meanwhile.
    #[inline]
    pub fn closest_packets<const N: usize>(&self, asked: &Asked<'_, N>, tell: impl FnOnce(&[PacketHits; N])) {
        const { assert!(N >= 1 && N <= MAX, "one packet, or two") };
        with_scratch(|scratch| {
            // Not asked before: what was given here is then read piece by piece, as it was written, and not in one go,
            // which would have to wait for the pieces.
            if self.has_fixed() {
                isa::dispatch(self.isa, ClosestPackets { bvh: self, asked, scratch });
            } else {
                scratch.hits.iter_mut().for_each(|hits| hits.lanes = 0);
            }
            if let Some(hits) = scratch.hits.first_chunk() {
                tell(hits);
            }
        });
    }

    /// [`Bvh::occludes`] of each ray of a packet, or of two that go together: a bit for each that is occluded.
    pub fn occluded_packets<const N: usize>(&self, asked: &Asked<'_, N>) -> [u32; N] {
        const { assert!(N >= 1 && N <= MAX, "one packet, or two") };
        let mut occluded = [0; N];
        with_scratch(|scratch| {
            if self.has_fixed() {
                isa::dispatch(self.isa, OccludedPackets { bvh: self, asked, scratch, occluded: &mut occluded });
            }
        });
        occluded
    }
}

/// Of its origin, tmin, direction and tmax.
#[inline(always)]
fn single(row: impl Array<RAYS>) -> SingleRay {
    let [x, y, z, tmin, dx, dy, dz, tmax] = row.to_array();
    SingleRay { origin: Vec3::new(x, y, z), tmin, direction: Vec3::new(dx, dy, dz), time: tmax, tmax }
}

struct ClosestPackets<'a, const N: usize> {
    bvh: &'a Bvh,
    asked: &'a Asked<'a, N>,
    scratch: &'a mut Scratch,
}

impl<const N: usize> Kernel for ClosestPackets<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, asked, scratch } = self;
        let mut own = None;
        let bounds = bvh.fixed.triangles.tree().bounds();
        if let Some((asked, beam)) = together::<S, N>(bounds, WIDE, asked, &mut own) {
            let Scratch { found, hits } = scratch;
            let mut doubts = Doubts::new(found);
            let mut octets = [Octet::nothing(); N];
            way::trace::<S, Closest, N>(bvh, &asked, &beam, &mut doubts, &mut octets);
            for (number, octet) in octets.iter().enumerate() {
                let (packet, lanes) = (asked.packets[number], asked.lanes[number]);
                finish::finish::<S>(bvh, number, packet, lanes, octet, &doubts, &mut hits[number]);
            }
            return;
        }
        for (number, (packet, lanes)) in asked.packets.into_iter().zip(asked.lanes).enumerate() {
            isa::dispatch(bvh.isa, ClosestAlone { bvh, packet, lanes, hits: &mut scratch.hits[number] });
        }
    }
}

struct OccludedPackets<'a, const N: usize> {
    bvh: &'a Bvh,
    asked: &'a Asked<'a, N>,
    scratch: &'a mut Scratch,
    occluded: &'a mut [u32; N],
}

impl<const N: usize> Kernel for OccludedPackets<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, asked, scratch, occluded } = self;
        let mut own = None;
        let bounds = bvh.fixed.triangles.tree().bounds();
        if let Some((asked, beam)) = together::<S, N>(bounds, WIDE, asked, &mut own) {
            let mut doubts = Doubts::new(&mut scratch.found);
            let mut octets = [Octet::nothing(); N];
            way::trace::<S, Occluded, N>(bvh, &asked, &beam, &mut doubts, &mut octets);
            for (occluded, octet) in occluded.iter_mut().zip(&octets) {
                *occluded = octet.hit;
            }
            return;
        }
        for (occluded, (packet, lanes)) in occluded.iter_mut().zip(asked.packets.into_iter().zip(asked.lanes)) {
            *occluded = isa::dispatch(bvh.isa, OccludedAlone { bvh, packet, lanes });
        }
    }
}

/// The packets, `own` ones if rays had to be left out, and their beam; none where rays make no beam, or are more than
/// the share `wide` of `bounds` apart.
#[inline(always)]
fn together<'a, S: Simd, const N: usize>(
    bounds: Aabb,
    wide: f32,
    asked: &Asked<'a, N>,
    own: &'a mut Option<[Packet; N]>,
) -> Option<(Asked<'a, N>, Beam)> {
    let (mut valid, mut all) = ([0; N], 0xff);
    for (number, valid) in valid.iter_mut().enumerate() {
        *valid = asked.packets[number].valid::<S>() & asked.lanes[number];
        all &= *valid;
    }
    let packets = if all == 0xff { asked.packets } else { own.insert(only::<S, N>(asked, &valid)?).each_ref() };
    let beam = Beam::new::<S, N>(&packets, bounds, wide)?;
    (!beam.is_wide).then_some((Asked { packets, lanes: valid }, beam))
}

/// The packets with valid rays alone, and copies of one of these in the other lanes; none where there are none.
#[inline(always)]
fn only<S: Simd, const N: usize>(asked: &Asked<'_, N>, valid: &[u32; N]) -> Option<[Packet; N]> {
    let first = valid.iter().position(|&lanes| lanes != 0)?;
    let (source, lane) = (asked.packets[first], valid[first].trailing_zeros() as usize % RAYS);
    let mut packets = [const { Packet::NONE }; N];
    for (packet, (other, &valid)) in packets.iter_mut().zip(asked.packets.iter().zip(valid)) {
        let stays = S::V8::splat(0.5).less(S::V8::load(&LANES[valid as usize % LANES.len()]));
        for axis in 0..3 {
            packet.origin[axis] = fill::<S>(stays, &other.origin[axis], source.origin[axis][lane]);
            packet.direction[axis] = fill::<S>(stays, &other.direction[axis], source.direction[axis][lane]);
        }
        packet.tmin = fill::<S>(stays, &other.tmin, source.tmin[lane]);
        packet.tmax = fill::<S>(stays, &other.tmax, source.tmax[lane]);
    }
    Some(packets)
}

/// A row, with another number where it does not stay.
#[inline(always)]
fn fill<S: Simd>(stays: <S::V8 as Vector>::Mask, row: &[f32; RAYS], other: f32) -> [f32; RAYS] {
    S::V8::select(stays, S::V8::load(row), S::V8::splat(other)).to_array()
}

/// For each mask of a packet 1 in the lanes of its bits.
static LANES: [[f32; RAYS]; 1 << RAYS] = {
    let mut lanes = [[0.0; RAYS]; 1 << RAYS];
    let mut mask = 0;
    while mask < lanes.len() {
        let mut lane = 0;
        while lane < RAYS {
            if mask >> lane & 1 != 0 {
                lanes[mask][lane] = 1.0;
            }
            lane += 1;
        }
        mask += 1;
    }
    lanes
};
