//! Where on a pixel its samples lie.
//!
//! Every number is a function of (pixel, sample, dimension, seed) and of nothing else, so that neither threads nor
//! tiles show in a picture. Samples are correlated multi-jittered (Kensler 2013, *Correlated multi-jittered sampling*,
//! Pixar 13-01): stratified on the square and on both axes, for any number of them. Plain jitter on an m x n grid would
//! leave prime numbers of samples stratified along one axis only.

use crate::math::DVec2;

/// Dimensions that hashes are drawn for.
const PATTERN: u32 = 0;
const JITTER: u32 = 1;

/// The sample points of every pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    spp: u32,
    seed: u64,
    /// Columns and rows of the grid that samples are stratified on, at least `spp` cells.
    columns: u32,
    rows: u32,
}

/// How one pixel's samples are arranged: what all of them have in common.
#[derive(Clone, Copy, Debug)]
pub struct Pattern {
    x: u32,
    y: u32,
    order: Key,
    columns: Key,
    rows: Key,
}

impl Sampler {
    /// `spp` samples a pixel, at least 1.
    pub const fn new(spp: u32, seed: u64) -> Self {
        let columns = spp.isqrt();
        Self { spp, seed, columns, rows: spp.div_ceil(columns) }
    }

    /// What the samples of a pixel have in common, computed once for all of them.
    // Inlined, with `place`: a pattern that came back from a call would be copied by loads wider than the stores that made
    // it, which wait for those.
    #[inline]
    pub fn pattern(&self, x: u32, y: u32) -> Pattern {
        if self.spp == 1 {
            // Not hashed, nor divided: every pixel has the same.
            let (order, columns, rows) = (Key::ONLY, Key::ONLY, Key::ONLY);
            return Pattern { x, y, order, columns, rows };
        }
        let [order, columns, rows, _] = self.hash(x, y, 0, PATTERN);
        Pattern {
            x,
            y,
            order: Key::new(order, self.spp),
            columns: Key::new(columns, self.columns),
            rows: Key::new(rows, self.rows),
        }
    }

    /// A point on the film, in pixels from its top left corner: the place of one of a pixel's samples. The pixel's
    /// middle for a single sample.
    #[inline]
    pub fn place(&self, pixel: &Pattern, sample: u32) -> DVec2 {
        let corner = DVec2::new(f64::from(pixel.x), f64::from(pixel.y));
        corner + self.within(pixel, sample)
    }

    /// The same within the unit square.
    #[inline]
    fn within(&self, pixel: &Pattern, sample: u32) -> DVec2 {
        if self.spp == 1 {
            return DVec2::splat(0.5);
        }
        let jitter = self.hash(pixel.x, pixel.y, sample, JITTER);
        let (m, n) = (self.columns, self.rows);
        let s = permute(sample, self.spp, pixel.order);
        let column = f64::from(permute(s % m, m, pixel.columns));
        let row = f64::from(permute(s / m, n, pixel.rows));
        let (jx, jy) = (unit(jitter[0]), unit(jitter[1]));
        DVec2::new((column + (row + jx) / f64::from(n)) / f64::from(m), (f64::from(s) + jy) / f64::from(self.spp))
    }

    fn hash(&self, x: u32, y: u32, sample: u32, dimension: u32) -> [u32; 4] {
        let [a, b, c, d] = pcg4d([x, y, sample, dimension]);
        pcg4d([a ^ self.seed as u32, b ^ (self.seed >> 32) as u32, c, d])
    }
}

/// Chooses a permutation of `0..length`.
#[derive(Clone, Copy, Debug)]
struct Key {
    bits: u32,
    /// The bits modulo the length: a division that all elements share.
    turn: u32,
}

impl Key {
    /// The permutation of one element.
    const ONLY: Self = Self { bits: 0, turn: 0 };

    const fn new(bits: u32, length: u32) -> Self {
        Self { bits, turn: bits % length }
    }
}

/// To [0, 1).
fn unit(bits: u32) -> f64 {
    f64::from(bits) / 4_294_967_296.0
}

/// Four hashes of four numbers (Jarzynski and Olano 2020, *Hash functions for GPU rendering*, JCGT 9(3)).
pub(crate) const fn pcg4d(v: [u32; 4]) -> [u32; 4] {
    let [x, y, z, w] = v;
    let x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let y = y.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let z = z.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let w = w.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let [x, y, z, w] = mix([x, y, z, w]);
    mix([x ^ (x >> 16), y ^ (y >> 16), z ^ (z >> 16), w ^ (w >> 16)])
}

const fn mix([x, y, z, w]: [u32; 4]) -> [u32; 4] {
    let x = x.wrapping_add(y.wrapping_mul(w));
    let y = y.wrapping_add(z.wrapping_mul(x));
    let z = z.wrapping_add(x.wrapping_mul(y));
    let w = w.wrapping_add(y.wrapping_mul(z));
    [x, y, z, w]
}

/// The `i`th element of a permutation of `0..length` that `key` chooses: Kensler's, a hash of the next power of two
/// that is repeated until it falls inside.
const fn permute(mut i: u32, length: u32, key: Key) -> u32 {
    let Key { bits: key, turn } = key;
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
            let rest = length - turn;
            return if i < rest { i + turn } else { i - rest };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permutations_are_permutations() {
        for length in [1, 2, 3, 5, 8, 13, 64, 100] {
            for key in [0, 1, 0x9e37_79b9, u32::MAX] {
                let mut images: Vec<_> = (0..length).map(|i| permute(i, length, Key::new(key, length))).collect();
                images.sort_unstable();
                assert_eq!(images, (0..length).collect::<Vec<_>>(), "{length} by {key}");
            }
        }
    }

    #[test]
    fn every_row_and_every_stratum_has_one_sample() {
        for (spp, columns, rows) in [(4, 2, 2), (7, 2, 4), (16, 4, 4), (25, 5, 5)] {
            let sampler = Sampler::new(spp, 3);
            for (x, y) in [(0, 0), (5, 9), (4_000_000, 1)] {
                let places: Vec<_> = (0..spp).map(|s| sampler.within(&sampler.pattern(x, y), s)).collect();
                assert!(places.iter().all(|p| p.min_element() >= 0.0 && p.max_element() < 1.0));
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

    #[test]
    fn pixels_samples_and_seeds_differ_and_a_single_sample_is_central() {
        let within = |sampler: Sampler, x, y, s| sampler.within(&sampler.pattern(x, y), s);
        let place = |seed, x, s| within(Sampler::new(4, seed), x, 0, s);
        assert_ne!(place(0, 0, 0), place(0, 1, 0));
        assert_ne!(place(0, 0, 0), place(1, 0, 0));
        assert_ne!(place(0, 0, 0), place(1 << 40, 0, 0));
        assert_ne!(place(0, 0, 0), place(0, 0, 1));
        assert_eq!(within(Sampler::new(1, 9), 3, 4, 0), DVec2::splat(0.5));
        let one = Sampler::new(1, 9);
        assert_eq!(one.place(&one.pattern(3, 4), 0), DVec2::new(3.5, 4.5));
    }

    /// Mean and variance of a uniform distribution over many pixels: no corner of the pixel is preferred.
    #[test]
    fn samples_are_uniform() {
        let sampler = Sampler::new(5, 0);
        let places: Vec<_> =
            (0..20_000u32).map(|i| sampler.within(&sampler.pattern(i % 200, i / 200), i % 5)).collect();
        let n = places.len() as f64;
        let mean = places.iter().sum::<DVec2>() / n;
        let variance = places.iter().map(|p| (*p - mean) * (*p - mean)).sum::<DVec2>() / n;
        assert!((mean - 0.5).abs().max_element() < 0.01, "{mean}");
        assert!((variance - 1.0 / 12.0).abs().max_element() < 0.002, "{variance}");
    }
}
