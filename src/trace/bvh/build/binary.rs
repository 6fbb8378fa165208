//! A range of items divided in two again and again: the binary tree from which [`collapse`](super::collapse) makes the wide one.

use super::split::{Range, Rule, Split, Splitter};
use crate::trace::bvh::node::WIDTH;

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
    /// Of so many slots those for its first side; none where all of it is in one. In place of the first, those of its own node.
    pub shares: [u8; WIDTH],
}

impl Branch {
    /// As a leaf.
    #[inline(always)]
    fn new(range: &Range, rule: &Rule) -> Self {
        let &Range { first, len, bounds, .. } = range;
        let mut costs = [f32::INFINITY; 2 * WIDTH];
        costs[WIDTH..].fill(rule.blocks(len as usize) * range.half_area());
        Self { first, len, bounds, second: 0, is_leaf: true, costs, shares: [0; WIDTH] }
    }
}

impl Binary {
    /// Divides `whole` until ranges fill a block, or a leaf is no worse than its halves; below `cut` levels down the middle.
    #[inline(always)]
    pub fn new(whole: Range, cut: u32, rule: &Rule, splitter: &mut impl Splitter) -> Self {
        let mut branches: Vec<Branch> = Vec::with_capacity((3 * whole.len / rule.block) as usize + 1);
        let mut open = vec![(whole, 0, None::<usize>)];
        while let Some((range, depth, above)) = open.pop() {
            let number = branches.len();
            if let Some(above) = above {
                branches[above].second = number as u32;
            }
            let branch = Branch::new(&range, rule);
            let cost = branch.costs[WIDTH];
            branches.push(branch);
            if range.len <= rule.block {
                continue;
            }
            let split = if depth < cut { splitter.find(&range) } else { Split::HALF };
            // Written so that what is no number, for boxes too large to be measured, is divided.
            if range.len <= rule.leaf && cost <= split.cost {
                continue;
            }
            let [first, second] = splitter.apply(&range, &split);
            // The first comes next.
            open.push((second, depth + 1, Some(number)));
            open.push((first, depth + 1, None));
        }
        Self { branches }
    }
}
