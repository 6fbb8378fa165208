//! The reflex corners that a polygon still has, in a tree of boxes (k-d order, medians along the longer side).

use super::cross;
use crate::math::DVec2;

/// Corners in a leaf.
const LEAF: usize = 8;

/// Corners of which some are in the way of an ear.
pub(super) struct Reflex<'a> {
    corners: &'a [DVec2],
    /// The reflex ones, in the tree's order; and whether each is one still.
    order: Vec<(usize, bool)>,
    /// Where in the order each corner of the polygon is.
    place: Vec<usize>,
    /// Of a node the children are `2 k + 1` and `2 k + 2`; each has half of what it has.
    nodes: Vec<Node>,
    /// Boxes and corners that were looked at.
    pub looked: usize,
}

#[derive(Clone, Copy)]
struct Node {
    min: DVec2,
    max: DVec2,
    /// Corners below it that are reflex still.
    count: usize,
}

impl<'a> Reflex<'a> {
    /// Those of `corners` that `reflex` names.
    pub fn new(corners: &'a [DVec2], mut reflex: Vec<usize>) -> Self {
        let levels = (reflex.len().div_ceil(LEAF)).next_power_of_two().ilog2() + 1;
        let mut nodes = vec![Node { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY, count: 0 }; (1 << levels) - 1];
        arrange(corners, &mut reflex, &mut nodes, 0);
        let mut place = vec![usize::MAX; corners.len()];
        reflex.iter().enumerate().for_each(|(at, &corner)| place[corner] = at);
        Self { corners, order: reflex.into_iter().map(|corner| (corner, true)).collect(), place, nodes, looked: 0 }
    }

    /// A corner that is reflex no longer, or never was.
    pub fn remove(&mut self, corner: usize) {
        let at = self.place[corner];
        let Some((_, is_reflex)) = self.order.get_mut(at) else { return };
        if !std::mem::replace(is_reflex, false) {
            return;
        }
        let (mut node, mut range) = (0, 0..self.order.len());
        while let Some(Node { count, .. }) = self.nodes.get_mut(node) {
            *count -= 1;
            let middle = range.start + range.len() / 2;
            (node, range) =
                if at < middle { (2 * node + 1, range.start..middle) } else { (2 * node + 2, middle..range.end) };
        }
    }

    /// Whether one is in the triangle or on its edges. Rounding may put a corner that is far along an edge on the inner
    /// side of all three: outside the triangle's box none counts. Corners that coincide with one of its own do not
    /// count: they are bridges to holes.
    pub fn any_in(&mut self, triangle: [DVec2; 3]) -> bool {
        self.any_below(0, 0..self.order.len(), triangle)
    }

    fn any_below(&mut self, node: usize, range: std::ops::Range<usize>, triangle: [DVec2; 3]) -> bool {
        self.looked += 1;
        if self.nodes[node].count == 0 || !self.nodes[node].may_reach(triangle) {
            return false;
        }
        if 2 * node + 2 < self.nodes.len() {
            let middle = range.start + range.len() / 2;
            return self.any_below(2 * node + 1, range.start..middle, triangle)
                || self.any_below(2 * node + 2, middle..range.end, triangle);
        }
        self.looked += range.len();
        let mut corners =
            self.order[range].iter().filter(|(_, is_reflex)| *is_reflex).map(|&(corner, _)| self.corners[corner]);
        corners.any(|p| is_in(triangle, p) && !triangle.contains(&p))
    }
}

/// Whether a point is in a triangle's box, and not on the outer side of an edge.
fn is_in([a, b, c]: [DVec2; 3], p: DVec2) -> bool {
    let is_near = a.min(b).min(c).cmple(p).all() && p.cmple(a.max(b).max(c)).all();
    is_near && cross(a, b, p) >= 0.0 && cross(b, c, p) >= 0.0 && cross(c, a, p) >= 0.0
}

impl Node {
    /// Whether a point of the box may be in the triangle: in its box, and on the inner side of all edges. What is
    /// computed of a point for an edge grows with each of its coordinates or falls with it, rounded or not, so that no
    /// point of the box has more than the corner that is taken here.
    fn may_reach(&self, [a, b, c]: [DVec2; 3]) -> bool {
        let (min, max) = (a.min(b).min(c), a.max(b).max(c));
        let is_near = self.min.cmple(max).all() && min.cmple(self.max).all();
        is_near
            && [(a, b), (b, c), (c, a)].into_iter().all(|(from, to)| {
                let edge = to - from;
                let x = if edge.y <= 0.0 { self.max.x } else { self.min.x };
                let y = if edge.x >= 0.0 { self.max.y } else { self.min.y };
                cross(from, to, DVec2::new(x, y)) >= 0.0
            })
    }
}

/// Puts corners in order, and gives each node of the tree its box.
fn arrange(corners: &[DVec2], reflex: &mut [usize], nodes: &mut [Node], node: usize) {
    let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for &corner in &*reflex {
        (min, max) = (min.min(corners[corner]), max.max(corners[corner]));
    }
    nodes[node] = Node { min, max, count: reflex.len() };
    if 2 * node + 2 < nodes.len() {
        let axis = usize::from(max.y - min.y > max.x - min.x);
        let middle = reflex.len() / 2;
        if middle > 0 {
            reflex.select_nth_unstable_by(middle, |&i, &j| corners[i][axis].total_cmp(&corners[j][axis]));
        }
        let (low, high) = reflex.split_at_mut(middle);
        arrange(corners, low, nodes, 2 * node + 1);
        arrange(corners, high, nodes, 2 * node + 2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    /// As all corners that are left, gone through one by one.
    #[test]
    fn finds_what_brute_force_finds() {
        let mut numbers = Random::new(1, 0);
        let mut random = || (numbers.bits() >> 40) as usize;
        let (mut found, mut missed) = (0, 0);
        for count in [1, 7, 8, 9, 40, 1000] {
            // Few different places: many coincide, and are on edges.
            let corners: Vec<_> =
                (0..count).map(|_| DVec2::new((random() % 40) as f64, (random() % 40) as f64 * 0.1)).collect();
            let mut left: Vec<usize> = (0..count).filter(|i| i % 3 != 1).collect();
            let mut reflex = Reflex::new(&corners, left.clone());
            // Those that have never been reflex.
            (1..count).step_by(3).for_each(|corner| reflex.remove(corner));
            while !left.is_empty() {
                for _ in 0..20 {
                    let size = 1 + random() % 30;
                    let near = corners[random() % count];
                    let [a, b, c] = std::array::from_fn(|_| {
                        near + DVec2::new((random() % size) as f64, (random() % size) as f64 * 0.1)
                    });
                    let is_in_the_way = |&corner: &usize| {
                        let p = corners[corner];
                        is_in([a, b, c], p) && ![a, b, c].contains(&p)
                    };
                    let expected = left.iter().any(is_in_the_way);
                    assert_eq!(reflex.any_in([a, b, c]), expected, "{a} {b} {c} among {} of {count}", left.len());
                    if expected { found += 1 } else { missed += 1 }
                }
                let gone = left.swap_remove(random() % left.len());
                reflex.remove(gone);
                // Again, which changes nothing.
                reflex.remove(gone);
            }
            assert_eq!(reflex.nodes[0].count, 0);
        }
        assert!(found > 1000 && missed > 1000, "{found} {missed}");
    }
}
