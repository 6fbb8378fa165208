//! From a binary tree to the wide one that costs least: which branches become nodes, and which are taken apart into
//! slots of a node above them (Ylitie, Karras, Laine 2017, *Efficient incoherent ray traversal on GPUs through
//! compressed wide BVHs*).
//!
//! What a branch costs at least in one slot, in two, in up to eight, follows from what its sides cost: from the ends
//! up, a few additions of vectors for each. To open the widest child until there are eight, the usual way, makes up to
//! twice as many nodes, which are less full, and costs 2 to 6 % more (see docs/PERFORMANCE.md).

use super::binary::{Binary, Branch};
use super::split::Rule;
use super::{Slot, fill, point};
use crate::trace::bvh::node::{NODE_COST, Node, WIDTH};
use crate::trace::bvh::simd::boxes::{Boxes, half_area};
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector};

/// Of 1, 2 .. 8 slots half of them.
const HALVES: [f32; WIDTH] = [0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0];

impl Binary {
    /// Finds what each branch costs, and how slots are best shared out. The first of the whole tree `is_root`.
    #[inline(always)]
    pub fn weigh<S: Simd>(&mut self, rule: &Rule, is_root: bool) {
        for number in (0..self.branches.len()).rev() {
            self.weigh_branch::<S>(number, rule, is_root && number == 0);
        }
    }

    /// The same of one branch, whose sides have been weighed; what is not divided costs what it does as a leaf.
    #[inline(always)]
    pub fn weigh_branch<S: Simd>(&mut self, number: usize, rule: &Rule, is_root: bool) {
        let Branch { second, bounds, len, .. } = self.branches[number];
        if second == 0 {
            return;
        }
        let (first, second) = (&self.branches[number + 1].costs, &self.branches[second as usize].costs);
        // Lane i is for i + 1 slots. Where costs are no numbers, slots go to both sides alike.
        let (mut least, mut share) = (S::V8::splat(f32::INFINITY), S::V8::load(&HALVES));
        for k in 1..WIDTH {
            let mut others = [0.0; WIDTH];
            others.copy_from_slice(&second[WIDTH - k..][..WIDTH]);
            let cost = S::V8::splat(first[WIDTH + k - 1]).add(S::V8::load(&others));
            let cheaper = cost.less(least);
            least = S::V8::select(cheaper, cost, least);
            share = S::V8::select(cheaper, S::V8::splat(k as f32), share);
        }
        let area = half_area(&bounds);
        // A little more than by its area, so that nodes are few where none has any; and the root is a node in any case.
        let own = if is_root { 0.0 } else { NODE_COST * area + f32::MIN_POSITIVE };
        let node = own + least.to_array()[WIDTH - 1];
        let is_leaf = rule.prefers_leaf(len, area, node);
        let alone = S::V8::splat(if is_leaf { rule.blocks(len as usize) * area } else { node });
        let together = alone.less(least);
        let costs = S::V8::select(together, alone, least).to_array();
        let (together, share) = (together.bits(), share.truncate());
        let branch = &mut self.branches[number];
        branch.is_leaf = is_leaf;
        branch.costs[WIDTH..].copy_from_slice(&costs);
        branch.costs[WIDTH] = alone.to_array()[0];
        for (slot, (of_first, share)) in branch.shares.iter_mut().zip(share).enumerate() {
            *of_first = if together >> slot & 1 != 0 { 0 } else { share as u8 };
        }
        branch.shares[0] = share[WIDTH - 1] as u8;
    }

    /// The nodes of the wide tree, each before what is below it, of at most `levels`: at least a third of the binary
    /// tree's, rounded up.
    pub fn nodes(&self, rule: &Rule, levels: usize) -> Vec<Node> {
        let best = |branch: &Branch, slots: usize| usize::from(branch.shares[slots - 1]);
        self.collapsed(rule, levels, best).unwrap_or_else(|| {
            // Eight slots for three levels, whatever it costs.
            let halves = |_: &Branch, slots: usize| if slots == 1 { WIDTH / 2 } else { slots / 2 };
            self.collapsed(rule, usize::MAX, halves).expect("as deep as it is")
        })
    }

    /// The nodes, where `share` tells what [`Branch::shares`] does; none where these take more levels.
    #[inline(always)]
    fn collapsed(&self, rule: &Rule, levels: usize, share: impl Fn(&Branch, usize) -> usize) -> Option<Vec<Node>> {
        let sides = |number: usize, slots: usize, of_first: usize| {
            [(self.branches[number].second as usize, slots - of_first), (number + 1, of_first)]
        };
        let mut nodes = Vec::with_capacity(self.branches.len() / WIDTH + 1);
        let mut open = vec![(None, 0, 1)];
        // Branches, and how many slots these may fill.
        let mut waiting = Vec::with_capacity(WIDTH);
        while let Some((above, number, level)) = open.pop() {
            if level > levels {
                return None;
            }
            let index = nodes.len() as u32;
            point(&mut nodes, above, index);
            let whole = &self.branches[number];
            if whole.is_leaf {
                // All there is.
                waiting.push((number, 1));
            } else {
                waiting.extend(sides(number, WIDTH, share(whole, 1)));
            }
            let (mut node, mut slot, below) = (Node::empty(), 0, open.len());
            while let Some((number, slots)) = waiting.pop() {
                let branch = &self.branches[number];
                let of_first = if slots > 1 && branch.second != 0 { share(branch, slots) } else { 0 };
                if of_first > 0 {
                    waiting.extend(sides(number, slots, of_first));
                    continue;
                }
                fill(&mut node, slot, &branch.bounds, branch.is_leaf.then_some((branch.first, branch.len)), rule);
                if !branch.is_leaf {
                    open.push((Some(Slot { node: index, slot: slot as u32 }), number, level + 1));
                }
                slot += 1;
            }
            nodes.push(node);
            // The first comes next, and so follows in memory.
            open[below..].reverse();
        }
        Some(nodes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Aabb;
    use crate::trace::bvh::build::record::aabb;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::Portable;
    use crate::trace::bvh::simd::isa::{Kernel, Present, dispatch};

    const RULE: Rule = Rule { block: 2, leaf: 6, samples: true };

    /// A binary tree, told by what is at its ends.
    enum Shape {
        /// So many items in a cube.
        End(u32, f32),
        Fork(Box<[Shape; 2]>),
    }

    impl Shape {
        fn fork(first: Self, second: Self) -> Self {
            Self::Fork(Box::new([first, second]))
        }

        /// So many ends, divided anywhere.
        fn random(random: &mut Random, ends: usize) -> Self {
            let mut below = |n: usize| ((random.vec3().x.abs() * 1e4) as usize) % n;
            if ends == 1 {
                return Self::End(1 + below(4) as u32, [0.01, 0.1, 1.0][below(3)]);
            }
            let first = 1 + below(ends - 1);
            Self::fork(Self::random(random, first), Self::random(random, ends - first))
        }

        /// Puts it into a tree, its items from `first` on, each end beside the one before.
        fn push(&self, first: u32, binary: &mut Binary) -> (u32, [f32; 8]) {
            let number = binary.branches.len();
            let blank = [f32::NEG_INFINITY; 8];
            let (costs, shares) = ([f32::INFINITY; 2 * WIDTH], [0; WIDTH]);
            binary.branches.push(Branch { first, len: 0, bounds: blank, second: 0, is_leaf: true, costs, shares });
            let (len, bounds) = match self {
                &Self::End(len, size) => {
                    let low = [first as f32, 0.0, 0.0];
                    let [x, y, z] = low.map(|x| 0.0 - x);
                    (len, [x, y, z, 0.0, low[0] + size, size, size, 0.0])
                }
                Self::Fork(sides) => {
                    let (len, a) = sides[0].push(first, binary);
                    binary.branches[number].second = binary.branches.len() as u32;
                    let (more, b) = sides[1].push(first + len, binary);
                    let mut both = a;
                    both.iter_mut().zip(b).for_each(|(a, b)| *a = a.max(b));
                    (len + more, both)
                }
            };
            let branch = &mut binary.branches[number];
            (branch.len, branch.bounds) = (len, bounds);
            branch.costs[WIDTH..].fill(RULE.blocks(len as usize) * half_area(&bounds));
            (len, bounds)
        }

        fn binary(&self) -> Binary {
            let mut binary = Binary { branches: Vec::new() };
            self.push(0, &mut binary);
            binary
        }
    }

    /// All ways to choose at most eight branches that make up a branch.
    fn ways(binary: &Binary, number: usize) -> Vec<Vec<usize>> {
        let mut all = vec![vec![number]];
        let second = binary.branches[number].second as usize;
        if second != 0 {
            for a in ways(binary, number + 1) {
                all.extend(ways(binary, second).into_iter().map(|b| [a.clone(), b].concat()));
            }
        }
        all.retain(|way| way.len() <= WIDTH);
        all
    }

    /// What a branch costs at least as a child, and as the root.
    fn least(binary: &Binary, number: usize) -> [f64; 2] {
        let branch = &binary.branches[number];
        let area = f64::from(half_area(&branch.bounds));
        let may_be_leaf = branch.second == 0 || branch.len <= RULE.leaf;
        let leaf = if may_be_leaf { f64::from(RULE.blocks(branch.len as usize)) * area } else { f64::INFINITY };
        let cost = |way: Vec<usize>| way.into_iter().map(|child| least(binary, child)[0]).sum::<f64>();
        let below = ways(binary, number).into_iter().skip(1).map(cost).fold(f64::INFINITY, f64::min);
        let node = f64::from(NODE_COST) * area;
        [leaf.min(node + below), node + leaf.min(below)]
    }

    /// What nodes cost, the root with them; also tells how many levels they have, and what is around them: boxes in
    /// nodes are wider.
    fn cost(binary: &Binary, nodes: &[Node], node: u32) -> (f64, usize, Aabb) {
        let node = &nodes[node as usize];
        let (mut sum, mut levels, mut all) = (0.0, 0, Aabb::EMPTY);
        for (slot, child) in node.children() {
            let (more, below, bounds) = if child.is_leaf() {
                let range = (child.first(), u32::from(node.items[slot]));
                let leaf = binary.branches.iter().find(|branch| (branch.first, branch.len) == range).expect("a branch");
                let bounds = aabb(&leaf.bounds);
                (f64::from(child.count()) * f64::from(bounds.half_area()), 0, bounds)
            } else {
                cost(binary, nodes, child.node())
            };
            (sum, levels, all) = (sum + more, levels.max(below), all.union(bounds));
        }
        (sum + f64::from(NODE_COST) * f64::from(all.half_area()), levels + 1, all)
    }

    /// The items of a tree's leaves, in the order of its slots.
    fn items(nodes: &[Node], node: u32, into: &mut Vec<u32>) {
        let node = &nodes[node as usize];
        for (slot, child) in node.children() {
            if child.is_leaf() {
                into.extend(child.first()..child.first() + u32::from(node.items[slot]));
            } else {
                items(nodes, child.node(), into);
            }
        }
    }

    struct Weigh<'a>(&'a mut Binary);

    impl Kernel for Weigh<'_> {
        type Output = ();

        #[inline(always)]
        fn run<S: Simd>(self) {
            self.0.weigh::<S>(&RULE, true);
        }
    }

    /// No choice of branches for nodes costs less, whichever instruction set makes it.
    #[test]
    fn no_way_costs_less() {
        let mut random = Random::new(7);
        let mut leaves = 0;
        for ends in (2..15).flat_map(|ends| [ends; 24]).chain([2; 500]) {
            let mut expected = None;
            let shape = Shape::random(&mut random, ends);
            for isa in Present::all() {
                let mut binary = shape.binary();
                dispatch(isa, Weigh(&mut binary));
                let nodes = binary.nodes(&RULE, 9);
                let mut all = Vec::new();
                items(&nodes, 0, &mut all);
                assert_eq!(all, (0..binary.branches[0].len).collect::<Vec<_>>(), "each item once, and in order");
                let (found, [_, least]) = (cost(&binary, &nodes, 0).0, least(&binary, 0));
                leaves += usize::from(binary.branches[0].is_leaf);
                assert!((found / least - 1.0).abs() < 1e-5, "{isa:?}, {ends} ends: {found}, best {least}");
                let nodes = format!("{nodes:?}");
                assert_eq!(*expected.get_or_insert_with(|| nodes.clone()), nodes, "{isa:?}");
            }
        }
        assert!(leaves > 0, "some are all one leaf");
    }

    /// Where nothing has an area there are no more nodes than there must be: 256 leaves of four items, in 32 nodes, in
    /// four, in one.
    #[test]
    fn nodes_of_no_area_are_full() {
        fn even(ends: usize) -> Shape {
            if ends == 1 { Shape::End(2, 0.0) } else { Shape::fork(even(ends / 2), even(ends / 2)) }
        }
        let mut binary = even(512).binary();
        binary.branches.iter_mut().for_each(|branch| {
            branch.bounds = [0.0; 8];
            branch.costs[WIDTH..].fill(0.0);
        });
        binary.weigh::<Portable>(&RULE, true);
        assert_eq!(binary.nodes(&RULE, 9).len(), 1 + 4 + 32);
    }

    /// Where what is cheapest is too deep, three levels become one. Next to what takes all slots the rest of a chain
    /// gets one, again and again.
    #[test]
    fn levels_are_bounded() {
        let cluster = |size: f32| {
            let end = || Shape::End(2, size);
            let two = || Shape::fork(end(), end());
            let four = || Shape::fork(two(), two());
            Shape::fork(four(), four())
        };
        let mut shape = cluster(1e3);
        for level in 0..24 {
            shape = Shape::fork(cluster(1e3 * 2f32.powi(level + 1)), shape);
        }
        let mut binary = shape.binary();
        binary.weigh::<Portable>(&RULE, true);
        let (deep, flat) = (binary.nodes(&RULE, usize::MAX), binary.nodes(&RULE, 9));
        let levels = [&deep, &flat].map(|nodes| cost(&binary, nodes, 0).1);
        assert!(levels[0] > 9 && levels[1] <= 9, "{levels:?}");
        let mut all = Vec::new();
        items(&flat, 0, &mut all);
        assert_eq!(all, (0..binary.branches[0].len).collect::<Vec<_>>());
    }
}
