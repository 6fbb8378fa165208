//! One ray against a block of four triangles: rejected in f32 by the ray's own shear.
//!
//! The test is Woop's (Woop, Benthin, Wald 2013, *Watertight ray/triangle intersection*): corners relative to the
//! origin are sheared so that the ray runs along its largest axis, and the edge functions are 2 x 2 determinants,
//! without FMA. Here it only rejects: a triangle falls out when two edge functions have opposite signs by more than their
//! rounding error. What remains goes to the exact test.

use super::block::Block;
use super::simd::{Array, Mask, Simd, Vector};
use crate::math::UNIT_ROUNDOFF;
use crate::ray::Ray;

/// A ray made ready for the f32 reject test.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    /// Axes such that the direction is largest along the third.
    axes: [usize; 3],
    /// Origin, in the order of `axes`.
    origin: [f32; 3],
    /// Direction along the first two axes over that along the third; at most 1 in magnitude.
    shear: [f32; 2],
    /// Error of a sheared component, relative to the largest component of a corner relative to the origin.
    error: f32,
    /// Added to that largest component: how far the origin itself may be off, in its own roundings.
    blur: f32,
}

impl Filter {
    /// `blur` is by how much more than its own rounding the ray may be off (1: not at all).
    #[inline(always)]
    pub fn new(ray: &Ray, blur: f32) -> Self {
        let d = ray.direction.abs();
        let z = if d.x > d.y && d.x > d.z {
            0
        } else if d.y > d.z {
            1
        } else {
            2
        };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let (direction, origin) = (ray.direction.to_array(), ray.origin.to_array());
        let along = direction[z];
        Self {
            axes,
            origin: [origin[axes[0]], origin[axes[1]], origin[z]],
            shear: [direction[axes[0]] / along, direction[axes[1]] / along],
            error: 8.0 * UNIT_ROUNDOFF * blur,
            blur: if blur > 1.0 { ray.origin.abs().max_element() } else { 0.0 },
        }
    }

    /// A bit for every triangle that the ray's line may pass.
    ///
    /// With L the largest component of the corners relative to the origin and S the largest after the shear, a sheared
    /// component errs by e = 8 u L (a subtraction, a quotient, a product and a subtraction, of magnitudes up to L
    /// each), an edge function by 4 e S + 2 e^2 and its own rounding 4 u S^2.
    #[inline(always)]
    pub fn candidates<S: Simd>(&self, block: &Block) -> u32 {
        let splat = S::V4::splat;
        let [kx, ky, kz] = self.axes;
        let mut x = [splat(0.0); 3];
        let mut y = [splat(0.0); 3];
        let mut largest = splat(self.blur);
        let mut sheared = splat(0.0);
        for k in 0..3 {
            let px = S::V4::load(&block.corners[3 * k + kx]).sub(splat(self.origin[0]));
            let py = S::V4::load(&block.corners[3 * k + ky]).sub(splat(self.origin[1]));
            let pz = S::V4::load(&block.corners[3 * k + kz]).sub(splat(self.origin[2]));
            largest = largest.max(px.abs()).max(py.abs().max(pz.abs()));
            x[k] = px.sub(pz.mul(splat(self.shear[0])));
            y[k] = py.sub(pz.mul(splat(self.shear[1])));
            sheared = sheared.max(x[k].abs().max(y[k].abs()));
        }
        let (u, v, w) = (edge(x, y, 2, 1), edge(x, y, 0, 2), edge(x, y, 1, 0));
        let e = largest.mul(splat(self.error));
        // The sum doubled against rounding of the bound; a constant against underflow.
        let edges = e.mul(sheared.mul(splat(8.0)).add(e.mul(splat(4.0))));
        let own = sheared.mul(sheared).mul(splat(8.0 * UNIT_ROUNDOFF));
        let bound = edges.add(own).add(splat(1e-36));
        let low = u.min(v).min(w).add(bound);
        let high = u.max(v).max(w).sub(bound);
        let zero = splat(0.0);
        // Whatever overflowed is not rejected.
        let outside = low.less(zero).and(zero.less(high));
        !outside.bits() & block.lanes
    }
}

/// The edge function of the edge from corner `a` to corner `b`, each of which is at (x, y).
#[inline(always)]
fn edge<V: Vector>(x: [V; 3], y: [V; 3], a: usize, b: usize) -> V {
    x[a].mul(y[b]).sub(y[a].mul(x[b]))
}
