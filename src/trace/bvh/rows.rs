//! The rays of a bundle row by row, eight rows of eight: what tells most of them at once that a box, or a triangle, does not
//! concern them.

use super::bundle::{Boxes, PerRay, RAYS};
use super::simd::{Array, Mask, Simd, Vector};

/// Rows of a bundle: eight rays each.
pub(super) const ROWS: usize = RAYS / 8;

/// For each row of a bundle, the least and the largest slope on two axes, and the same of their reciprocals. Slopes have one
/// sign on each axis.
pub(super) struct Rows {
    pub low: [[f32; ROWS]; 2],
    pub high: [[f32; ROWS]; 2],
    least_reciprocal: [[f32; ROWS]; 2],
    most_reciprocal: [[f32; ROWS]; 2],
}

impl Rows {
    pub const NONE: Self = {
        let zero = [[0.0; ROWS]; 2];
        Self { low: zero, high: zero, least_reciprocal: zero, most_reciprocal: zero }
    };

    #[inline(always)]
    pub fn new<S: Simd>(slope: &[PerRay; 2]) -> Self {
        let mut rows = Self::NONE;
        let one = S::V8::splat(1.0);
        for (i, slope) in slope.iter().enumerate() {
            let columns = columns::<S>(slope);
            let [a, b, c, d, e, f, g, h] = columns;
            let low = a.min(b).min(c.min(d)).min(e.min(f).min(g.min(h)));
            let high = largest::<S>(columns);
            (rows.low[i], rows.high[i]) = (low.to_array(), high.to_array());
            // Division is monotone, also when it rounds: no ray's own reciprocal is out of this range.
            rows.least_reciprocal[i] = one.div(high).to_array();
            rows.most_reciprocal[i] = one.div(low).to_array();
        }
        rows
    }

    /// A bit for every row of which a ray may enter the box in that slot up to the row's limit.
    #[inline(always)]
    pub fn enter<S: Simd>(&self, boxes: &Boxes, slot: usize, limit: &[f32; ROWS]) -> u32 {
        let mut first = S::V8::splat(boxes.near[2][slot]);
        let mut last = S::V8::splat(boxes.far[2][slot]).min(S::V8::load(limit));
        for i in 0..2 {
            let (near, far) = (S::V8::splat(boxes.near[i][slot]), S::V8::splat(boxes.far[i][slot]));
            let (least, most) = (S::V8::load(&self.least_reciprocal[i]), S::V8::load(&self.most_reciprocal[i]));
            first = near.mul(least).min(near.mul(most)).max(first);
            last = far.mul(least).max(far.mul(most)).min(last);
        }
        first.at_most(last).bits()
    }
}

/// The largest value of each row.
#[inline(always)]
pub(super) fn most<S: Simd>(values: &PerRay) -> S::V8 {
    largest::<S>(columns::<S>(values))
}

/// The rays of some rows.
#[inline(always)]
pub(super) const fn rays(rows: u32) -> u64 {
    // A copy for each byte, of which each keeps another bit.
    let bits = (rows as u64 & 0xff).wrapping_mul(0x0101_0101_0101_0101) & 0x8040_2010_0804_0201;
    // Into the highest bit of the byte, and from there over all of it.
    let bits = (bits.wrapping_add(0x7f7f_7f7f_7f7f_7f7f) | bits) & 0x8080_8080_8080_8080;
    (bits >> 7).wrapping_mul(0xff)
}

/// The rows in which some rays are.
#[inline(always)]
pub(super) const fn rows(rays: u64) -> u32 {
    let rays = rays | rays >> 4;
    let rays = rays | rays >> 2;
    let rays = (rays | rays >> 1) & 0x0101_0101_0101_0101;
    // The lowest bits of the bytes, moved together into the highest byte.
    (rays.wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32
}

#[inline(always)]
fn largest<S: Simd>([a, b, c, d, e, f, g, h]: [S::V8; 8]) -> S::V8 {
    a.max(b).max(c.max(d)).max(e.max(f).max(g.max(h)))
}

/// Of each row the first value, the second, and so on.
#[inline(always)]
fn columns<S: Simd>(values: &PerRay) -> [S::V8; 8] {
    // Written out: a closure mapped over an array may miss the instruction set.
    S::transpose([
        row::<S>(values, 0),
        row::<S>(values, 1),
        row::<S>(values, 2),
        row::<S>(values, 3),
        row::<S>(values, 4),
        row::<S>(values, 5),
        row::<S>(values, 6),
        row::<S>(values, 7),
    ])
}

/// The values of one row.
#[inline(always)]
pub(super) fn row<S: Simd>(values: &PerRay, row: u32) -> S::V8 {
    S::V8::load(&values.0.as_chunks().0[row as usize % ROWS])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_their_rays() {
        for some in 0..256 {
            let all = rays(some);
            assert_eq!(all, (0..64).filter(|ray| some >> (ray / 8) & 1 != 0).map(|ray| 1u64 << ray).sum::<u64>());
            assert_eq!(rows(all), some);
        }
        for ray in 0..64 {
            assert_eq!(rows(1 << ray), 1 << (ray / 8));
        }
    }
}
