//! A ray against eight boxes at once, conservatively.
//!
//! A slab's t is (bound - origin) * (1 / direction) in f32: three roundings, so it is off by less than 3 u |1/d|
//! (|bound| + |origin|), with u = 2^-24. The near and far t are moved apart by 4 u |1/d| (reach + |origin|), where the
//! reach is the largest coordinate in the tree: an exact hit is never lost, and there is slack for the rounding of the
//! hit's own t (Ize 2013, *Robust BVH ray traversal*, moves the far t by a relative 2 ulp instead, which does not cover
//! a bound - origin that is itself rounded).
//!
//! A direction component that is zero, or small against the largest, is replaced by 1e-18 of it, and the pad by how
//! far the ray strays then: 1/d stays finite, and no 0 * infinity arises.

use super::node::{Node, WIDTH};
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;

/// A ray made ready for slab tests in one tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct SlabRay {
    origin: [f32; 3],
    reciprocal: [f32; 3],
    pad: [f32; 3],
    /// Which of a node's six bounds is met first, by axis.
    near: [usize; 3],
    tmin: f32,
}

/// The smallest share of the largest direction component that a component keeps.
const SMALLEST: f32 = 1e-18;

impl SlabRay {
    /// `reach` is the tree's, `blur` by how much more than its own rounding the ray may be off (1: not at all).
    #[inline(always)]
    pub fn new(ray: &Ray, reach: Vec3, blur: f32) -> Self {
        let origin = ray.origin.to_array();
        let largest = ray.direction.abs().max_element();
        let smallest = (SMALLEST * largest).max(f32::MIN_POSITIVE);
        let span = ray.origin.abs() + reach;
        let stray = 4.0 * (smallest / largest) * span.max_element();
        let mut slab = Self { origin, reciprocal: [0.0; 3], pad: [0.0; 3], near: [0; 3], tmin: ray.tmin.next_down() };
        for axis in 0..3 {
            let component = ray.direction[axis];
            let kept = if component.abs() < smallest { smallest.copysign(component) } else { component };
            let reciprocal = 1.0 / kept;
            slab.reciprocal[axis] = reciprocal;
            slab.pad[axis] = reciprocal.abs() * (4.0 * UNIT_ROUNDOFF * blur * span[axis] + stray);
            slab.near[axis] = if reciprocal < 0.0 { axis + 3 } else { axis };
        }
        slab
    }

    /// The children the ray may hit something in, up to `limit`, as a bit mask; and where it enters each.
    #[inline(always)]
    pub fn enter(&self, node: &Node, limit: f32) -> (u32, [f32; WIDTH]) {
        let mut near = [self.tmin; WIDTH];
        let mut far = [limit; WIDTH];
        for axis in 0..3 {
            let (origin, reciprocal, pad) = (self.origin[axis], self.reciprocal[axis], self.pad[axis]);
            let first = &node.bounds[self.near[axis]];
            let second = &node.bounds[(self.near[axis] + 3) % 6];
            for i in 0..WIDTH {
                let t = (first[i] - origin) * reciprocal - pad;
                near[i] = if t > near[i] { t } else { near[i] };
                let t = (second[i] - origin) * reciprocal + pad;
                far[i] = if t < far[i] { t } else { far[i] };
            }
        }
        let mut mask = 0;
        for i in 0..WIDTH {
            mask |= u32::from(near[i] <= far[i]) << i;
        }
        (mask, near)
    }
}
