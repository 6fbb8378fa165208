//! How many cells a grid has, and what is in them.
//!
//! Cells are cubes as far as possible, a few to an item (Cleary, Wyvill 1988, *Analysis of an algorithm for fast ray
//! tracing using uniform space subdivision*). Items are counted in each cell first and filled in then, in linear time
//! and without a list for each cell. Where scales are mixed, a teapot in a stadium, a cell with too many items gets a
//! grid of its own (Jevans, Wyvill 1989, *Adaptive voxel subdivision for ray tracing*).

use super::{Block, Grid, NESTED, SLACK};
use crate::math::{Aabb, DVec3, UVec3};
use crate::scene::Resolution;
use crate::trace::accel::items::bounds_of;

/// Cells for each item, where no resolution is asked for.
const DENSITY: f64 = 3.0;
/// More items in a cell than this make a nested grid, if that helps.
const CROWD: usize = 24;
/// Grids within grids.
const DEEPEST: u32 = 6;
/// References for each item: beyond, a coarser grid serves better. Half as many in each grid within a grid, for these
/// multiply.
const MAX_REFERENCES: usize = 12;
/// References in all where a resolution is asked for: 4 GB of them.
const MAX_ENTRIES: usize = 1 << 30;

impl Resolution {
    fn counts(self, bounds: &Aabb) -> UVec3 {
        let counts = match self {
            Self::Axes(counts) => counts,
            Self::Longest(count) => {
                let size = bounds.max.as_dvec3() - bounds.min.as_dvec3();
                let edge = size.max_element() / f64::from(count);
                // A point has no longest side: 0 / 0 is cast to 0.
                (size / edge).round().as_uvec3()
            }
        };
        let mut counts = counts.clamp(UVec3::ONE, UVec3::splat(Self::MAX));
        while cells(counts) > Self::MAX_CELLS {
            counts = halved(counts);
        }
        counts
    }
}

fn cells(counts: UVec3) -> u64 {
    counts.as_u64vec3().element_product()
}

fn halved(counts: UVec3) -> UVec3 {
    (counts / 2).max(UVec3::ONE)
}

impl Grid {
    /// Over some of the boxes, as far as they are within `bounds`.
    pub fn over(boxes: &[Aabb], items: &[u32], bounds: &Aabb, resolution: Option<Resolution>, depth: u32) -> Self {
        let mut counts = match resolution {
            Some(resolution) => resolution.counts(bounds),
            None => counts_for(bounds, items.len()),
        };
        let most = if resolution.is_some() { MAX_ENTRIES } else { (MAX_REFERENCES >> depth).max(2) * items.len() };
        let mut grid = Self::empty(bounds, counts);
        // Where items are larger than cells, fewer cells lose nothing.
        while grid.references(boxes, items) > most && counts.max_element() > 1 {
            counts = halved(counts);
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
        Self { min, width, counts, starts: Vec::new(), entries: Vec::new(), nested: Vec::new() }
    }

    /// Sorts the items into the cells by counting.
    fn fill(&mut self, boxes: &[Aabb], items: &[u32]) {
        let mut starts = vec![0u32; cells(self.counts) as usize + 1];
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
    (size / edge).round().clamp(DVec3::ONE, DVec3::splat(Resolution::MAX.into())).as_uvec3()
}

fn intersection(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb { min: a.min.max(b.min), max: a.max.min(b.max) }
}
