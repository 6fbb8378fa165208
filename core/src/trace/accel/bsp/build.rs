//! Choosing the planes of a BSP tree, within limits.
//!
//! Candidates are the planes of a few of the cell's triangles, and planes across the axes through the middle of its
//! boxes: a smooth mesh lies on one side of all of its own planes, so that these alone would make a list of it (Ize,
//! Wald, Parker 2008 mix both kinds for that). The surface area heuristic chooses, with the areas of the polyhedra that
//! come out. Trying the plane of every triangle, as they do, is quadratic near the root.
//!
//! Even so it is by far the slowest of the builds, and triangles that planes cut are held in many cells. So it stops
//! after a time, or at a number of references, and says so; cells that are not divided by then are lists. The fullest
//! cell comes first, so that a tree that was stopped is coarse everywhere, and nowhere a list of half the scene.

use std::collections::BinaryHeap;
use std::time::{Duration, Instant};

use super::polyhedron::Polyhedron;
use super::{Bsp, Link, Node, Plane, Run};
use crate::math::{Aabb, DVec3};
use crate::trace::accel::Options;
use crate::trace::accel::items::{Input, reach};

/// Most items that are not told apart.
const LEAF: usize = 4;
/// What crossing a plane costs, in tests of an item.
const NODE_COST: f64 = 0.4;
/// Triangles whose planes are tried.
const TRIALS: usize = 6;
/// Cells of so many items or fewer are finished at once, and their polyhedra forgotten.
const FEW: usize = 64;
/// Planes above a cell, at most.
const DEEPEST: u32 = 60;
/// References for each item, and besides.
const MAX_REFERENCES: [usize; 2] = [24, 4096];
/// How long it may take.
const LONGEST: Duration = Duration::from_secs(10);
/// As a share of the largest coordinate, how far from a plane counts as within it: a thousand times the rounding of the
/// distance.
const DOUBT: f64 = 1.0 / (1u64 << 40) as f64;

/// A cell that may be divided.
struct Cell {
    items: Vec<u32>,
    body: Polyhedron,
    depth: u32,
    /// Where its link belongs.
    parent: Option<Side>,
}

/// One side of a node.
#[derive(Clone, Copy)]
struct Side {
    node: u32,
    is_front: bool,
}

struct Builder<'a> {
    input: &'a Input<'a>,
    tree: Bsp,
    /// None where it may take any time.
    deadline: Option<Instant>,
    /// References that may still be added.
    room: usize,
    /// Why it stopped, and the items in cells that it would have divided.
    stopped: Option<(&'static str, usize)>,
}

/// What a plane does to a cell.
struct Trial {
    plane: Plane,
    cost: f64,
    bodies: [Polyhedron; 2],
}

pub(super) fn build(input: &Input<'_>, options: &Options) -> Bsp {
    let bounds = input.bounds();
    let doubt = DOUBT * reach(&bounds).max_element();
    let root = Link::Leaf(0);
    let tree = Bsp { bounds, doubt, root, nodes: Vec::new(), leaves: Vec::new(), items: Vec::new(), stopped: None };
    let [each, besides] = MAX_REFERENCES;
    let longest = options.bsp_time.unwrap_or(LONGEST);
    let room = input.boxes.len().saturating_mul(each) + besides;
    let mut builder = Builder { input, tree, deadline: Instant::now().checked_add(longest), room, stopped: None };
    builder.run(Cell { items: input.all(), body: Polyhedron::of_box(&bounds), depth: 0, parent: None });
    let cells = builder.tree.leaves.len();
    builder.tree.stopped = builder.stopped.map(|(why, items)| {
        format!("the BSP tree stopped {why} with {cells} cells; those not divided further hold {items} items")
    });
    builder.tree
}

impl Builder<'_> {
    fn run(&mut self, root: Cell) {
        let mut large = BinaryHeap::from([ByCount(root)]);
        while let Some(ByCount(cell)) = large.pop() {
            let mut cells = vec![cell];
            while let Some(cell) = cells.pop() {
                for child in self.divide(cell) {
                    if child.items.len() > FEW { large.push(ByCount(child)) } else { cells.push(child) }
                }
            }
        }
    }

    /// Adds a node for the cell and gives its parts, or a leaf and gives none.
    fn divide(&mut self, cell: Cell) -> Vec<Cell> {
        let Cell { items, body, depth, parent } = cell;
        let trial = if items.len() > LEAF && depth < DEEPEST && self.may_go_on(items.len()) {
            self.best(&items, &body)
        } else {
            None
        };
        let Some(Trial { plane, bodies, .. }) = trial else {
            let leaf = self.tree.leaves.len() as u32;
            let run = self.store(&items);
            self.tree.leaves.push(run);
            self.link(parent, Link::Leaf(leaf));
            return Vec::new();
        };
        let (mut back, mut front, mut on) = (Vec::new(), Vec::new(), Vec::new());
        for &item in &items {
            let (is_back, is_front) = self.sides(item, &plane);
            if is_back {
                back.push(item);
            }
            if is_front {
                front.push(item);
            }
            if !is_back && !is_front {
                on.push(item);
            }
        }
        self.room = self.room.saturating_sub((back.len() + front.len() + on.len()).saturating_sub(items.len()));
        let node = self.tree.nodes.len() as u32;
        let on = self.store(&on);
        self.tree.nodes.push(Node { plane, on, back: Link::Leaf(0), front: Link::Leaf(0) });
        self.link(parent, Link::Node(node));
        let parts = [(back, false), (front, true)].into_iter().zip(bodies);
        let cell =
            |((items, is_front), body)| Cell { items, body, depth: depth + 1, parent: Some(Side { node, is_front }) };
        parts.map(cell).collect()
    }

    fn may_go_on(&mut self, items: usize) -> bool {
        let why = if self.room == 0 {
            "at its most references"
        } else if self.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            "at its time limit"
        } else {
            return true;
        };
        self.stopped.get_or_insert((why, 0)).1 += items;
        false
    }

    fn link(&mut self, parent: Option<Side>, link: Link) {
        match parent {
            None => self.tree.root = link,
            Some(Side { node, is_front: false }) => self.tree.nodes[node as usize].back = link,
            Some(Side { node, is_front: true }) => self.tree.nodes[node as usize].front = link,
        }
    }

    fn store(&mut self, items: &[u32]) -> Run {
        let first = self.tree.items.len() as u32;
        self.tree.items.extend(items);
        Run { first, count: items.len() as u32 }
    }

    /// The plane at which rays are expected to cost least, if that is less than testing all items.
    fn best(&self, items: &[u32], body: &Polyhedron) -> Option<Trial> {
        let whole = body.area();
        let trials = self.candidates(items).into_iter().filter_map(|plane| {
            let [back, front, on] = self.counts(items, &plane).map(|count| count as f64);
            let bodies = body.cut(&plane);
            let share = |part: &Polyhedron| part.area() / whole;
            let (behind, before) = (share(&bodies[0]), share(&bodies[1]));
            // A plane beside the cell divides nothing.
            let divides = behind > 0.0 && before > 0.0;
            // Those within the plane are met by rays that cross it within the cell: by the sides' areas beyond the
            // whole, twice the cut.
            let crossing = ((behind + before - 1.0) * 0.5).clamp(0.0, 1.0);
            let cost = NODE_COST + behind * back + before * front + crossing * on;
            divides.then_some(Trial { plane, cost, bodies })
        });
        let best = trials.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        (best.cost < items.len() as f64).then_some(best)
    }

    /// Planes of triangles spread over the list, and one across each axis.
    fn candidates(&self, items: &[u32]) -> Vec<Plane> {
        let stride = items.len().div_ceil(TRIALS);
        // Not the first of each stretch alone: neighbours in the list are neighbours in the mesh.
        let spread = (0..TRIALS).filter_map(|k| items.get(k * stride + stride / 2));
        let mut planes: Vec<Plane> = spread.filter_map(|&item| self.plane_of(item)).collect();
        for (axis, normal) in DVec3::AXES.into_iter().enumerate() {
            let mut sides: Vec<f32> = items.iter().map(|&item| self.input.boxes[item as usize].max[axis]).collect();
            let middle = sides.len() / 2;
            let (_, &mut median, _) = sides.select_nth_unstable_by(middle, f32::total_cmp);
            planes.push(Plane { normal, offset: median.into() });
        }
        planes
    }

    fn plane_of(&self, item: u32) -> Option<Plane> {
        let [a, b, c] = self.input.triangles.get(item as usize)?.map(|p| p.as_dvec3());
        let normal = (b - a).cross(c - a).try_normalize()?;
        Some(Plane { normal, offset: normal.dot(a) })
    }

    /// Whether an item reaches behind a plane, and in front of it; neither where it is within.
    fn sides(&self, item: u32, plane: &Plane) -> (bool, bool) {
        let (low, high) = match self.input.triangles.get(item as usize) {
            Some(corners) => {
                let [a, b, c] = corners.map(|p| plane.distance(p.as_dvec3()));
                (a.min(b).min(c), a.max(b).max(c))
            }
            None => {
                let Aabb { min, max } = self.input.boxes[item as usize];
                let (min, max) = (min.as_dvec3(), max.as_dvec3());
                let middle = plane.distance(min * 0.5 + max * 0.5);
                let half = plane.normal.abs().dot(max * 0.5 - min * 0.5);
                (middle - half, middle + half)
            }
        };
        (low < -self.tree.doubt, high > self.tree.doubt)
    }

    /// Items behind, in front of and within a plane.
    fn counts(&self, items: &[u32], plane: &Plane) -> [usize; 3] {
        let mut counts = [0; 3];
        for &item in items {
            let (back, front) = self.sides(item, plane);
            counts[0] += usize::from(back);
            counts[1] += usize::from(front);
            counts[2] += usize::from(!back && !front);
        }
        counts
    }
}

/// Orders cells by the number of their items.
struct ByCount(Cell);

impl Ord for ByCount {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.items.len().cmp(&other.0.items.len())
    }
}

impl PartialOrd for ByCount {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for ByCount {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for ByCount {}
