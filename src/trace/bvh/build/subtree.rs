//! A subtree by one thread, all of it compiled for one instruction set.

use super::binary::Binary;
use super::bins::{self, Bins, Grid};
use super::record::Record;
use super::split::{Range, Rule, Split};
use super::sweep;
use crate::trace::bvh::isa::Kernel;
use crate::trace::bvh::node::Node;
use crate::trace::bvh::simd::Simd;

/// Builds the nodes over a range's items, the root first. Leaves name ranges of items by their index in the whole.
pub(super) struct SubtreeKernel<'a> {
    pub rule: &'a Rule,
    pub items: &'a mut [Record],
    pub range: Range,
    /// Levels that its nodes may have.
    pub levels: usize,
}

impl Kernel for SubtreeKernel<'_> {
    type Output = Vec<Node>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Vec<Node> {
        let Self { rule, items, range, levels } = self;
        let mut local = Local::<S> { rule, items, base: range.first, isa: std::marker::PhantomData };
        // Where it comes to that, a node takes three levels of the binary tree.
        let mut binary = Binary::new(range, 3 * levels as u32, rule, &mut local);
        binary.weigh::<S>(rule);
        binary.nodes(rule, levels)
    }
}

/// Divides ranges of `items`, the first of which has the index `base`.
pub(super) struct Local<'a, S> {
    rule: &'a Rule,
    items: &'a mut [Record],
    base: u32,
    isa: std::marker::PhantomData<S>,
}

impl<S: Simd> Local<'_, S> {
    /// The best way to divide `range`.
    #[inline(always)]
    pub fn find(&mut self, range: &Range) -> Split {
        let items = &self.items[range.within(self.base)];
        let best = if items.len() <= sweep::MOST {
            sweep::best::<S>(items, self.rule)
        } else if items.len() < bins::LARGE {
            binned::<S, { bins::FEW }>(items, range, self.rule)
        } else {
            binned::<S, { bins::MANY }>(items, range, self.rule)
        };
        best.unwrap_or(Split::HALF)
    }

    /// Does it.
    #[inline(always)]
    pub fn apply(&mut self, range: &Range, split: &Split) -> [Range; 2] {
        let items = &mut self.items[range.within(self.base)];
        let sides = split.partition::<S>(items, range);
        if sides[0].len > 0 && sides[1].len > 0 { sides } else { Split::HALF.partition::<S>(items, range) }
    }
}

/// The best plane between `N` bins.
#[inline(always)]
pub(super) fn binned<S: Simd, const N: usize>(items: &[Record], range: &Range, rule: &Rule) -> Option<Split> {
    let grid = Grid::new::<N>(&range.centres);
    let mut bins = Bins::<N>::empty();
    if items.len() < 2 * SAMPLE {
        bins.add::<S>(items.iter(), &grid);
    } else {
        bins.add::<S>(sample(items), &grid);
    }
    bins.best::<S>(&grid, rule)
}

/// Items by which a large range is judged.
pub(super) const SAMPLE: usize = 1 << 11;

/// One item of each of [`SAMPLE`] equal stretches: not always the first, or a mesh of even rows would be judged by a few of its
/// columns.
#[inline(always)]
pub(super) fn sample(items: &[Record]) -> impl Iterator<Item = &Record> {
    let stride = items.len() / SAMPLE;
    (0..SAMPLE).map(
        #[inline(always)]
        move |i| {
            // Fibonacci hashing (Knuth, The art of computer programming 3, 6.4), scaled to the stride.
            let hash = (i as u32).wrapping_mul(0x9e37_79b9);
            &items[i * stride + ((u64::from(hash) * stride as u64) >> 32) as usize]
        },
    )
}
