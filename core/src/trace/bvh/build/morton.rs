//! Triangles along a space-filling curve (Lauterbach, Garland, Sengupta, Luebke, Manocha 2009, *Fast BVH construction
//! on GPUs*): the quick way to blocks of neighbours.
//!
//! The fast presets sort triangles by Morton code, cut the curve into clusters of up to 64 at borders of cells, and put
//! each eight of a cluster that follow one another into a block. A cluster becomes one node; the tree above the
//! clusters is built by the surface area heuristic, over a fortieth of the items (Garanzha, Pantaleoni, McAllister
//! 2011, *Simpler and faster HLBVH with work queues*). A tree by the heuristic down to the blocks, tried first, took
//! twice as long and was no better: most of what is lost is lost in the blocks.

use rayon::prelude::*;

use crate::math::{Aabb, Vec3, is_traceable};
use crate::memory::room;
use crate::trace::bvh::meshes::Meshes;

/// Bits of a code for the three axes together.
const BITS: u32 = 30;

/// The most bits for one axis.
const MAX_BITS: u32 = 16;

/// Set in the codes of large triangles.
const LARGE_BIT: u32 = BITS;

/// No code of a triangle that can be hit.
const UNTRACEABLE: u32 = u32::MAX;

/// The code of a triangle, and its number.
#[derive(Clone, Copy, Debug)]
pub(in crate::trace::bvh) struct Coded {
    code: u32,
    pub number: u32,
}

/// The traceable triangles along the curve, by number; those with equal codes as they came.
pub(in crate::trace::bvh) fn sorted(meshes: &Meshes) -> Vec<Coded> {
    let grid = Grid::new(&meshes.bounds());
    let mut coded = room::fill(meshes.stretches(), |(mesh, range), room| {
        for i in range {
            let corners = mesh.corners(i);
            let code = if corners.into_iter().all(is_traceable) { grid.code(&corners) } else { UNTRACEABLE };
            room.push(Coded { code, number: mesh.first + i });
        }
    });
    if coded.par_iter().with_min_len(room::few::<Coded>()).any(|item| item.code == UNTRACEABLE) {
        coded.retain(|item| item.code != UNTRACEABLE);
    }
    sorted_by_code(coded)
}

/// From a triangle to the cell of its middle, the cells being nearly cubes: each bit halves the longest side of what is
/// left (Vinkler, Bittner, Havran 2017, *Extended Morton codes for high performance bounding volume hierarchy
/// construction*). With as many bits for each axis, a terrain would leave most of those for its height unused, and
/// twenty triangles of twenty million would be in a cell.
struct Grid {
    /// Three times the smallest corner: corners are added up, not averaged.
    origin: Vec3,
    /// Cells to a unit of these sums, for each axis.
    scale: Vec3,
    /// The last cell of each axis.
    last: [u32; 3],
    /// Where in a code the bits of an axis's cell are, for each of its two bytes.
    spread: Box<[[[u32; 256]; 2]; 3]>,
    /// Triangles wider than this come last, by themselves: among small ones they would spoil a whole cluster's box.
    large: f32,
}

impl Grid {
    fn new(bounds: &Aabb) -> Self {
        let size = 3.0 * bounds.size();
        let mut bits = [const { Vec::new() }; 3];
        let mut left = size;
        for bit in (0..BITS).rev() {
            let axis = left.max_position();
            if left[axis] > 0.0 {
                bits[axis].push(bit);
                left[axis] = if bits[axis].len() < MAX_BITS as usize { left[axis] / 2.0 } else { 0.0 };
            }
        }
        let (mut scale, mut spread) = (Vec3::ZERO, Box::new([[[0; 256]; 2]; 3]));
        for axis in 0..3 {
            if size[axis] > 0.0 {
                scale[axis] = ((1 << bits[axis].len()) as f32 / size[axis]).min(f32::MAX);
            }
            for (place, bit) in bits[axis].iter().rev().enumerate() {
                let byte = spread[axis][place / 8].iter_mut().enumerate();
                byte.filter(|(cell, _)| cell >> (place % 8) & 1 != 0).for_each(|(_, code)| *code |= 1 << bit);
            }
        }
        let last = bits.map(|bits| (1 << bits.len()) - 1);
        Self { origin: 3.0 * bounds.min, scale, last, spread, large: size.max_element() / 48.0 }
    }

    #[inline]
    fn code(&self, corners: &[Vec3; 3]) -> u32 {
        let cell = ((corners[0] + corners[1] + corners[2] - self.origin) * self.scale).to_array();
        let of_axis = |axis: usize| {
            // The cast saturates, and makes NaN 0.
            let cell = (cell[axis] as u32).min(self.last[axis]);
            let [low, high] = &self.spread[axis];
            low[cell as usize % 256] | high[(cell >> 8) as usize % 256]
        };
        let extent = corners[0].max(corners[1]).max(corners[2]) - corners[0].min(corners[1]).min(corners[2]);
        let is_large = u32::from(extent.max_element() > self.large);
        is_large << LARGE_BIT | of_axis(0) | of_axis(1) | of_axis(2)
    }
}

/// Bits by which chunks are sorted at first, the highest ones.
const TOP_BITS: u32 = LARGE_BIT + 1 - 2 * LOW_BITS;

/// Bits that buckets are sorted by at a time, twice.
const LOW_BITS: u32 = 10;

/// What one thread sorts by the highest bits, or cuts into clusters, at a time: codes and their copy fit the second
/// cache.
const CHUNK: usize = 1 << 15;

/// Buckets of at most this many are sorted by comparing: to go through all counts would take longer.
const BY_COMPARING: usize = 256;

/// All are sorted so where they are no more than these: to wake other threads would take longer.
const ALONE: usize = 1 << 12;

/// By rising code, those with equal codes as they came: each chunk by the highest bits, what has these in common from
/// all chunks into one bucket, and each bucket by the other bits; all of it by all threads. Numbers rise in `coded`.
fn sorted_by_code(mut coded: Vec<Coded>) -> Vec<Coded> {
    if coded.len() <= ALONE {
        sort_by_comparing(&mut coded);
        return coded;
    }
    let by_chunks = coded.par_chunks_mut(CHUNK).map(|chunk| {
        let mut sorted = vec![Coded { code: 0, number: 0 }; chunk.len()];
        let ends = counting_sort(chunk, &mut sorted, TOP_BITS, 2 * LOW_BITS);
        chunk.copy_from_slice(&sorted);
        ends
    });
    let ends: Vec<Vec<u32>> = by_chunks.collect();
    let of_bucket = |bucket: usize, ends: &[u32]| {
        let first = if bucket > 0 { ends[bucket - 1] } else { 0 };
        first as usize..ends[bucket] as usize
    };
    let len = |bucket| ends.iter().map(|ends| of_bucket(bucket, ends).len()).sum();
    let buckets: Vec<(usize, usize)> = (0..1 << TOP_BITS).into_par_iter().map(|bucket| (len(bucket), bucket)).collect();
    let mut sorted = room::fill(buckets, |bucket, room| {
        for (chunk, ends) in coded.chunks(CHUNK).zip(&ends) {
            chunk[of_bucket(bucket, ends)].iter().for_each(|&item| room.push(item));
        }
    });
    drop(coded);
    let top = |item: &Coded| item.code >> (2 * LOW_BITS);
    sorted.par_chunk_by_mut(|a, b| top(a) == top(b)).for_each(|bucket| {
        if bucket.len() <= BY_COMPARING {
            return sort_by_comparing(bucket);
        }
        let mut other = vec![Coded { code: 0, number: 0 }; bucket.len()];
        counting_sort(bucket, &mut other, LOW_BITS, 0);
        counting_sort(&other, bucket, LOW_BITS, LOW_BITS);
    });
    sorted
}

/// By numbers, too, since those with equal codes came by rising number.
fn sort_by_comparing(coded: &mut [Coded]) {
    coded.sort_unstable_by_key(|item| u64::from(item.code) << 32 | u64::from(item.number));
}

/// Stable, by `bits` of the codes from bit `shift` on; and where those with each digit end.
fn counting_sort(from: &[Coded], to: &mut [Coded], bits: u32, shift: u32) -> Vec<u32> {
    let digit = |item: &Coded| (item.code >> shift) as usize % (1 << bits);
    let mut places = vec![0u32; 1 << bits];
    for item in from {
        places[digit(item)] += 1;
    }
    let mut sum = 0;
    for place in &mut places {
        sum += std::mem::replace(place, sum);
    }
    for item in from {
        let place = &mut places[digit(item)];
        to[*place as usize] = *item;
        *place += 1;
    }
    places
}

/// Lengths of the clusters, in order: each of at most `most` items, and cut from others where the highest bit of the
/// codes changes.
pub(in crate::trace::bvh) fn clusters(sorted: &[Coded], most: usize) -> Vec<usize> {
    if sorted.len() > CHUNK {
        let (left, right) = sorted.split_at(cut(sorted));
        let (mut left, mut right) = rayon::join(|| clusters(left, most), || clusters(right, most));
        left.append(&mut right);
        return left;
    }
    let mut lengths = Vec::with_capacity(2 * sorted.len() / most + 1);
    let mut open = vec![sorted];
    while let Some(range) = open.pop() {
        if range.len() > most {
            let (left, right) = range.split_at(cut(range));
            open.extend([right, left]);
        } else if !range.is_empty() {
            lengths.push(range.len());
        }
    }
    lengths
}

/// Where two or more items are cut in two: equal codes in the middle.
fn cut(range: &[Coded]) -> usize {
    let highest = (range[0].code ^ range[range.len() - 1].code).checked_ilog2();
    highest.map_or(range.len() / 2, |bit| range.partition_point(|item| item.code >> bit & 1 == 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The code of a point, in its digits.
    fn digits(size: Vec3, at: Vec3) -> String {
        format!("{:030b}", Grid::new(&Aabb { min: Vec3::ZERO, max: size }).code(&[at; 3]))
    }

    #[test]
    fn codes_interleave_bits() {
        // As many for each axis of a cube, the first for x; and of a cell each axis's own.
        let cube = Vec3::splat(1024.0);
        for x in [0u32, 1, 2, 5, 0x155, 0x2aa, 0x3ff] {
            let expected = |axis| (0..10).fold(0, |sum, bit| sum | (x >> bit & 1) << (3 * bit + 2 - axis));
            for axis in 0..3 {
                let at = (x as f32 + 0.5) * Vec3::AXES[axis];
                assert_eq!(digits(cube, at), format!("{:030b}", expected(axis)), "{x} on axis {axis}");
            }
        }
        // Halved: x six times, then x and z by turns until both are as short as y, then all three.
        let flat = Vec3::new(4096.0, 2.0, 64.0);
        let of_x = digits(flat, Vec3::X * 4096.0);
        assert_eq!(of_x, "111111101010101010010010010010");
        assert_eq!(digits(flat, Vec3::Z * 64.0), "000000010101010100100100100100");
        assert_eq!(digits(flat, Vec3::Y * 2.0), "000000000000000001001001001001");
        // No more than there is a table for, and none for what has no extent.
        assert_eq!(digits(Vec3::Y, Vec3::Y), format!("{}{}", "1".repeat(16), "0".repeat(14)));
        assert_eq!(digits(Vec3::ZERO, Vec3::ONE), "0".repeat(30));
        assert_eq!(digits(cube, Vec3::MAX), "1".repeat(30), "outside counts as at the border");
        let grid = Grid::new(&Aabb { min: Vec3::ZERO, max: cube });
        assert_eq!(grid.code(&[Vec3::ZERO, Vec3::ZERO, Vec3::X * 65.0]) >> LARGE_BIT, 1);
    }

    #[test]
    fn clusters_are_cells() {
        let coded = |codes: &[u32]| codes.iter().map(|&code| Coded { code, number: 0 }).collect::<Vec<_>>();
        assert_eq!(clusters(&coded(&[]), 4), [0; 0]);
        assert_eq!(clusters(&coded(&[9]), 4), [1]);
        assert_eq!(clusters(&coded(&[0, 1, 7, 8, 9]), 4), [3, 2]);
        assert_eq!(clusters(&coded(&[3; 10]), 4), [2, 3, 2, 3]);
        // By several threads: of cells of all sizes, some of them with equal codes.
        fn one_by_one(sorted: &[Coded], most: usize) -> Vec<usize> {
            if sorted.len() <= most {
                return (!sorted.is_empty()).then_some(sorted.len()).into_iter().collect();
            }
            let different = sorted[0].code ^ sorted[sorted.len() - 1].code;
            let bit = |item: &Coded| item.code & (1 << different.checked_ilog2().unwrap_or(0)) != 0;
            let middle = sorted.len() / 2;
            let at = if different == 0 { middle } else { sorted.iter().position(bit).expect("the last one") };
            [one_by_one(&sorted[..at], most), one_by_one(&sorted[at..], most)].concat()
        }
        let mut codes: Vec<u32> = (0..100_000u32).map(|i| i.wrapping_mul(i) >> (i % 13) & 0x3fff_ffff).collect();
        codes.sort_unstable();
        let codes = coded(&codes);
        assert_eq!(clusters(&codes, 32), one_by_one(&codes, 32));
    }

    /// Few codes and many, of one bucket and of all: buckets on either side of [`BY_COMPARING`], and chunks that are
    /// not full.
    #[test]
    fn sorting_is_stable() {
        let some_bits = [0x7fff_ffff, 0x7fc0_07ff, 0x00ff_ffff, 0x000f_fc00, 0x3ff];
        let many = some_bits.map(|bits| (100_000, bits));
        for (count, bits) in [(0, 0), (1, 0), (200, 0x7fff_ffff), (4096, 0xff), (4097, 0xff)].into_iter().chain(many) {
            let mut state = 1u32;
            let coded: Vec<Coded> = (0..count)
                .map(|number| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    Coded { code: (state >> 1) & bits, number }
                })
                .collect();
            let mut expected = coded.clone();
            expected.sort_by_key(|item| item.code);
            let pairs = |list: &[Coded]| list.iter().map(|item| (item.code, item.number)).collect::<Vec<_>>();
            assert!(pairs(&sorted_by_code(coded)) == pairs(&expected), "{count} with bits {bits:x}");
        }
    }
}
