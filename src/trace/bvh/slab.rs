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
