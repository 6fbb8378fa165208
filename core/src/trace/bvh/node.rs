//! A node of a tree: eight boxes, laid out component by component for eight-wide arithmetic, each as much wider than
//! what is in it as tests of boxes round.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3A;

use crate::math::{Aabb, UNIT_ROUNDOFF, Vec3};
use crate::trace::limits;

/// Children of a node.
pub(super) const WIDTH: usize = 8;

/// Cost of visiting a node, in tests of a block. Measured: with a half rates are the same and a triangle takes a byte
/// more, with two rays are 1 to 4 % slower.
pub(super) const NODE_COST: f32 = 1.0;

/// What is in a slot of a node: another node, or a leaf's blocks; in one word, so that one instruction reorders eight.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct Child(pub u32);

/// The largest number that a leaf can name is kept for [`Child::NONE`].
const _: () = assert!(Child::NAMES < 1 << Child::COUNT_SHIFT);

impl Child {
    /// Nothing; its box is empty, so that no ray enters it.
    pub const NONE: Self = Self(u32::MAX);
    /// The first node.
    pub const ROOT: Self = Self(0);
    /// Blocks that a leaf can hold. From 1 to 8 rates hardly differ; with 1 a triangle takes a quarter more memory.
    pub const MAX: u32 = 4;
    /// Blocks, or items before blocks are made of them, that leaves can name.
    pub const NAMES: usize = limits::MAX_PRIMITIVES as usize;

    /// Set for a leaf.
    const LEAF: u32 = 1 << 31;
    /// Two bits: the number of blocks, less one.
    const COUNT_SHIFT: u32 = 29;

    pub fn inner(node: u32) -> Self {
        debug_assert!(node < Self::LEAF);
        Self(node)
    }

    /// `count` blocks from `first` on.
    pub fn leaf(first: u32, count: u32) -> Self {
        debug_assert!((1..=Self::MAX).contains(&count) && (first as usize) < Self::NAMES);
        Self(Self::LEAF | (count - 1) << Self::COUNT_SHIFT | first)
    }

    #[inline(always)]
    pub fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// Of one that is no leaf, its node.
    #[inline(always)]
    pub fn node(self) -> u32 {
        self.0
    }

    /// A leaf's first block; or a node.
    #[inline(always)]
    pub fn first(self) -> u32 {
        self.0 & ((1 << Self::COUNT_SHIFT) - 1)
    }

    /// A leaf's number of blocks.
    #[inline(always)]
    pub fn count(self) -> u32 {
        (self.0 >> Self::COUNT_SHIFT) % Self::MAX + 1
    }

    /// What a leaf of several blocks is without its first.
    #[inline(always)]
    pub fn rest(self) -> Self {
        // One block fewer, from the next on.
        Self(self.0.wrapping_sub((1 << Self::COUNT_SHIFT) - 1))
    }

    /// 0 for a node, 1 for a leaf, 2 for [`Self::NONE`]; without a branch, since nobody can predict it.
    #[inline(always)]
    pub fn kind(self) -> usize {
        (self.0 >> 31) as usize + usize::from(self == Self::NONE)
    }

    /// A leaf's blocks.
    #[inline(always)]
    pub fn blocks(self) -> Range<u32> {
        self.first()..self.first() + self.count()
    }
}

/// Eight children: 256 bytes, four cache lines. Boxes are [widened](widened).
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Node {
    /// Of each child: min x, max x, min y, max y, min z, max z; [`widened`].
    pub bounds: [[f32; WIDTH]; 6],
    pub child: [Child; WIDTH],
    /// Of each leaf its number of items, where several are in a block. Only while the tree is made.
    pub items: [u8; WIDTH],
    /// What fills the fourth line: zeros, so that a node is its bytes.
    pub unused: [u8; 24],
}

impl Node {
    /// Bytes of a row of bounds.
    pub const ROW: u32 = size_of::<[f32; WIDTH]>() as u32;

    /// A node without children.
    pub fn empty() -> Self {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        let bounds = [low, high, low, high, low, high];
        Self { bounds, child: [Child::NONE; WIDTH], items: [0; WIDTH], unused: [0; 24] }
    }

    /// Fills one slot, with what is in `bounds`, which are not empty.
    #[inline]
    pub fn set(&mut self, slot: usize, bounds: &Aabb, child: Child) {
        self.put(slot, &widened(bounds), child);
    }

    /// Fills one slot, with a box that is wide already.
    #[inline]
    pub fn put(&mut self, slot: usize, bounds: &Aabb, child: Child) {
        for axis in 0..3 {
            self.bounds[2 * axis][slot] = bounds.min[axis];
            self.bounds[2 * axis + 1][slot] = bounds.max[axis];
        }
        self.child[slot] = child;
    }

    /// The slots that have a child, and these.
    #[inline]
    pub fn children(&self) -> impl Iterator<Item = (usize, Child)> {
        self.child.into_iter().enumerate().filter(|&(_, child)| child != Child::NONE)
    }

    /// A bit for each slot that has a child.
    #[inline(always)]
    pub fn occupied(&self) -> u32 {
        self.children().fold(0, |occupied, (slot, _)| occupied | 1 << slot)
    }

    /// The box around all children.
    pub fn bounds(&self) -> Aabb {
        (0..WIDTH).map(|slot| self.child_bounds(slot)).fold(Aabb::EMPTY, Aabb::union)
    }

    /// The box of one slot.
    pub fn child_bounds(&self, slot: usize) -> Aabb {
        let corner = |first: usize| {
            Vec3::new(self.bounds[first][slot], self.bounds[first + 2][slot], self.bounds[first + 4][slot])
        };
        Aabb { min: corner(0), max: corner(1) }
    }
}

/// By what share of its coordinate each side of a box is farther out than what is in it, at least. Tests of boxes round
/// relative to the coordinates of the box and of the ray's origin; the first part of that is in the box, so that rays
/// need only know of the other, and what lies far away makes nothing near it less certain. What is in boxes together
/// may be in a wider one, whose sides are farther out by more than their rounding grows.
pub(super) const WIDENED: f32 = 7.0 * UNIT_ROUNDOFF;

/// By what share of its largest coordinate besides: as far as a ray strays on its way there whose direction's
/// components are off by this share of the largest, or corners that are rounded.
pub(super) const WIDENED_ALL: f32 = 5.0 * UNIT_ROUNDOFF;

/// The box, which is not empty, with each side moved out by [`WIDENED`] and [`WIDENED_ALL`], and by more for what that
/// rounds. It grows with the box.
#[inline(always)]
pub(super) fn widened(bounds: &Aabb) -> Aabb {
    let [min, max] = widened_corners([bounds.min.into(), bounds.max.into()]);
    Aabb { min: min.into(), max: max.into() }
}

/// The same of a box's least and largest corner.
#[inline(always)]
pub(super) fn widened_corners([min, max]: [Vec3A; 2]) -> [Vec3A; 2] {
    // All are f32, and both products and the difference round by a unit each.
    const OUT: Vec3A = Vec3A::splat(1.0 + (WIDENED + 3.0 * UNIT_ROUNDOFF));
    const IN: Vec3A = Vec3A::splat(1.0 - (WIDENED + 2.0 * UNIT_ROUNDOFF));
    const ALL: f32 = WIDENED_ALL + UNIT_ROUNDOFF;
    let is_below = |x: Vec3A| x.cmplt(Vec3A::ZERO);
    let all = Vec3A::splat(min.abs().max(max.abs()).max_element() * ALL);
    [min * Vec3A::select(is_below(min), OUT, IN) - all, max * Vec3A::select(is_below(max), IN, OUT) + all]
}
