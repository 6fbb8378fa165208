//! The best of the planes between bins (Wald 2007, *On fast construction of SAH-based bounding volume hierarchies*), on
//! all three axes in one pass.

use super::lanes::Boxes;
use super::record::{EMPTY, Record};
use super::split::{Cut, Rule, Split};
use crate::trace::bvh::simd::{Simd, Vector};

/// Bins an axis of a large range is divided into.
pub(super) const MANY: usize = 16;

/// Bins where a pass over the bins would cost as much as one over the items.
pub(super) const FEW: usize = 8;

/// Ranges of fewer items than this are divided into [`FEW`] bins.
pub(super) const LARGE: usize = 512;

/// From a centre to its bin: centres are doubled, as [-c, c].
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    origin: [f32; 8],
    scale: [f32; 8],
}

impl Grid {
    /// Bins for centres within `centres`.
    #[inline(always)]
    pub fn new<const N: usize>(centres: &[f32; 8]) -> Self {
        let mut grid = Self { origin: [0.0; 8], scale: [0.0; 8] };
        for axis in 0..3 {
            let (min, max) = (0.0 - centres[axis], centres[axis + 4]);
            grid.origin[axis + 4] = min;
            // Where all centres coincide they fall into bin 0, and nothing can be divided.
            grid.scale[axis + 4] = if max > min { N as f32 / (max - min) } else { 0.0 };
        }
        grid
    }

    /// Origin and scale of an axis.
    #[inline(always)]
    pub fn axis(&self, axis: usize) -> (f32, f32) {
        (self.origin[axis + 4], self.scale[axis + 4])
    }
}

/// Boxes and numbers of items of each bin; of each axis.
#[derive(Clone)]
pub(super) struct Bins<const N: usize> {
    boxes: [[[f32; 8]; 3]; N],
    counts: [[u32; 4]; N],
}

impl<const N: usize> Bins<N> {
    #[inline(always)]
    pub fn empty() -> Self {
        Self { boxes: [[EMPTY; 3]; N], counts: [[0; 4]; N] }
    }

    /// Adds the items to their bins.
    #[inline(always)]
    pub fn add<S: Simd>(&mut self, items: &[Record], grid: &Grid) {
        let (origin, scale) = (S::V8::load(&grid.origin), S::V8::load(&grid.scale));
        let last = S::V8::splat((N - 1) as f32);
        for item in items {
            let bounds = S::V8::load(&item.0);
            let centre = bounds.sub(bounds.swap_halves());
            // The last bin also takes what is not a number (an infinite scale times zero).
            let bins = centre.sub(origin).mul(scale).min(last).truncate();
            for axis in 0..3 {
                let bin = bins[axis + 4] as usize % N;
                let sum = &mut self.boxes[bin][axis];
                *sum = bounds.max(S::V8::load(sum)).to_array();
                self.counts[bin][axis] += 1;
            }
        }
    }

    /// Adds the bins of other items of the same range.
    #[inline(always)]
    pub fn merge<S: Simd>(&mut self, other: &Self) {
        for bin in 0..N {
            for axis in 0..3 {
                let (a, b) = (S::V8::load(&self.boxes[bin][axis]), S::V8::load(&other.boxes[bin][axis]));
                self.boxes[bin][axis] = a.max(b).to_array();
                self.counts[bin][axis] += other.counts[bin][axis];
            }
        }
    }

    /// The cheapest plane that leaves something on both sides; None where all centres coincide.
    #[inline(always)]
    pub fn best<S: Simd>(&self, grid: &Grid, rule: &Rule) -> Option<Split> {
        let load = |boxes: &[[f32; 8]; 3]| [S::V8::load(&boxes[0]), S::V8::load(&boxes[1]), S::V8::load(&boxes[2])];
        let join = |a: [S::V8; 3], b: [S::V8; 3]| [a[0].max(b[0]), a[1].max(b[1]), a[2].max(b[2])];
        let mut right_costs = [[0.0; 4]; N];
        let (mut right, mut count) = ([S::V8::splat(f32::NEG_INFINITY); 3], [0u32; 4]);
        for bin in (1..N).rev() {
            right = join(right, load(&self.boxes[bin]));
            for axis in 0..4 {
                count[axis] += self.counts[bin][axis];
            }
            let areas = S::V4::load(&S::V8::half_areas(right));
            right_costs[bin] = areas.mul(S::V4::load(&rule.blocks_of_four(&count))).to_array();
        }
        let mut least = S::V4::splat(f32::INFINITY);
        let mut best = None;
        let (mut left, mut count) = ([S::V8::splat(f32::NEG_INFINITY); 3], [0u32; 4]);
        for bin in 1..N {
            left = join(left, load(&self.boxes[bin - 1]));
            for axis in 0..4 {
                count[axis] += self.counts[bin - 1][axis];
            }
            let areas = S::V4::load(&S::V8::half_areas(left));
            let cost = areas.mul(S::V4::load(&rule.blocks_of_four(&count))).add(S::V4::load(&right_costs[bin]));
            // An empty side costs infinity times zero, which is less than nothing.
            if cost.less(least) & 7 != 0 {
                let cost = cost.to_array();
                for axis in 0..3 {
                    if cost[axis] < least.to_array()[0] {
                        least = S::V4::splat(cost[axis]);
                        best = Some((axis, bin, cost[axis]));
                    }
                }
            }
        }
        let (axis, bin, cost) = best?;
        let sum = |bins: &[[[f32; 8]; 3]]| {
            let join = |sum: S::V8, bin: &[[f32; 8]; 3]| sum.max(S::V8::load(&bin[axis]));
            bins.iter().fold(S::V8::splat(f32::NEG_INFINITY), join).to_array()
        };
        let (origin, scale) = grid.axis(axis);
        let cut = Cut::Plane { axis, origin, scale, bin: bin as f32 };
        Some(Split { cut, cost, left: sum(&self.boxes[..bin]), right: sum(&self.boxes[bin..]) })
    }
}
