//! Triangles along a space-filling curve (Lauterbach, Garland, Sengupta, Luebke, Manocha 2009, *Fast BVH construction on
//! GPUs*): the quick way to blocks of neighbours.
//!
//! The fast preset sorts triangles by Morton code, cuts the curve into clusters of up to 32 at borders of cells, and puts each
//! four of a cluster that follow one another into a block. A cluster becomes one node; the tree above the clusters is
//! built by the surface area heuristic, over a twentieth of the items (Garanzha, Pantaleoni, McAllister 2011, *Simpler
//! and faster HLBVH with work queues*). A tree by the heuristic down to the blocks, tried first, took twice as long and was
//! no better: most of what is lost is lost in the blocks.

use rayon::prelude::*;

use crate::math::{Aabb, Vec3, is_traceable};
use crate::memory;
use crate::trace::bvh::meshes::{Mesh, Meshes};

/// Bits of a code for each axis.
const BITS: u32 = 10;

/// Set in the codes of large triangles.
const LARGE_BIT: u32 = 3 * BITS;

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
    let include = |bounds: Aabb, &p: &Vec3| if is_traceable(p) { bounds.include(p) } else { bounds };
    let of_mesh =
        |mesh: &Mesh| mesh.positions.par_iter().fold(|| Aabb::EMPTY, include).reduce(|| Aabb::EMPTY, Aabb::union);
    let bounds = meshes.iter().map(of_mesh).fold(Aabb::EMPTY, Aabb::union);
    let grid = Grid::new(&bounds);
    let mut coded = memory::with_capacity(meshes.triangle_count());
    for mesh in meshes.iter() {
        coded.par_extend((0..mesh.triangles.len() as u32).into_par_iter().map(|i| {
            let corners = mesh.corners(i);
            let code = if corners.into_iter().all(is_traceable) { grid.code(&corners) } else { UNTRACEABLE };
            Coded { code, number: mesh.first + i }
        }));
    }
    if coded.par_iter().any(|item| item.code == UNTRACEABLE) {
        coded.retain(|item| item.code != UNTRACEABLE);
    }
    radix_sort(&mut coded);
    coded
}

/// From a triangle to the cell of its middle, the cells being cubes.
struct Grid {
    /// Three times the smallest corner: corners are added up, not averaged.
    origin: Vec3,
    scale: f32,
    /// Triangles wider than this come last, by themselves: among small ones they would spoil a whole cluster's box.
    large: f32,
}

impl Grid {
    fn new(bounds: &Aabb) -> Self {
        let size = 3.0 * bounds.size().max_element();
        let scale = ((1 << BITS) as f32 / size).min(f32::MAX);
        Self { origin: 3.0 * bounds.min, scale: if size > 0.0 { scale } else { 0.0 }, large: size / 48.0 }
    }

    #[inline]
    fn code(&self, corners: &[Vec3; 3]) -> u32 {
        let cell = (corners[0] + corners[1] + corners[2] - self.origin) * self.scale;
        // The cast saturates, and makes NaN 0.
        let [x, y, z] = cell.to_array().map(|x| spread((x as u32).min((1 << BITS) - 1)));
        let extent = corners[0].max(corners[1]).max(corners[2]) - corners[0].min(corners[1]).min(corners[2]);
        u32::from(extent.max_element() > self.large) << LARGE_BIT | x << 2 | y << 1 | z
    }
}

/// Two zeros between each two of the ten lowest bits.
#[inline]
fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

/// Bits that are sorted by at a time.
const DIGIT_BITS: u32 = 11;

/// Stable, by counting eleven bits at a time.
fn radix_sort(coded: &mut Vec<Coded>) {
    let mut counts = [[0u32; 1 << DIGIT_BITS]; 3];
    for item in coded.iter() {
        for (pass, counts) in counts.iter_mut().enumerate() {
            counts[digit(item, pass)] += 1;
        }
    }
    let mut other = memory::with_capacity(coded.len());
    other.extend_from_slice(coded);
    for (pass, counts) in counts.iter_mut().enumerate() {
        let mut sum = 0;
        for count in counts.iter_mut() {
            sum += std::mem::replace(count, sum);
        }
        for &item in coded.iter() {
            let place = &mut counts[digit(&item, pass)];
            other[*place as usize] = item;
            *place += 1;
        }
        std::mem::swap(coded, &mut other);
    }
}

#[inline(always)]
fn digit(item: &Coded, pass: usize) -> usize {
    (item.code >> (DIGIT_BITS * pass as u32)) as usize % (1 << DIGIT_BITS)
}

/// Lengths of the clusters, in order: each of at most `most` items, and cut from others where the highest bit of the codes
/// changes.
pub(in crate::trace::bvh) fn clusters(sorted: &[Coded], most: usize) -> Vec<usize> {
    let mut lengths = Vec::with_capacity(2 * sorted.len() / most + 1);
    let mut open = vec![sorted];
    while let Some(range) = open.pop() {
        let [first, .., last] = range else {
            lengths.extend((range.len() == 1).then_some(1));
            continue;
        };
        if range.len() <= most {
            lengths.push(range.len());
            continue;
        }
        let highest = (first.code ^ last.code).checked_ilog2();
        // Equal codes are halved.
        let cut = highest.map_or(range.len() / 2, |bit| range.partition_point(|item| item.code >> bit & 1 == 0));
        let (left, right) = range.split_at(cut);
        open.extend([right, left]);
    }
    lengths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_interleave_bits() {
        for x in [0u32, 1, 2, 5, 0x155, 0x2aa, 0x3ff] {
            let expected = (0..BITS).fold(0, |sum, bit| sum | (x >> bit & 1) << (3 * bit));
            assert_eq!(spread(x), expected);
        }
        let grid = Grid::new(&Aabb { min: Vec3::ZERO, max: Vec3::new(1024.0, 3.0, 512.0) });
        assert_eq!(grid.code(&[Vec3::new(1.5, 2.5, 3.5); 3]), 0b011_101);
        assert_eq!(grid.code(&[Vec3::ZERO, Vec3::ZERO, Vec3::X * 65.0]) >> LARGE_BIT, 1);
        assert_eq!(grid.code(&[Vec3::MAX; 3]), (1 << 30) - 1, "outside counts as at the border");
    }

    #[test]
    fn clusters_are_cells() {
        let coded = |codes: &[u32]| codes.iter().map(|&code| Coded { code, number: 0 }).collect::<Vec<_>>();
        assert_eq!(clusters(&coded(&[]), 4), [0; 0]);
        assert_eq!(clusters(&coded(&[9]), 4), [1]);
        assert_eq!(clusters(&coded(&[0, 1, 7, 8, 9]), 4), [3, 2]);
        assert_eq!(clusters(&coded(&[3; 10]), 4), [2, 3, 2, 3]);
    }

    #[test]
    fn sorting_is_stable() {
        let mut state = 1u32;
        let mut coded: Vec<Coded> = (0..10_000)
            .map(|number| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                Coded { code: (state >> 1) & 0x7fc0_07ff, number }
            })
            .collect();
        let mut expected = coded.clone();
        expected.sort_by_key(|item| item.code);
        radix_sort(&mut coded);
        let numbers = |list: &[Coded]| list.iter().map(|item| item.number).collect::<Vec<_>>();
        assert_eq!(numbers(&coded), numbers(&expected));
    }
}
