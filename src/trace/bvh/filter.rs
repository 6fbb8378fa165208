//! One ray against a block of four triangles: rejected in f32 by the ray's own shear.
//!
//! The test is Woop's (Woop, Benthin, Wald 2013, *Watertight ray/triangle intersection*): corners relative to the
//! origin are sheared so that the ray runs along its largest axis, and the edge functions are 2 x 2 determinants. Here it
//! only rejects: a triangle falls out when two edge functions have opposite signs by more than their rounding error, or
//! when t is out of range by more than its own. What remains goes to the exact test.
//!
//! With u = 2^-24, a triangle that is hit has its corners, after the shear, within S = (1 + k) s of the ray, s being the
//! largest component of its edges and k <= 1 of the shear; so no component of a corner relative to the origin is larger
//! than L = Z + S, Z being the largest along the ray. A sheared component errs by e = 8 u L (a subtraction, the shear's
//! two roundings, a product and a subtraction), an edge function by 4 e S + 2 e^2 and its own rounding 4 u S^2, t by
//! three such errors. A triangle that is not hit may be bounded wrongly, to no harm.

use super::block::Block;
use super::bundle::axes;
use super::simd::{Array, Mask, Simd, Vector};
use crate::math::{UNIT_ROUNDOFF, Vec3};
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
    /// 1 more than the larger of the two.
    width: f32,
    /// Direction along the third.
    along: f32,
    /// 1 over its magnitude.
    shorten: f32,
    /// Least t, rounded down, times the magnitude of `along`.
    begin: f32,
    /// Error of a sheared component, relative to the largest component of a corner relative to the origin.
    error: f32,
    /// Added to that largest component: how far the origin itself may be off, in its own roundings.
    blur: f32,
}

/// Triangles of a block that a ray may hit.
pub(super) struct Candidates {
    /// A bit for each of them.
    pub lanes: u32,
    /// A bit for those that it hits without doubt, at a t between `low` and `high`, and so that t, u and v can be computed
    /// in f64.
    pub sure: u32,
    pub low: [f32; 4],
    pub high: [f32; 4],
}

/// Slack of t for its own rounding and that of products with it.
const SLACK: f32 = 8.0 * UNIT_ROUNDOFF;

impl Filter {
    /// `blur` is by how much more than its own rounding the ray may be off (1: not at all).
    #[inline(always)]
    pub fn new(ray: &Ray, blur: f32) -> Self {
        let [x, y, z] = axes(largest_axis(ray.direction.abs()));
        let (direction, origin) = (ray.direction.to_array(), ray.origin.to_array());
        let reciprocal = 1.0 / direction[z];
        let shear = [direction[x] * -reciprocal, direction[y] * -reciprocal];
        Self {
            axes: [x, y, z],
            origin: [origin[x], origin[y], origin[z]],
            shear,
            width: 1.0 + shear[0].abs().max(shear[1].abs()),
            along: direction[z],
            shorten: reciprocal.abs(),
            begin: ray.tmin * direction[z].abs() * (1.0 - SLACK),
            error: 9.0 * UNIT_ROUNDOFF * blur,
            blur: if blur > 1.0 { ray.origin.abs().max_element() } else { 0.0 },
        }
    }

    /// The triangles that the ray may hit up to `limit`.
    #[inline(always)]
    pub fn candidates<S: Simd>(&self, block: &Block, limit: f32) -> Candidates {
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
        let reach = self.width * block.size;
        let e = deep.mul_add(error, splat((reach + self.blur) * self.error));
        let wide = e.add(splat(reach));
        // More than wanted, for the rounding of the bound; a constant against underflow.
        let bound = wide.mul_add(e.mul_add(splat(5.0), wide.mul(splat(6.0 * UNIT_ROUNDOFF))), splat(1e-36));
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        let zero = splat(0.0);
        // Whatever overflowed is not rejected.
        let outside = least.add(bound).less(zero).and(zero.less(most.sub(bound)));
        let passed = !outside.bits() & block.lanes;
        let mut candidates = Candidates { lanes: passed, sure: 0, low: [0.0; 4], high: [0.0; 4] };
        if passed == 0 || self.blur > 0.0 {
            return candidates;
        }
        // t |along| = depth / determinant, both multiplied by the determinant.
        let determinant = u.add(v).add(w);
        let size = determinant.abs();
        let square = determinant.mul(determinant);
        let depth = u.mul(z[0]).add(v.mul(z[1])).add(w.mul(z[2]));
        let depth = depth.mul(determinant).mul(splat(1.0f32.copysign(self.along)));
        let error = bound.mul_add(splat(4.0), size.mul(splat(SLACK))).mul(size);
        let depth_error = error.mul(deep).add(splat(f32::MIN_POSITIVE));
        let (near, far) = (depth.sub(depth_error), depth.add(depth_error));
        let before = far.less(square.sub(error).mul(splat(self.begin)));
        let behind = square.add(error).mul(splat(limit * self.along.abs() * (1.0 + SLACK))).less(near);
        candidates.lanes = passed & !before.or(behind).bits();
        if candidates.lanes == 0 {
            return candidates;
        }
        // Precise to a quarter in f32 is more than enough in f64, unless the origin all but touches the triangle: both
        // count the same products of components, but f64 is wanted 2^18 times as precise, and is 2^29 times.
        let four = splat(4.0);
        let precise = error.mul(four).less(square).and(depth_error.mul(four).less(depth));
        let apart = splat(block.size / 32.0).less(deep);
        let inside = bound.less(least).or(most.less(zero.sub(bound)));
        candidates.sure = inside.and(precise).and(apart).bits();
        candidates.low = near.div(square.add(error)).mul(splat(self.shorten * (1.0 - SLACK))).to_array();
        candidates.high = far.div(square.sub(error)).mul(splat(self.shorten * (1.0 + SLACK))).to_array();
        candidates
    }
}

/// The axis of the largest component.
#[inline(always)]
pub(super) fn largest_axis(v: Vec3) -> usize {
    if v.x > v.y && v.x > v.z {
        0
    } else if v.y > v.z {
        1
    } else {
        2
    }
}

/// Filters of rays that are made ready eight at a time.
pub(super) struct Filters {
    axis: [usize; 8],
    origin: [[f32; 8]; 3],
    shear: [[f32; 8]; 2],
    width: [f32; 8],
    along: [f32; 8],
    shorten: [f32; 8],
    begin: [f32; 8],
}

impl Filters {
    /// As [`Filter::new`] for each of them, with no blur.
    #[inline(always)]
    pub fn new<S: Simd>(origin: [S::V8; 3], direction: [S::V8; 3], tmin: S::V8) -> Self {
        let splat = S::V8::splat;
        let [dx, dy, dz] = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
        let is_x = dy.less(dx).and(dz.less(dx));
        let is_y = dz.less(dy).without(is_x);
        // What stands at the axis, and at those after it.
        let along = pick::<S>(is_x, is_y, direction, 0);
        let reciprocal = splat(1.0).div(along);
        let negative = splat(0.0).sub(reciprocal);
        let shear =
            [pick::<S>(is_x, is_y, direction, 1).mul(negative), pick::<S>(is_x, is_y, direction, 2).mul(negative)];
        let mut axis = [2; 8];
        let (x, y) = (is_x.bits(), is_y.bits());
        for (i, axis) in axis.iter_mut().enumerate() {
            *axis = 2 - (y >> i & 1) as usize - 2 * (x >> i & 1) as usize;
        }
        Self {
            axis,
            origin: [
                pick::<S>(is_x, is_y, origin, 1).to_array(),
                pick::<S>(is_x, is_y, origin, 2).to_array(),
                pick::<S>(is_x, is_y, origin, 0).to_array(),
            ],
            width: shear[0].abs().max(shear[1].abs()).add(splat(1.0)).to_array(),
            shear: [shear[0].to_array(), shear[1].to_array()],
            along: along.to_array(),
            shorten: reciprocal.abs().to_array(),
            begin: tmin.mul(along.abs()).mul(splat(1.0 - SLACK)).to_array(),
        }
    }

    /// One of them.
    #[inline(always)]
    pub fn get(&self, ray: usize) -> Filter {
        Filter {
            axes: axes(self.axis[ray] % 3),
            origin: [self.origin[0][ray], self.origin[1][ray], self.origin[2][ray]],
            shear: [self.shear[0][ray], self.shear[1][ray]],
            width: self.width[ray],
            along: self.along[ray],
            shorten: self.shorten[ray],
            begin: self.begin[ray],
            error: 9.0 * UNIT_ROUNDOFF,
            blur: 0.0,
        }
    }
}

/// The component `next` places after the axis that each lane's masks name.
#[inline(always)]
fn pick<S: Simd>(is_x: <S::V8 as Vector>::Mask, is_y: <S::V8 as Vector>::Mask, v: [S::V8; 3], next: usize) -> S::V8 {
    let of_yz = S::V8::select(is_y, v[(1 + next) % 3], v[(2 + next) % 3]);
    S::V8::select(is_x, v[next % 3], of_yz)
}

/// The edge function of the edge from corner `a` to corner `b`, each of which is at (x, y).
#[inline(always)]
fn edge<V: Vector>(x: [V; 3], y: [V; 3], a: usize, b: usize) -> V {
    x[a].mul(y[b]).sub(y[a].mul(x[b]))
}
