//! 64 rays that share an origin, or that end in one point: made ready for tests in common.
//!
//! Shadow rays towards a point light do not share their origin but their end. They are turned round: the bundle starts
//! at the light, and t runs from there. The turned rays serve the tests that reject; what decides a hit is asked of the
//! rays as they were given.

use super::simd::{Simd, Vector};
use super::slab::SlabRay;
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;

/// Rays tested together by one vector instruction.
pub(super) const LANES: usize = 8;
/// Groups of them in a bundle.
pub(super) const GROUPS: usize = 8;
/// Rays in a bundle.
pub(super) const RAYS: usize = LANES * GROUPS;

/// One number for each ray.
pub(super) type PerRay = [[f32; LANES]; GROUPS];

/// The rays of a bundle, component by component.
pub(super) struct Bundle {
    /// Where they start.
    pub origin: [f32; 3],
    /// How far a ray's own origin may be from there, in each component.
    pub blur: f32,
    /// Directions.
    pub direction: [PerRay; 3],
    /// Smallest and largest component of the directions.
    pub low: [f32; 3],
    pub high: [f32; 3],
    /// Largest magnitude of a component of the directions.
    pub largest: f32,
    /// Least and most that t may be, in f32; rounded inwards, so that what lies between is within the range for sure.
    pub begin: PerRay,
    pub end: PerRay,
    /// Whether t runs from the common end back to the rays' own origins.
    pub is_turned: bool,
}

impl Bundle {
    /// None where the rays do not start, nor (`ends`) end, in one point, where one of them is not valid, or where a
    /// component of their directions changes its sign or vanishes.
    #[inline(always)]
    pub fn new<S: Simd>(rays: &[Ray; RAYS], ends: bool) -> Option<Self> {
        let empty = [[0.0; LANES]; GROUPS];
        let origin = rays[0].origin;
        let mut bundle = Self {
            origin: origin.to_array(),
            blur: 0.0,
            direction: [empty; 3],
            low: [0.0; 3],
            high: [0.0; 3],
            largest: 0.0,
            begin: empty,
            end: empty,
            is_turned: false,
        };
        let mut is_shared = true;
        let mut in_range = true;
        for group in 0..GROUPS {
            for lane in 0..LANES {
                let ray = &rays[group * LANES + lane];
                is_shared &= ray.origin == origin;
                in_range &= ray.tmin >= 0.0 && ray.tmin <= ray.tmax;
                bundle.begin[group][lane] = ray.tmin;
                bundle.end[group][lane] = ray.tmax;
                bundle.direction[0][group][lane] = ray.direction.x;
                bundle.direction[1][group][lane] = ray.direction.y;
                bundle.direction[2][group][lane] = ray.direction.z;
            }
        }
        if !in_range || !origin.is_finite() {
            return None;
        }
        if !is_shared {
            if !ends {
                return None;
            }
            bundle.turn(rays)?;
        }
        for axis in 0..3 {
            let sign = S::V8::splat(if bundle.is_turned { -1.0 } else { 1.0 });
            let mut low = S::V8::splat(f32::INFINITY);
            let mut high = S::V8::splat(f32::NEG_INFINITY);
            let mut zero = S::V8::splat(0.0);
            for group in &mut bundle.direction[axis] {
                let d = S::V8::load(group).mul(sign);
                *group = d.to_array();
                low = low.min(d);
                high = high.max(d);
                // Stays zero only for finite numbers.
                zero = d.mul_add(S::V8::splat(0.0), zero);
            }
            let (low, high) = (low.to_array(), high.to_array());
            let (mut least, mut most) = (low[0], high[0]);
            for lane in 1..LANES {
                least = if low[lane] < least { low[lane] } else { least };
                most = if high[lane] > most { high[lane] } else { most };
            }
            let one_sided = least > f32::MIN_POSITIVE || most < -f32::MIN_POSITIVE;
            if !one_sided || zero.at_most(S::V8::splat(0.0)) != 0xff {
                return None;
            }
            (bundle.low[axis], bundle.high[axis]) = (least, most);
            let magnitude = if most > -least { most } else { -least };
            bundle.largest = if magnitude > bundle.largest { magnitude } else { bundle.largest };
        }
        for group in 0..GROUPS {
            for lane in 0..LANES {
                let (low, high) = (bundle.begin[group][lane].next_up(), bundle.end[group][lane].next_down());
                // 1 - t is off by half a step of 1 at most.
                let (begin, end) = if bundle.is_turned { (1.0 - high + 1e-6, 1.0 - low - 1e-6) } else { (low, high) };
                bundle.begin[group][lane] = begin;
                bundle.end[group][lane] = end;
            }
        }
        Some(bundle)
    }

    /// Starts the bundle where the rays end, if that is one point up to rounding.
    #[inline(always)]
    fn turn(&mut self, rays: &[Ray; RAYS]) -> Option<()> {
        let end = rays[0].origin + rays[0].direction;
        let mut apart = Vec3::ZERO;
        let mut size = Vec3::ZERO;
        for ray in rays {
            // NaN, too.
            if !ray.is_valid() {
                return None;
            }
            // Farther than the common end, t does not run backwards from it.
            if ray.tmax > 1.0 {
                return None;
            }
            apart = apart.max((ray.origin + ray.direction - end).abs());
            size = size.max(ray.origin.abs() + ray.direction.abs());
        }
        let rounding = 4.0 * UNIT_ROUNDOFF * size.max_element();
        // A light of some size is no point: its rays are better traced one by one.
        if apart.max_element() > 4.0 * rounding {
            return None;
        }
        self.origin = end.to_array();
        self.blur = apart.max_element() + rounding;
        self.is_turned = true;
        Some(())
    }

    /// The two ends of the bundle for slab tests in a tree that reaches that far.
    #[inline(always)]
    pub fn slabs(&self, reach: Vec3) -> Option<[SlabRay; 2]> {
        let low = [1.0 / self.low[0], 1.0 / self.low[1], 1.0 / self.low[2]];
        let high = [1.0 / self.high[0], 1.0 / self.high[1], 1.0 / self.high[2]];
        let low = SlabRay::of_bundle(self.origin, low, reach, self.blur)?;
        Some([low, SlabRay::of_bundle(self.origin, high, reach, self.blur)?])
    }
}
