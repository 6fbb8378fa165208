//! Triangles along a space-filling curve (Lauterbach, Garland, Sengupta, Luebke, Manocha 2009, *Fast BVH construction on
//! GPUs*): the quick way to blocks of neighbours.
//!
//! The fast preset sorts triangles by Morton code and puts each four that follow one another into a block; the tree above the
//! blocks is built by the surface area heuristic, over a quarter of the items. (Garanzha, Pantaleoni, McAllister 2011,
//! *Simpler and faster HLBVH with work queues*, do the same with larger clusters.) A tree read off the codes would be
//! built sooner still, and be traced slower by a third.

use rayon::prelude::*;

use crate::math::{Aabb, Vec3, is_traceable};
use crate::trace::{Part, Primitives};

/// Bits of a code for each axis.
const BITS: u32 = 10;

/// The code of a triangle, and its number.
#[derive(Clone, Copy, Debug)]
pub(in crate::trace::bvh) struct Coded {
    code: u32,
    pub number: u32,
}

/// The traceable triangles of `parts` along the curve; those with equal codes as they came. They are numbered through all
/// parts, `firsts` being the number of each part's first.
pub(in crate::trace::bvh) fn sorted(parts: &[Part], firsts: &[u32]) -> Vec<Coded> {
    let meshes = || {
        parts.iter().zip(firsts).filter_map(|(part, &first)| match &part.primitives {
            Primitives::Triangles { positions, triangles } => Some((positions, triangles, first)),
            Primitives::Shapes(_) => None,
        })
    };
    let include = |bounds: Aabb, &p: &Vec3| if is_traceable(p) { bounds.include(p) } else { bounds };
    let bounds = meshes()
        .map(|(positions, ..)| positions.par_iter().fold(|| Aabb::EMPTY, include).reduce(|| Aabb::EMPTY, Aabb::union))
        .fold(Aabb::EMPTY, Aabb::union);
    let grid = Grid::new(&bounds);
    let mut coded = Vec::with_capacity(meshes().map(|(_, triangles, _)| triangles.len()).sum());
    for (positions, triangles, first) in meshes() {
        coded.par_extend(triangles.par_iter().enumerate().filter_map(|(i, corners)| {
            let corners = corners.map(|i| positions[i as usize]);
            let code = grid.code(&corners);
            corners.into_iter().all(is_traceable).then_some(Coded { code, number: first + i as u32 })
        }));
    }
    radix_sort(&mut coded);
    coded
}

/// From a triangle to the cell of its middle, the cells being cubes.
struct Grid {
    /// Three times the smallest corner: corners are added up, not averaged.
    origin: Vec3,
    scale: f32,
}

impl Grid {
    fn new(bounds: &Aabb) -> Self {
        let size = 3.0 * bounds.size().max_element();
        let scale = ((1 << BITS) as f32 / size).min(f32::MAX);
        Self { origin: 3.0 * bounds.min, scale: if size > 0.0 { scale } else { 0.0 } }
    }

    #[inline]
    fn code(&self, corners: &[Vec3; 3]) -> u32 {
        let cell = (corners[0] + corners[1] + corners[2] - self.origin) * self.scale;
        // The cast saturates, and makes NaN 0.
        let [x, y, z] = cell.to_array().map(|x| spread((x as u32).min((1 << BITS) - 1)));
        x << 2 | y << 1 | z
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

/// Stable, by counting ten bits at a time.
fn radix_sort(coded: &mut Vec<Coded>) {
    const BUCKETS: usize = 1 << BITS;
    let mut counts = [[0u32; BUCKETS]; 3];
    for item in coded.iter() {
        for (pass, counts) in counts.iter_mut().enumerate() {
            counts[digit(item, pass)] += 1;
        }
    }
    let mut other = coded.clone();
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
    (item.code >> (BITS * pass as u32)) as usize % (1 << BITS)
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
        assert_eq!(grid.code(&[Vec3::MAX; 3]), (1 << 30) - 1, "outside counts as at the border");
    }

    #[test]
    fn sorting_is_stable() {
        let mut state = 1u32;
        let mut coded: Vec<Coded> = (0..10_000)
            .map(|number| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                Coded { code: (state >> 2) & 0x3fc0_03ff, number }
            })
            .collect();
        let mut expected = coded.clone();
        expected.sort_by_key(|item| item.code);
        radix_sort(&mut coded);
        let numbers = |list: &[Coded]| list.iter().map(|item| item.number).collect::<Vec<_>>();
        assert_eq!(numbers(&coded), numbers(&expected));
    }
}
