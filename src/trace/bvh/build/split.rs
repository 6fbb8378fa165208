//! A range of items, and how it is divided in two.

use super::lanes::Boxes;
use super::record::{EMPTY, Record, half_area};
use crate::trace::bvh::simd::{Simd, Vector};

/// What a tree costs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule {
    /// Items tested together: a power of two.
    pub block: u32,
}

impl Rule {
    /// Blocks that hold `count` items.
    #[inline(always)]
    pub fn blocks(&self, count: usize) -> f32 {
        count.div_ceil(self.block as usize) as f32
    }

    /// The same for four counts.
    #[inline(always)]
    pub fn blocks_of_four(&self, counts: &[u32; 4]) -> [f32; 4] {
        let shift = self.block.trailing_zeros();
        counts.map(|count| ((count + self.block - 1) >> shift) as i32 as f32)
    }
}

/// A range of items, and what a split needs to know of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub first: u32,
    pub len: u32,
    /// The box around them, as [-min, max].
    pub bounds: [f32; 8],
    /// The box around their doubled centres, as [-min, max].
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
    /// Blocks times areas of the two sides.
    pub cost: f32,
    /// The boxes of the two sides.
    pub left: [f32; 8],
    pub right: [f32; 8],
}

/// Which items go left.
#[derive(Clone, Copy, Debug)]
pub(super) enum Cut {
    /// Those whose doubled centre lies before the border to a bin.
    Plane { axis: usize, origin: f32, scale: f32, bin: f32 },
    /// Those with a bit, of at most 32.
    Mask(u32),
    /// The first half.
    Half,
}

impl Split {
    /// Into halves, for items that no plane divides.
    pub const HALF: Self = Self { cut: Cut::Half, cost: f32::INFINITY, left: EMPTY, right: EMPTY };

    /// Puts the items of the left side first, and gives the two sides; `items` are those of `range`.
    #[inline(always)]
    pub fn partition<S: Simd>(&self, items: &mut [Record], range: &Range) -> [Range; 2] {
        let nothing = S::V8::splat(f32::NEG_INFINITY);
        let mut centres = [nothing; 2];
        let mut split = 0;
        match self.cut {
            Cut::Plane { axis, origin, scale, bin } => {
                let axis = axis % 4;
                for i in 0..items.len() {
                    let item = items[i];
                    let bounds = S::V8::load(&item.0);
                    let centre = bounds.sub(bounds.swap_halves());
                    let is_left = (item.0[axis + 4] - item.0[axis] - origin) * scale < bin;
                    centres[0] = centre.keep_if(is_left).max(centres[0]);
                    centres[1] = centre.keep_if(!is_left).max(centres[1]);
                    // Without a branch, which would be guessed wrong every other time: what lies between `split` and i
                    // belongs to the right, and one of it changes place with the item.
                    items[i] = items[split];
                    items[split] = item;
                    split += usize::from(is_left);
                }
            }
            Cut::Mask(mask) => {
                let mut right = [Record::NOTHING; 32];
                let mut kept = 0;
                for i in 0..items.len() {
                    let item = items[i];
                    let bounds = S::V8::load(&item.0);
                    let centre = bounds.sub(bounds.swap_halves());
                    let is_left = mask >> (i % 32) & 1 != 0;
                    centres[0] = centre.keep_if(is_left).max(centres[0]);
                    centres[1] = centre.keep_if(!is_left).max(centres[1]);
                    items[split] = item;
                    right[kept % 32] = item;
                    split += usize::from(is_left);
                    kept += usize::from(!is_left);
                }
                items[split..].copy_from_slice(&right[..kept]);
            }
            Cut::Half => {
                let (left, right) = items.split_at(items.len() / 2);
                let first = range.first + left.len() as u32;
                return [Range::new::<S>(left, range.first), Range::new::<S>(right, first)];
            }
        }
        self.sides(range, split, centres.map(S::V8::to_array))
    }

    /// The two sides of `range`, the first of which has `left_len` items.
    #[inline(always)]
    pub fn sides(&self, range: &Range, left_len: usize, [left, right]: [[f32; 8]; 2]) -> [Range; 2] {
        let len = left_len as u32;
        [
            Range { first: range.first, len, bounds: self.left, centres: left },
            Range { first: range.first + len, len: range.len - len, bounds: self.right, centres: right },
        ]
    }
}
