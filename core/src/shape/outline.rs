//! The outline of a polygon, and whether a line passes inside.
//!
//! Looked at along the ray, the corners are points of a plane and the line is one point of it. A half-line from that
//! point crosses the outline an odd number of times where the point is inside (Shimrat 1962, *Algorithm 112*; Haines
//! 1994, *Point in polygon strategies*). Which edges it crosses is told by signs: on which side of the half-line's own
//! line the corners are, where one on it counts as above, and for edges with an end on either side the sign of the
//! volume d . (b x c), as for triangles. All signs are exact, so a ray through a corner is counted once, and a point on
//! an edge or a corner is seen as such: it is inside. Two polygons that share an edge leave no gap.
//!
//! Of many corners, boxes around runs of them, in a binary tree, tell which edges the half-line's own line passes by:
//! the sign of a box's corner that is farthest to a side is exact, too. An outline that runs to and fro across that
//! line has all of its edges looked at.

use std::ops::Range;

use super::line::Line;
use crate::math::number::{Formula, Number, cross, dot, minus, vector};
use crate::math::{Aabb, DVec3, Vec3};

/// Edges that are gone through one by one.
const RUN: usize = 16;

/// Corners in order; the last is joined to the first.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outline {
    corners: Vec<Vec3>,
    /// Around runs of edges, where they are more than [`RUN`]: the children of box k are 2 k + 1 and 2 k + 2, each with
    /// half of its edges.
    boxes: Vec<Aabb>,
}

impl Outline {
    pub fn new(corners: Vec<Vec3>) -> Self {
        let runs = corners.len().div_ceil(RUN);
        let mut boxes = vec![Aabb::EMPTY; if runs > 1 { 2 * runs.next_power_of_two() - 1 } else { 0 }];
        let mut outline = Self { corners, boxes: Vec::new() };
        outline.enclose(&mut boxes, 0, 0..outline.corners.len());
        outline.boxes = boxes;
        outline
    }

    /// The corners, in order.
    pub fn corners(&self) -> &[Vec3] {
        &self.corners
    }

    /// Memory it holds beside itself.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.corners[..]) + size_of_val(&self.boxes[..])
    }

    /// Edge i leads to corner i.
    fn edge(&self, i: usize) -> [Vec3; 2] {
        [self.corners[i.checked_sub(1).unwrap_or(self.corners.len() - 1)], self.corners[i]]
    }

    fn enclose(&self, boxes: &mut [Aabb], node: usize, edges: Range<usize>) {
        if node >= boxes.len() {
            return;
        }
        boxes[node] = Aabb::around(edges.clone().flat_map(|i| self.edge(i)));
        let [first, second] = halves(edges);
        self.enclose(boxes, 2 * node + 1, first);
        self.enclose(boxes, 2 * node + 2, second);
    }

    /// Whether the line passes inside, or through the outline.
    pub fn contains(&self, line: &Line) -> bool {
        let size = line.direction.abs();
        let mut axes = [0, 1, 2];
        axes.sort_by(|&i, &j| size[i].total_cmp(&size[j]));
        // The half-line goes along the axis that is farthest from the direction.
        let [along, across, _] = axes;
        let mut count = Count { outline: self, line, along, across, is_inside: false };
        count.touches(0, 0..self.corners.len()) || count.is_inside
    }
}

/// A range in two.
fn halves(range: Range<usize>) -> [Range<usize>; 2] {
    let middle = range.start + range.len() / 2;
    [range.start..middle, middle..range.end]
}

/// How often a half-line crosses an outline.
struct Count<'a> {
    outline: &'a Outline,
    line: &'a Line,
    along: usize,
    across: usize,
    /// Whether the edges that it has crossed so far are odd in number.
    is_inside: bool,
}

impl Count<'_> {
    /// On which side of the line, in the direction of an axis, a point is.
    fn side(&self, p: Vec3, axis: usize) -> i32 {
        Side { line: self.line, axis, corner: self.line.place(p) }.signs()[0]
    }

    /// Counts these edges, which are below a node, unless one of them touches the line: then it says so.
    fn touches(&mut self, node: usize, edges: Range<usize>) -> bool {
        let boxes = &self.outline.boxes;
        if boxes.get(node).is_some_and(|bounds| self.passes_by(bounds)) {
            return false;
        }
        if 2 * node + 2 < boxes.len() {
            let [first, second] = halves(edges);
            return self.touches(2 * node + 1, first) || self.touches(2 * node + 2, second);
        }
        let Some(start) = edges.clone().next() else { return false };
        let mut from_side = self.side(self.outline.edge(start)[0], self.along);
        for i in edges {
            let [from, to] = self.outline.edge(i);
            let to_side = self.side(to, self.along);
            if (from_side >= 0) != (to_side >= 0) {
                let volume = Volume { line: self.line, ends: [from, to].map(|p| self.line.place(p)) }.signs()[0];
                if volume == 0 {
                    return true;
                }
                self.is_inside ^= (volume > 0) == (to_side >= 0);
            } else if to_side == 0 {
                // In a corner, or on an edge along the half-line.
                let place = self.side(to, self.across);
                if place == 0 || from_side == 0 && self.side(from, self.across) * place < 0 {
                    return true;
                }
            }
            from_side = to_side;
        }
        false
    }

    /// Whether all of a box is to one side of the half-line's own line: the side grows with one coordinate, or falls,
    /// and so does it with another.
    fn passes_by(&self, bounds: &Aabb) -> bool {
        let (i, j) = ((self.along + 1) % 3, (self.along + 2) % 3);
        let (mut most, mut least) = (bounds.max, bounds.min);
        if self.line.direction[j] < 0.0 {
            (most[i], least[i]) = (least[i], most[i]);
        }
        if self.line.direction[i] > 0.0 {
            (most[j], least[j]) = (least[j], most[j]);
        }
        self.side(most, self.along) < 0 || self.side(least, self.along) > 0
    }
}

/// d . (e x v) for an axis e and v from the ray's origin to a corner: on which side of the plane of d and e the corner
/// is.
struct Side<'a> {
    line: &'a Line,
    axis: usize,
    corner: DVec3,
}

impl Formula<1> for Side<'_> {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 1] {
        let (i, j) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let v = |k: usize| N::new(self.corner[k]).sub(&N::new(self.line.origin[k]));
        let d = |k: usize| N::new(self.line.direction[k]);
        [d(j).mul(&v(i)).sub(&d(i).mul(&v(j)))]
    }
}

/// d . (b x c), with the edge in place of c, which cancels less.
struct Volume<'a> {
    line: &'a Line,
    ends: [DVec3; 2],
}

impl Formula<1> for Volume<'_> {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 1] {
        let [from, to] = self.ends.map(vector::<N>);
        let (b, edge) = (minus(&from, &vector(self.line.origin)), minus(&to, &from));
        [dot(&vector(self.line.direction), &cross(&b, &edge))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;
    use crate::ray::Ray;

    /// With boxes as without, also where lines pass through corners and along edges, whichever axes these run along.
    #[test]
    fn boxes_leave_out_nothing() {
        let mut numbers = Random::new(5, 0);
        let mut random = |most: u64| numbers.below(most) as f32;
        let (mut inside, mut outside) = (0, 0);
        for (turn, count) in (0..3).flat_map(|turn| [RUN, RUN + 1, 100, 1000].map(|count| (turn, count))) {
            let turned = |v: Vec3| Vec3::new(v[turn], v[(turn + 1) % 3], v[(turn + 2) % 3]);
            // A walk over a coarse grid, which crosses itself and goes along its axes.
            let mut at = Vec3::new(0.0, 0.0, 3.0);
            let mut step = |k: usize| {
                at[k % 2] += random(7) - 3.0;
                turned(at)
            };
            let corners: Vec<Vec3> = (0..count).map(&mut step).collect();
            let outline = Outline::new(corners.clone());
            assert_eq!(outline.boxes.is_empty(), count <= RUN);
            let alone = Outline { corners: corners.clone(), boxes: Vec::new() };
            for k in 0..1000 {
                let beside = Vec3::new(random(5) - 2.0, random(5) - 2.0, 0.0) * 0.5;
                let target = corners[random(count as u64) as usize] + turned(beside);
                let aside =
                    turned(Vec3::new(random(9) - 4.0, random(9) - 4.0, 8.0)) * if k % 2 == 0 { 1.0 } else { -1.0 };
                let line = Line::new(&Ray::new(target - aside, aside), 1000.0);
                let expected = alone.contains(&line);
                assert_eq!(outline.contains(&line), expected, "{count} corners, at {target} from {aside}");
                if expected { inside += 1 } else { outside += 1 }
            }
        }
        assert!(inside > 500 && outside > 500, "{inside} {outside}");
    }

    /// Of a circle a half-line's line comes near two runs of edges.
    #[test]
    fn most_edges_are_passed_by() {
        let corner = |k: u32| {
            let (sin, cos) = (k as f32 * std::f32::consts::TAU / 1600.0).sin_cos();
            Vec3::new(sin, cos, 0.0)
        };
        let outline = Outline::new((0..1600).map(corner).collect());
        let line = Line::new(&Ray::new(Vec3::new(0.3, 0.4, 5.0), Vec3::NEG_Z), 5.0);
        let count = Count { outline: &outline, line: &line, along: 0, across: 1, is_inside: false };
        let leaves = &outline.boxes[outline.boxes.len() / 2..];
        let met = leaves.iter().filter(|bounds| !count.passes_by(bounds)).count();
        assert_eq!((leaves.len(), met), (128, 2));
        assert!(outline.contains(&line));
    }
}
