//! A uniform grid, walked cell by cell (Amanatides, Woo 1987, *A fast voxel traversal algorithm for ray tracing*).
//!
//! Cells are cubes as far as possible, a few to an item (Cleary, Wyvill 1988, *Analysis of an algorithm for fast ray tracing using uniform
//! space subdivision*); cells and their items are filled by counting, in linear time. Where scales are mixed, a teapot in a stadium, a
//! cell with too many items gets a grid of its own (Jevans, Wyvill 1989, *Adaptive voxel subdivision for ray tracing*).
//!
//! A step adds a constant to the t of the next plane, and rounds: the walk may pass a plane a little early or late and name a
//! cell that the ray misses by a hair. So items lie in every cell within [`SLACK`] of a cell's width, far more than all steps
//! together round. A ray that is known less well than that (from very far away, or into a tiny nested grid) takes another way,
//! [`Grid::halve`], which treats the cells as leaves of a tree of boxes.

use super::items::{Input, bounds_of};
use super::ray::IndexRay;
use super::{Index, Options};
use crate::math::{Aabb, DVec3, UNIT_ROUNDOFF_64, UVec3};

/// Cells for each item, where no resolution is asked for.
const DENSITY: f64 = 3.0;
/// By how much of a cell's width items reach into the neighbours.
const SLACK: f64 = 1.0 / 128.0;
/// More items in a cell than this make a nested grid, if that helps.
const CROWD: usize = 24;
/// Grids within grids.
const DEEPEST: u32 = 6;
/// Marks an entry of a cell that names a nested grid.
const NESTED: u32 = 1 << 31;
/// References for each item: beyond, a coarser grid serves better.
const MOST_REFERENCES: usize = 12;
/// References in all where a resolution is asked for: 4 GB of them.
const MOST_ENTRIES: usize = 1 << 30;

/// How many cells a grid has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// So many along the longest side; cubes.
    Longest(u32),
    /// So many along each axis.
    Axes(UVec3),
}

impl Resolution {
    /// Most cells along an axis.
    pub const MOST: u32 = 2048;

    fn counts(self, bounds: &Aabb) -> UVec3 {
        match self {
            Self::Axes(counts) => counts.clamp(UVec3::ONE, UVec3::splat(Self::MOST)),
            Self::Longest(count) => {
                let size = bounds.max.as_dvec3() - bounds.min.as_dvec3();
                let edge = size.max_element() / f64::from(count);
                // A point has no longest side: 0 / 0 is cast to 0.
                (size / edge).round().as_uvec3().clamp(UVec3::ONE, UVec3::splat(Self::MOST))
            }
        }
    }
}

/// The index.
pub(super) struct Grid {
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
    /// Over some of the boxes, as far as they are within `bounds`.
    fn over(boxes: &[Aabb], items: &[u32], bounds: &Aabb, resolution: Option<Resolution>, depth: u32) -> Self {
        let mut counts = match resolution {
            Some(resolution) => resolution.counts(bounds),
            None => counts_for(bounds, items.len()),
        };
        let most = if resolution.is_some() { MOST_ENTRIES } else { MOST_REFERENCES * items.len() };
        let mut grid = Self::empty(bounds, counts);
        // Where items are larger than cells, fewer cells lose nothing.
        while grid.references(boxes, items) > most && counts.max_element() > 1 {
            counts = (counts / 2).max(UVec3::ONE);
            grid = Self::empty(bounds, counts);
        }
        grid.fill(boxes, items);
        if depth < DEEPEST {
            grid.nest(boxes, depth);
        }
        grid
    }

    fn references(&self, boxes: &[Aabb], items: &[u32]) -> usize {
        items.iter().map(|&item| self.cells_of(&boxes[item as usize]).len()).sum()
    }

    fn empty(bounds: &Aabb, counts: UVec3) -> Self {
        let (min, max) =
            if bounds.is_empty() { (DVec3::ZERO, DVec3::ZERO) } else { (bounds.min.as_dvec3(), bounds.max.as_dvec3()) };
        // A flat grid has a thickness, so that no cell is without width.
        let least = ((max - min).max_element() * 1e-6).max(min.abs().max(max.abs()).max_element() * 1e-12).max(1e-300);
        let width = (max - min).max(DVec3::splat(least)) / counts.as_dvec3();
        // The outermost items reach over the edge by the slack as well.
        Self { min, width, counts, starts: Vec::new(), entries: Vec::new(), nested: Vec::new() }
    }

    /// Sorts the items into the cells by counting.
    fn fill(&mut self, boxes: &[Aabb], items: &[u32]) {
        let mut starts = vec![0u32; self.counts.as_u64vec3().element_product() as usize + 1];
        for &item in items {
            self.each_cell(self.cells_of(&boxes[item as usize]), |cell| starts[cell + 1] += 1);
        }
        for cell in 1..starts.len() {
            starts[cell] += starts[cell - 1];
        }
        let mut entries = vec![0; starts.last().map_or(0, |&end| end as usize)];
        let mut next = starts.clone();
        for &item in items {
            self.each_cell(self.cells_of(&boxes[item as usize]), |cell| {
                entries[next[cell] as usize] = item;
                next[cell] += 1;
            });
        }
        (self.starts, self.entries) = (starts, entries);
    }

    /// Gives crowded cells grids of their own.
    fn nest(&mut self, boxes: &[Aabb], depth: u32) {
        let crowded = |cell: &usize| (self.starts[cell + 1] - self.starts[*cell]) as usize > CROWD;
        let crowded: Vec<usize> = (0..self.starts.len() - 1).filter(crowded).collect();
        if crowded.is_empty() {
            return;
        }
        let mut replaced = vec![false; self.starts.len() - 1];
        for cell in crowded {
            let items = &self.entries[self.starts[cell] as usize..self.starts[cell + 1] as usize];
            let around = self.around(cell);
            let bounds = bounds_of(items.iter().map(|&item| intersection(&boxes[item as usize], &around)));
            let grid = Self::over(boxes, items, &bounds, None, depth + 1);
            // Items that fill the cell cannot be told apart by any grid.
            if grid.fullest() * 2 < items.len() {
                self.entries[self.starts[cell] as usize] = NESTED | self.nested.len() as u32;
                self.nested.push(grid);
                replaced[cell] = true;
            }
        }
        self.compact(&replaced);
    }

    /// Leaves of the cells that were replaced the first entry only.
    fn compact(&mut self, replaced: &[bool]) {
        let (mut to, mut from) = (0, 0);
        for (cell, &replaced) in replaced.iter().enumerate() {
            let end = self.starts[cell + 1] as usize;
            let keep = if replaced { from..from + 1 } else { from..end };
            let count = keep.len();
            self.entries.copy_within(keep, to);
            from = end;
            to += count;
            self.starts[cell + 1] = to as u32;
        }
        self.entries.truncate(to);
        self.entries.shrink_to_fit();
    }

    /// Most items in a cell, those of nested grids not counted.
    fn fullest(&self) -> usize {
        self.starts.windows(2).map(|pair| (pair[1] - pair[0]) as usize).max().unwrap_or(0)
    }

    /// A cell and its slack, rounded outwards.
    fn around(&self, cell: usize) -> Aabb {
        let UVec3 { x, y, .. } = self.counts;
        let cell = cell as u32;
        let at = UVec3::new(cell % x, cell / x % y, cell / x / y).as_dvec3();
        let low = self.min + (at - SLACK) * self.width;
        let high = self.min + (at + 1.0 + SLACK) * self.width;
        let (mut min, mut max) = (low.as_vec3(), high.as_vec3());
        for axis in 0..3 {
            (min[axis], max[axis]) = (min[axis].next_down(), max[axis].next_up());
        }
        Aabb { min, max }
    }

    /// The cells that a box and the slack around it touch.
    fn cells_of(&self, bounds: &Aabb) -> Block {
        let cell = |p: DVec3| (p - self.min) / self.width;
        let last = self.counts.as_dvec3() - 1.0;
        let low = (cell(bounds.min.as_dvec3()) - SLACK).floor().clamp(DVec3::ZERO, last);
        let high = (cell(bounds.max.as_dvec3()) + SLACK).floor().clamp(DVec3::ZERO, last);
        Block { low: low.as_uvec3(), high: high.as_uvec3() }
    }

    fn each_cell(&self, Block { low, high }: Block, mut each: impl FnMut(usize)) {
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                let row = self.cell([0, y, z]);
                for x in low.x..=high.x {
                    each(row + x as usize);
                }
            }
        }
    }

    fn cell(&self, [x, y, z]: [u32; 3]) -> usize {
        (z as usize * self.counts.y as usize + y as usize) * self.counts.x as usize + x as usize
    }

    /// Visits what the ray passes and gives the new limit.
    fn enter(&self, ray: &IndexRay, limit: f64, each: &mut impl FnMut(u32) -> f64) -> f64 {
        if self.entries.is_empty() {
            return limit;
        }
        // The items may reach out by nothing, but the walk may be off by the slack.
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

impl Block {
    fn len(&self) -> usize {
        (self.high - self.low + 1).as_u64vec3().element_product() as usize
    }
}

/// Cubes, [`DENSITY`] to an item; an axis along which there is next to nothing has one cell.
fn counts_for(bounds: &Aabb, items: usize) -> UVec3 {
    if bounds.is_empty() || items == 0 {
        return UVec3::ONE;
    }
    let size = bounds.max.as_dvec3() - bounds.min.as_dvec3();
    let cells = DENSITY * items as f64;
    // First as if all axes took part, then without those that get less than one cell.
    let mut edge = size.max_element();
    let mut takes_part = [true; 3];
    for _ in 0..3 {
        let part = || (0..3).filter(|&axis| takes_part[axis] && size[axis] > 0.0);
        let (volume, axes) = part().fold((1.0, 0), |(volume, axes), axis| (volume * size[axis], axes + 1));
        if axes == 0 {
            return UVec3::ONE;
        }
        edge = (volume / cells).powf(1.0 / f64::from(axes));
        takes_part = [0, 1, 2].map(|axis| size[axis] >= edge);
    }
    (size / edge).round().clamp(DVec3::ONE, DVec3::splat(Resolution::MOST.into())).as_uvec3()
}

fn intersection(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb { min: a.min.max(b.min), max: a.max.min(b.max) }
}
