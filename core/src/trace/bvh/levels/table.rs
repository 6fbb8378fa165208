//! A support function that is tabulated, on a grid over the surface of a cube.
//!
//! A support function is convex, and as many times as large in a direction that is as many times as long: in a
//! direction between three others it is at most what lies between their values. So a table never tells too little, and
//! for a ball a 64th of its radius too much at most, or a 256th on the finer grid, besides what
//! [searches](crate::trace::bvh::tree::Tree::farthest) spare.

use rayon::prelude::*;

use crate::math::{DMat3, DVec3, Vec3};
use crate::trace::bvh::simd::{Doubles, Simd};

/// A support function's values on the surface of the cube from -1 to 1.
pub(super) struct Table {
    /// Along each side of a face; a power of two, so that the grid is exact.
    cells: usize,
    /// Face by face and row by row, one more than cells to a row; along and against. Faces are those of x, y, z, with
    /// the other axes in their order.
    values: Vec<[f64; 2]>,
    /// More than rounding can add in a direction of which no component is larger than 1.
    spare: f64,
}

impl Table {
    /// How fine a grid is worth it for so many boxes; none where searches for each by itself are done sooner.
    pub fn cells(boxes: usize) -> Option<usize> {
        match boxes {
            0..128 => None,
            128..4096 => Some(8),
            4096.. => Some(16),
        }
    }

    /// Values that it has.
    pub fn entries(cells: usize) -> usize {
        2 * 3 * (cells + 1) * (cells + 1)
    }

    /// Of a support function, which is asked for neighbours together, as [`Level::farthest`](super::Level::farthest)
    /// is.
    pub fn new(cells: usize, support: impl Fn(&[Vec3], &mut [f64]) + Sync) -> Self {
        let side = cells + 1;
        let mut values = vec![[0.0; 2]; Self::entries(cells) / 2];
        values.par_chunks_mut(side).enumerate().for_each(|(row, values)| {
            let (axis, j) = (row / side, row % side);
            let component = |at: usize| 2.0 * at as f32 / cells as f32 - 1.0;
            let mut ways = vec![Vec3::ZERO; side];
            for (i, way) in ways.iter_mut().enumerate() {
                let [p, q] = OTHERS[axis];
                (way[axis], way[p], way[q]) = (1.0, component(i), component(j));
            }
            let mut reach = vec![0.0; side];
            for end in 0..2 {
                support(&ways, &mut reach);
                for ((value, &reach), way) in values.iter_mut().zip(&reach).zip(&mut ways) {
                    value[end] = reach;
                    *way = -*way;
                }
            }
        });
        let most = values.as_flattened().iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        // A few roundings of what is at most `cells`, times values.
        let spare = most * cells as f64 * 64.0 * f64::EPSILON;
        Self { cells, values, spare }
    }

    /// At least the support along each row of a matrix, whose entries are those of f32, and in the opposite direction;
    /// infinite or NaN where nothing is known.
    #[inline(always)]
    pub fn extents<S: Simd>(&self, rows: &DMat3) -> [DVec3; 2] {
        let lanes = |axis: usize| {
            let DVec3 { x, y, z } = rows.col(axis);
            S::D4::load(&[x, y, z, 1.0])
        };
        let [x, y, z] = [lanes(0), lanes(1), lanes(2)];
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let two = ax.max(ay);
        // One of three by which component is the largest: without branches, which nobody can predict.
        let by_largest = |x, y, z| two.less_select(az, z, ax.less_select(ay, y, x));
        // That component, and the others in their order.
        let (main, p, q) = (by_largest(x, y, z), by_largest(y, x, x), by_largest(z, z, y));
        let length = two.max(az);
        let side = self.cells + 1;
        // Where its face's values begin.
        let face = (side * side) as f64;
        let first = by_largest(S::D4::splat(0.0), S::D4::splat(face), S::D4::splat(2.0 * face)).to_array();
        // The way is so many times as long as one on the cube, which it runs along or against.
        let half = S::D4::splat(self.cells as f64 / 2.0);
        let scale = half.div(main);
        let (at_p, at_q) = (p.mul(scale).add(half).to_array(), q.mul(scale).add(half).to_array());
        let (main, length) = (main.to_array(), length.to_array());
        let (mut along, mut against) = (DVec3::ZERO, DVec3::ZERO);
        for row in 0..3 {
            let cell = |at: f64| (at as i32 as usize).min(self.cells - 1);
            let (i, j) = (cell(at_p[row]), cell(at_q[row]));
            let (f, g) = (at_p[row] - i as f64, at_q[row] - j as f64);
            let corners = &self.values[first[row] as usize + j * side + i..][..side + 2];
            // The cell is cut into two triangles.
            let beside = if f > g { 1 } else { side };
            let (more, less) = (f.max(g), f.min(g));
            let [low, beside, across] = [&corners[0], &corners[beside], &corners[side + 1]];
            let on = |k: usize| low[k] * (1.0 - more) + beside[k] * (more - less) + across[k] * less;
            let extent = [on(0), on(1)].map(|value| length[row] * (value + self.spare));
            let is_against = usize::from(main[row] < 0.0);
            (along[row], against[row]) = (extent[is_against], extent[1 - is_against]);
        }
        [along, against]
    }
}

/// The two axes beside each.
const OTHERS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::isa::{self, Kernel, Present};

    fn tabulated(cells: usize, support: impl Fn(DVec3) -> f64 + Sync) -> Table {
        Table::new(cells, |ways, values| {
            for (value, way) in values.iter_mut().zip(ways) {
                *value = support(way.as_dvec3());
            }
        })
    }

    /// What a table has for `way`, whichever row it is, the same on every instruction set.
    fn extent(table: &Table, way: DVec3) -> [f64; 2] {
        struct Extents<'a>(&'a Table, DMat3);
        impl Kernel for Extents<'_> {
            type Output = [DVec3; 2];
            #[inline(always)]
            fn run<S: Simd>(self) -> [DVec3; 2] {
                self.0.extents::<S>(&self.1)
            }
        }
        let mut found = Vec::new();
        for row in 0..3 {
            let mut rows = [DVec3::new(-2.0, 3.0, 5.0), DVec3::new(7.0, 3.0, -1.0), DVec3::new(0.0, -0.5, 0.0)];
            rows[row] = way;
            let rows = DMat3::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose();
            for isa in Present::all() {
                found.push(isa::dispatch(isa, Extents(table, rows)).map(|extents| extents[row]));
            }
        }
        let bits = |extent: [f64; 2]| extent.map(f64::to_bits);
        assert!(found.iter().all(|&extent| bits(extent) == bits(found[0])), "{found:?} along {way}");
        found[0]
    }

    /// What is tabulated is never too little, also on the grid, on the edges of the cube and beside them, at any
    /// length; and no more too much than is said, for a ball.
    #[test]
    fn a_table_reaches_as_far_and_little_farther() {
        let mut random = Random::new(9);
        let points: Vec<_> = (0..900).map(|_| random.vec3().as_dvec3() * 10.0).collect();
        let reach = |way: DVec3| points.iter().map(|at| at.dot(way)).fold(f64::NEG_INFINITY, f64::max);
        for cells in [8, 16] {
            let ball = tabulated(cells, |way| way.length());
            let cloud = tabulated(cells, reach);
            let (mut worst, finer) = (0.0_f64, 1.0 / (cells * cells) as f64);
            for case in 0..20_000 {
                let length = [1.0, 10.0, 1e4, 1e30, 1e37, 1e-4, 1e-30, 1e-40][case / 4 % 8];
                let mut way = random.vec3() * length;
                match case % 4 {
                    0 => way = (way / way.abs().max_element() * 8.0).round() * length,
                    1 => way.x = way.y,
                    2 => way.z = 0.0,
                    _ => {}
                }
                let way = way.as_dvec3();
                for way in [way, -way] {
                    let (most, farthest) = (way.length(), extent(&ball, way)[0]);
                    assert!(farthest >= most, "{farthest:e} < {most:e} along {way} of {cells} cells");
                    worst = worst.max((farthest - most) / way.abs().max_element());
                    let (most, [farthest, against]) = (reach(way), extent(&cloud, way));
                    assert!(farthest >= most, "{farthest:e} < {most:e} along {way} of {cells} cells");
                    assert_eq!([against, farthest], extent(&cloud, -way));
                }
            }
            assert!(worst > 0.8 * finer && worst < 1.0001 * finer, "{worst} of {cells} cells");
            assert!(extent(&ball, DVec3::ZERO).iter().all(|at| at.is_nan()), "nowhere is no way");
        }
    }
}
