//! A range of items, and how it is divided in two.

use super::lanes::Boxes;
use super::record::{EMPTY, Record, half_area};
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector};

/// What a tree costs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule {
    /// Items tested together: a power of two.
    pub block: u32,
    /// Most items in a leaf.
    pub leaf: u32,
}

impl Rule {
    /// Whether so many items cost no more as a leaf than what the sides of a split, or a node of them, come to.
    #[inline(always)]
    pub fn prefers_leaf(&self, len: u32, area: f32, others: f32) -> bool {
        // Written so that what is no number, for boxes too large to be measured, is divided.
        len <= self.leaf && self.blocks(len as usize) * area <= others
    }

    /// Blocks that hold `count` items.
    #[inline(always)]
    pub fn blocks(&self, count: usize) -> f32 {
        count.div_ceil(self.block as usize) as f32
    }

    /// The same for four counts.
    #[inline(always)]
    pub fn blocks_of_four(&self, counts: &[u32; 4]) -> [f32; 4] {
        let shift = self.block.trailing_zeros();
        let [x, y, z, w] = *counts;
        let blocks = |count: u32| ((count + self.block - 1) >> shift) as i32 as f32;
        [blocks(x), blocks(y), blocks(z), blocks(w)]
    }
}

/// A range of items, and what a split needs to know of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub first: u32,
    pub len: u32,
    /// The box around them, as [-min, max].
    pub bounds: [f32; 8],
    /// A box around their doubled centres, as [-min, max]; not always the smallest.
    pub centres: [f32; 8],
}

impl Range {
    pub const EMPTY: Self = Self { first: 0, len: 0, bounds: EMPTY, centres: EMPTY };

    /// Of `items`, the first of which has the index `first`.
    #[inline(always)]
    pub fn new<S: Simd>(items: &[Record], first: u32) -> Self {
        let mut bounds = S::V8::splat(f32::NEG_INFINITY);
        let mut centres = bounds;
        for item in items {
            let item = S::V8::load(&item.0);
            bounds = item.max(bounds);
            centres = item.sub(item.swap_halves()).max(centres);
        }
        Self { first, len: items.len() as u32, bounds: bounds.to_array(), centres: centres.to_array() }
    }

    /// A box around the doubled centres of those items whose boxes lie within `bounds`. To find the smallest one would
    /// take another look at each of them.
    #[inline(always)]
    fn centres_within(&self, bounds: &[f32; 8]) -> [f32; 8] {
        let mut centres = self.centres;
        for (centre, bound) in centres.iter_mut().zip(bounds) {
            *centre = centre.min(2.0 * bound);
        }
        centres
    }

    #[inline(always)]
    pub fn half_area(&self) -> f32 {
        half_area(&self.bounds)
    }

    /// Where its items are in a slice that starts with item `base`.
    #[inline(always)]
    pub fn within(&self, base: u32) -> std::ops::Range<usize> {
        (self.first - base) as usize..(self.first - base + self.len) as usize
    }
}

/// A way to divide a range.
#[derive(Clone, Copy, Debug)]
pub(super) struct Split {
    pub cut: Cut,
    /// Blocks times areas of the two sides; an estimate for large ranges.
    pub cost: f32,
}

/// Which items go left.
#[derive(Clone, Copy, Debug)]
pub(super) enum Cut {
    /// Those whose doubled centre lies before a plane.
    Plane { axis: usize, at: f32 },
    /// Those with a bit, of at most 32.
    Mask(u32),
    /// The first half.
    Half,
}

/// The cheapest of many ways to divide, tried on three axes at a time.
pub(super) struct Cheapest<S: Simd> {
    least: S::V4,
    /// Axis, place on it, cost.
    found: Option<(usize, usize, f32)>,
}

impl<S: Simd> Cheapest<S> {
    #[inline(always)]
    pub fn new() -> Self {
        Self { least: S::V4::splat(f32::INFINITY), found: None }
    }

    /// Tries a place with its cost on each axis, and a fourth number that is passed over. NaN is not cheap: an empty side
    /// costs infinity times zero.
    #[inline(always)]
    pub fn offer(&mut self, place: usize, costs: S::V4) {
        if costs.less(self.least).bits() & 7 == 0 {
            return;
        }
        let mut least = self.least.to_array()[0];
        for (axis, cost) in costs.to_array().into_iter().enumerate().take(3) {
            if cost < least {
                least = cost;
                self.found = Some((axis, place, cost));
            }
        }
        self.least = S::V4::splat(least);
    }

    /// Axis, place and cost; None where everything costs infinity.
    #[inline(always)]
    pub fn found(&self) -> Option<(usize, usize, f32)> {
        self.found
    }
}

impl Split {
    /// Into halves, for items that no plane divides.
    pub const HALF: Self = Self { cut: Cut::Half, cost: f32::INFINITY };

    /// Puts the items of the left side first, and gives the two sides; `items` are those of `range`. A plane that leaves
    /// nothing on one side gives an empty range.
    #[inline(always)]
    pub fn partition<S: Simd>(&self, items: &mut [Record], range: &Range) -> [Range; 2] {
        let mut sides = [S::V8::splat(f32::NEG_INFINITY); 2];
        let mut split = 0;
        match self.cut {
            Cut::Plane { axis, at } => {
                for i in 0..items.len() {
                    let item = items[i];
                    let is_left = S::V8::load(&item.0).join_side(axis, at, &mut sides);
                    // Without a branch, too: what lies between `split` and i belongs to the right, and the first of it
                    // changes place with the item.
                    items[i] = items[split];
                    items[split] = item;
                    split += usize::from(is_left);
                }
            }
            Cut::Mask(mask) => {
                let mut right = [Record::NOTHING; 32];
                for i in 0..items.len() {
                    let item = items[i];
                    let is_left = mask >> (i % 32) & 1 != 0;
                    right[(i - split) % 32] = item;
                    items[split] = item;
                    split += usize::from(is_left);
                }
                let len = items.len() - split;
                items[split..].copy_from_slice(&right[..len]);
                let join = |sum: S::V8, item: &Record| S::V8::load(&item.0).max(sum);
                sides = [items[..split].iter().fold(sides[0], join), items[split..].iter().fold(sides[1], join)];
            }
            Cut::Half => {
                split = items.len() / 2;
                let join = |sum: S::V8, item: &Record| S::V8::load(&item.0).max(sum);
                sides = [items[..split].iter().fold(sides[0], join), items[split..].iter().fold(sides[1], join)];
            }
        }
        self.sides(range, split, [sides[0].to_array(), sides[1].to_array()])
    }

    /// The two sides of `range`, by the number of items of the left one and by their boxes.
    #[inline(always)]
    pub fn sides(&self, range: &Range, left_len: usize, bounds: [[f32; 8]; 2]) -> [Range; 2] {
        let len = left_len as u32;
        let [left, right] = bounds;
        let side = |bounds: [f32; 8]| Range { first: range.first, len, bounds, centres: range.centres_within(&bounds) };
        let mut sides = [side(left), side(right)];
        sides[1].first += len;
        sides[1].len = range.len - len;
        if let Cut::Plane { axis, at } = self.cut {
            sides[0].centres[axis + 4] = at.min(sides[0].centres[axis + 4]);
            sides[1].centres[axis] = (-at).min(sides[1].centres[axis]);
        }
        sides
    }
}
