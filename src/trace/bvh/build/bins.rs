//! The best of the planes between bins (Wald 2007, *On fast construction of SAH-based bounding volume hierarchies*), on
//! all three axes in one pass.

use super::lanes::Boxes;
use super::record::{EMPTY, Record};
use super::split::{Cheapest, Cut, Rule, Split};
use crate::trace::bvh::simd::{Array, Simd, Vector};

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

    /// Where a bin begins, but for rounding.
    #[inline(always)]
    fn border(&self, axis: usize, bin: usize) -> f32 {
        self.origin[axis + 4] + bin as f32 / self.scale[axis + 4]
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
    pub fn add<'a, S: Simd>(&mut self, items: impl Iterator<Item = &'a Record>, grid: &Grid) {
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

    /// The cheapest plane that leaves something on both sides; None where all centres coincide.
    #[inline(always)]
    pub fn best<S: Simd>(&self, grid: &Grid, rule: &Rule) -> Option<Split> {
        let load = |boxes: &[[f32; 8]; 3]| [S::V8::load(&boxes[0]), S::V8::load(&boxes[1]), S::V8::load(&boxes[2])];
        let join = |a: [S::V8; 3], b: [S::V8; 3]| [a[0].max(b[0]), a[1].max(b[1]), a[2].max(b[2])];
        let add = |sum: &mut [u32; 4], counts: &[u32; 4]| {
            for (sum, count) in sum.iter_mut().zip(counts) {
                *sum += count;
            }
        };
        let cost = |boxes, counts: &[u32; 4]| {
            S::V4::load(&S::V8::half_areas(boxes)).mul(S::V4::load(&rule.blocks_of_four(counts)))
        };
        let nothing = ([S::V8::splat(f32::NEG_INFINITY); 3], [0u32; 4]);
        let mut right_costs = [[0.0; 4]; N];
        let (mut right, mut count) = nothing;
        for (bin, right_cost) in right_costs.iter_mut().enumerate().skip(1).rev() {
            right = join(right, load(&self.boxes[bin]));
            add(&mut count, &self.counts[bin]);
            *right_cost = cost(right, &count).to_array();
        }
        let mut cheapest = Cheapest::<S>::new();
        let (mut left, mut count) = nothing;
        for (bin, right_cost) in right_costs.iter().enumerate().skip(1) {
            left = join(left, load(&self.boxes[bin - 1]));
            add(&mut count, &self.counts[bin - 1]);
            cheapest.offer(bin, cost(left, &count).add(S::V4::load(right_cost)));
        }
        let (axis, bin, cost) = cheapest.found()?;
        Some(Split { cut: Cut::Plane { axis, at: grid.border(axis, bin) }, cost })
    }
}
