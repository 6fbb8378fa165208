//! One ray against a block of four triangles: rejected in f32 by the ray's own shear.
//!
//! The test is Woop's (Woop, Benthin, Wald 2013, *Watertight ray/triangle intersection*): corners relative to the
//! origin are sheared so that the ray runs along its largest axis, and the edge functions are 2 x 2 determinants. Here it
//! only rejects: a triangle falls out when two edge functions have opposite signs by more than their rounding error, or
//! when t is out of range by more than its own. What remains goes to the exact test.
//!
//! With u = 2^-24, a triangle that is hit has its corners, after the shear, within S = 2 s of the ray, s being the
//! largest component of its edges; so no component of a corner relative to the origin is larger than L = Z + S, Z being
//! the largest along the ray. A sheared component errs by e = 8 u L (a subtraction, the shear's two roundings, a
//! product and a subtraction), an edge function by 4 e S + 2 e^2 and its own rounding 4 u S^2, t by three such errors.
//! A triangle that is not hit may be bounded wrongly, to no harm.

use super::block::Block;
use super::simd::{Array, Mask, Simd, Vector};
use super::slab::SlabRay;
use crate::math::UNIT_ROUNDOFF;
use crate::ray::Ray;

/// A ray made ready for the f32 reject test.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    /// Axes such that the direction is largest along the third.
    axes: [usize; 3],
    /// Origin, in the order of `axes`.
    origin: [f32; 3],
    /// Direction along the first two axes over that along the third, negative; at most 1 in magnitude.
    shear: [f32; 2],
    /// Direction along the third.
    along: f32,
    /// Least t, rounded down, times the magnitude of `along`.
    begin: f32,
    /// Error of a sheared component, relative to the largest component of a corner relative to the origin.
    error: f32,
    /// Added to that largest component: how far the origin itself may be off, in its own roundings.
    blur: f32,
}

/// Slack of t for its own rounding and that of products with it.
const SLACK: f32 = 8.0 * UNIT_ROUNDOFF;

impl Filter {
    /// `blur` is by how much more than its own rounding the ray may be off (1: not at all); `slab` is the same ray's.
    #[inline(always)]
    pub fn new(ray: &Ray, slab: &SlabRay, blur: f32) -> Self {
        let d = ray.direction.abs();
        let z = if d.x > d.y && d.x > d.z {
            0
        } else if d.y > d.z {
            1
        } else {
            2
        };
        let [x, y, z] = [(z + 1) % 3, (z + 2) % 3, z];
        let (direction, origin) = (ray.direction.to_array(), ray.origin.to_array());
        let reciprocal = -slab.reciprocal()[z];
        Self {
            axes: [x, y, z],
            origin: [origin[x], origin[y], origin[z]],
            shear: [direction[x] * reciprocal, direction[y] * reciprocal],
            along: direction[z],
            begin: ray.tmin * direction[z].abs() * (1.0 - SLACK),
            error: 10.0 * UNIT_ROUNDOFF * blur,
            blur: if blur > 1.0 { ray.origin.abs().max_element() } else { 0.0 },
        }
    }

    /// A bit for every triangle that the ray may hit up to `limit`.
    #[inline(always)]
    pub fn candidates<S: Simd>(&self, block: &Block, limit: f32) -> u32 {
        let splat = S::V4::splat;
        let [kx, ky, kz] = self.axes;
        let mut x = [splat(0.0); 3];
        let mut y = [splat(0.0); 3];
        let mut z = [splat(0.0); 3];
        for k in 0..3 {
            let px = S::V4::load(&block.corners[3 * k + kx]).sub(splat(self.origin[0]));
            let py = S::V4::load(&block.corners[3 * k + ky]).sub(splat(self.origin[1]));
            z[k] = S::V4::load(&block.corners[3 * k + kz]).sub(splat(self.origin[2]));
            x[k] = z[k].mul_add(splat(self.shear[0]), px);
            y[k] = z[k].mul_add(splat(self.shear[1]), py);
        }
        let (u, v, w) = (edge(x, y, 2, 1), edge(x, y, 0, 2), edge(x, y, 1, 0));
        let deep = z[0].abs().max(z[1].abs()).max(z[2].abs());
        let error = splat(self.error);
        let e = deep.mul_add(error, splat((2.0 * block.size + self.blur) * self.error));
        let wide = e.add(splat(2.0 * block.size));
        // Half as much again for the rounding of the bound; a constant against underflow.
        let bound = wide.mul_add(e.mul_add(splat(12.0), wide.mul(splat(8.0 * UNIT_ROUNDOFF))), splat(1e-36));
        let low = u.min(v).min(w).add(bound);
        let high = u.max(v).max(w).sub(bound);
        let zero = splat(0.0);
        // Whatever overflowed is not rejected.
        let outside = low.less(zero).and(zero.less(high));
        let passed = !outside.bits() & block.lanes;
        if passed == 0 || self.blur > 0.0 {
            return passed;
        }
        // t |along| = depth / determinant, both multiplied by the determinant.
        let determinant = u.add(v).add(w);
        let size = determinant.abs();
        let square = determinant.mul(determinant);
        let depth = u.mul(z[0]).add(v.mul(z[1])).add(w.mul(z[2]));
        let depth = depth.mul(determinant).mul(splat(1.0f32.copysign(self.along)));
        let error = bound.mul_add(splat(4.0), size.mul(splat(SLACK))).mul(size);
        let depth_error = error.mul(deep).add(splat(f32::MIN_POSITIVE));
        let limit = splat(limit * self.along.abs() * (1.0 + SLACK));
        let before = depth.add(depth_error).less(square.sub(error).mul(splat(self.begin)));
        let behind = square.add(error).mul(limit).less(depth.sub(depth_error));
        passed & !before.or(behind).bits()
    }
}

/// The edge function of the edge from corner `a` to corner `b`, each of which is at (x, y).
#[inline(always)]
fn edge<V: Vector>(x: [V; 3], y: [V; 3], a: usize, b: usize) -> V {
    x[a].mul(y[b]).sub(y[a].mul(x[b]))
}
