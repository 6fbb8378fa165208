//! A BSP tree of general planes: those of the scene's own triangles, where they divide it well (Fuchs, Kedem, Naylor
//! 1980, *On visible surface generation by a priori tree structures*; for rays Ize, Wald, Parker 2008, *Ray tracing
//! with the BSP tree*).
//!
//! Each node's plane cuts a cell, a convex polyhedron, in two. Triangles within the plane stay with the node, and a ray
//! asks them as it crosses; others lie in the cells that they reach. `build` has how planes are chosen, and when it
//! stops; `polyhedron` the cells. Planes fit the scene better than boxes do, and cost more: to find, and to cross.
//!
//! **Rounding.** A corner counts as in the plane up to a doubt of e, so an item that is on one side only may reach 2 e
//! across. The ray's own distance from the plane is a sum of three products at t, off by less than 12 u of |n| (reach +
//! |origin|) for all t in the scene's bounds, and by |n| times what the ray strays: 2 |n| pad covers both, since the
//! pad is at least 8 u (reach + |origin|). So the sides are entered 2 e + 2 |n| pad too early and left as much too
//! late.

mod build;
mod polyhedron;

use super::items::Input;
use super::ray::{IndexRay, TInterval};
use super::{Cell, Index, Options};
use crate::math::{Aabb, DVec3, Vec3};

/// The index.
pub(in crate::trace::accel) struct Bsp {
    bounds: Aabb,
    /// How far from a plane what counts as within it may be: e.
    doubt: f64,
    root: Link,
    nodes: Vec<Node>,
    leaves: Vec<Run>,
    items: Vec<u32>,
    stopped: Option<String>,
}

/// A plane and what is on either side of it.
struct Node {
    plane: Plane,
    /// Items within the plane.
    on: Run,
    back: Link,
    front: Link,
}

/// A node, or a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Link {
    Node(u32),
    Leaf(u32),
}

/// Items that lie side by side.
#[derive(Clone, Copy)]
struct Run {
    first: u32,
    count: u32,
}

/// All points with normal . p = offset; a unit normal, up to rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plane {
    normal: DVec3,
    offset: f64,
}

impl Plane {
    /// Above 0 in front.
    fn distance(&self, p: DVec3) -> f64 {
        self.normal.dot(p) - self.offset
    }
}

impl Index for Bsp {
    const REPEATS: bool = true;

    fn build(input: &Input<'_>, options: &Options) -> Self {
        build::build(input, options)
    }

    fn visit(&self, ray: &IndexRay, limit: f64, each: &mut impl FnMut(u32) -> f64) {
        if self.bounds.is_empty() {
            return;
        }
        let range = ray.within_box(&self.bounds, limit);
        if !range.is_empty() {
            self.enter(self.root, ray, range, limit, each);
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..]) + size_of_val(&self.items[..])
    }

    fn note(&self) -> Option<String> {
        self.stopped.clone()
    }

    fn locate(&self, point: Vec3) -> Option<Cell> {
        let mut cell = Cell::within(&self.bounds, point)?;
        let mut link = self.root;
        loop {
            match link {
                Link::Leaf(leaf) => {
                    cell.number = leaf;
                    cell.items.extend(self.run(self.leaves[leaf as usize]));
                    return Some(cell);
                }
                Link::Node(node) => {
                    let Node { plane, back, front, on } = &self.nodes[node as usize];
                    let is_in_front = plane.distance(point.as_dvec3()) >= 0.0;
                    link = if is_in_front { *front } else { *back };
                    cell.items.extend(self.run(*on));
                    let Plane { normal, offset } = *plane;
                    cell.sides.push(if is_in_front { (-normal, -offset) } else { (normal, offset) });
                }
            }
        }
    }
}

impl Bsp {
    fn run(&self, run: Run) -> &[u32] {
        &self.items[run.first as usize..][..run.count as usize]
    }

    /// Visits what the ray meets within a range of t, and gives the new limit.
    fn enter(
        &self,
        mut link: Link,
        ray: &IndexRay,
        mut range: TInterval,
        mut limit: f64,
        each: &mut impl FnMut(u32) -> f64,
    ) -> f64 {
        loop {
            let node = match link {
                Link::Leaf(leaf) => {
                    for &item in self.run(self.leaves[leaf as usize]) {
                        limit = each(item);
                    }
                    return limit;
                }
                Link::Node(node) => &self.nodes[node as usize],
            };
            let (near, far) = self.split(&node.plane, ray, range);
            let backwards = ray.direction.dot(node.plane.normal).is_sign_negative();
            let (first, second) = if backwards { (node.front, node.back) } else { (node.back, node.front) };
            if !near.is_empty() {
                limit = self.enter(first, ray, near, limit, each);
            }
            if far.from.max(range.from) <= near.to.min(limit) {
                for &item in self.run(node.on) {
                    limit = each(item);
                }
            }
            (link, range) = (second, far.until(limit));
            if range.is_empty() {
                return limit;
            }
        }
    }

    /// The parts of a range before and behind a plane: see [`IndexRay::split`], which is this for planes across an
    /// axis.
    fn split(&self, plane: &Plane, ray: &IndexRay, range: TInterval) -> (TInterval, TInterval) {
        let doubt = 2.0 * self.doubt + 2.0 * plane.normal.abs().dot(ray.pad);
        let distance = plane.distance(ray.origin);
        let slope = ray.direction.dot(plane.normal);
        let side = doubt.copysign(slope);
        let from = (-side - distance) / slope;
        let to = (side - distance) / slope;
        // NaN, of a ray that stays at the edge of the doubt, leaves both parts as they are.
        let before = TInterval { to: if to < range.to { to } else { range.to }, ..range };
        let behind = TInterval { from: if from > range.from { from } else { range.from }, ..range };
        (before, behind)
    }
}
