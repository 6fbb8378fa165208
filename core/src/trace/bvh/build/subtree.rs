//! A subtree, compiled for one instruction set: by one thread, or in pieces by several.

use super::binary::{Binary, Piece};
use super::bins::{self, Bins, Grid};
use super::record::Record;
use super::split::{PrimitiveRange, Rule, Split};
use super::sweep;
use crate::trace::bvh::node::Node;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::simd::isa::{self, Kernel, Present};

/// Ranges of at most this many items are pieces of one thread.
const PIECE: u32 = 1 << 11;

/// What is to be made of a range.
pub(super) struct Subtree<'a> {
    pub rule: &'a Rule,
    pub items: &'a mut [Record],
    pub range: PrimitiveRange,
    /// Levels that its nodes may have.
    pub levels: usize,
}

impl Subtree<'_> {
    /// The nodes over the range's items, the root first. Leaves name ranges of items by their index in the whole.
    pub fn nodes(self, isa: Present) -> Vec<Node> {
        let Self { rule, items, range, levels } = self;
        let binary =
            isa::dispatch(isa, BinaryKernel { is_root: true, ..BinaryKernel::new(rule, items, range, levels) });
        binary.nodes(rule, levels)
    }

    /// The same, for threads that have nothing else to do.
    pub fn nodes_by_all(self, isa: Present) -> Vec<Node> {
        if self.range.len <= PIECE {
            return self.nodes(isa);
        }
        let Self { rule, items, range, levels } = self;
        let mut pieces = Vec::new();
        BinaryKernel::new(rule, items, range, levels).pieces(isa, &mut pieces);
        let (binary, joints) = Binary::joined(pieces, rule);
        isa::dispatch(isa, WeighKernel { binary, joints, rule }).nodes(rule, levels)
    }
}

/// The binary tree of a range, with costs.
struct BinaryKernel<'a> {
    rule: &'a Rule,
    items: &'a mut [Record],
    range: PrimitiveRange,
    /// Levels that it may have.
    levels: u32,
    is_root: bool,
}

impl<'a> BinaryKernel<'a> {
    /// For so many levels of nodes. Where it comes to that, a node takes three levels of the binary tree.
    fn new(rule: &'a Rule, items: &'a mut [Record], range: PrimitiveRange, levels: usize) -> Self {
        Self { rule, items, range, levels: 3 * levels as u32, is_root: false }
    }

    /// Adds its pieces, each branch before its first side, and all of that before its second.
    fn pieces(self, isa: Present, pieces: &mut Vec<Piece>) {
        let Self { rule, items, range, levels, .. } = self;
        let side = |range, levels, items| BinaryKernel { rule, items, range, levels, is_root: false };
        let sides = (range.len > PIECE)
            .then(|| isa::dispatch(isa, DivideKernel { rule, items: &mut *items, range, levels }))
            .flatten();
        let Some([first, second]) = sides else {
            pieces.push(Piece::Whole(isa::dispatch(isa, side(range, levels, items))));
            return;
        };
        let (first_items, second_items) = items.split_at_mut(first.len as usize);
        let (first, second) = (side(first, levels - 1, first_items), side(second, levels - 1, second_items));
        let branch = pieces.len();
        pieces.push(Piece::Branch { range, second: 0 });
        let mut others = Vec::new();
        rayon::join(|| first.pieces(isa, pieces), || second.pieces(isa, &mut others));
        pieces[branch] = Piece::Branch { range, second: pieces.len() - branch };
        pieces.append(&mut others);
    }
}

impl Kernel for BinaryKernel<'_> {
    type Output = Binary;

    #[inline(always)]
    fn run<S: Simd>(self) -> Binary {
        let Self { rule, items, range, levels, is_root } = self;
        let mut local = Local::<S>::new(rule, items, range.first);
        let mut binary = Binary::new(range, levels, rule, &mut local);
        binary.weigh::<S>(rule, is_root);
        binary
    }
}

/// The two sides of a range; none where it is better a leaf.
struct DivideKernel<'a> {
    rule: &'a Rule,
    items: &'a mut [Record],
    range: PrimitiveRange,
    levels: u32,
}

impl Kernel for DivideKernel<'_> {
    type Output = Option<[PrimitiveRange; 2]>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Option<[PrimitiveRange; 2]> {
        let Self { rule, items, range, levels } = self;
        Local::<S>::new(rule, items, range.first).divide(&range, levels)
    }
}

/// A whole binary tree, with costs of those branches too that join others.
struct WeighKernel<'a> {
    binary: Binary,
    joints: Vec<usize>,
    rule: &'a Rule,
}

impl Kernel for WeighKernel<'_> {
    type Output = Binary;

    #[inline(always)]
    fn run<S: Simd>(self) -> Binary {
        let Self { mut binary, joints, rule } = self;
        for number in joints.into_iter().rev() {
            binary.weigh_branch::<S>(number, rule, number == 0);
        }
        binary
    }
}

/// Divides ranges of `items`, the first of which has the index `base`.
pub(super) struct Local<'a, S> {
    rule: &'a Rule,
    items: &'a mut [Record],
    base: u32,
    finder: Finder<S>,
}

/// Finds the best way to divide ranges, one after the other.
pub(super) struct Finder<S> {
    /// Used again and again: to make them costs as much as to fill them with few items.
    few: Bins<{ bins::FEW }>,
    many: Bins<{ bins::MANY }>,
    isa: std::marker::PhantomData<S>,
}

impl<S: Simd> Finder<S> {
    #[inline(always)]
    pub fn new() -> Self {
        Self { few: Bins::ANY, many: Bins::ANY, isa: std::marker::PhantomData }
    }

    /// The best way to divide `items`, those of `range`.
    #[inline(always)]
    pub fn find(&mut self, items: &[Record], range: &PrimitiveRange, rule: &Rule) -> Split {
        let best = if items.len() <= sweep::MAX {
            sweep::best::<S>(items, rule)
        } else if items.len() < bins::LARGE {
            binned::<S, _>(&mut self.few, items, range, rule)
        } else {
            binned::<S, _>(&mut self.many, items, range, rule)
        };
        best.unwrap_or(Split::HALF)
    }
}

impl<'a, S: Simd> Local<'a, S> {
    /// Of `items`, the first of which has the index `base`.
    #[inline(always)]
    fn new(rule: &'a Rule, items: &'a mut [Record], base: u32) -> Self {
        Self { rule, items, base, finder: Finder::new() }
    }

    /// The two sides of `range`, by the best split, or down the middle where `levels` would not suffice for anything
    /// else; none where a leaf is no worse.
    #[inline(always)]
    pub fn divide(&mut self, range: &PrimitiveRange, levels: u32) -> Option<[PrimitiveRange; 2]> {
        let split = if in_halves(range.len) < levels { self.find(range) } else { Split::HALF };
        if self.rule.prefers_leaf(range.len, range.half_area(), split.cost) {
            return None;
        }
        Some(self.apply(range, &split))
    }

    /// The best way to divide `range`.
    #[inline(always)]
    fn find(&mut self, range: &PrimitiveRange) -> Split {
        self.finder.find(&self.items[range.within(self.base)], range, self.rule)
    }

    /// Does it.
    #[inline(always)]
    fn apply(&mut self, range: &PrimitiveRange, split: &Split) -> [PrimitiveRange; 2] {
        split.apply::<S>(&mut self.items[range.within(self.base)], range)
    }
}

/// Levels of a binary tree over `len` items that is divided down the middle.
#[inline(always)]
pub(super) fn in_halves(len: u32) -> u32 {
    len.next_power_of_two().trailing_zeros()
}

/// The best plane between `N` bins.
#[inline(always)]
pub(super) fn binned<S: Simd, const N: usize>(
    bins: &mut Bins<N>,
    items: &[Record],
    range: &PrimitiveRange,
    rule: &Rule,
) -> Option<Split> {
    let grid = Grid::new::<S, N>(&range.centres);
    if items.len() < 2 * SAMPLE || !rule.samples {
        bins.fill::<S>(items.iter(), &grid);
    } else {
        bins.fill::<S>(sample(items), &grid);
    }
    bins.best::<S>(&grid, rule)
}

/// Items by which a large range is judged.
pub(super) const SAMPLE: usize = 1 << 11;

/// One item of each of [`SAMPLE`] equal stretches: not always the first, or a mesh of even rows would be judged by a
/// few of its columns.
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
