//! A range of items, and how it is divided in two.

use std::hint::black_box;

use super::record::{EMPTY, Record};
use crate::trace::bvh::simd::boxes::{Boxes, half_area};
use crate::trace::bvh::simd::{Array, Simd, Vector};

/// What a tree costs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule {
    /// Items tested together: a power of two.
    pub block: u32,
    /// Most items in a leaf.
    pub leaf: u32,
    /// Whether large ranges are judged by a part of their items: few that are much larger than all others are not seen
    /// then.
    pub samples: bool,
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
        let [blocks, ..] = self.blocks_of_four(&[count as u32; 4]);
        blocks
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
pub(super) struct PrimitiveRange {
    pub first: u32,
    pub len: u32,
    /// The box around them, as [-min, max].
    pub bounds: [f32; 8],
    /// A box around their doubled centres, as [-min, max]; not always the smallest.
    pub centres: [f32; 8],
}

impl PrimitiveRange {
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

/// Boxes joined, axis by axis.
#[inline(always)]
pub(super) fn join<V: Vector>([a, b, c]: [V; 3], [d, e, f]: [V; 3]) -> [V; 3] {
    [a.max(d), b.max(e), c.max(f)]
}

/// The cheapest of many ways to divide, tried on three axes at a time.
pub(super) struct Cheapest<S: Simd> {
    /// On each axis the least cost so far, and its place. No branch says which is less: nobody could predict it.
    least: S::V4,
    place: S::V4,
}

impl<S: Simd> Cheapest<S> {
    #[inline(always)]
    pub fn new() -> Self {
        Self { least: S::V4::splat(f32::INFINITY), place: S::V4::splat(0.0) }
    }

    /// Tries a place, later than those before, with its cost on each axis, and a fourth number that is passed over. NaN
    /// is not cheap: an empty side costs infinity times zero.
    #[inline(always)]
    pub fn offer(&mut self, place: usize, costs: S::V4) {
        let is_less = costs.less(self.least);
        self.least = S::V4::select(is_less, costs, self.least);
        self.place = S::V4::select(is_less, S::V4::splat(place as f32), self.place);
    }

    /// Axis, place and cost; of equal costs the first place, on the first axis. None where everything costs infinity.
    #[inline(always)]
    pub fn found(&self) -> Option<(usize, usize, f32)> {
        let (least, place) = (self.least.to_array(), self.place.to_array());
        let mut found = (0, place[0], least[0]);
        for axis in 1..3 {
            if least[axis] < found.2 || least[axis] == found.2 && place[axis] < found.1 {
                found = (axis, place[axis], least[axis]);
            }
        }
        (found.2 < f32::INFINITY).then_some((found.0, found.1 as usize, found.2))
    }
}

impl Split {
    /// Into halves, for items that no plane divides.
    pub const HALF: Self = Self { cut: Cut::Half, cost: f32::INFINITY };

    /// Puts the items of the left side first, and gives the two sides; `items` are those of `range`. A plane that
    /// leaves nothing on one side gives an empty range.
    #[inline(always)]
    pub fn partition<S: Simd>(&self, items: &mut [Record], range: &PrimitiveRange) -> [PrimitiveRange; 2] {
        let nothing = S::V8::splat(f32::NEG_INFINITY);
        let (mut left, mut right, mut split) = (nothing, nothing, 0);
        match self.cut {
            Cut::Plane { axis, at } => {
                for i in 0..items.len() {
                    let item = items[i];
                    let is_left;
                    (left, right, is_left) = S::V8::load(&item.0).join_side(axis, at, left, right);
                    // Without a branch, too: what lies between `split` and i belongs to the right, and the first of it
                    // changes place with the item.
                    items[i] = items[split];
                    items[split] = item;
                    split += usize::from(is_left);
                }
                // Into memory here and not before: else both are kept there in the loop, too, since they live on across
                // calls, and each item waits for the last.
                (left, right) = black_box((left, right));
            }
            Cut::Mask(mask) => {
                let mut others = [Record::NOTHING; 32];
                for i in 0..items.len() {
                    let item = items[i];
                    let is_left = mask >> (i % 32) & 1 != 0;
                    others[(i - split) % 32] = item;
                    items[split] = item;
                    split += usize::from(is_left);
                }
                let len = items.len() - split;
                items[split..].copy_from_slice(&others[..len]);
                (left, right) = (around::<S>(&items[..split]), around::<S>(&items[split..]));
            }
            Cut::Half => {
                split = items.len() / 2;
                (left, right) = (around::<S>(&items[..split]), around::<S>(&items[split..]));
            }
        }
        self.sides::<S>(range, split, left, right)
    }

    /// As [`Self::partition`], down the middle where that leaves nothing on one side.
    #[inline(always)]
    pub fn apply<S: Simd>(&self, items: &mut [Record], range: &PrimitiveRange) -> [PrimitiveRange; 2] {
        let sides = self.partition::<S>(items, range);
        if sides[0].len > 0 && sides[1].len > 0 { sides } else { Self::HALF.partition::<S>(items, range) }
    }

    /// The two sides of `range`, by the number of items of the left one and by their boxes.
    #[inline(always)]
    pub fn sides<S: Simd>(
        &self,
        range: &PrimitiveRange,
        left_len: usize,
        left: S::V8,
        right: S::V8,
    ) -> [PrimitiveRange; 2] {
        // Doubled centres lie within doubled boxes: not always the smallest box, but to find that one would take
        // another look at each item.
        let centres = S::V8::load(&range.centres);
        let (mut left_centres, mut right_centres) = (left.add(left).min(centres), right.add(right).min(centres));
        if let Cut::Plane { axis, at } = self.cut {
            // No single lane is stored: see `bins`.
            let [others, opposite_others] = [S::V8::load(&ALL_BUT[axis + 4]), S::V8::load(&ALL_BUT[axis])];
            left_centres = S::V8::splat(at).max(others).min(left_centres);
            right_centres = S::V8::splat(-at).max(opposite_others).min(right_centres);
        }
        let (first, len) = (range.first, left_len as u32);
        [
            PrimitiveRange { first, len, bounds: left.to_array(), centres: left_centres.to_array() },
            PrimitiveRange {
                first: first + len,
                len: range.len - len,
                bounds: right.to_array(),
                centres: right_centres.to_array(),
            },
        ]
    }
}

/// The box around all of them.
#[inline(always)]
fn around<S: Simd>(items: &[Record]) -> S::V8 {
    let mut sum = S::V8::splat(f32::NEG_INFINITY);
    for item in items {
        sum = S::V8::load(&item.0).max(sum);
    }
    sum
}

/// Infinite in all lanes but one.
const ALL_BUT: [[f32; 8]; 8] = {
    let mut all_but = [[f32::INFINITY; 8]; 8];
    let mut lane = 0;
    while lane < 8 {
        all_but[lane][lane] = f32::NEG_INFINITY;
        lane += 1;
    }
    all_but
};

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::math::Aabb;
    use crate::trace::bvh::build::record::aabb;
    use crate::trace::bvh::build::top::PartitionKernel;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::Portable;
    use crate::trace::bvh::simd::isa::{Present, dispatch};

    /// Costs of which many are equal, and some are no cost.
    fn cost() -> impl Strategy<Value = f32> {
        prop_oneof![4 => (0u8..6).prop_map(f32::from), 1 => Just(f32::NAN), 1 => Just(f32::INFINITY)]
    }

    /// Each side has the items that the plane leaves on it, the box around them, and a box around their centres that
    /// ends at the plane.
    #[test]
    fn sides_are_those_of_the_plane() {
        let mut random = Random::new(5);
        for (isa, axis) in Present::all().flat_map(|isa| [(isa, 0), (isa, 1), (isa, 2)]) {
            for at in [-9.0, -0.5, 0.0, 0.75, 9.0] {
                let item = |i| {
                    let corner = random.vec3();
                    Record::new(&Aabb { min: corner, max: corner + random.vec3().abs() * 0.5 }, 0, i)
                };
                let mut items: Vec<Record> = (0..100).map(item).collect();
                let range = PrimitiveRange { first: 1000, ..PrimitiveRange::new::<Portable>(&items, 0) };
                let centre = |item: &Record| (item.bounds().min + item.bounds().max).to_array();
                let count = items.iter().filter(|item| centre(item)[axis] < at).count();
                let split = Split { cut: Cut::Plane { axis, at }, cost: 0.0 };
                let sides = dispatch(isa, PartitionKernel { items: &mut items, range: &range, split: &split });
                assert_eq!([sides[0].first, sides[1].first], [1000, 1000 + count as u32]);
                let (left, right) = items.split_at(count);
                for (is_right, (side, items)) in sides.iter().zip([left, right]).enumerate() {
                    assert_eq!(side.len as usize, items.len());
                    let around = items.iter().fold(Aabb::EMPTY, |sum, item| sum.union(item.bounds()));
                    assert_eq!(aabb(&side.bounds), around);
                    let [min, max] = [aabb(&side.centres).min.to_array(), aabb(&side.centres).max.to_array()];
                    for centre in items.iter().map(centre) {
                        assert!((0..3).all(|k| min[k] <= centre[k] && centre[k] <= max[k]), "{isa:?}, {axis} at {at}");
                        assert_eq!(centre[axis] >= at, is_right == 1);
                    }
                    let whole = aabb(&range.centres);
                    assert!(if is_right == 1 {
                        min[axis] == at.max(whole.min[axis]).max(2.0 * around.min[axis])
                    } else {
                        max[axis] == at.min(whole.max[axis]).min(2.0 * around.max[axis])
                    });
                }
            }
        }
    }

    #[test]
    fn blocks_are_begun_ones() {
        for block in [1, 2, 4, 8] {
            let rule = Rule { block, leaf: 4 * block, samples: true };
            for count in [0, 1, 2, 7, 8, 9, 31, 32, 33, 1 << 20] {
                assert_eq!(rule.blocks(count), count.div_ceil(block as usize) as f32);
            }
        }
    }

    proptest! {
        #[test]
        fn of_equal_costs_the_first_is_found(costs in prop::collection::vec([cost(), cost(), cost(), cost()], 0..20)) {
            let mut cheapest = Cheapest::<Portable>::new();
            let mut least = None::<(usize, usize, f32)>;
            for (place, costs) in costs.iter().enumerate() {
                cheapest.offer(place, <Portable as Simd>::V4::load(costs));
                for (axis, &cost) in costs[..3].iter().enumerate() {
                    if cost < least.map_or(f32::INFINITY, |(_, _, least)| least) {
                        least = Some((axis, place, cost));
                    }
                }
            }
            prop_assert_eq!(cheapest.found(), least);
        }
    }
}
