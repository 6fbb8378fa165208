//! A single ray and its hit as Embree lays them out.
//!
//! What is judged by four rays at a time is whether Embree can trace them: one by one, that took half of all
//! instructions around a query.

use super::lanes::Lanes;
use super::packet::{ALL_BITS, hit_row};
use super::reach::Reach;
use super::{PartIds, sys};
use crate::math::Vec4;
use crate::ray::{Hit, Ray};

/// `RTCRay`.
#[repr(C, align(16))]
pub(super) struct SingleRay([Vec4; 3]);

/// `RTCRayHit`.
#[repr(C, align(16))]
pub(super) struct SingleRayHit {
    ray: SingleRay,
    hit: [u32; size_of::<sys::RTCHit>() / 4],
}

/// Calls `trace` for each ray that Embree can trace, and gives `miss` for the others.
#[inline(always)]
pub(super) fn each<T: Copy>(rays: &[Ray], answers: &mut [T], miss: T, reach: &Reach, mut trace: impl FnMut(&Ray) -> T) {
    for (rays, answers) in rays.chunks(4).zip(answers.chunks_mut(4)) {
        let all_traceable = rays.first_chunk::<4>().is_some_and(|four| Lanes::new(four).surely_traceable(reach).all());
        for (ray, answer) in rays.iter().zip(answers) {
            *answer = if all_traceable || reach.has(ray) { trace(ray) } else { miss };
        }
    }
}

impl SingleRay {
    /// Room for a ray.
    #[inline]
    pub const fn new() -> Self {
        // Time 0, every bit of the mask; id and flags 0.
        Self([Vec4::ZERO, Vec4::ZERO, Vec4::new(0.0, ALL_BITS, 0.0, 0.0)])
    }

    /// Takes a ray that Embree can trace.
    #[inline(always)]
    pub fn load(&mut self, ray: &Ray) {
        self.0[0] = ray.origin.extend(ray.tmin);
        self.0[1] = ray.direction.extend(ray.moment());
        self.0[2] = Vec4::new(ray.tmax, ALL_BITS, 0.0, 0.0);
    }

    /// The end of the ray; negative infinity once it is occluded.
    #[inline(always)]
    pub fn tfar(&self) -> f32 {
        self.0[2].x
    }
}

impl SingleRayHit {
    /// Room for a ray and its hit.
    #[inline]
    pub const fn new() -> Self {
        Self { ray: SingleRay::new(), hit: [sys::INVALID_ID; _] }
    }

    /// Takes a ray that Embree can trace, which has hit nothing yet.
    #[inline(always)]
    pub fn load(&mut self, ray: &Ray) {
        self.hit[hit_row::GEOMETRY] = sys::INVALID_ID;
        self.hit[hit_row::INSTANCE] = sys::INVALID_ID;
        self.ray.load(ray);
    }

    /// What the ray hit; `ids` turns Embree's ids of a geometry and an instance into the scene's.
    #[inline(always)]
    pub fn hit(&self, ids: impl Fn(u32, Option<u32>) -> PartIds) -> Option<Hit> {
        let geometry = self.hit[hit_row::GEOMETRY];
        if geometry == sys::INVALID_ID {
            return None;
        }
        let instance = Some(self.hit[hit_row::INSTANCE]).filter(|&instance| instance != sys::INVALID_ID);
        let PartIds { geometry, instance } = ids(geometry, instance);
        Some(Hit {
            t: self.ray.tfar(),
            u: f32::from_bits(self.hit[hit_row::U]),
            v: f32::from_bits(self.hit[hit_row::V]),
            primitive: self.hit[hit_row::PRIMITIVE],
            geometry,
            instance,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn only_valid_rays_are_traced() {
        let rays: Vec<Ray> = (0..11)
            .map(|i| Ray { tmin: if i % 5 == 3 { f32::NAN } else { i as f32 }, ..Ray::new(Vec3::ONE, Vec3::X) })
            .collect();
        let mut answers = [7.0; 11];
        each(&rays, &mut answers, -1.0, &Reach::WORLD, |ray| ray.tmin);
        assert_eq!(answers, [0.0, 1.0, 2.0, -1.0, 4.0, 5.0, 6.0, 7.0, -1.0, 9.0, 10.0]);
    }
}
