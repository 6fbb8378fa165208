//! Where a bundle sees triangles: rectangles of slopes (in a parallel bundle, of where rays are), by which most rays
//! are told apart from small triangles.
//!
//! A triangle of the size of a pixel concerns one ray or two of a bundle's 64. The rectangle around the slopes of its
//! corners, held against those of eight rows of eight rays, says which, at the price of one group's edge functions.
//!
//! A ray that hits a triangle has a slope between the least and the largest of the corners', all of them in front of
//! the origin. Let u = 2^-24, L be the largest component of a corner relative to the origin, b how far the origin may
//! be off, z > 0 a corner's depth, g its slope. A component is off by e = u L + b, the quotient by e (1 + |g|) / z and
//! 2 u |g| for reciprocal and product, and the ray's own slope by 4.25 u D, D >= 1 being the largest of a direction
//! ([`Edges`](super::edges::Edges)).

use super::rays::Bundle;
use super::rows::{ROWS, Rows};
use crate::math::UNIT_ROUNDOFF;
use crate::trace::bvh::block::LANES;
use crate::trace::bvh::reject::slab::HUGE;
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector, axes};

/// Rectangles of slopes around eight triangles.
pub(super) struct Footprints {
    pub low: [[f32; LANES]; 2],
    pub high: [[f32; LANES]; 2],
}

impl Footprints {
    #[inline(always)]
    pub fn new<S: Simd>(corners: &[[[f32; LANES]; 3]; 3], bundle: &Bundle) -> Self {
        let splat = S::V8::splat;
        let [p, q, along] = axes(bundle.axis);
        let forward = splat(bundle.forward);
        let origin = [splat(bundle.origin[p]), splat(bundle.origin[q]), splat(bundle.origin[along])];
        let (zero, one) = (splat(0.0), splat(1.0));
        let (mut least, mut most) = ([splat(f32::INFINITY); 2], [splat(f32::NEG_INFINITY); 2]);
        let (mut far, mut nearest, mut largest) = (zero, splat(f32::INFINITY), zero);
        let (components, zx) = ([&corners[p], &corners[q]], &corners[along]);
        // By index: iterators zipped are not always taken apart, here and in `edges`.
        for k in 0..3 {
            let z = S::V8::load(&zx[k]).sub(origin[2]).mul(forward);
            let inverse = one.div(z);
            (far, nearest) = (z.abs().max(far), z.min(nearest));
            for i in 0..2 {
                let x = S::V8::load(&components[i][k]).sub(origin[i]);
                let slope = x.mul(inverse);
                far = x.abs().max(far);
                largest = slope.abs().max(largest);
                (least[i], most[i]) = (slope.min(least[i]), slope.max(most[i]));
            }
        }
        let u = UNIT_ROUNDOFF;
        let error = far.mul_add(splat(2.0 * u), splat(1.1 * bundle.blur));
        // Half as much again and more, for what is rounded here, and for 1 / z being off itself.
        let pad = error.mul(splat(1.5)).mul(one.add(largest)).div(nearest);
        let pad = largest.mul_add(splat(4.0 * u), splat(8.0 * u * bundle.largest)).add(pad);
        // Where a corner is not in front for sure, or 1 / z is too large, the triangle may be seen anywhere; NaN
        // included.
        let in_front = error.mul_add(splat(4.0), splat(1.0 / HUGE)).less(nearest);
        let mut seen = Self { low: [[0.0; LANES]; 2], high: [[0.0; LANES]; 2] };
        for i in 0..2 {
            let (low, high) = (least[i].sub(pad), most[i].add(pad));
            seen.low[i] = S::V8::select(in_front, low, splat(f32::NEG_INFINITY)).to_array();
            seen.high[i] = S::V8::select(in_front, high, splat(f32::INFINITY)).to_array();
        }
        seen
    }

    /// A byte for each triangle: in it a bit for every row with a ray that may hit it.
    #[inline(always)]
    pub fn rows<S: Simd>(&self, rows: &Rows) -> u64 {
        let mut misses = 0;
        for lane in 0..LANES {
            let is_apart = apart::<S>(self.low[0][lane], self.high[0][lane], &rows.low[0], &rows.high[0]);
            let is_apart = is_apart.or(apart::<S>(self.low[1][lane], self.high[1][lane], &rows.low[1], &rows.high[1]));
            misses |= u64::from(is_apart.bits() & 0xff) << (8 * lane);
        }
        !misses
    }
}

#[inline(always)]
fn apart<S: Simd>(low: f32, high: f32, least: &[f32; ROWS], most: &[f32; ROWS]) -> <S::V8 as Vector>::Mask {
    S::V8::splat(high).less(S::V8::load(least)).or(S::V8::load(most).less(S::V8::splat(low)))
}
