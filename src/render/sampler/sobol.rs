//! The first two dimensions of Sobol's sequence (1967), shuffled and scrambled by Owen's method (1995, *Randomly
//! permuted (t, m, s)-nets and (t, s)-sequences*), with the hash of Burley (2020, *Practical hash-based Owen
//! scrambling*, JCGT 9(4)) after Laine and Karras. Any power of two of the samples, from the first on, has one in each
//! of as many equal cells, of every shape that halving gives.

use super::unit;
use crate::math::DVec2;

/// The `sample`th point of the sequence that `key` chooses.
pub(super) fn point(sample: u32, key: [u32; 4]) -> DVec2 {
    // Shuffled, so that pairs of dimensions are not the same points in the same order.
    let index = scramble(sample, key[0]);
    DVec2::new(unit(scramble(index.reverse_bits(), key[1])), unit(scramble(second(u64::from(index)), key[2])))
}

/// The second dimension: Pascal's triangle modulo 2 as its matrix. The first 32 binary digits.
pub(super) fn second(index: u64) -> u32 {
    // Byte by byte: a shuffled index has many digits, and each would be a step.
    let bytes = index.to_le_bytes().into_iter().zip(&COLUMNS);
    bytes.fold(0, |digits, (byte, columns)| digits ^ columns[usize::from(byte)])
}

/// The sums of the matrix's columns that each byte of an index selects.
static COLUMNS: [[u32; 256]; 8] = {
    let mut sums = [[0; 256]; 8];
    let (mut bit, mut column) = (0, 1u64 << 63);
    while bit < 64 {
        let (byte, low) = (bit / 8, 1 << (bit % 8));
        let mut value = low;
        while value < 2 * low {
            // With this digit as the highest: what the lower ones give, and its own column.
            sums[byte][value] = sums[byte][value - low] ^ (column >> 32) as u32;
            value += 1;
        }
        column ^= column >> 1;
        bit += 1;
    }
    sums
};

/// Owen's scrambling of 32 binary digits: each is turned by a bit that depends on all before it.
pub(super) const fn scramble(digits: u32, key: u32) -> u32 {
    let mut x = digits.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Sampler, Sampling};
    use super::*;

    /// Whether each of 2^k points is alone in its cell, for cells of every shape that halving gives.
    #[track_caller]
    pub fn assert_net(points: &[DVec2]) {
        let n = points.len() as u32;
        for columns in (0..=n.ilog2()).map(|k| 1 << k) {
            let rows = n / columns;
            let cell = |p: &DVec2| (p.x * f64::from(columns)) as u32 * rows + (p.y * f64::from(rows)) as u32;
            let mut cells: Vec<_> = points.iter().map(cell).collect();
            cells.sort_unstable();
            assert_eq!(cells, (0..n).collect::<Vec<_>>(), "{columns} x {rows}");
        }
    }

    #[test]
    fn the_first_points_are_sobols() {
        let points: Vec<_> = (0..8u32).map(|i| (unit(i.reverse_bits()), unit(second(u64::from(i))))).collect();
        let x = [0.0, 0.5, 0.25, 0.75, 0.125, 0.625, 0.375, 0.875];
        let y = [0.0, 0.5, 0.75, 0.25, 0.625, 0.125, 0.375, 0.875];
        assert_eq!(points, x.into_iter().zip(y).collect::<Vec<_>>());
    }

    #[test]
    fn scrambling_permutes_cells_of_every_size() {
        for key in [0, 1, 0x9e37_79b9, u32::MAX] {
            for bits in 1..8 {
                let mut cells: Vec<_> =
                    (0..1u32 << bits).map(|i| scramble(i << (32 - bits), key) >> (32 - bits)).collect();
                cells.sort_unstable();
                assert_eq!(cells, (0..1 << bits).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn powers_of_two_fill_every_cell_once() {
        for (spp, x, y) in [(4, 0, 0), (16, 7, 3), (64, 1000, 1), (256, 1, 65_535)] {
            let sampler = Sampler::new(Sampling::Sobol, spp, 5);
            let pixel = sampler.pattern(x, y);
            assert_net(&(0..spp).map(|s| sampler.film(&pixel, s)).collect::<Vec<_>>());
        }
    }
}
