//! One sequence for the whole picture, dealt out to pixels along a curve, so that neighbours have samples that
//! complement one another and their errors differ: what noise is left has no low frequencies (Ahmed and Wonka
//! 2020, *Screen-space blue-noise diffusion of Monte Carlo sampling error via hierarchical ordering of pixels*).
//!
//! Pixels are numbered along a Z-order curve of which every quadruple is shuffled, by a hash of the quadruples it lies
//! in.

use super::sobol::{scramble, second};
use super::{pcg4d, unit};
use crate::math::DVec2;

/// Base-4 digits of a pixel's number, for pictures of up to 65,536 pixels a side.
const PIXEL_DIGITS: u32 = 16;

/// The `sample`th of `spp` points of a pixel. `key` is that of the dimension, the same for all pixels.
pub(super) fn point([x, y]: [u32; 2], sample: u32, spp: u32, key: [u32; 4]) -> DVec2 {
    // Each pixel has its samples on end: a power of four of them, of which the first are used.
    let sample_digits = spp.next_power_of_two().ilog2().div_ceil(2);
    let number = (spread(x) | spread(y) << 1) << (2 * sample_digits) | u64::from(sample);
    let index = shuffle(number, PIXEL_DIGITS + sample_digits, key[0]);
    let first = (index.reverse_bits() >> 32) as u32;
    DVec2::new(unit(scramble(first, key[1])), unit(scramble(second(index), key[2])))
}

/// The bits of a number below 2^16, with zeros between.
fn spread(x: u32) -> u64 {
    let x = u64::from(x & 0xffff);
    let x = (x | x << 8) & 0x00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
}

/// Permutes each of a number's `digits` in base 4 by what stands before it.
fn shuffle(number: u64, digits: u32, key: u32) -> u64 {
    let mut shuffled = 0;
    for place in (0..digits).rev() {
        let before = number >> (2 * place + 2);
        let digit = number >> (2 * place) & 3;
        let [choice, ..] = pcg4d([before as u32, (before >> 32) as u32, place, key]);
        shuffled |= u64::from(PERMUTATIONS[choice as usize % 24][digit as usize]) << (2 * place);
    }
    shuffled
}

/// Of four things.
const PERMUTATIONS: [[u8; 4]; 24] = {
    let (mut all, mut count, mut code) = ([[0; 4]; 24], 0, 0u32);
    while code < 256 {
        let p = [(code & 3) as u8, (code >> 2 & 3) as u8, (code >> 4 & 3) as u8, (code >> 6) as u8];
        if 1 << p[0] | 1 << p[1] | 1 << p[2] | 1 << p[3] == 15 {
            all[count] = p;
            count += 1;
        }
        code += 1;
    }
    all
};

#[cfg(test)]
mod tests {
    use super::super::sobol::tests::assert_net;
    use super::super::{Sampler, Sampling};
    use super::*;

    fn places(sampler: &Sampler, spp: u32, pixels: impl Iterator<Item = (u32, u32)>) -> Vec<DVec2> {
        let of = |(x, y)| (0..spp).map(move |s| sampler.film(&sampler.pattern(x, y), s));
        pixels.flat_map(of).collect()
    }

    #[test]
    fn pixels_and_blocks_of_pixels_fill_every_cell_once() {
        let sampler = Sampler::new(Sampling::BlueNoise, 4, 5);
        assert_net(&places(&sampler, 4, std::iter::once((77, 30_000))));
        for side in [2, 4, 8] {
            let block = (0..side * side).map(|i| (3 * side + i % side, 11 * side + i / side));
            assert_net(&places(&sampler, 4, block));
        }
    }

    /// The error of neighbours' sums is far below that of pixels apart, which is what blue noise means.
    #[test]
    fn neighbouring_errors_cancel() {
        let sampler = Sampler::new(Sampling::BlueNoise, 4, 0);
        let error = |pixels: &[(u32, u32)]| {
            let places = places(&sampler, 4, pixels.iter().copied());
            let inside = places.iter().filter(|p| p.length_squared() < 1.0).count();
            (inside as f64 / places.len() as f64 - std::f64::consts::FRAC_PI_4).powi(2)
        };
        let mean = |group: &dyn Fn(u32) -> Vec<(u32, u32)>| (0..500).map(|i| error(&group(i))).sum::<f64>() / 500.0;
        let block = |i: u32| (0..16).map(|k| (4 * i + k % 4, 8 + k / 4)).collect();
        let scattered = |i: u32| (0..16).map(|k| (4 * i + k * 1000, 8 + k * 777)).collect();
        let (near, far) = (mean(&block), mean(&scattered));
        assert!(near < 0.5 * far, "{near} against {far}");
    }
}
