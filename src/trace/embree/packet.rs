//! Rays and hits as Embree lays them out: one array a component, as long as the packet is wide.
//!
//! Embree reads rays with vector loads. A load that follows narrower stores to the same bytes waits until they have
//! left the store buffer, so rays are transposed in registers, four at a time, and stored as whole vectors. Filling
//! bindgen's structs field by field would be simpler, and leaves it to the optimiser which stores come out.
//!
//! The layouts are stated here once for every version and width: a packet of `4 * G` rays is 12 rows of a ray and then
//! the rows of a hit, of which some versions have one more than others, behind all that are read. Assertions below hold
//! this to the header.

use std::array::from_fn;
use std::mem::offset_of;

use super::sys;
use crate::math::{Mat4, Vec4};
use crate::ray::Ray;

/// Rows of a ray, or fields of a single one.
pub(super) mod ray_row {
    pub const ORIGIN: usize = 0;
    pub const TNEAR: usize = 3;
    pub const DIRECTION: usize = 4;
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

/// A hit with Embree's ids.
#[derive(Clone, Copy)]
pub(super) struct Answer {
    pub t: f32,
    pub u: f32,
    pub v: f32,
    pub primitive: u32,
    pub geometry: u32,
    pub instance: Option<u32>,
}

/// `RTCRay`.
#[repr(C, align(16))]
pub(super) struct SingleRay([Vec4; 3]);

/// `RTCRayHit`.
#[repr(C, align(16))]
pub(super) struct SingleRayHit {
    ray: SingleRay,
    hit: [u32; size_of::<sys::RTCHit>() / 4],
}

impl SingleRay {
    #[inline]
    pub fn new(ray: &Ray) -> Self {
        let time = 0.0;
        let (mask, id, flags) = (f32::from_bits(u32::MAX), 0.0, 0.0);
        Self([ray.origin.extend(ray.tmin), ray.direction.extend(time), Vec4::new(ray.tmax, mask, id, flags)])
    }

    /// The end of the ray; negative infinity once it is occluded.
    #[inline]
    pub fn tfar(&self) -> f32 {
        self.0[2].x
    }
}

impl SingleRayHit {
    #[inline]
    pub fn new(ray: &Ray) -> Self {
        Self { ray: SingleRay::new(ray), hit: [sys::INVALID_ID; _] }
    }

    #[inline]
    pub fn answer(&self) -> Option<Answer> {
        answer(self.ray.tfar(), |row| self.hit[row])
    }
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

/// Which rays of a packet Embree is to trace: -1, or 0 for those to leave alone.
#[repr(C, align(64))]
pub(super) struct Active<const G: usize>(pub [[i32; 4]; G]);

/// Stands in for rays that are not traced: even if it were, it would hit nothing.
const NOWHERE: Ray = Ray { tmin: f32::INFINITY, tmax: 0.0, ..Ray::new(crate::math::Vec3::ZERO, crate::math::Vec3::Z) };

impl<const G: usize> Rays<G> {
    /// Up to `4 * G` rays; those that are missing or not valid are inactive.
    #[inline]
    pub fn load(rays: &[Ray]) -> (Self, Active<G>) {
        let mut active = Active([[-1; 4]; G]);
        let mut rows = [[Vec4::ZERO; G]; ray_row::COUNT];
        rows[ray_row::MASK] = [Vec4::splat(f32::from_bits(u32::MAX)); G];
        for (g, active) in active.0.iter_mut().enumerate() {
            let four: [Ray; 4] = from_fn(|k| match rays.get(4 * g + k) {
                Some(ray) if ray.is_valid() => *ray,
                _ => {
                    active[k] = 0;
                    NOWHERE
                }
            });
            let [a, b, c, d] = four.map(|ray| ray.origin.extend(ray.tmin));
            let starts = Mat4::from_cols(a, b, c, d).transpose();
            let [a, b, c, d] = four.map(|ray| ray.direction.extend(ray.tmax));
            let ways = Mat4::from_cols(a, b, c, d).transpose();
            for axis in 0..3 {
                rows[ray_row::ORIGIN + axis][g] = starts.col(axis);
                rows[ray_row::DIRECTION + axis][g] = ways.col(axis);
            }
            rows[ray_row::TNEAR][g] = starts.w_axis;
            rows[ray_row::TFAR][g] = ways.w_axis;
        }
        (Self(rows), active)
    }

    #[inline]
    fn tfar(&self, lane: usize) -> f32 {
        self.0[ray_row::TFAR][lane / 4][lane % 4]
    }

    /// Whether Embree found the ray occluded: its end is then negative infinity.
    #[inline]
    pub fn is_occluded(&self, lane: usize) -> bool {
        self.tfar(lane) < 0.0
    }
}

impl<const G: usize> RayHits<G> {
    /// The rays, which have hit nothing yet.
    #[inline]
    pub const fn new(rays: Rays<G>) -> Self {
        Self { rays, hits: [[[sys::INVALID_ID; 4]; G]; hit_row::COUNT] }
    }

    /// What the ray hit.
    #[inline]
    pub fn answer(&self, lane: usize) -> Option<Answer> {
        answer(self.rays.tfar(lane), |row| self.hits[row][lane / 4][lane % 4])
    }
}

#[inline]
fn answer(t: f32, hit: impl Fn(usize) -> u32) -> Option<Answer> {
    let geometry = hit(hit_row::GEOMETRY);
    (geometry != sys::INVALID_ID).then(|| Answer {
        t,
        u: f32::from_bits(hit(hit_row::U)),
        v: f32::from_bits(hit(hit_row::V)),
        primitive: hit(hit_row::PRIMITIVE),
        geometry,
        instance: Some(hit(hit_row::INSTANCE)).filter(|&instance| instance != sys::INVALID_ID),
    })
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
    assert!(offset_of!(SingleRayHit, hit) == size_of::<sys::RTCRay>());
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
        let (packet, active) = Rays::<2>::load(&rays);
        assert_eq!(active.0, [[-1, -1, 0, -1], [-1, -1, -1, 0]]);
        for lane in [0, 1, 3, 4, 5, 6] {
            let get = |row: usize| packet.0[row][lane / 4][lane % 4];
            let ray = rays[lane];
            assert_eq!([get(0), get(1), get(2), get(3)], [ray.origin.x, ray.origin.y, ray.origin.z, ray.tmin]);
            assert_eq!([get(4), get(5), get(6), get(7)], [ray.direction.x, ray.direction.y, ray.direction.z, 0.0]);
            assert_eq!((get(8), get(9).to_bits()), (ray.tmax, u32::MAX));
        }
        assert!((0..8).all(|lane| !packet.is_occluded(lane)));
    }
}
