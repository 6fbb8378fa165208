//! Whether a tree that was read is a tree over just these triangles.
//!
//! A digest finds damage; it does not tell whether who wrote the file was right, or meant well. So nothing is taken on
//! trust that a ray will rely on:
//!
//! - every node but the root has one parent, which comes before it: no cycles, nothing unreachable; and the tree is no
//!   deeper than the stack of a walk;
//! - every box is finite and holds the boxes of the node below it, or the triangles of its leaf, [`widened`]; slots
//!   without a child are empty;
//! - every block is in one leaf, names triangles of the mesh, and has their corners;
//! - every triangle that can be hit is in a leaf. In the high preset the leaves that name it hold all pieces that it is
//!   cut into: these are cut once more, which takes as long as it did, so that such a tree is read in little less time
//!   than it is built where much is cut.
//!
//! What passes gives the hits that a tree built anew gives. It takes a tenth of the time to build: one pass over nodes
//! and triangles, by all threads. Marks are plain stores and counts are compared in the end, for atomic exchanges took
//! as long as everything else.

use std::ops::Range;
use std::result::Result;
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering::Relaxed};

use glam::Vec3A;
use rayon::prelude::*;

use crate::math::{Aabb, MAX_COORDINATE, Vec3, is_traceable};
use crate::trace::bvh::build::{MAX_DEPTH, spatial, triangle_items};
use crate::trace::bvh::levels::leaves::Leaves;
use crate::trace::bvh::meshes::Meshes;
use crate::trace::bvh::node::{Child, Node, WIDTH, widened, widened_corners};
use crate::trace::bvh::simd::isa::Isa;
use crate::trace::bvh::tree::Tree;

/// Nodes that are gone through by one thread at a time.
const CHUNK: usize = 512;

/// A triangle by its number, and the box of a leaf that holds a part of it.
type Piece = (u32, Aabb);

/// How many triangles the tree is over.
///
/// `cut` allows triangles that leaves hold in pieces.
///
/// # Errors
/// What is wrong.
pub(super) fn check(tree: &Tree, leaves: &Leaves, meshes: &Meshes, cut: bool) -> Result<usize, String> {
    let nodes = tree.nodes();
    if nodes.len() >= ROOT as usize || leaves.len() > Child::NAMES {
        return Err("has more nodes or blocks than can be numbered".to_owned());
    }
    let pass = Pass {
        nodes,
        leaves,
        meshes,
        cut,
        parents: (0..nodes.len()).map(|_| AtomicU32::new(ROOT)).collect(),
        blocks: flags(leaves.len()),
        triangles: flags(meshes.triangle_count()),
    };
    let chunks = nodes.par_chunks(CHUNK).enumerate();
    let counts: Vec<_> = chunks.map(|(chunk, nodes)| pass.check_nodes(chunk * CHUNK, nodes)).collect();
    let mut all = Counts::default();
    for counts in counts {
        all.add(counts?);
    }
    pass.check_shape(&all)?;
    if !all.pieces.is_empty() {
        pass.check_pieces(all.pieces)?;
    }
    let found = pass.check_triangles()?;
    if !cut && all.triangles != found {
        return Err("has a triangle in two leaves".to_owned());
    }
    Ok(found)
}

/// The parent of nodes that have none.
const ROOT: u32 = u32::MAX;

fn flags(count: usize) -> Vec<AtomicU8> {
    (0..count).map(|_| AtomicU8::new(0)).collect()
}

/// What is known so far; written by all threads.
struct Pass<'a> {
    nodes: &'a [Node],
    leaves: &'a Leaves,
    meshes: &'a Meshes,
    cut: bool,
    /// Of each node.
    parents: Vec<AtomicU32>,
    /// Whether a leaf has it.
    blocks: Vec<AtomicU8>,
    /// Whether a leaf has all of it.
    triangles: Vec<AtomicU8>,
}

/// What was counted in some nodes.
#[derive(Default)]
struct Counts {
    children: usize,
    blocks: usize,
    triangles: usize,
    pieces: Vec<Piece>,
}

impl Counts {
    fn add(&mut self, other: Self) {
        self.children += other.children;
        self.blocks += other.blocks;
        self.triangles += other.triangles;
        self.pieces.extend(other.pieces);
    }
}

/// What a thread has counted, and leaves whose triangles it looks up together: which corners they have first, where
/// these are next. One by one, each triangle would wait for memory twice.
#[derive(Default)]
struct Work {
    counts: Counts,
    leaves: Vec<Leaf>,
    numbers: Vec<u32>,
    /// Of each number.
    corners: Vec<[u32; 3]>,
}

/// A leaf, and where its numbers end.
struct Leaf {
    node: usize,
    bounds: Aabb,
    end: usize,
}

/// Triangles that are looked up together, about.
const BATCH: usize = 256;

impl Pass<'_> {
    fn check_nodes(&self, first: usize, nodes: &[Node]) -> Result<Counts, String> {
        let mut work = Work::default();
        let most = Aabb { min: Vec3::ZERO, max: Vec3::splat(MAX_COORDINATE) };
        // Above clusters boxes are around those of nodes, which are wide already.
        let most = widened(&widened(&most)).max;
        for (index, node) in (first..).zip(nodes) {
            for slot in 0..WIDTH {
                let (child, bounds) = (node.child[slot], node.child_bounds(slot));
                let is_sound = match child {
                    Child::NONE => bounds == Aabb::EMPTY,
                    _ => [bounds.min, bounds.max].iter().all(|corner| corner.abs().cmple(most).all()),
                };
                if !is_sound {
                    return Err(format!("has an impossible box in node {index}"));
                }
                match child {
                    Child::NONE => {}
                    leaf if leaf.is_leaf() => self.check_leaf(index, bounds, leaf.blocks(), &mut work)?,
                    inner => self.check_child(index, &bounds, inner.node(), &mut work.counts)?,
                }
            }
            if work.numbers.len() >= BATCH {
                self.check_corners(&mut work)?;
            }
        }
        self.check_corners(&mut work)?;
        Ok(work.counts)
    }

    fn check_child(&self, index: usize, bounds: &Aabb, child: u32, counts: &mut Counts) -> Result<(), String> {
        let below = self.nodes.get(child as usize).filter(|_| child as usize > index);
        let below = below.ok_or_else(|| format!("has in node {index} a child {child}, which cannot be one"))?;
        if !contains(bounds, &below.bounds()) {
            return Err(format!("has in node {index} a box that does not hold its child {child}"));
        }
        self.parents[child as usize].store(index as u32, Relaxed);
        counts.children += 1;
        Ok(())
    }

    fn check_leaf(&self, node: usize, bounds: Aabb, blocks: Range<u32>, work: &mut Work) -> Result<(), String> {
        if blocks.end as usize > self.blocks.len() {
            return Err(format!("has in node {node} a leaf of blocks {blocks:?}, which are not there"));
        }
        work.counts.blocks += blocks.len();
        for block in blocks {
            self.blocks[block as usize].store(1, Relaxed);
            let numbers = self.leaves.numbers(block, self.meshes);
            let (numbers, count) = numbers.ok_or_else(|| format!("has a block {block} that is not of this mesh"))?;
            work.numbers.extend_from_slice(&numbers[..count]);
        }
        work.leaves.push(Leaf { node, bounds, end: work.numbers.len() });
        Ok(())
    }

    /// That leaves hold their triangles.
    fn check_corners(&self, work: &mut Work) -> Result<(), String> {
        let Work { counts, leaves, numbers, corners } = work;
        corners.clear();
        corners.extend(numbers.iter().map(|&number| {
            let (mesh, primitive) = self.meshes.find(number);
            mesh.triangles[primitive as usize]
        }));
        let mut first = 0;
        for Leaf { node, bounds, end } in leaves.drain(..) {
            for (&number, corners) in numbers[first..end].iter().zip(&corners[first..end]) {
                let positions = &self.meshes.find(number).0.positions;
                let corners = corners.map(|corner| positions[corner as usize]);
                // The box is finite, so what it holds is.
                if holds(&bounds, corners) {
                    self.triangles[number as usize].store(1, Relaxed);
                } else if !corners.into_iter().all(is_traceable) {
                    return Err(format!("has in a leaf of node {node} a triangle that cannot be hit"));
                } else if self.cut {
                    counts.pieces.push((number, bounds));
                } else {
                    return Err(format!("has in node {node} a box that does not hold its triangles"));
                }
            }
            first = end;
        }
        counts.triangles += numbers.len();
        numbers.clear();
        Ok(())
    }

    /// That every node and every block hangs in one place, and none too deep.
    fn check_shape(&self, counts: &Counts) -> Result<(), String> {
        let mut depths = vec![0u8; self.nodes.len()];
        for node in 1..self.nodes.len() {
            let parent = self.parents[node].load(Relaxed);
            if parent == ROOT {
                return Err(format!("has a node {node} that no other leads to"));
            }
            // The parent comes first, and was at most as deep as is allowed.
            depths[node] = depths[parent as usize] + 1;
            if usize::from(depths[node]) >= MAX_DEPTH {
                return Err(format!("has a node {node} that is too deep"));
            }
        }
        let has_all = self.blocks.par_iter().all(|flag| flag.load(Relaxed) != 0);
        if counts.children + 1 != self.nodes.len().max(1) || counts.blocks != self.blocks.len() || !has_all {
            return Err("has a node or a block that hangs in two places or in none".to_owned());
        }
        Ok(())
    }

    /// That triangles which no leaf has all of are cut into `pieces` as the builder does it.
    fn check_pieces(&self, mut pieces: Vec<Piece>) -> Result<(), String> {
        pieces.sort_unstable_by_key(|&(number, _)| number);
        for item in spatial::pieces(triangle_items(self.meshes), self.meshes, Isa::detect().demand()) {
            let number = self.meshes.number(item.part(), item.primitive());
            let own = &pieces[pieces.partition_point(|piece| piece.0 < number)..];
            let mut own = own.iter().take_while(|piece| piece.0 == number);
            if self.triangles[number as usize].load(Relaxed) != 1
                && !own.any(|(_, bounds)| contains(bounds, &widened(&item.bounds())))
            {
                return Err(format!("lacks a piece of triangle {}", item.primitive()));
            }
        }
        // Not before: a triangle has several.
        pieces.iter().for_each(|piece| self.triangles[piece.0 as usize].store(1, Relaxed));
        Ok(())
    }

    /// That no triangle is missing; how many there are.
    fn check_triangles(&self) -> Result<usize, String> {
        let chunks = self.triangles.par_chunks(1 << 16).enumerate();
        let found = chunks.map(|(chunk, flags)| {
            let first = (chunk << 16) as u32;
            let missing = (first..).zip(flags).filter(|(_, flag)| flag.load(Relaxed) == 0);
            let mut skipped = 0;
            for (number, _) in missing {
                let (mesh, primitive) = self.meshes.find(number);
                if mesh.corners(primitive).into_iter().all(is_traceable) {
                    return Err(format!("lacks triangle {primitive}"));
                }
                skipped += 1;
            }
            Ok(flags.len() - skipped)
        });
        found.collect::<Vec<_>>().into_iter().sum()
    }
}

/// Whether the box around all corners, [`widened`], is in a box; false for NaN.
#[inline(always)]
fn holds(bounds: &Aabb, [a, b, c]: [Vec3; 3]) -> bool {
    // Vectors of a register each, and one branch: this is asked of every triangle.
    let (min, max) = (Vec3A::from(bounds.min), Vec3A::from(bounds.max));
    let [a, b, c] = [Vec3A::from(a), Vec3A::from(b), Vec3A::from(c)];
    let [low, high] = widened_corners([a.min(b).min(c), a.max(b).max(c)]);
    // A least and a largest number may pass over NaN, a sum does not.
    let sum = a + b + c;
    (min.cmple(low) & max.cmpge(high) & sum.cmpeq(sum)).all()
}

/// False for NaN.
fn contains(outer: &Aabb, inner: &Aabb) -> bool {
    outer.min.cmple(inner.min).all() && outer.max.cmpge(inner.max).all()
}
