//! Boxes against all rays of a bundle at once, by the rectangle of their slopes, or of where parallel rays are.

use super::pencil::Pencil;
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
    /// By what planes across the first two axes are multiplied before they are held against rays, in a parallel bundle;
    /// and the ends of what they are held against.
    scale: [f32; 2],
    ends: [[f32; 2]; 2],
    forward: f32,
}

/// The boxes of a node, seen from the origin of a bundle.
pub(super) struct Boxes {
    /// On the first two axes: what [`Pencil::meet`] takes. On the third: t'.
    pub near: [[f32; WIDTH]; 3],
    pub far: [[f32; WIDTH]; 3],
}

impl Bundle {
    /// The slope rectangle's reciprocals, against the boxes of a tree that reaches that far. None where they are too
    /// large.
    #[inline(always)]
    pub fn slab(&self, reach: Vec3) -> Option<BundleSlab> {
        let [p, q, along] = axes(self.axis);
        let sign = |low: f32| if low > 0.0 { 1.0f32 } else { -1.0 };
        let sign = [sign(self.low[0]), sign(self.low[1]), self.forward];
        let ends = [[1.0 / self.low[0], 1.0 / self.high[0]], [1.0 / self.low[1], 1.0 / self.high[1]]];
        let span = Vec3::from_array(self.origin).abs() + reach;
        let steepest = |[a, b]: [f32; 2]| a.abs().max(b.abs());
        let is_finite = steepest(ends[0]) * span[p] < HUGE && steepest(ends[1]) * span[q] < HUGE && span[along] < HUGE;
        is_finite.then(
            #[inline(always)]
            || BundleSlab::new(self, sign, self.blur, [1.0; 2], ends),
        )
    }
}

impl BundleSlab {
    /// `sign` says which way rays run along each axis of the bundle, and `stray` by how much they may be off.
    #[inline(always)]
    pub fn new(bundle: &Bundle, sign: [f32; 3], stray: f32, scale: [f32; 2], ends: [[f32; 2]; 2]) -> Self {
        let mut slab = Self {
            near: [0; 3],
            far: [0; 3],
            near_origin: [0.0; 3],
            far_origin: [0.0; 3],
            scale,
            ends,
            forward: bundle.forward,
        };
        for (i, axis) in axes(bundle.axis).into_iter().enumerate() {
            // Origin and box are subtracted (2 u of both), the slope is off by 2 u (in an object's coordinates by 4.25
            // u), its reciprocal and the product by another each, or by the least number that there is; or, of a
            // parallel bundle, the difference by another. What of that is relative to the box is in the box.
            const { assert!(10.0 * UNIT_ROUNDOFF < WIDENED + WIDENED_ALL) };
            let origin = bundle.origin[axis];
            let pad = sign[i] * (10.0 * UNIT_ROUNDOFF * origin.abs() + stray + f32::MIN_POSITIVE);
            (slab.near_origin[i], slab.far_origin[i]) = (origin + pad, origin - pad);
            (slab.near[i], slab.far[i]) =
                if sign[i] > 0.0 { (2 * axis, 2 * axis + 1) } else { (2 * axis + 1, 2 * axis) };
        }
        slab
    }

    /// The boxes of a node's children; t' is at least `begin`.
    #[inline(always)]
    pub fn boxes<S: Simd, P: Pencil>(&self, node: &Node, begin: f32) -> Boxes {
        let splat = S::V8::splat;
        let forward = splat(self.forward);
        let near_along = S::V8::load(&node.bounds[self.near[2]]).sub(splat(self.near_origin[2])).mul(forward);
        let far_along = S::V8::load(&node.bounds[self.far[2]]).sub(splat(self.far_origin[2])).mul(forward);
        let mut boxes = Boxes { near: [near_along.max(splat(begin)).to_array(); 3], far: [far_along.to_array(); 3] };
        for i in 0..2 {
            let mut near = S::V8::load(&node.bounds[self.near[i]]).sub(splat(self.near_origin[i]));
            let mut far = S::V8::load(&node.bounds[self.far[i]]).sub(splat(self.far_origin[i]));
            if P::IS_PARALLEL {
                (near, far) = (near.mul(splat(self.scale[i])), far.mul(splat(self.scale[i])));
            }
            (boxes.near[i], boxes.far[i]) = (near.to_array(), far.to_array());
        }
        boxes
    }

    /// The children that some ray of the bundle may enter with t' up to `limit`, as a bit mask; and where it enters
    /// each at the earliest.
    #[inline(always)]
    pub fn enter<S: Simd, P: Pencil>(&self, boxes: &Boxes, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        let splat = S::V8::splat;
        let (mut near, mut far) = (S::V8::load(&boxes.near[2]), S::V8::load(&boxes.far[2]).min(splat(limit)));
        for i in 0..2 {
            let (first, last) = (S::V8::load(&boxes.near[i]), S::V8::load(&boxes.far[i]));
            let [a, b] = self.ends[i];
            let (a, b) = (splat(a), splat(b));
            near = P::meet(first, a).min(P::meet(first, b)).max(near);
            far = P::meet(last, a).max(P::meet(last, b)).min(far);
        }
        (near.at_most(far), near)
    }
}
