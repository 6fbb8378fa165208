//! A range of items divided in two again and again: the binary tree from which [`collapse`](super::collapse) makes the
//! wide one.

use super::split::{PrimitiveRange, Rule};
use super::subtree::{Local, in_halves};
use crate::trace::bvh::node::WIDTH;
use crate::trace::bvh::simd::Simd;

/// A binary tree, each branch before its first side, and all of that before its second.
pub(super) struct Binary {
    pub branches: Vec<Branch>,
}

/// One range of it.
#[derive(Clone, Debug)]
pub(super) struct Branch {
    pub first: u32,
    pub len: u32,
    /// The box around its items, as [-min, max].
    pub bounds: [f32; 8],
    /// The number of its second side; the first one's follows its own. 0 where it is not divided.
    pub second: u32,
    /// Whether it is better a leaf than a node.
    pub is_leaf: bool,
    /// The least cost in at most 1, 2 .. 8 slots, behind as many infinities: in no slots.
    pub costs: [f32; 2 * WIDTH],
    /// Of so many slots those for its first side; none where all of it is in one. In place of the first, those of its
    /// own node.
    pub shares: [u8; WIDTH],
}

impl Branch {
    /// As a leaf.
    #[inline(always)]
    fn new(range: &PrimitiveRange, rule: &Rule) -> Self {
        let &PrimitiveRange { first, len, bounds, .. } = range;
        let mut costs = [f32::INFINITY; 2 * WIDTH];
        costs[WIDTH..].fill(rule.blocks(len as usize) * range.half_area());
        Self { first, len, bounds, second: 0, is_leaf: true, costs, shares: [0; WIDTH] }
    }
}

impl Binary {
    /// Divides `whole` until ranges fill a block, or a leaf is no worse than its halves. Where `levels` would not
    /// suffice for anything else, down the middle; for halves of the whole they do.
    #[inline(always)]
    pub fn new<S: Simd>(whole: PrimitiveRange, levels: u32, rule: &Rule, local: &mut Local<'_, S>) -> Self {
        debug_assert!(in_halves(whole.len) <= levels, "{} items in {levels} levels", whole.len);
        let most = (3 * whole.len / rule.block + 1).min(2 * whole.len);
        let mut branches: Vec<Branch> = Vec::with_capacity(most as usize);
        let mut open = vec![(whole, levels, None::<usize>)];
        while let Some((range, levels, above)) = open.pop() {
            let number = branches.len();
            if let Some(above) = above {
                branches[above].second = number as u32;
            }
            branches.push(Branch::new(&range, rule));
            if range.len <= rule.block {
                continue;
            }
            let Some([first, second]) = local.divide(&range, levels) else { continue };
            // The first comes next.
            open.push((second, levels - 1, Some(number)));
            open.push((first, levels - 1, None));
        }
        Self { branches }
    }

    /// Of pieces in order; besides the numbers of those branches that were not in a piece, and so have no costs yet.
    pub fn joined(pieces: Vec<Piece>, rule: &Rule) -> (Self, Vec<usize>) {
        let len = |piece: &Piece| match piece {
            Piece::Branch { .. } => 1,
            Piece::Whole(binary) => binary.branches.len(),
        };
        let mut starts = Vec::with_capacity(pieces.len());
        let mut count = 0;
        for piece in &pieces {
            starts.push(count);
            count += len(piece);
        }
        let (mut branches, mut joints) = (Vec::with_capacity(count), Vec::new());
        for (i, piece) in pieces.into_iter().enumerate() {
            match piece {
                Piece::Branch { range, second } => {
                    joints.push(starts[i]);
                    branches.push(Branch { second: starts[i + second] as u32, ..Branch::new(&range, rule) });
                }
                Piece::Whole(mut binary) => {
                    let divided = binary.branches.iter_mut().filter(|branch| branch.second != 0);
                    divided.for_each(|branch| branch.second += starts[i] as u32);
                    branches.append(&mut binary.branches);
                }
            }
        }
        (Self { branches }, joints)
    }
}

/// A part of a binary tree.
pub(super) enum Piece {
    /// A branch by itself. Its first side is the next piece, its second one so many pieces after it.
    Branch { range: PrimitiveRange, second: usize },
    /// All that is below.
    Whole(Binary),
}
