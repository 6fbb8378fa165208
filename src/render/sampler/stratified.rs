//! Correlated multi-jittered samples (Kensler 2013, *Correlated multi-jittered sampling*, Pixar 13-01): stratified on
//! the square and on both axes, for any number of them. Plain jitter on an m x n grid would leave prime numbers of
//! samples stratified along one axis only.

use super::unit;
use crate::math::DVec2;

/// The `sample`th of `spp` points. `key` is the pattern's, `jitter` the sample's.
pub(super) fn point(sample: u32, spp: u32, key: [u32; 4], jitter: [u32; 4]) -> DVec2 {
    // A grid of at least `spp` cells.
    let m = spp.isqrt();
    let n = spp.div_ceil(m);
    let s = permute(sample, spp, key[0]);
    let column = f64::from(permute(s % m, m, key[1]));
    let row = f64::from(permute(s / m, n, key[2]));
    let (jx, jy) = (unit(jitter[0]), unit(jitter[1]));
    DVec2::new((column + (row + jx) / f64::from(n)) / f64::from(m), (f64::from(s) + jy) / f64::from(spp))
}

/// The middle of the `sample`th of `spp` cells, row by row or in the order that a key chooses: where on the pixel a
/// sample is must not say when it is taken. Cells are alike in area: of as many as fill no grid some rows have one
/// less, and are the lower for it.
pub(super) fn grid(sample: u32, spp: u32, order: Option<u32>) -> DVec2 {
    let rows = spp.div_ceil(spp.isqrt());
    let (few, more) = (spp / rows, spp % rows);
    let sample = order.map_or(sample, |key| permute(sample, spp, key));
    let in_low_rows = (rows - more) * few;
    let (before, count) = if sample < in_low_rows { (0, few) } else { (in_low_rows, few + 1) };
    let (row, column) = ((sample - before) / count, (sample - before) % count);
    let middle = f64::from(before + row * count) + f64::from(count) / 2.0;
    DVec2::new((f64::from(column) + 0.5) / f64::from(count), middle / f64::from(spp))
}

/// The `i`th element of a permutation of `0..length` that `key` chooses: Kensler's, a hash of the next power of two
/// that is repeated until it falls inside.
pub(super) const fn permute(mut i: u32, length: u32, key: u32) -> u32 {
    let mask = length.next_power_of_two() - 1;
    loop {
        i = (i ^ key).wrapping_mul(0xe170_893d);
        i ^= key >> 16;
        i ^= (i & mask) >> 4;
        i = (i ^ (key >> 8)).wrapping_mul(0x0929_eb3f);
        i ^= key >> 23;
        i ^= (i & mask) >> 1;
        i = i.wrapping_mul(1 | (key >> 27)).wrapping_mul(0x6935_fa69);
        i ^= (i & mask) >> 11;
        i = i.wrapping_mul(0x74dc_b303);
        i ^= (i & mask) >> 2;
        i = i.wrapping_mul(0x9e50_1cc3);
        i ^= (i & mask) >> 2;
        i = i.wrapping_mul(0xc860_a3df) & mask;
        i ^= i >> 5;
        if i < length {
            // i + key modulo length; neither exceeds the length.
            let turn = key % length;
            let rest = length - turn;
            return if i < rest { i + turn } else { i - rest };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Sampler, Sampling};
    use super::*;

    #[test]
    fn permutations_are_permutations() {
        for length in [1, 2, 3, 5, 8, 13, 64, 100] {
            for key in [0, 1, 0x9e37_79b9, u32::MAX] {
                let mut images: Vec<_> = (0..length).map(|i| permute(i, length, key)).collect();
                images.sort_unstable();
                assert_eq!(images, (0..length).collect::<Vec<_>>(), "{length} by {key}");
            }
        }
    }

    /// What a pixel shows of an edge is its share of the pixel, as near as so many samples can tell; and nothing is
    /// missed at one end.
    #[test]
    fn a_grid_covers_the_pixel_evenly() {
        for spp in 1..200 {
            let places: Vec<_> = (0..spp).map(|sample| grid(sample, spp, None)).collect();
            let shuffled: Vec<_> = (0..spp).map(|sample| grid(sample, spp, Some(7))).collect();
            assert!(places.iter().all(|place| shuffled.contains(place)), "{spp}");
            let mean = places.iter().sum::<DVec2>() / f64::from(spp);
            assert!((mean - DVec2::splat(0.5)).abs().max_element() < 1e-12, "{spp}: {mean}");
            // On either axis no strip has a share of the samples that differs from its width by more than the side of a
            // cell.
            let side = 1.0 / f64::from(spp.isqrt());
            for edge in [0.3, 0.5, 0.7] {
                let share = |is_below: &dyn Fn(&DVec2) -> bool| {
                    places.iter().filter(|place| is_below(place)).count() as f64 / f64::from(spp)
                };
                for share in [share(&|place| place.x < edge), share(&|place| place.y < edge)] {
                    assert!((share - edge).abs() <= side, "{spp}, {edge}: {share}");
                }
            }
        }
    }

    #[test]
    fn every_row_and_every_stratum_has_one_sample() {
        for (spp, columns, rows) in [(4, 2, 2), (7, 2, 4), (16, 4, 4), (25, 5, 5)] {
            let sampler = Sampler::new(Sampling::Stratified, spp, 3);
            for (x, y) in [(0, 0), (5, 9), (4_000_000, 1)] {
                let places: Vec<_> = (0..spp).map(|s| sampler.film(&sampler.pattern(x, y), s)).collect();
                let mut fine: Vec<_> = places.iter().map(|p| (p.y * f64::from(spp)) as u32).collect();
                fine.sort_unstable();
                assert_eq!(fine, (0..spp).collect::<Vec<_>>());
                let mut cells: Vec<_> = places
                    .iter()
                    .map(|p| ((p.x * f64::from(columns)) as u32, (p.x * f64::from(columns * rows)) as u32))
                    .collect();
                cells.sort_unstable();
                cells.dedup();
                assert_eq!(cells.len(), spp as usize, "{spp}: each fine column once");
            }
        }
    }
}
