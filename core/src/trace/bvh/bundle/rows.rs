//! The rays of a bundle row by row, eight rows of eight: what tells most of them at once that a triangle does not
//! concern them.

use crate::trace::bvh::simd::{Array, PerRay, RAYS, Simd, Vector};

/// Rows of a bundle: eight rays each.
pub(super) const ROWS: usize = RAYS / 8;

/// For each row of a bundle, the least and the largest of where rays are across, on two axes.
pub(super) struct Rows {
    pub low: [[f32; ROWS]; 2],
    pub high: [[f32; ROWS]; 2],
}

impl Rows {
    pub const NONE: Self = {
        let zero = [[0.0; ROWS]; 2];
        Self { low: zero, high: zero }
    };

    #[inline(always)]
    pub fn new<S: Simd>(across: &[PerRay; 2]) -> Self {
        let mut rows = Self::NONE;
        for (i, across) in across.iter().enumerate() {
            let columns = columns::<S>(across);
            let [a, b, c, d, e, f, g, h] = columns;
            let low = a.min(b).min(c.min(d)).min(e.min(f).min(g.min(h)));
            let high = a.max(b).max(c.max(d)).max(e.max(f).max(g.max(h)));
            (rows.low[i], rows.high[i]) = (low.to_array(), high.to_array());
        }
        rows
    }
}

/// All of a byte for each of eight bits: of rows their rays.
#[inline(always)]
pub(super) const fn bytes(bits: u32) -> u64 {
    // A copy for each byte, of which each keeps another bit.
    let bits = (bits as u64 & 0xff).wrapping_mul(0x0101_0101_0101_0101) & 0x8040_2010_0804_0201;
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
fn row<S: Simd>(values: &PerRay, row: u32) -> S::V8 {
    S::V8::load(&values.0.as_chunks().0[row as usize % ROWS])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_their_rays() {
        for some in 0..256 {
            let all = bytes(some);
            assert_eq!(all, (0..64).filter(|ray| some >> (ray / 8) & 1 != 0).map(|ray| 1u64 << ray).sum::<u64>());
            assert_eq!(rows(all), some);
        }
        for ray in 0..64 {
            assert_eq!(rows(1 << ray), 1 << (ray / 8));
        }
    }
}
