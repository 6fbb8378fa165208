//! Halton's sequence (1964, *Algorithm 247: radical-inverse quasi-random point sequence*) in bases 2 and 3, scrambled
//! by Owen's method: each digit is permuted by a permutation that the digits before it choose. Shuffled by the same
//! method in base 6, so that pairs of dimensions are not the same points in the same order: any power of six of the
//! samples, from the first on, has one in each of as many equal cells.

use super::sobol::scramble;
use super::stratified::permute;
use super::{pcg4d, unit};
use crate::math::DVec2;

/// Digits in base 3 that are permuted: 3^-20 is less than f32 tells apart.
const DIGITS: u32 = 20;

/// Digits in base 6 that are shuffled: as many samples as no pixel has.
const SHUFFLED: u32 = 8;

/// The `sample`th point of the sequence that `key` chooses.
pub(super) fn point(sample: u32, key: [u32; 4]) -> DVec2 {
    let index = shuffle(sample, key[2]);
    DVec2::new(unit(scramble(index.reverse_bits(), key[0])), ternary(index, key[1]))
}

/// Digits in base 6, each permuted by a permutation that those above it choose.
fn shuffle(index: u32, key: u32) -> u32 {
    let blocks = index / 6u32.pow(SHUFFLED);
    let (mut shuffled, mut above) = (blocks, blocks);
    for place in (0..SHUFFLED).rev() {
        let digit = index / 6u32.pow(place) % 6;
        let [choice, ..] = pcg4d([above, place, key, 6]);
        // Only the last block, which 32 bits do not hold whole, wraps around.
        shuffled = shuffled.wrapping_mul(6).wrapping_add(permute(digit, 6, choice));
        above = above * 6 + digit;
    }
    shuffled
}

/// The digits of `index` in base 3 behind the point, last first, scrambled.
fn ternary(mut index: u32, key: u32) -> f64 {
    let (mut value, mut scale, mut before) = (0.0, 1.0, 0u32);
    for place in 0..DIGITS {
        let digit = index % 3;
        index /= 3;
        let [choice, ..] = pcg4d([before, place, key, 3]);
        scale /= 3.0;
        value += f64::from(permute(digit, 3, choice)) * scale;
        before = before.wrapping_mul(3).wrapping_add(digit);
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shuffled_are_all_of_a_block() {
        for key in 0..20 {
            let mut block: Vec<_> = (0..216).map(|i| shuffle(i, key)).collect();
            block.sort_unstable();
            assert!(block.windows(2).all(|pair| pair[1] == pair[0] + 1) && block[0] % 216 == 0, "{key}");
            let far = 1000 * 6u32.pow(SHUFFLED) + 77;
            assert_eq!(shuffle(far, key) / 6u32.pow(SHUFFLED), 1000);
            _ = shuffle(u32::MAX, key);
        }
    }

    #[test]
    fn powers_of_both_bases_fill_every_cell_once() {
        for seed in 0..20 {
            let key = pcg4d([seed, 1, 2, 3]);
            let points: Vec<_> = (0..36).map(|i| point(i, key)).collect();
            // 36 samples on 4 x 9 cells, by the Chinese remainder theorem.
            let mut cells: Vec<_> = points.iter().map(|p| (p.x * 4.0) as u32 * 9 + (p.y * 9.0) as u32).collect();
            cells.sort_unstable();
            assert_eq!(cells, (0..36).collect::<Vec<_>>());
            assert!(points.iter().all(|p| p.min_element() >= 0.0 && p.max_element() < 1.0));
        }
    }
}
