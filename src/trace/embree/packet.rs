//! Rays and hits as Embree lays them out: one array a component, as long as the packet is wide.
//!
//! Embree reads rays with vector loads. A load that follows narrower stores to the same bytes waits until they have
//! left the store buffer, so rays are transposed in registers, four at a time, and stored as whole vectors. Filling
//! bindgen's structs field by field would be simpler, and leaves it to the optimiser which stores come out.
//!
//! A packet is made once a batch and filled again and again: rows that Embree does not change keep their constants, and
//! nothing is moved. With a fresh packet for each query, packing and unpacking took a third of Embree's own time on
//! coherent rays.
//!
//! The layouts are stated here once for every version and width: a packet of `4 * G` rays is 12 rows of a ray and then
//! the rows of a hit, of which some versions have one more than others, behind all that are read. Assertions below hold
//! this to the header.

use std::mem::offset_of;

use super::lanes::{Lanes, NOWHERE};
use super::reach::Reach;
use super::single::{SingleRay, SingleRayHit};
use super::{PartIds, sys};
use crate::math::{BVec4A, Mat4, Vec4};
use crate::memory;
use crate::ray::{Hit, Ray};

/// Rows of a ray, or fields of a single one.
pub(super) mod ray_row {
    pub const ORIGIN: usize = 0;
    pub const TNEAR: usize = 3;
    pub const DIRECTION: usize = 4;
    pub const TIME: usize = 7;
    pub const TFAR: usize = 8;
    pub const MASK: usize = 9;
    pub const COUNT: usize = 12;
}

/// Rows of a hit, or fields of a single one; a normal comes first.
pub(super) mod hit_row {
    pub const NORMAL: usize = 0;
    pub const U: usize = 3;
    pub const V: usize = 4;
    pub const PRIMITIVE: usize = 5;
    pub const GEOMETRY: usize = 6;
    pub const INSTANCE: usize = 7;
    /// With the `instPrimID` of some versions and the padding of none: `RTCHit4` has none.
    pub const COUNT: usize = size_of::<super::sys::RTCHit4>() / 16;
}

/// `RTCRay4` for G = 1, `RTCRay8` for 2, `RTCRay16` for 4.
#[repr(C, align(64))]
pub(super) struct Rays<const G: usize>([[Vec4; G]; ray_row::COUNT]);

/// `RTCRayHit4` for G = 1, `RTCRayHit8` for 2, `RTCRayHit16` for 4.
#[repr(C, align(64))]
pub(super) struct RayHits<const G: usize> {
    rays: Rays<G>,
    hits: [[[u32; 4]; G]; hit_row::COUNT],
}

/// Which rays of a packet Embree is to trace: in bits -1, or 0 for those to leave alone.
#[repr(C, align(64))]
pub(super) struct Active<const G: usize>([Vec4; G]);

/// The f32 of all bits set.
pub(super) const ALL_BITS: f32 = f32::from_bits(u32::MAX);

/// One thing for each ray of a packet, in groups of four.
pub(super) type Packet<T, const G: usize> = [[T; 4]; G];

/// Calls `trace` for each packet of `rays` and the places of its answers; what is missing of the last packet is made up
/// of rays that are not valid.
#[inline(always)]
pub(super) fn each<T: Copy + Default, const G: usize>(
    rays: &[Ray],
    answers: &mut [T],
    mut trace: impl FnMut(&Packet<Ray, G>, &mut Packet<T, G>),
) {
    let (ray_fours, last_rays) = rays.as_chunks::<4>();
    let (answer_fours, last_answers) = answers.as_chunks_mut::<4>();
    let (ray_packets, more_rays) = ray_fours.as_chunks::<G>();
    let (answer_packets, more_answers) = answer_fours.as_chunks_mut::<G>();
    for (rays, answers) in ray_packets.iter().zip(answer_packets) {
        fetch_ahead(rays);
        trace(rays, answers);
    }
    let rest = more_rays.as_flattened().iter().chain(last_rays);
    let mut packet = [[NOWHERE; 4]; G];
    packet.as_flattened_mut().iter_mut().zip(rest).for_each(|(place, ray)| *place = *ray);
    let rest = more_answers.as_flattened_mut().iter_mut().chain(last_answers);
    if rest.size_hint().0 > 0 {
        let mut answered = [[T::default(); 4]; G];
        trace(&packet, &mut answered);
        rest.zip(answered.as_flattened()).for_each(|(place, answer)| *place = *answer);
    }
}

/// Has rays loaded that come soon after those of a packet: from memory mostly, as those of the native tracer's bundles
/// are. There may be none.
#[inline(always)]
fn fetch_ahead<const G: usize>(rays: &Packet<Ray, G>) {
    const AHEAD: usize = 192;
    let ahead = rays.as_ptr().cast::<Ray>().wrapping_add(AHEAD).cast::<u8>();
    for offset in (0..size_of_val(rays)).step_by(64) {
        memory::prefetch(ahead.wrapping_add(offset));
    }
}

impl<const G: usize> Active<G> {
    /// None.
    #[inline]
    pub const fn new() -> Self {
        Self([Vec4::ZERO; G])
    }

    /// As Embree takes it.
    #[inline]
    pub const fn as_ptr(&self) -> *const i32 {
        self.0.as_ptr().cast()
    }
}

impl<const G: usize> Rays<G> {
    /// Room for rays.
    #[inline]
    pub const fn new() -> Self {
        let mut rows = [[Vec4::ZERO; G]; ray_row::COUNT];
        rows[ray_row::MASK] = [Vec4::splat(ALL_BITS); G];
        Self(rows)
    }

    /// Takes new rays; those that Embree cannot trace are inactive.
    #[inline(always)]
    pub fn load(&mut self, rays: &Packet<Ray, G>, reach: &Reach, active: &mut Active<G>) {
        let mut traceable = BVec4A::splat(true);
        for (g, four) in rays.iter().enumerate() {
            let lanes = Lanes::new(four);
            traceable &= lanes.surely_traceable(reach);
            self.put(g, &lanes);
            if reach.is_moving {
                // From 0 to 1, as Embree demands.
                self.0[ray_row::TIME][g] = Vec4::from_array(four.each_ref().map(Ray::moment));
            }
            active.0[g] = Vec4::splat(ALL_BITS);
        }
        // One branch a packet.
        if !traceable.all() {
            self.leave_out_untraceable(rays, reach, active);
        }
    }

    #[inline(always)]
    fn put(&mut self, group: usize, lanes: &Lanes) {
        for axis in 0..3 {
            self.0[ray_row::ORIGIN + axis][group] = lanes.origin[axis];
            self.0[ray_row::DIRECTION + axis][group] = lanes.direction[axis];
        }
        self.0[ray_row::TNEAR][group] = lanes.tmin;
        self.0[ray_row::TFAR][group] = lanes.tmax;
    }

    /// Judges each ray; in the place of those that Embree cannot trace stands one that hits nothing.
    #[cold]
    #[inline(never)]
    fn leave_out_untraceable(&mut self, rays: &Packet<Ray, G>, reach: &Reach, active: &mut Active<G>) {
        for (g, four) in rays.iter().enumerate() {
            active.0[g] = Vec4::from_array(four.map(|ray| if reach.has(&ray) { ALL_BITS } else { 0.0 }));
            self.put(g, &Lanes::new(&four.map(|ray| if reach.has(&ray) { ray } else { NOWHERE })));
        }
    }

    /// Whether Embree found the rays of a group occluded: their ends are then negative infinity.
    #[inline(always)]
    pub fn occluded(&self, group: usize) -> [bool; 4] {
        self.tfar(group).map(|tfar| tfar < 0.0)
    }

    #[inline(always)]
    fn tfar(&self, group: usize) -> &[f32; 4] {
        self.0[ray_row::TFAR][group].as_ref()
    }
}

impl<const G: usize> RayHits<G> {
    /// Room for rays and their hits.
    #[inline]
    pub const fn new() -> Self {
        Self { rays: Rays::new(), hits: [[[sys::INVALID_ID; 4]; G]; hit_row::COUNT] }
    }

    /// Takes new rays, which have hit nothing yet; those that Embree cannot trace are inactive.
    #[inline(always)]
    pub fn load(&mut self, rays: &Packet<Ray, G>, reach: &Reach, active: &mut Active<G>) {
        self.rays.load(rays, reach, active);
        self.hits[hit_row::GEOMETRY] = [[sys::INVALID_ID; 4]; G];
        self.hits[hit_row::INSTANCE] = [[sys::INVALID_ID; 4]; G];
    }

    /// What the rays of a group hit. `ids` turns Embree's ids of a geometry and an instance into the scene's; `recent`
    /// is kept from group to group.
    ///
    /// Neighbours mostly hit the same geometry or nothing, so four rays are one comparison each, and no branch depends
    /// on a single ray unless they differ.
    #[inline(always)]
    pub fn hits(
        &self,
        group: usize,
        hits: &mut [Option<Hit>; 4],
        recent: &mut Recent,
        ids: impl Fn(u32, Option<u32>) -> PartIds,
    ) {
        let (geometry, instance) = (self.hits[hit_row::GEOMETRY][group], self.hits[hit_row::INSTANCE][group]);
        if geometry == [sys::INVALID_ID; 4] {
            *hits = [None; 4];
            return;
        }
        let row = |row: usize| bytemuck::cast(self.hits[row][group]);
        let (t, primitive) = (self.rays.0[ray_row::TFAR][group], row(hit_row::PRIMITIVE));
        let columns = Mat4::from_cols(t, row(hit_row::U), row(hit_row::V), primitive).transpose();
        let columns = [columns.x_axis, columns.y_axis, columns.z_axis, columns.w_axis];
        // Written as a vector of t, u, v and primitive and a pair of ids.
        let hit = |lane: usize, PartIds { geometry, instance }| {
            let [[t, u], [v, primitive]]: [[u32; 2]; 2] = bytemuck::cast(columns[lane]);
            Some(bytemuck::cast([[t, u], [v, primitive], [geometry, instance]]))
        };
        if geometry == [recent.geometry; 4] && instance == [sys::INVALID_ID; 4] {
            for (lane, place) in hits.iter_mut().enumerate() {
                *place = hit(lane, recent.ids);
            }
            return;
        }
        for (lane, place) in hits.iter_mut().enumerate() {
            *place = None;
            if geometry[lane] != sys::INVALID_ID {
                let instance = Some(instance[lane]).filter(|&instance| instance != sys::INVALID_ID);
                let ids = ids(geometry[lane], instance);
                if instance.is_none() {
                    *recent = Recent { geometry: geometry[lane], ids };
                }
                *place = hit(lane, ids);
            }
        }
    }
}

/// The geometry hit most recently outside any instance, by Embree's id and the scene's.
pub(super) struct Recent {
    geometry: u32,
    ids: PartIds,
}

impl Recent {
    /// None yet.
    pub const NONE: Self = Self { geometry: sys::INVALID_ID, ids: PartIds { geometry: 0, instance: 0 } };
}

/// Holds the layouts of one width to the header's. Ours may be longer by padding; Embree knows nothing of that.
macro_rules! assert_layout {
    ($ours:ty, $width:literal, $ray:ident, $hit:ident, $ray_hit:ident) => {
        const _: () = {
            const ROW: usize = 4 * $width;
            assert!(offset_of!(sys::$ray, org_x) == ray_row::ORIGIN * ROW);
            assert!(offset_of!(sys::$ray, tnear) == ray_row::TNEAR * ROW);
            assert!(offset_of!(sys::$ray, dir_x) == ray_row::DIRECTION * ROW);
            assert!(offset_of!(sys::$ray, tfar) == ray_row::TFAR * ROW);
            assert!(offset_of!(sys::$ray, mask) == ray_row::MASK * ROW);
            assert!(size_of::<sys::$ray>() == ray_row::COUNT * ROW);
            assert!(offset_of!(sys::$hit, Ng_x) == hit_row::NORMAL * ROW);
            assert!(offset_of!(sys::$hit, u) == hit_row::U * ROW);
            assert!(offset_of!(sys::$hit, v) == hit_row::V * ROW);
            assert!(offset_of!(sys::$hit, primID) == hit_row::PRIMITIVE * ROW);
            assert!(offset_of!(sys::$hit, geomID) == hit_row::GEOMETRY * ROW);
            assert!(offset_of!(sys::$hit, instID) == hit_row::INSTANCE * ROW);
            assert!(offset_of!(sys::$ray_hit, ray) == 0);
            assert!(offset_of!(sys::$ray_hit, hit) == size_of::<sys::$ray>());
            assert!(size_of::<$ours>() >= size_of::<sys::$ray_hit>());
            assert!(align_of::<$ours>() >= align_of::<sys::$ray_hit>());
        };
    };
}
assert_layout!(SingleRayHit, 1, RTCRay, RTCHit, RTCRayHit);
assert_layout!(RayHits<1>, 4, RTCRay4, RTCHit4, RTCRayHit4);
assert_layout!(RayHits<2>, 8, RTCRay8, RTCHit8, RTCRayHit8);
assert_layout!(RayHits<4>, 16, RTCRay16, RTCHit16, RTCRayHit16);
const _: () = {
    assert!(size_of::<SingleRay>() == size_of::<sys::RTCRay>());
    assert!(offset_of!(RayHits<1>, hits) == size_of::<sys::RTCRay4>());
    assert!(offset_of!(RayHits<2>, hits) == size_of::<sys::RTCRay8>());
    assert!(offset_of!(RayHits<4>, hits) == size_of::<sys::RTCRay16>());
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn rays_are_transposed_and_bad_ones_are_inactive() {
        let mut rays: Vec<Ray> = (0..7)
            .map(|i| {
                let x = i as f32;
                Ray { tmin: x + 0.5, tmax: x + 9.0, ..Ray::new(Vec3::new(x, x + 1.0, x + 2.0), Vec3::new(3.0, x, 5.0)) }
            })
            .collect();
        rays[2].direction = Vec3::ZERO;
        let (mut packet, mut active) = (Rays::<2>::new(), Active::new());
        let mut answers = [0; 7];
        each(&rays, &mut answers, |rays, answers| {
            packet.load(rays, &Reach::WORLD, &mut active);
            *answers = [[1, 2, 3, 4], [5, 6, 7, 8]];
        });
        assert_eq!(answers, [1, 2, 3, 4, 5, 6, 7]);
        let bits = active.0.map(|four| four.to_array().map(|lane| lane.to_bits() as i32));
        assert_eq!(bits, [[-1, -1, 0, -1], [-1, -1, -1, 0]]);
        for lane in [0, 1, 3, 4, 5, 6] {
            let get = |row: usize| packet.0[row][lane / 4][lane % 4];
            let ray = rays[lane];
            assert_eq!([get(0), get(1), get(2), get(3)], [ray.origin.x, ray.origin.y, ray.origin.z, ray.tmin]);
            assert_eq!([get(4), get(5), get(6), get(7)], [ray.direction.x, ray.direction.y, ray.direction.z, 0.0]);
            assert_eq!((get(8), get(9).to_bits()), (ray.tmax, u32::MAX));
        }
        assert_eq!([packet.occluded(0), packet.occluded(1)], [[false; 4]; 2]);
    }

    #[test]
    fn times_are_told_where_something_moves() {
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        let rays = [[0.25, -1.0, f32::NAN, 7.0].map(|time| Ray { time, ..ray })];
        let (mut packet, mut active) = (Rays::<1>::new(), Active::new());
        let mut reach = Reach::WORLD;
        reach.is_moving = true;
        packet.load(&rays, &reach, &mut active);
        assert_eq!(packet.0[ray_row::TIME][0].to_array(), [0.25, 0.0, 0.0, 1.0]);
    }
}
