//! Boxes against all rays of a bundle at once, by the rectangle of their slopes.

use super::rays::Bundle;
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::trace::bvh::node::{Node, WIDENED, WIDENED_ALL, WIDTH};
use crate::trace::bvh::reject::slab::HUGE;
use crate::trace::bvh::simd::{Array, Simd, Vector, axes};

/// A bundle made ready for slab tests in one tree, on its own axes.
pub(super) struct BundleSlab {
    /// Which of a node's six bounds is met first, and last.
    near: [usize; 3],
    far: [usize; 3],
    /// What is subtracted from them: the origin, and the pad.
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    /// Of the smallest and the largest slope.
    reciprocal: [[f32; 2]; 2],
    forward: f32,
}

/// The boxes of a node, seen from the origin of a bundle.
pub(super) struct Boxes {
    /// On the first two axes: what reciprocals of slopes are multiplied with. On the third: t'.
    pub near: [[f32; WIDTH]; 3],
    pub far: [[f32; WIDTH]; 3],
}

impl Bundle {
    /// The slope rectangle's reciprocals, against the boxes of a tree that reaches that far. None where they are too
    /// large.
    #[inline(always)]
    pub fn slab(&self, reach: Vec3) -> Option<BundleSlab> {
        let axes = axes(self.axis);
        let sign = |low: f32| if low > 0.0 { 1.0f32 } else { -1.0 };
        let sign = [sign(self.low[0]), sign(self.low[1])];
        let sign = [sign[0], sign[1], self.forward];
        let mut slab = BundleSlab {
            near: [0; 3],
            far: [0; 3],
            near_origin: [0.0; 3],
            far_origin: [0.0; 3],
            reciprocal: [[1.0 / self.low[0], 1.0 / self.high[0]], [1.0 / self.low[1], 1.0 / self.high[1]]],
            forward: self.forward,
        };
        let away = Vec3::from_array(self.origin).abs();
        let span = away + reach;
        let mut is_finite = true;
        for (i, axis) in axes.into_iter().enumerate() {
            // Origin and box are subtracted (2 u of both), the slope is off by 2 u (in an object's coordinates by
            // 4.25 u), its reciprocal and the product by another each, or by the least number that there is. What of that is relative to the
            // box is in the box.
            const { assert!(10.0 * UNIT_ROUNDOFF < WIDENED + WIDENED_ALL) };
            let pad = sign[i] * (10.0 * UNIT_ROUNDOFF * away[axis] + self.blur + f32::MIN_POSITIVE);
            slab.near_origin[i] = self.origin[axis] + pad;
            slab.far_origin[i] = self.origin[axis] - pad;
            (slab.near[i], slab.far[i]) =
                if sign[i] > 0.0 { (2 * axis, 2 * axis + 1) } else { (2 * axis + 1, 2 * axis) };
            let steepest = slab.reciprocal.get(i).map_or(1.0, |[a, b]| a.abs().max(b.abs()));
            is_finite &= steepest * span[axis] < HUGE;
        }
        is_finite.then_some(slab)
    }
}

impl BundleSlab {
    /// The boxes of a node's children; t' is at least `begin`.
    #[inline(always)]
    pub fn boxes<S: Simd>(&self, node: &Node, begin: f32) -> Boxes {
        let splat = S::V8::splat;
        let forward = splat(self.forward);
        let near_along = S::V8::load(&node.bounds[self.near[2]]).sub(splat(self.near_origin[2])).mul(forward);
        let far_along = S::V8::load(&node.bounds[self.far[2]]).sub(splat(self.far_origin[2])).mul(forward);
        let mut boxes = Boxes { near: [near_along.max(splat(begin)).to_array(); 3], far: [far_along.to_array(); 3] };
        for i in 0..2 {
            boxes.near[i] = S::V8::load(&node.bounds[self.near[i]]).sub(splat(self.near_origin[i])).to_array();
            boxes.far[i] = S::V8::load(&node.bounds[self.far[i]]).sub(splat(self.far_origin[i])).to_array();
        }
        boxes
    }

    /// The children that some ray of the bundle may enter with t' up to `limit`, as a bit mask; and where it enters each at the
    /// earliest.
    #[inline(always)]
    pub fn enter<S: Simd>(&self, boxes: &Boxes, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        let splat = S::V8::splat;
        let (mut near, mut far) = (S::V8::load(&boxes.near[2]), S::V8::load(&boxes.far[2]).min(splat(limit)));
        for i in 0..2 {
            let (first, last) = (S::V8::load(&boxes.near[i]), S::V8::load(&boxes.far[i]));
            let [a, b] = self.reciprocal[i];
            let (a, b) = (splat(a), splat(b));
            near = first.mul(a).min(first.mul(b)).max(near);
            far = last.mul(a).max(last.mul(b)).min(far);
        }
        (near.at_most(far), near)
    }
}
