//! The best of the planes between bins (Wald 2007, *On fast construction of SAH-based bounding volume hierarchies*), on
//! all three axes in one pass.

use super::record::Record;
use super::split::{Cheapest, Cut, Rule, Split, join};
use crate::trace::bvh::simd::boxes::Boxes;
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector};

/// Bins an axis of a large range is divided into.
pub(super) const MANY: usize = 16;

/// Bins where a pass over the bins would cost as much as one over the items.
pub(super) const FEW: usize = 8;

/// Ranges of fewer items than this are divided into [`FEW`] bins.
pub(super) const LARGE: usize = 512;

/// Positive in the lanes of the largest coordinates.
const AXES: [f32; 8] = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0];

/// From a centre to its bin: centres are doubled, as [-c, c].
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    origin: [f32; 8],
    scale: [f32; 8],
}

impl Grid {
    /// Bins for centres within `centres`.
    #[inline(always)]
    pub fn new<S: Simd, const N: usize>(centres: &[f32; 8]) -> Self {
        // Vectors, stored whole: whoever loads what was just stored lane by lane waits until it is in the cache.
        let zero = S::V8::splat(0.0);
        let axes = zero.less(S::V8::load(&AXES));
        let max = S::V8::load(centres);
        let min = zero.sub(max.swap_halves());
        let size = max.sub(min);
        // Where all centres coincide they fall into bin 0, and nothing can be divided.
        let scale = S::V8::select(axes.and(zero.less(size)), S::V8::splat(N as f32).div(size), zero);
        Self { origin: S::V8::select(axes, min, zero).to_array(), scale: scale.to_array() }
    }

    /// Where a bin begins, but for rounding.
    #[inline(always)]
    fn border(&self, axis: usize, bin: usize) -> f32 {
        self.origin[axis + 4] + bin as f32 / self.scale[axis + 4]
    }
}

/// Items in bins, on each axis.
pub(super) struct Bins<const N: usize> {
    /// Of every other item, and in the end of all.
    sums: Sums<N>,
    /// Of those between: neighbours mostly fall into one bin, and the second would wait for what the first has stored.
    others: Sums<N>,
}

/// Boxes and numbers of the items of each bin, on each axis. No box lies across two cache lines.
#[repr(align(64))]
struct Sums<const N: usize> {
    boxes: [[[f32; 8]; 3]; N],
    counts: [[u32; 4]; N],
}

impl<const N: usize> Bins<N> {
    /// With anything in them.
    pub const ANY: Self = Self { sums: Sums::ANY, others: Sums::ANY };

    /// Holds these items, and no others.
    #[inline(always)]
    pub fn fill<'a, S: Simd>(&mut self, mut items: impl Iterator<Item = &'a Record>, grid: &Grid) {
        let Self { sums, others } = self;
        sums.clear::<S>();
        others.clear::<S>();
        while let Some(item) = items.next() {
            sums.add::<S>(item, grid);
            let Some(item) = items.next() else { break };
            others.add::<S>(item, grid);
        }
        sums.join::<S>(others);
    }

    /// Holds what either holds.
    pub fn join<S: Simd>(&mut self, others: &Self) {
        self.sums.join::<S>(&others.sums);
    }

    /// The cheapest plane that leaves something on both sides; None where all centres coincide.
    #[inline(always)]
    pub fn best<S: Simd>(&self, grid: &Grid, rule: &Rule) -> Option<Split> {
        let Sums { boxes, counts } = &self.sums;
        let (axis, bin, cost) = swept::<S, N>(boxes, [counts, counts], rule)?;
        Some(Split { cut: Cut::Plane { axis, at: grid.border(axis, bin) }, cost })
    }
}

/// The cheapest plane before a bin that leaves something on both sides: its axis, the bin, and what it costs. Of what
/// is in the bins on each axis there are numbers of two kinds: `counts[0]` for who are before a plane, `counts[1]` for
/// who are behind it.
#[inline(always)]
pub(super) fn swept<S: Simd, const N: usize>(
    boxes: &[[[f32; 8]; 3]; N],
    counts: [&[[u32; 4]; N]; 2],
    rule: &Rule,
) -> Option<(usize, usize, f32)> {
    let nothing = ([S::V8::splat(f32::NEG_INFINITY); 3], [0u32; 4]);
    let mut right_costs = [[0.0; 4]; N];
    let (mut right, mut count) = nothing;
    for (bin, right_cost) in right_costs.iter_mut().enumerate().skip(1).rev() {
        right = join(right, load::<S>(&boxes[bin]));
        add_up(&mut count, &counts[1][bin]);
        *right_cost = cost::<S>(right, &count, rule).to_array();
    }
    let mut cheapest = Cheapest::<S>::new();
    let (mut left, mut count) = nothing;
    for (bin, right_cost) in right_costs.iter().enumerate().skip(1) {
        left = join(left, load::<S>(&boxes[bin - 1]));
        add_up(&mut count, &counts[0][bin - 1]);
        cheapest.offer(bin, cost::<S>(left, &count, rule).add(S::V4::load(right_cost)));
    }
    cheapest.found()
}

impl<const N: usize> Sums<N> {
    const ANY: Self = Self { boxes: [[[0.0; 8]; 3]; N], counts: [[0; 4]; N] };

    #[inline(always)]
    fn clear<S: Simd>(&mut self) {
        let nothing = S::V8::splat(f32::NEG_INFINITY);
        for sum in self.boxes.as_flattened_mut() {
            *sum = nothing.to_array();
        }
        self.counts = [[0; 4]; N];
    }

    #[inline(always)]
    fn join<S: Simd>(&mut self, others: &Self) {
        join_boxes::<S, N>(&mut self.boxes, &others.boxes);
        for (sum, other) in self.counts.iter_mut().zip(&others.counts) {
            add_up(sum, other);
        }
    }

    #[inline(always)]
    fn add<S: Simd>(&mut self, item: &Record, grid: &Grid) {
        let (origin, scale) = (S::V8::load(&grid.origin), S::V8::load(&grid.scale));
        let last = S::V8::splat((N - 1) as f32);
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

#[inline(always)]
fn load<S: Simd>([x, y, z]: &[[f32; 8]; 3]) -> [S::V8; 3] {
    [S::V8::load(x), S::V8::load(y), S::V8::load(z)]
}

/// Bins with what is in the same ones of others.
#[inline(always)]
pub(super) fn join_boxes<S: Simd, const N: usize>(boxes: &mut [[[f32; 8]; 3]; N], others: &[[[f32; 8]; 3]; N]) {
    for (sum, other) in boxes.as_flattened_mut().iter_mut().zip(others.as_flattened()) {
        *sum = S::V8::load(other).max(S::V8::load(sum)).to_array();
    }
}

#[inline(always)]
pub(super) fn add_up(sum: &mut [u32; 4], counts: &[u32; 4]) {
    for (sum, count) in sum.iter_mut().zip(counts) {
        *sum += count;
    }
}

/// Of boxes and counts on three axes.
#[inline(always)]
fn cost<S: Simd>(boxes: [S::V8; 3], counts: &[u32; 4], rule: &Rule) -> S::V4 {
    S::V4::load(&S::V8::half_areas(boxes)).mul(S::V4::load(&rule.blocks_of_four(counts)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Aabb, Vec3};
    use crate::trace::bvh::build::record::aabb;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::Portable;
    use crate::trace::bvh::simd::isa::{Kernel, Present, dispatch};

    struct Fill<'a>(&'a mut Bins<8>, &'a [Record], Grid);

    impl Kernel for Fill<'_> {
        type Output = ();
        #[inline(always)]
        fn run<S: Simd>(self) {
            self.0.fill::<S>(self.1.iter(), &self.2);
        }
    }

    struct Grids<'a>(&'a [f32; 8]);

    impl Kernel for Grids<'_> {
        type Output = Grid;
        #[inline(always)]
        fn run<S: Simd>(self) -> Grid {
            Grid::new::<S, 8>(self.0)
        }
    }

    /// Any number of items, runs of which fall into one bin, at once or in parts, are what each bin's items come to one
    /// by one; whatever was there before.
    #[test]
    fn bins_hold_what_falls_into_them() {
        let mut random = Random::new(9);
        for isa in Present::all() {
            let mut bins = Bins::<8>::ANY;
            for count in [102, 101, 1, 2, 3, 50, 0] {
                let item = |i| {
                    let corner = if i % 8 < 4 { Vec3::splat(0.5) } else { random.vec3().abs() * 2.0 };
                    Record::new(&Aabb { min: corner, max: corner + Vec3::splat(0.25) }, 0, i)
                };
                let items: Vec<Record> = (0..count).map(item).collect();
                // Centres up to 4.25: the last lie behind the last bin, and are in it.
                let grid = dispatch(isa, Grids(&[0.0, 0.0, 0.0, 0.0, 4.0, 4.0, 4.0, 0.0]));
                if count % 2 == 0 {
                    dispatch(isa, Fill(&mut bins, &items, grid));
                } else {
                    // In two parts, which are joined.
                    let (first, others) = items.split_at(items.len() / 3);
                    dispatch(isa, Fill(&mut bins, first, grid));
                    let mut more = Bins::<8>::ANY;
                    dispatch(isa, Fill(&mut more, others, grid));
                    bins.join::<Portable>(&more);
                }
                for (bin, axis) in (0..8).flat_map(|bin| (0..3).map(move |axis| (bin, axis))) {
                    let inside = items.iter().filter(|item| {
                        let Aabb { min, max } = item.bounds();
                        (((min + max)[axis] * 2.0) as usize).min(7) == bin
                    });
                    let place = format!("{isa:?}, {count} items, bin {bin} of axis {axis}");
                    assert_eq!(bins.sums.counts[bin][axis], inside.clone().count() as u32, "{place}");
                    let bounds = inside.fold(Aabb::EMPTY, |sum, item| sum.union(item.bounds()));
                    assert_eq!(aabb(&bins.sums.boxes[bin][axis]), bounds, "{place}");
                }
            }
        }
    }

    /// Where all centres coincide, or are infinitely far apart or away, nothing is divided.
    #[test]
    fn grids_are_those_of_one_axis_after_the_other() {
        let infinity = f32::INFINITY;
        let sides = [
            (-1.0, 2.0),
            (0.0, 0.0),
            (3.0, 3.0),
            (5.0, 5.5),
            (-infinity, infinity),
            (infinity, infinity),
            (infinity, -infinity),
            (0.0, 1e-45),
            (-3e38, 3e38),
        ];
        for (k, &(min, max)) in sides.iter().enumerate() {
            let ((p, q), (r, s)) = (sides[(k + 1) % sides.len()], sides[(k + 2) % sides.len()]);
            let ids = [f32::from_bits(7), f32::from_bits(u32::MAX)];
            let centres = [0.0 - min, 0.0 - p, 0.0 - r, ids[0], max, q, s, ids[1]];
            for isa in Present::all() {
                let grid = dispatch(isa, Grids(&centres));
                for (axis, (min, max)) in [(min, max), (p, q), (r, s)].into_iter().enumerate() {
                    let scale = if max > min { 8.0 / (max - min) } else { 0.0 };
                    assert_eq!((grid.origin[axis + 4], grid.scale[axis + 4]), (min, scale), "{isa:?}, axis {axis}");
                    assert_eq!((grid.origin[axis], grid.scale[axis]), (0.0, 0.0));
                }
                assert_eq!([grid.origin[3], grid.scale[3], grid.origin[7], grid.scale[7]], [0.0; 4]);
            }
        }
    }
}
