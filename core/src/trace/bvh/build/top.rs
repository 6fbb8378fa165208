//! Ranges too large for one thread: items are partitioned chunk by chunk, side by side.
//!
//! Chunks have a fixed size and are put together in order, so the result does not depend on how many threads there are.

use rayon::prelude::*;

use super::bins::{Bins, Grid, MANY};
use super::record::Record;
use super::split::{PrimitiveRange, Rule, Split};
use super::subtree::binned;
use crate::trace::bvh::simd::isa::{self, Kernel, Present};
use crate::trace::bvh::simd::{Array, Portable, Simd, Vector};

/// Items in a chunk.
const CHUNK: usize = 1 << 15;

/// The range of all `items`.
pub(super) fn whole(items: &[Record], isa: Present) -> PrimitiveRange {
    let chunk = |items| isa::dispatch(isa, RangeKernel(items));
    let whole = items.par_chunks(CHUNK).map(chunk).reduce(|| PrimitiveRange::EMPTY, PrimitiveRange::union);
    PrimitiveRange { len: items.len() as u32, ..whole }
}

/// Divides ranges of `items`, the first of which has the index `base`, by all threads.
pub(super) struct Shared<'a> {
    pub rule: &'a Rule,
    pub items: &'a mut [Record],
    pub base: u32,
    pub isa: Present,
}

impl Shared<'_> {
    /// The best way to divide `range`.
    pub fn find(&mut self, range: &PrimitiveRange) -> Split {
        let items = &self.items[range.within(self.base)];
        let found = if self.rule.samples {
            isa::dispatch(self.isa, FindKernel { items, range, rule: self.rule })
        } else {
            let grid = Grid::new::<Portable, MANY>(&range.centres);
            let fill = |items| Box::new(isa::dispatch(self.isa, FillKernel { items, grid: &grid }));
            let bins = items.par_chunks(CHUNK).map(fill).reduce_with(|mut all, chunk| {
                all.join::<Portable>(&chunk);
                all
            });
            bins.and_then(|bins| bins.best::<Portable>(&grid, self.rule))
        };
        found.unwrap_or(Split::HALF)
    }

    /// Does it.
    pub fn apply(&mut self, range: &PrimitiveRange, split: &Split) -> [PrimitiveRange; 2] {
        let isa = self.isa;
        let items = &mut self.items[range.within(self.base)];
        if matches!(split.cut, super::split::Cut::Half) {
            return isa::dispatch(isa, PartitionKernel { items, range, split });
        }
        let chunks = items.par_chunks_mut(CHUNK);
        let sides: Vec<[PrimitiveRange; 2]> = chunks
            .map(|items| {
                let range = PrimitiveRange { first: 0, len: items.len() as u32, ..*range };
                isa::dispatch(isa, PartitionKernel { items, range: &range, split })
            })
            .collect();
        let left_len = sides.iter().map(|[left, _]| left.len as usize).sum();
        gather(items, &sides, left_len);
        if left_len == 0 || left_len == items.len() {
            return isa::dispatch(isa, PartitionKernel { items, range, split: &Split::HALF });
        }
        let union = |[left, right]: [PrimitiveRange; 2], [l, r]: [PrimitiveRange; 2]| [left.union(l), right.union(r)];
        let [left, right] = sides.into_iter().fold([PrimitiveRange::EMPTY; 2], union);
        let load = <Portable as Simd>::V8::load;
        split.sides::<Portable>(range, left_len, load(&left.bounds), load(&right.bounds))
    }
}

/// Brings the left sides of all chunks together at the front: what is of the right side there changes place with what
/// is of the left side behind.
fn gather(items: &mut [Record], sides: &[[PrimitiveRange; 2]], left_len: usize) {
    let (front, back) = items.split_at_mut(left_len);
    let (mut gaps, mut strays) = (Vec::new(), Vec::new());
    let mut at = 0;
    for [left, right] in sides {
        let middle = at + left.len as usize;
        let end = middle + right.len as usize;
        gaps.push(middle.min(left_len)..end.min(left_len));
        strays.push(at.max(left_len) - left_len..middle.max(left_len) - left_len);
        at = end;
    }
    let mut strays = strays.into_iter().filter(|range| !range.is_empty());
    let mut stray = 0..0;
    let (mut here, mut there) = (Vec::new(), Vec::new());
    for mut gap in gaps {
        while !gap.is_empty() {
            if stray.is_empty() {
                stray = strays.next().expect("as many are astray as there are gaps");
            }
            let len = gap.len().min(stray.len());
            here.push(gap.start..gap.start + len);
            there.push(stray.start..stray.start + len);
            gap.start += len;
            stray.start += len;
        }
    }
    let pairs = parts(front, here).into_par_iter().zip(parts(back, there));
    pairs.for_each(|(here, there)| here.swap_with_slice(there));
}

/// The given ranges of a slice, which follow one another.
pub(super) fn parts(
    mut items: &mut [Record],
    ranges: impl IntoIterator<Item = std::ops::Range<usize>>,
) -> Vec<&mut [Record]> {
    let mut first = 0;
    let part = |range: std::ops::Range<usize>| {
        let (_, rest) = std::mem::take(&mut items).split_at_mut(range.start - first);
        let (part, rest) = rest.split_at_mut(range.len());
        (items, first) = (rest, range.end);
        part
    };
    ranges.into_iter().map(part).collect()
}

impl PrimitiveRange {
    pub(super) fn union(self, other: Self) -> Self {
        let max = |a: [f32; 8], b: [f32; 8]| a.max(b);
        let (bounds, centres) = (max(self.bounds, other.bounds), max(self.centres, other.centres));
        Self { bounds, centres, ..self }
    }
}

struct RangeKernel<'a>(&'a [Record]);

impl Kernel for RangeKernel<'_> {
    type Output = PrimitiveRange;
    #[inline(always)]
    fn run<S: Simd>(self) -> PrimitiveRange {
        PrimitiveRange::new::<S>(self.0, 0)
    }
}

struct FindKernel<'a> {
    items: &'a [Record],
    range: &'a PrimitiveRange,
    rule: &'a Rule,
}

impl Kernel for FindKernel<'_> {
    type Output = Option<Split>;
    #[inline(always)]
    fn run<S: Simd>(self) -> Option<Split> {
        let mut bins = Bins::ANY;
        binned::<S, MANY>(&mut bins, self.items, self.range, self.rule)
    }
}

/// All items in bins.
struct FillKernel<'a> {
    items: &'a [Record],
    grid: &'a Grid,
}

impl Kernel for FillKernel<'_> {
    type Output = Bins<MANY>;
    #[inline(always)]
    fn run<S: Simd>(self) -> Bins<MANY> {
        let mut bins = Bins::ANY;
        bins.fill::<S>(self.items.iter(), self.grid);
        bins
    }
}

/// [`Split::partition`].
pub(super) struct PartitionKernel<'a> {
    pub items: &'a mut [Record],
    pub range: &'a PrimitiveRange,
    pub split: &'a Split,
}

impl Kernel for PartitionKernel<'_> {
    type Output = [PrimitiveRange; 2];
    #[inline(always)]
    fn run<S: Simd>(self) -> [PrimitiveRange; 2] {
        self.split.partition::<S>(self.items, self.range)
    }
}
