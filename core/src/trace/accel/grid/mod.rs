//! A uniform grid, walked cell by cell (Amanatides, Woo 1987, *A fast voxel traversal algorithm for ray tracing*).
//!
//! `build` has how many cells there are and what is in them.
//!
//! A step adds a constant to the t of the next plane, and rounds: the walk may pass a plane a little early or late and
//! name a cell that the ray misses by a hair. So items lie in every cell within [`SLACK`] of a cell's width, far more
//! than all steps together round. A ray that is known less well than that (from very far away, or into a tiny nested
//! grid) takes another way, [`Grid::halve`], which treats the cells as leaves of a tree of boxes.

mod build;

use super::items::Input;
use super::ray::IndexRay;
use super::{Index, Options};
use crate::math::{DVec3, UNIT_ROUNDOFF_64, UVec3};

/// By how much of a cell's width items reach into the neighbours.
const SLACK: f64 = 1.0 / 128.0;
/// Marks an entry of a cell that names a nested grid.
const NESTED: u32 = 1 << 31;

/// The index.
pub(in crate::trace::accel) struct Grid {
    min: DVec3,
    /// Of a cell.
    width: DVec3,
    counts: UVec3,
    /// Where the entries of each cell begin, and where the last ones end.
    starts: Vec<u32>,
    /// Items, or the one nested grid of a cell.
    entries: Vec<u32>,
    nested: Vec<Grid>,
}

impl Index for Grid {
    const REPEATS: bool = true;

    fn build(input: &Input<'_>, options: &Options) -> Self {
        Self::over(input.boxes, &input.all(), &input.bounds(), options.grid, 0)
    }

    fn visit(&self, ray: &IndexRay, limit: f64, each: &mut impl FnMut(u32) -> f64) {
        self.enter(ray, limit, each);
    }

    fn bytes(&self) -> usize {
        let own = size_of_val(&self.starts[..]) + size_of_val(&self.entries[..]) + size_of_val(&self.nested[..]);
        own + self.nested.iter().map(Self::bytes).sum::<usize>()
    }

    fn note(&self) -> Option<String> {
        let UVec3 { x, y, z } = self.counts;
        let nested = self.nested.len();
        (!self.entries.is_empty())
            .then(|| format!("a grid of {x} x {y} x {z} cells, {nested} of them with grids of their own"))
    }
}

/// Cells from one corner to another, both included.
#[derive(Clone, Copy)]
struct Block {
    low: UVec3,
    high: UVec3,
}

impl Grid {
    fn cell(&self, [x, y, z]: [u32; 3]) -> usize {
        (z as usize * self.counts.y as usize + y as usize) * self.counts.x as usize + x as usize
    }

    /// Visits what the ray passes and gives the new limit.
    fn enter(&self, ray: &IndexRay, limit: f64, each: &mut impl FnMut(u32) -> f64) -> f64 {
        if self.entries.is_empty() {
            return limit;
        }
        // Items end at the sides of the grid, but the walk may be off by the slack.
        let slack = self.width * SLACK;
        let max = self.min + self.width * self.counts.as_dvec3();
        let range = ray.within(self.min - slack, max + slack, limit);
        if range.is_empty() {
            limit
        } else if (ray.pad + self.steps_error(ray)).cmple(slack).all() {
            self.walk(ray, range.from, limit, each)
        } else {
            self.halve(ray, Block { low: UVec3::ZERO, high: self.counts - 1 }, limit, each)
        }
    }

    /// How far all steps of a walk together may be off: each adds a rounded width, by an addition that rounds.
    fn steps_error(&self, ray: &IndexRay) -> DVec3 {
        ray.span * (4.0 * UNIT_ROUNDOFF_64 * f64::from(self.counts.max_element()))
    }

    /// From cell to cell.
    fn walk(&self, ray: &IndexRay, from: f64, mut limit: f64, each: &mut impl FnMut(u32) -> f64) -> f64 {
        let start = (ray.origin + ray.direction * from - self.min) / self.width;
        let counts = self.counts.to_array();
        let (mut at, mut next, mut step, mut along, mut left) = ([0; 3], [0.0; 3], [0.0; 3], [0; 3], [0; 3]);
        let strides = [1, counts[0] as isize, counts[0] as isize * counts[1] as isize];
        for axis in 0..3 {
            // A cast saturates: what is below goes to 0.
            at[axis] = (start[axis] as u32).min(counts[axis] - 1);
            let is_back = ray.backwards[axis];
            let plane = self.min[axis] + f64::from(at[axis] + u32::from(!is_back)) * self.width[axis];
            let reciprocal = ray.reciprocal[axis];
            next[axis] = if reciprocal.is_finite() { (plane - ray.origin[axis]) * reciprocal } else { f64::INFINITY };
            step[axis] = self.width[axis] * reciprocal.abs();
            along[axis] = if is_back { -strides[axis] } else { strides[axis] };
            left[axis] = if is_back { at[axis] } else { counts[axis] - 1 - at[axis] };
        }
        let mut cell = self.cell(at);
        loop {
            limit = self.cell_items(cell, ray, limit, each);
            let axis = if next[0] < next[1] {
                if next[0] < next[2] { 0 } else { 2 }
            } else if next[1] < next[2] {
                1
            } else {
                2
            };
            if next[axis] > limit || left[axis] == 0 {
                return limit;
            }
            left[axis] -= 1;
            next[axis] += step[axis];
            cell = cell.wrapping_add_signed(along[axis]);
        }
    }

    #[inline]
    fn cell_items(&self, cell: usize, ray: &IndexRay, mut limit: f64, each: &mut impl FnMut(u32) -> f64) -> f64 {
        for &entry in &self.entries[self.starts[cell] as usize..self.starts[cell + 1] as usize] {
            limit = if entry & NESTED == 0 {
                each(entry)
            } else {
                self.nested[(entry & !NESTED) as usize].enter(ray, limit, each)
            };
        }
        limit
    }

    /// The cells as a tree: the longer way, which takes any pad.
    fn halve(&self, ray: &IndexRay, block: Block, limit: f64, each: &mut impl FnMut(u32) -> f64) -> f64 {
        let Block { low, high } = block;
        let slack = self.width * SLACK;
        let min = self.min + low.as_dvec3() * self.width - slack;
        let max = self.min + (high + 1).as_dvec3() * self.width + slack;
        if ray.within(min, max, limit).is_empty() {
            return limit;
        }
        let size = high - low;
        if size == UVec3::ZERO {
            return self.cell_items(self.cell(low.to_array()), ray, limit, each);
        }
        let axis = (0..3).max_by_key(|&axis| size[axis]).unwrap_or(0);
        let middle = low[axis] + size[axis] / 2;
        let mut halves = [block, block];
        halves[0].high[axis] = middle;
        halves[1].low[axis] = middle + 1;
        let near = usize::from(ray.backwards[axis]);
        let limit = self.halve(ray, halves[near], limit, each);
        self.halve(ray, halves[1 - near], limit, each)
    }
}
