//! How far the rays of a bundle still look, in a unit that they share in all systems of coordinates: t.

use super::pencil::Pencil;
use super::rays::{Bundle, SLACK, TINY};
use crate::trace::bvh::simd::{Group, Mask, PerRay, RAYS, Simd, Vector};

/// Which t of each ray are still of interest, in units of its direction; of the turned one where the bundle is turned.
pub(super) struct RayIntervals {
    /// The least t, rounded inwards and outwards.
    pub begin: PerRay,
    pub start: PerRay,
    /// A hit nearer than this is the nearest for sure.
    pub sure: PerRay,
    /// No hit beyond this is wanted; rounded outwards. Below every t for a ray that is done.
    pub limit: PerRay,
}

impl RayIntervals {
    pub fn new() -> Self {
        Self { begin: PerRay::ZERO, start: PerRay::ZERO, sure: PerRay::ZERO, limit: PerRay::ZERO }
    }

    /// From tmin, in `begin`, and tmax, in `limit`.
    #[inline(always)]
    pub fn open<S: Simd>(&mut self, is_turned: bool) {
        let splat = S::Wide::splat;
        for group in 0..RAYS / S::Wide::LANES {
            let (begin, end) = (S::Wide::at(&self.begin, group), S::Wide::at(&self.limit, group));
            let (begin, start, sure, limit) = if is_turned {
                // In turned t, both inwards and both outwards. 1 - t is off by half a step of 1 at most.
                let (a, b) = (splat(1.0 + 1e-6), splat(1.0 - 1e-6));
                (a.sub(end), b.sub(end), b.sub(begin), a.sub(begin))
            } else {
                // A t that overflows is no hit.
                (begin, begin, end.min(splat(f32::MAX)), end)
            };
            begin.put(&mut self.begin, group);
            start.put(&mut self.start, group);
            sure.put(&mut self.sure, group);
            limit.put(&mut self.limit, group);
        }
    }

    /// Takes what has become less in t' since `bundle` was made ready.
    #[inline(always)]
    pub fn shorten<S: Simd, P: Pencil>(&mut self, bundle: &Bundle, sure: &PerRay, limit: &PerRay) {
        let splat = S::Wide::splat;
        for group in 0..RAYS / S::Wide::LANES {
            let (least, most) = (S::Wide::at(sure, group), S::Wide::at(limit, group));
            let is_less = most.less(S::Wide::at(&bundle.limit, group)).or(least.less(S::Wide::at(&bundle.end, group)));
            if is_less.bits() != 0 {
                let shrink = splat(1.0).div(S::Wide::at(&bundle.depth, group));
                let (old_sure, old_limit) = (S::Wide::at(&self.sure, group), S::Wide::at(&self.limit, group));
                let (mut least, mut most) = (least, most);
                if P::IS_PARALLEL {
                    // The slack of both is more than the difference rounds, for neither is much less than where the ray
                    // starts.
                    let start = S::Wide::at(&bundle.start[2], group);
                    least = least.mul_add(splat(1.0 - SLACK), splat(-TINY)).sub(start);
                    most = most.mul_add(splat(1.0 + SLACK), splat(TINY)).sub(start);
                }
                let least = least.mul(shrink).mul_add(splat(1.0 - SLACK), splat(-TINY)).min(old_sure);
                let most = most.mul(shrink).mul_add(splat(1.0 + SLACK), splat(TINY)).min(old_limit);
                least.put_where(is_less, &mut self.sure.0, group);
                most.put_where(is_less, &mut self.limit.0, group);
            }
        }
    }

    /// A bit for each ray that is done.
    #[inline(always)]
    pub fn done<S: Simd>(&self) -> u64 {
        let mut done = 0;
        for group in 0..RAYS / S::Wide::LANES {
            let is_done = S::Wide::at(&self.limit, group).less(S::Wide::splat(0.0));
            done |= u64::from(is_done.bits()) << (S::Wide::LANES * group);
        }
        done
    }

    /// One ray's, from t.
    pub fn set(&mut self, ray: usize, sure: f32, limit: f32) {
        (self.sure.0[ray], self.limit.0[ray]) = (sure, limit);
    }
}
