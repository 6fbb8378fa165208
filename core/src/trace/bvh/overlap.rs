//! What overlaps a box, by the leaves that do.

use super::node::Node;
use super::query::Occluded;
use super::simd::isa::{self, Kernel, Present};
use super::simd::{Mask, Simd, Vector};
use super::tree::Tree;
use super::walk::{self, Enter, Visit};
use crate::math::Aabb;

/// Names blocks, in no order, of the leaves of `tree` that overlap a box.
pub(super) fn visit_overlapping(tree: &Tree, isa: Present, bounds: &Aabb, visitor: &mut dyn FnMut(u32)) {
    if !tree.is_empty() {
        isa::dispatch(isa, VisitOverlapping { tree, bounds, visitor });
    }
}

/// What overlaps a box.
struct Overlap<'a>(&'a Aabb);

impl Overlap<'_> {
    #[inline(always)]
    fn along<S: Simd>(&self, node: &Node, axis: usize) -> <S::V8 as Vector>::Mask {
        let Self(Aabb { min, max }) = self;
        let first = 2 * axis as u32 * Node::ROW;
        let (low, high) = (S::row(node, first), S::row(node, first + Node::ROW));
        low.at_most(S::V8::splat(max[axis])).and(S::V8::splat(min[axis]).at_most(high))
    }
}

impl Enter for Overlap<'_> {
    #[inline(always)]
    fn enter<S: Simd>(&self, node: &Node, _limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        let [x, y, z] = [self.along::<S>(node, 0), self.along::<S>(node, 1), self.along::<S>(node, 2)];
        (x.and(y).and(z), S::V8::splat(0.0))
    }

    /// Slots without a child are from infinity to minus infinity, which overlaps what has no end.
    #[inline(always)]
    fn select<S: Simd>(&self, node: &Node, children: u32) -> u32 {
        node.occupied() & children
    }
}

struct VisitOverlapping<'a, 'v> {
    tree: &'a Tree,
    bounds: &'a Aabb,
    visitor: &'a mut (dyn FnMut(u32) + 'v),
}

impl Kernel for VisitOverlapping<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, bounds, visitor } = self;
        walk::single::<S, Occluded>(
            tree,
            &Overlap(bounds),
            f32::INFINITY,
            #[inline(always)]
            |leaf| {
                leaf.blocks().for_each(&mut *visitor);
                Visit::Until(f32::INFINITY)
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use crate::math::{Aabb, Random, Vec3};
    use crate::trace::bvh::simd::isa::Isa;
    use crate::trace::bvh::{BoxTree, Options};

    /// Every box that overlaps another is named, those that touch it and those without an end among them, and few of
    /// the others.
    #[test]
    fn what_overlaps_is_found() {
        let mut random = Random::new(64, 0);
        let mut boxes: Vec<Aabb> = Vec::new();
        for i in 0..4000 {
            let centre = random.vector() * 10.0;
            // On a grid, so that many touch, and some flat.
            let centre = if i % 3 == 0 { (centre * 4.0).round() / 4.0 } else { centre };
            let size = if i % 3 == 0 { Vec3::splat(0.125) } else { Vec3::splat(random.unit()) };
            let size = if i % 7 == 0 { size * Vec3::new(1.0, 0.0, 1.0) } else { size };
            boxes.push(Aabb { min: centre - size, max: centre + size });
        }
        boxes[5] = Aabb::EMPTY;
        boxes[8].max.x = f32::MAX;
        let whole = Aabb { min: Vec3::splat(f32::NEG_INFINITY), max: Vec3::splat(f32::INFINITY) };
        let asked: Vec<Aabb> = boxes.iter().step_by(3).copied().chain([whole]).collect();
        for isa in Isa::available() {
            let (tree, order) = BoxTree::build(&boxes, Options { isa, ..Options::default() });
            let (mut named, mut overlapping) = (0, 0);
            for bounds in &asked {
                let mut seen = vec![false; boxes.len()];
                tree.visit_overlapping(bounds, &mut |i| {
                    assert!(!std::mem::replace(&mut seen[order[i as usize] as usize], true), "once");
                });
                assert!(!seen[5], "it is nowhere");
                named += seen.iter().filter(|seen| **seen).count();
                for (i, other) in boxes.iter().enumerate().filter(|(i, _)| *i != 5) {
                    let overlaps = bounds.min.cmple(other.max).all() && other.min.cmple(bounds.max).all();
                    assert!(seen[i] || !overlaps, "{isa:?}, box {i}, {other:?}, {bounds:?}");
                    overlapping += usize::from(overlaps);
                }
            }
            assert!(named < 2 * overlapping, "{isa:?}: {named}, of which {overlapping} overlap");
        }
    }
}
