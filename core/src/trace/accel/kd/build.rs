//! Where the planes of a kd-tree are.
//!
//! Each is where the surface area heuristic expects rays to cost least: cells that are empty, or large with little in
//! them, are cut off early. Large cells choose among 32 planes an axis, counted in bins (Hunt, Mark, Stoll 2006, *Fast
//! kd-tree construction with an adaptive error-bounded heuristic*; Shevtsov, Soupikov, Kapustin 2007, *Highly parallel
//! fast kd-tree construction for interactive ray tracing of dynamic scenes*), small ones among the sides of all boxes:
//! O(n log n) in all. Sorting the sides once and keeping them sorted, as Wald and Havran do, finds slightly better
//! planes and takes three times as long to build and to read.

use rayon::join;

use super::super::items::Input;
use super::super::share;
use super::{LEAF, Node, STACK, Tree};
use crate::math::Aabb;

/// What going through a node costs, in tests of an item.
const NODE_COST: f32 = 0.15;
/// What is left of a cost where one side is empty (Wald, Havran 2006).
const EMPTY_BONUS: f32 = 0.8;
/// Bins an axis.
const BINS: usize = 32;
/// Up to this many items the sides of all boxes are tried.
const FEW: usize = 32;
/// From this many items on, children are built side by side.
const MANY: usize = 1 << 12;
/// References for each item that cutting may add in all; every cell has its share.
const MAX_REFERENCES: usize = 12;
/// A tree of which the upper part is built by all threads. What is below is finished at once: two allocations for each
/// of millions of leaves would take as long as choosing the planes.
enum Branch {
    Whole(Tree),
    Plane { axis: usize, plane: f32, children: Box<[Branch; 2]> },
}

/// A cell with everything that is in it.
struct Part {
    bounds: Aabb,
    items: Vec<Entry>,
    /// How many more planes may cut it.
    depth: u32,
    /// How many more references there may be in it.
    room: usize,
}

/// An item, and its box as far as that is in the cell. Copied from cell to cell: numbers alone would take a seventh of
/// the memory, and boxes be read in random order, which takes longer than all else.
#[derive(Clone, Copy)]
struct Entry {
    bounds: Aabb,
    item: u32,
}

/// The tree over all items, whose boxes are within `bounds`.
pub(super) fn tree(input: &Input<'_>, bounds: Aabb) -> Tree {
    let items: Vec<Entry> = input.boxes.iter().zip(0..).map(|(&bounds, item)| Entry { bounds, item }).collect();
    let room = MAX_REFERENCES * items.len();
    // As deep as Havran 2000 found to pay, plus some for uneven scenes.
    let depth = (8.0 + 1.6 * (items.len().max(1) as f64).log2()) as u32;
    let whole = Part { bounds, items, depth: depth.min(STACK as u32), room };
    let mut tree = Tree::default();
    tree.place(whole.build());
    tree
}

impl Tree {
    fn add_leaf(&mut self, items: &[Entry]) {
        let first = f32::from_bits(self.items.len() as u32);
        self.nodes.push(Node { plane: first, link: (items.len() as u32) << 2 | LEAF });
        self.items.extend(items.iter().map(|entry| entry.item));
    }

    /// Adds a node and, by two calls of `add`, its children.
    fn add_plane<T>(&mut self, axis: usize, plane: f32, [below, above]: [T; 2], add: impl Fn(&mut Self, T)) {
        let at = self.nodes.len();
        self.nodes.push(Node { plane, link: 0 });
        add(self, below);
        self.nodes[at].link = (self.nodes.len() as u32) << 2 | axis as u32;
        add(self, above);
    }

    /// Adds a branch, depth first.
    fn place(&mut self, branch: Branch) {
        match branch {
            Branch::Whole(tree) if self.nodes.is_empty() => *self = tree,
            Branch::Whole(tree) => {
                let (nodes, items) = (self.nodes.len() as u32, self.items.len() as u32);
                self.items.extend(tree.items);
                self.nodes.extend(tree.nodes.into_iter().map(|Node { plane, link }| match link & 3 {
                    LEAF => Node { plane: f32::from_bits(plane.to_bits() + items), link },
                    _ => Node { plane, link: link + (nodes << 2) },
                }));
            }
            Branch::Plane { axis, plane, children } => self.add_plane(axis, plane, *children, Self::place),
        }
    }
}

impl Part {
    fn build(self) -> Branch {
        if self.items.len() >= MANY {
            return match self.divide() {
                Ok((Split { axis, plane, .. }, [below, above])) => {
                    let children = join(|| below.build(), || above.build()).into();
                    Branch::Plane { axis, plane, children: Box::new(children) }
                }
                Err(whole) => {
                    let mut tree = Tree::default();
                    tree.add_leaf(&whole.items);
                    Branch::Whole(tree)
                }
            };
        }
        let mut tree = Tree::default();
        self.build_into(&mut tree);
        Branch::Whole(tree)
    }

    fn build_into(self, tree: &mut Tree) {
        match self.divide() {
            Ok((Split { axis, plane, .. }, parts)) => {
                tree.add_plane(axis, plane, parts, |tree, part| part.build_into(tree));
            }
            Err(whole) => tree.add_leaf(&whole.items),
        }
    }

    /// Cut in two, or the whole where that does not pay.
    fn divide(self) -> Result<(Split, [Self; 2]), Self> {
        let count = self.items.len() as f32;
        let split = if self.depth > 0 && self.items.len() > 1 { self.best_split() } else { None };
        match split.filter(|split| split.cost < count) {
            Some(split) => self.cut(split).map(|parts| (split, parts)),
            None => Err(self),
        }
    }

    /// The parts below and above a plane, what lies within it above; or the whole, where there is no room for both.
    fn cut(self, Split { axis, plane, counts, .. }: Split) -> Result<[Self; 2], Self> {
        let [mut below, mut above] = counts.map(Vec::with_capacity);
        for &entry in &self.items {
            let Aabb { min, max } = entry.bounds;
            let is_below = min[axis] < plane;
            if is_below {
                let mut part = entry;
                part.bounds.max[axis] = max[axis].min(plane);
                below.push(part);
            }
            if !is_below || max[axis] > plane {
                let mut part = entry;
                part.bounds.min[axis] = min[axis].max(plane);
                above.push(part);
            }
        }
        let references = below.len() + above.len();
        let Some(left) = (self.items.len() + self.room).checked_sub(references) else { return Err(self) };
        let (mut lower, mut upper) = (self.bounds, self.bounds);
        (lower.max[axis], upper.min[axis]) = (plane, plane);
        let part = |bounds, items: Vec<Entry>| {
            let room = share(left, items.len(), references);
            Part { bounds, items, depth: self.depth - 1, room }
        };
        Ok([part(lower, below), part(upper, above)])
    }

    fn best_split(&self) -> Option<Split> {
        let splits = if self.items.len() <= FEW { self.sweep() } else { self.bins() };
        splits.into_iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// The best on each axis among the sides of all boxes.
    fn sweep(&self) -> [Option<Split>; 3] {
        let (mut begins, mut ends) = ([[0.0; FEW]; 3], [[0.0; FEW]; 3]);
        for (i, Entry { bounds, .. }) in self.items.iter().enumerate() {
            for axis in 0..3 {
                (begins[axis][i], ends[axis][i]) = (bounds.min[axis], bounds.max[axis]);
            }
        }
        let count = self.items.len();
        std::array::from_fn(|axis| {
            let (begins, ends) = (&mut begins[axis][..count], &mut ends[axis][..count]);
            begins.sort_unstable_by(f32::total_cmp);
            ends.sort_unstable_by(f32::total_cmp);
            let mut best = Best::new(&self.bounds, axis);
            let (mut begun, mut ended) = (0, 0);
            // No box ends before it begins, so there is an end as long as there is anything.
            while let Some(&end) = ends.get(ended) {
                let plane = begins.get(begun).map_or(end, |begin| begin.min(end));
                let below = begun;
                while begins.get(begun).is_some_and(|&begin| begin <= plane) {
                    begun += 1;
                }
                while ends.get(ended).is_some_and(|&end| end <= plane) {
                    ended += 1;
                }
                best.offer(plane, [below, count - ended]);
            }
            best.split
        })
    }

    /// The best on each axis among planes at equal distances.
    fn bins(&self) -> [Option<Split>; 3] {
        let (start, end) = (self.bounds.min.to_array(), self.bounds.max.to_array());
        let scale: [f32; 3] = std::array::from_fn(|axis| BINS as f32 / (end[axis] - start[axis]));
        let bin = |x: f32, axis: usize| (((x - start[axis]) * scale[axis]) as usize).min(BINS - 1);
        let (mut begins, mut ends) = ([[0; BINS]; 3], [[0; BINS]; 3]);
        for Entry { bounds, .. } in &self.items {
            for axis in 0..3 {
                begins[axis][bin(bounds.min[axis], axis)] += 1;
                ends[axis][bin(bounds.max[axis], axis)] += 1;
            }
        }
        std::array::from_fn(|axis| {
            let mut best = Best::new(&self.bounds, axis);
            let (mut below, mut passed) = (0, 0);
            for bin in 1..BINS {
                below += begins[axis][bin - 1];
                passed += ends[axis][bin - 1];
                let plane = start[axis] + (end[axis] - start[axis]) * (bin as f32 / BINS as f32);
                best.offer(plane, [below, self.items.len() - passed]);
            }
            // A flat cell has no bins along the axis.
            best.split.filter(|_| scale[axis].is_finite())
        })
    }
}

#[derive(Clone, Copy)]
struct Split {
    axis: usize,
    plane: f32,
    /// In tests of an item.
    cost: f32,
    /// Items below and above; in bins, as far as these tell them apart.
    counts: [usize; 2],
}

/// The plane across an axis of a cell that the surface area heuristic likes best.
struct Best {
    axis: usize,
    start: f32,
    end: f32,
    /// Of the sides across the axis, and of a slice of length 1 along it, over the whole.
    across: f32,
    along: f32,
    split: Option<Split>,
}

impl Best {
    fn new(bounds: &Aabb, axis: usize) -> Self {
        let size = bounds.size();
        let (a, b) = (size[(axis + 1) % 3], size[(axis + 2) % 3]);
        let whole = bounds.half_area().max(f32::MIN_POSITIVE);
        let (start, end) = (bounds.min[axis], bounds.max[axis]);
        Self { axis, start, end, across: a * b / whole, along: (a + b) / whole, split: None }
    }

    /// A plane and the items below and above; one that does not divide the cell is none.
    #[inline]
    fn offer(&mut self, plane: f32, counts: [usize; 2]) {
        if !(self.start < plane && plane < self.end) {
            return;
        }
        let share = |length: f32| self.across + self.along * length;
        let [below, above] = counts;
        let items = share(plane - self.start) * below as f32 + share(self.end - plane) * above as f32;
        let bonus = if below == 0 || above == 0 { EMPTY_BONUS } else { 1.0 };
        let cost = bonus * (NODE_COST + items);
        if self.split.is_none_or(|best| cost < best.cost) {
            self.split = Some(Split { axis: self.axis, plane, cost, counts });
        }
    }
}
