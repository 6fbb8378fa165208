//! A binary BVH: the plainest tree of boxes that is not slow, and the yardstick of the other indices.
//!
//! Built from the top by the surface area heuristic with 16 bins an axis (Goldsmith, Salmon 1987, *Automatic creation
//! of object hierarchies for ray tracing*; Wald 2007, *On fast construction of SAH-based bounding volume hierarchies*);
//! visited children front to back, leaving out what begins behind the nearest hit. Bins are by centres, so each item is
//! in one leaf. Median splits alone would be shorter by thirty lines, and traced half as fast on meshes of uneven
//! density.

use std::ops::Range;

use super::items::{Input, bounds_of};
use super::ray::IndexRay;
use super::{Index, Options};
use crate::math::Aabb;

/// Bins an axis.
const BINS: usize = 16;
/// Most items that are left together because no split is worth it.
const LEAF: usize = 8;
/// What a node costs, in tests of an item.
const NODE_COST: f32 = 0.2;
/// From this depth on halves are made, so that the tree is never deeper than [`STACK`].
const DEEP: usize = 64;
/// Halving 2^32 items takes 32 levels more.
const STACK: usize = DEEP + 33;

/// The index.
pub(super) struct Binary {
    /// The root first; children of a node lie side by side.
    nodes: Vec<Node>,
    items: Vec<u32>,
}

/// 32 bytes.
#[derive(Clone, Copy)]
struct Node {
    bounds: Aabb,
    /// The first child, or the first item.
    first: u32,
    /// Items of a leaf; 0 for a node with children.
    count: u32,
}

/// An item that is being sorted into the tree.
#[derive(Clone, Copy)]
struct Record {
    bounds: Aabb,
    item: u32,
}

impl Index for Binary {
    const REPEATS: bool = false;

    fn build(input: &Input<'_>, _: &Options) -> Self {
        let mut records: Vec<Record> =
            input.boxes.iter().zip(0..).map(|(&bounds, item)| Record { bounds, item }).collect();
        let mut tree = Self { nodes: Vec::new(), items: Vec::new() };
        if !records.is_empty() {
            let bounds = input.bounds();
            tree.nodes.push(Node { bounds, first: 0, count: 0 });
            tree.split(0, &mut records, 0..input.boxes.len(), 0);
        }
        tree.items = records.iter().map(|record| record.item).collect();
        tree
    }

    fn visit(&self, ray: &IndexRay, mut limit: f64, each: &mut impl FnMut(u32) -> f64) {
        let Some(mut node) = self.nodes.first() else { return };
        if ray.within_box(&node.bounds, limit).is_empty() {
            return;
        }
        let (mut stack, mut waiting) = ([(0, 0.0); STACK], 0);
        loop {
            if node.count == 0 {
                let children = [node.first, node.first + 1];
                let ranges = children.map(|child| ray.within_box(&self.nodes[child as usize].bounds, limit));
                let near = usize::from(ranges[1].from < ranges[0].from);
                let mut next = None;
                // The far one first, so that it is what waits if both are entered.
                for i in [1 - near, near] {
                    if !ranges[i].is_empty()
                        && let Some(other) = next.replace((children[i], ranges[i].from))
                    {
                        stack[waiting] = other;
                        waiting += 1;
                    }
                }
                if let Some((child, _)) = next {
                    node = &self.nodes[child as usize];
                    continue;
                }
            } else {
                for &item in &self.items[node.first as usize..][..node.count as usize] {
                    limit = each(item);
                }
            }
            node = loop {
                if waiting == 0 {
                    return;
                }
                waiting -= 1;
                let (child, from) = stack[waiting];
                if from <= limit {
                    break &self.nodes[child as usize];
                }
            };
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.items[..])
    }
}

impl Binary {
    /// Gives `node` two children, or makes it a leaf of `records[range]`.
    fn split(&mut self, node: usize, records: &mut [Record], range: Range<usize>, depth: usize) {
        let own = &mut records[range.clone()];
        let Some(middle) = partition(own, depth) else {
            (self.nodes[node].first, self.nodes[node].count) = (range.start as u32, range.len() as u32);
            return;
        };
        let middle = range.start + middle;
        let first = self.nodes.len();
        self.nodes[node].first = first as u32;
        let halves = [range.start..middle, middle..range.end];
        for half in halves.clone() {
            let bounds = bounds_of(records[half].iter().map(|record| record.bounds));
            self.nodes.push(Node { bounds, first: 0, count: 0 });
        }
        for (half, child) in halves.into_iter().zip(first..) {
            self.split(child, records, half, depth + 1);
        }
    }
}

/// Sorts the records into two halves and says where the second begins; None where they had better stay together.
fn partition(records: &mut [Record], depth: usize) -> Option<usize> {
    if records.len() < 2 {
        return None;
    }
    let centres = Aabb::around(records.iter().map(|record| record.bounds.centre()));
    let whole = bounds_of(records.iter().map(|record| record.bounds)).half_area();
    let best = (depth < DEEP).then(|| best_split(records, &centres)).flatten();
    let cost = best.map_or(f32::INFINITY, |split| NODE_COST + split.cost / whole.max(f32::MIN_POSITIVE));
    if records.len() <= LEAF && records.len() as f32 <= cost {
        return None;
    }
    if let Some(Split { axis, bin, .. }) = best {
        let bins = Bins::new(&centres, axis);
        let middle = partition_in_place(records, |record| bins.of(record) <= bin);
        return Some(middle);
    }
    // All centres in one bin, or too deep: any halves will do.
    Some(records.len() / 2)
}

#[derive(Clone, Copy)]
struct Split {
    axis: usize,
    /// The last bin of the first half.
    bin: usize,
    /// Areas times items.
    cost: f32,
}

/// Where centres fall along an axis.
struct Bins {
    axis: usize,
    start: f32,
    scale: f32,
}

impl Bins {
    fn new(centres: &Aabb, axis: usize) -> Self {
        let length = centres.max[axis] - centres.min[axis];
        Self { axis, start: centres.min[axis], scale: BINS as f32 * (1.0 - 1e-6) / length }
    }

    fn of(&self, record: &Record) -> usize {
        // As a cast it saturates: NaN and what is below go to 0.
        (((record.bounds.centre()[self.axis] - self.start) * self.scale) as usize).min(BINS - 1)
    }
}

fn best_split(records: &[Record], centres: &Aabb) -> Option<Split> {
    let mut best: Option<Split> = None;
    for axis in 0..3 {
        let bins = Bins::new(centres, axis);
        if !bins.scale.is_finite() {
            continue;
        }
        let mut filled = [(Aabb::EMPTY, 0u32); BINS];
        for record in records {
            let (bounds, count) = &mut filled[bins.of(record)];
            *bounds = bounds.union(record.bounds);
            *count += 1;
        }
        let mut behind = [(0.0, 0); BINS];
        let (mut bounds, mut count) = (Aabb::EMPTY, 0);
        for bin in (1..BINS).rev() {
            bounds = bounds.union(filled[bin].0);
            count += filled[bin].1;
            behind[bin - 1] = (bounds.half_area(), count);
        }
        let (mut bounds, mut count) = (Aabb::EMPTY, 0);
        for bin in 0..BINS - 1 {
            bounds = bounds.union(filled[bin].0);
            count += filled[bin].1;
            let (area, others) = behind[bin];
            let cost = bounds.half_area() * count as f32 + area * others as f32;
            if count > 0 && others > 0 && best.is_none_or(|best| cost < best.cost) {
                best = Some(Split { axis, bin, cost });
            }
        }
    }
    best
}

/// Moves those that are `first` to the front and says how many they are. The same order for the same input.
fn partition_in_place(records: &mut [Record], first: impl Fn(&Record) -> bool) -> usize {
    let mut count = 0;
    for i in 0..records.len() {
        if first(&records[i]) {
            records.swap(i, count);
            count += 1;
        }
    }
    count
}
