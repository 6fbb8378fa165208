//! A ray against eight boxes at once, conservatively.
//!
//! A slab's t is bound * (1 / direction) - origin * (1 / direction): with u = 2^-24, the reciprocal, both products, the
//! sum and the offset below round by less than 5 u |1/d| (|bound| + |origin|) together, fused or not. The near and far t
//! are moved apart by 6 u |1/d| (reach + |origin|), where the reach is the largest coordinate in the tree: an exact hit
//! is never lost, and there is slack for the rounding of the hit's own t. (Ize 2013, *Robust BVH ray traversal*, moves the
//! far t by a relative 2 ulp instead, which needs bound - origin to be formed first: twice the operations.)
//!
//! A direction component that is zero, or small against the largest, is replaced by 1e-18 of it, and the pad by how
//! far the ray strays then: 1/d stays finite, and no 0 * infinity arises. What still overflows turns into a pad that
//! lets everything pass.

use super::filter::{Filter, Filters};
use super::node::{Node, WIDTH};
use super::simd::{Array, Mask, Simd, Vector};
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;

/// A ray made ready for slab tests in one tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct SlabRay {
    reciprocal: [f32; 3],
    /// -origin / direction, less the pad.
    near_offset: [f32; 3],
    /// -origin / direction, plus the pad.
    far_offset: [f32; 3],
    /// Which of a node's six bounds is met first, by axis.
    near: [usize; 3],
    /// Rounded down, for t is rounded before it is held against it; not below 0.
    tmin: f32,
}

/// The smallest share of the largest direction component that a component keeps.
const SMALLEST: f32 = 1e-18;

/// Products of this size are not trusted to be finite after a sum.
const HUGE: f32 = 1e37;

impl SlabRay {
    /// `reach` is the tree's, `blur` by how much more than its own rounding the ray may be off (1: not at all).
    #[inline(always)]
    pub fn new(ray: &Ray, reach: Vec3, blur: f32) -> Self {
        let largest = ray.direction.abs().max_element();
        let smallest = (SMALLEST * largest).max(f32::MIN_POSITIVE);
        let span = ray.origin.abs() + reach;
        let stray = 4.0 * (smallest / largest) * span.max_element();
        let mut slab = Self {
            reciprocal: [0.0; 3],
            near_offset: [0.0; 3],
            far_offset: [0.0; 3],
            near: [0; 3],
            tmin: if ray.tmin > 0.0 { ray.tmin.next_down() } else { 0.0 },
        };
        for axis in 0..3 {
            let component = ray.direction[axis];
            let kept = if component.abs() < smallest { smallest.copysign(component) } else { component };
            let reciprocal = 1.0 / kept;
            let width = reciprocal.abs() * (6.0 * UNIT_ROUNDOFF * blur * span[axis] + stray);
            let pad = if reciprocal.abs() * span[axis] < HUGE { width } else { f32::INFINITY };
            let offset = -ray.origin[axis] * reciprocal;
            slab.reciprocal[axis] = reciprocal;
            slab.near_offset[axis] = offset - pad;
            slab.far_offset[axis] = offset + pad;
            slab.near[axis] = if reciprocal < 0.0 { axis + 3 } else { axis };
        }
        slab
    }

    /// The children the ray may hit something in, up to `limit`, as a bit mask; and where it enters each,
    /// not below 0.
    #[inline(always)]
    pub fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (u32, [f32; WIDTH]) {
        let mut near = S::V8::splat(self.tmin);
        let mut far = S::V8::splat(limit);
        for axis in 0..3 {
            let first = S::V8::load(&node.bounds[self.near[axis]]);
            let second = S::V8::load(&node.bounds[if self.near[axis] < 3 { axis + 3 } else { axis }]);
            let reciprocal = S::V8::splat(self.reciprocal[axis]);
            // The accumulator second, so that a NaN (infinity less infinity) is passed over.
            near = first.mul_add(reciprocal, S::V8::splat(self.near_offset[axis])).max(near);
            far = second.mul_add(reciprocal, S::V8::splat(self.far_offset[axis])).min(far);
        }
        (near.at_most(far).bits(), near.to_array())
    }
}

/// Rays made ready eight at a time.
pub(super) struct SlabRays {
    /// Of each axis: 1 / direction, and -origin / direction less and plus the pad.
    reciprocal: [[f32; 8]; 3],
    near_offset: [[f32; 8]; 3],
    far_offset: [[f32; 8]; 3],
    tmin: [f32; 8],
    filters: Filters,
    /// A bit for each ray that [is valid](Ray::is_valid).
    valid: u32,
}

impl SlabRays {
    /// As [`SlabRay::new`] for each of them, with no blur.
    #[inline(always)]
    pub fn new<S: Simd>(rays: &[Ray; 8], reach: Vec3) -> Self {
        let splat = S::V8::splat;
        let zero = splat(0.0);
        let [x, y, z, dx, dy, dz, tmin, tmax] = columns::<S>(rays);
        let (origin, direction) = ([x, y, z], [dx, dy, dz]);
        let largest = dx.abs().max(dy.abs()).max(dz.abs());
        let smallest = largest.mul(splat(SMALLEST)).max(splat(f32::MIN_POSITIVE));
        let span = [x.abs().add(splat(reach.x)), y.abs().add(splat(reach.y)), z.abs().add(splat(reach.z))];
        let stray = smallest.div(largest).mul(splat(4.0)).mul(span[0].max(span[1]).max(span[2]));
        let mut finite = zero;
        let empty = [[0.0; 8]; 3];
        let filters = Filters::new::<S>(origin, direction, tmin);
        let mut slabs =
            Self { reciprocal: empty, near_offset: empty, far_offset: empty, tmin: [0.0; 8], filters, valid: 0 };
        for axis in 0..3 {
            let d = direction[axis];
            finite = d.mul_add(zero, origin[axis].mul_add(zero, finite));
            let least = S::V8::select(d.less(zero), zero.sub(smallest), smallest);
            let kept = S::V8::select(d.abs().less(smallest), least, d);
            let reciprocal = splat(1.0).div(kept);
            let steep = reciprocal.abs();
            let width = steep.mul(span[axis].mul_add(splat(6.0 * UNIT_ROUNDOFF), stray));
            let is_small = steep.mul(span[axis]).less(splat(HUGE));
            let pad = S::V8::select(is_small, width, splat(f32::INFINITY));
            let offset = zero.sub(origin[axis]).mul(reciprocal);
            slabs.reciprocal[axis] = reciprocal.to_array();
            slabs.near_offset[axis] = offset.sub(pad).to_array();
            slabs.far_offset[axis] = offset.add(pad).to_array();
        }
        // Rounded down, for t is rounded before it is held against it.
        let least = tmin.mul(splat(1.0 - 4.0 * UNIT_ROUNDOFF)).sub(splat(f32::MIN_POSITIVE));
        slabs.tmin = least.max(zero).to_array();
        let in_range = zero.at_most(tmin).and(tmin.at_most(tmax));
        let directed = splat(f32::MIN_POSITIVE).at_most(largest).and(finite.at_most(zero));
        slabs.valid = in_range.and(directed).bits();
        slabs
    }

    /// One of them, for nodes and for triangles, if it is valid.
    #[inline(always)]
    pub fn get(&self, ray: usize) -> Option<(SlabRay, Filter)> {
        if self.valid >> ray & 1 == 0 {
            return None;
        }
        let side = |axis: usize| if self.reciprocal[axis][ray] < 0.0 { axis + 3 } else { axis };
        let of = |values: &[[f32; 8]; 3]| [values[0][ray], values[1][ray], values[2][ray]];
        let slab = SlabRay {
            reciprocal: of(&self.reciprocal),
            near_offset: of(&self.near_offset),
            far_offset: of(&self.far_offset),
            near: [side(0), side(1), side(2)],
            tmin: self.tmin[ray],
        };
        Some((slab, self.filters.get(ray)))
    }
}

/// Eight rays, field by field: origin, direction, tmin, tmax.
#[inline(always)]
pub(super) fn columns<S: Simd>([a, b, c, d, e, f, g, h]: &[Ray; 8]) -> [S::V8; 8] {
    // Written out: a closure mapped over the array may miss the instruction set.
    S::transpose([
        row::<S>(a),
        row::<S>(b),
        row::<S>(c),
        row::<S>(d),
        row::<S>(e),
        row::<S>(f),
        row::<S>(g),
        row::<S>(h),
    ])
}

#[inline(always)]
fn row<S: Simd>(&Ray { origin: o, direction: d, tmin, tmax }: &Ray) -> S::V8 {
    S::V8::load(&[o.x, o.y, o.z, d.x, d.y, d.z, tmin, tmax])
}
