//! A ray by itself, made ready for nodes and triangles in as few instructions as will do.
//!
//! An axis a lane. Most rays have directions of which no component is small against the largest, and are where products
//! do not overflow: for these the bounds of [`slab`](crate::trace::bvh::reject::slab) need neither replacements nor
//! open axes, and numbers that are not finite fail the same tests. The others are made ready as those of everyone else,
//! out of the way.

use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;
use crate::trace::bvh::reject::Blur;
use crate::trace::bvh::reject::filter::{self, Filter};
use crate::trace::bvh::reject::slab::{HUGE, SLIGHT, SlabRay, least_t};
use crate::trace::bvh::reject::woop::{Margin, SLACK};
use crate::trace::bvh::simd::{Array, Mask, Portable, Simd, Three, Turned, Vector};

/// A ray by itself, in the order in which Embree's `RTCRay` begins: a caller's can be read where it is.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SingleRay {
    /// Where it starts.
    pub origin: Vec3,
    /// Nearest valid t; what is below 0 counts as 0.
    pub tmin: f32,
    /// Where it goes; not of unit length necessarily.
    pub direction: Vec3,
    /// Nothing depends on it: triangles stand still.
    pub time: f32,
    /// Farthest valid t.
    pub tmax: f32,
}

impl From<&Ray> for SingleRay {
    fn from(&Ray { origin, direction, tmin, tmax, time }: &Ray) -> Self {
        Self { origin, tmin, direction, time, tmax }
    }
}

/// [`Filter::axes`] of a ray along each axis.
const AXES: [[u32; 3]; 3] = [filter::rows(0), filter::rows(1), filter::rows(2)];

/// The share of the largest component that all must have, for the short way.
const STEEPEST: f32 = 1e-16;

impl SingleRay {
    /// The same ray.
    #[inline]
    pub fn ray(&self) -> Ray {
        let &Self { origin, direction, time, tmax, .. } = self;
        Ray { origin, direction, tmin: self.begin(), tmax, time }
    }

    #[inline(always)]
    pub(super) fn begin(&self) -> f32 {
        // NaN stays, so that the ray is not valid.
        if self.tmin < 0.0 { 0.0 } else { self.tmin }
    }

    /// Made ready for nodes, and what is left to be made ready for triangles; none where it [is not
    /// valid](Ray::is_valid). `reach` is the tree's. If it is not `BLURRED`, it is the ray that is meant.
    #[inline(always)]
    pub(in crate::trace::bvh) fn ready<S: Simd, const BLURRED: bool>(
        &self,
        reach: &[f32; 4],
        blur: Blur,
    ) -> Option<(SlabRay, Rest<S>)> {
        let splat = S::V4::splat;
        let Self { origin: o, direction: d, time, .. } = self;
        let tmin = self.begin();
        let (origin, direction) = (S::V4::load(&[o.x, o.y, o.z, self.tmin]), S::V4::load(&[d.x, d.y, d.z, *time]));
        let magnitude = direction.abs();
        let largest = magnitude.max(magnitude.yzx()).max(magnitude.yzx().yzx());
        let shorten = splat(1.0).div(largest);
        let slope = direction.mul(shorten);
        let inverse = splat(1.0).div(direction);
        let (steep, away) = (inverse.abs(), origin.abs());
        let span = away.add(S::V4::load(reach));
        let tiny = splat(f32::MIN_POSITIVE);
        let mut width = steep.mul_add(away.mul_add(splat(6.5 * UNIT_ROUNDOFF), tiny), tiny);
        let mut most = steep.mul(span);
        if BLURRED {
            let strayed = if blur.direction <= SLIGHT { away } else { span };
            let longest = strayed.max(strayed.yzx()).max(strayed.yzx().yzx());
            let stray = longest.mul_add(splat(1.1 * blur.direction), splat(1.1 * blur.origin));
            width = steep.mul_add(stray, width);
            most = most.max(width);
        }
        // False for NaN, which infinities become here or there.
        let is_usual = splat(STEEPEST).at_most(slope.abs()).and(most.less(splat(HUGE)));
        let is_usual = is_usual.and(splat(f32::MIN_POSITIVE).at_most(largest));
        let offset = splat(0.0).sub(origin.mul(inverse));
        let (mut reciprocal, mut near, mut far) = (inverse, offset.sub(width), offset.add(width));
        if is_usual.bits() & 0b111 != 0b111 {
            let [r, n, f] = unusual(self, reach, blur)?;
            (reciprocal, near, far) = (S::V4::load(&r), S::V4::load(&n), S::V4::load(&f));
        }
        let in_range = tmin <= self.tmax;
        if !in_range {
            return None;
        }
        let negative = reciprocal.less(splat(0.0)).bits();
        let slab = SlabRay {
            reciprocal: reciprocal.to_array(),
            near_offset: near.to_array(),
            far_offset: far.to_array(),
            first: SlabRay::first_rows(negative),
            tmin: least_t(tmin),
        };
        let largest_lanes = largest.at_most(magnitude).bits();
        Some((slab, Rest { origin, direction, slope, shorten, largest_lanes, tmin, blur }))
    }
}

/// What is left of a ray to be made ready for triangles, when it is for nodes. The root can be entered before: its
/// numbers take some time to come, in which this is done.
pub(in crate::trace::bvh) struct Rest<S: Simd> {
    origin: S::V4,
    direction: S::V4,
    /// The direction over its largest magnitude, and 1 over that.
    slope: S::V4,
    shorten: S::V4,
    /// A bit for each component of that magnitude.
    largest_lanes: u32,
    tmin: f32,
    blur: Blur,
}

impl<S: Simd> Rest<S> {
    #[inline(always)]
    pub fn filter(self) -> Filter {
        let Self { origin, direction, slope, shorten, largest_lanes, tmin, blur } = self;
        // The last of those that are largest.
        let axis = if largest_lanes & 0b100 != 0 { 2 } else { (largest_lanes >> 1 & 1) as usize };
        let [x, y, z, _] = origin.turned(axis).to_array();
        let [_, _, along, _] = direction.turned(axis).to_array();
        let [p, q, ..] = slope.turned(axis).to_array();
        let sign = if along < 0.0 { 1.0 } else { -1.0 };
        let shear = [p * sign, q * sign];
        let [shorten, ..] = shorten.to_array();
        // No number is NaN: a maximum of any kind will do.
        let (p, q) = (shear[0].abs(), shear[1].abs());
        let width = 1.0 + if p > q { p } else { q };
        Filter {
            axes: AXES[axis],
            origin: [x, y, z],
            shear,
            margin: Margin::of_one(width, blur.direction),
            against: -along,
            shorten,
            begin: tmin * along.abs() * (1.0 - SLACK),
            blur,
        }
    }
}

/// The long way, for rays along an axis, far away, or not valid: reciprocals, near and far offsets.
#[cold]
#[inline(never)]
fn unusual(ray: &SingleRay, &[x, y, z, _]: &[f32; 4], blur: Blur) -> Option<[[f32; 4]; 3]> {
    let ray = ray.ray();
    if !ray.is_valid() {
        return None;
    }
    let SlabRay { reciprocal, near_offset, far_offset, .. } = SlabRay::new::<Portable>(&ray, Vec3::new(x, y, z), blur);
    Some([reciprocal, near_offset, far_offset])
}
