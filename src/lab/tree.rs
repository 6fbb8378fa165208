//! The exact nearest hit among many primitives, at a pace of hundreds of thousands of rays a second.
//!
//! [`oracle::closest`] meets every primitive with integers. Here a plain binary tree of boxes, in f64, says which
//! triangles a ray may meet at all; of those, plain f64 under one bound for all of it passes most by (`passes_by`);
//! each of the others is met in f64 with a running error bound; and only where the bounds leave doubt about a sign,
//! about which is nearest or about an end of the range does [`oracle::meet`] decide. So the answers are the same, but
//! for the last digits of t.
//!
//! The tree is this file's own: median splits, boxes around exact corners, slabs that are widened by far more than f64
//! rounds. Shapes are met one by one, as their boxes would be those of the code that is judged.

use super::exact::{Approx, Ring, cross, det, dot, vector};
use super::oracle::{self, Body, Id, Meeting, Primitive};
use crate::math::{DVec3, UNIT_ROUNDOFF_64, Vec3, is_traceable};
use crate::ray::Ray;
use crate::trace::World;

/// The primitives of a world at one time.
pub struct Oracle<'a> {
    triangles: Vec<(Id, Primitive<'a>)>,
    nodes: Vec<Node>,
    shapes: Vec<(Id, Primitive<'a>)>,
}

/// The exact answer for a ray.
#[derive(Clone, Debug, PartialEq)]
pub struct Exact {
    /// What is hit: nothing, one, or several at exactly the same t, by rising id.
    pub nearest: Vec<Id>,
    /// Where, to all digits of f64 but the last few; infinite for a miss.
    pub t: f64,
    /// Whether the ray merely touches all of these: at an edge, a corner or a silhouette.
    pub touches: bool,
    /// Whether the range begins or ends within one f32 of t, so that the rounding of t may decide.
    pub at_range_end: bool,
}

impl Exact {
    const MISS: Self = Self { nearest: Vec::new(), t: f64::INFINITY, touches: false, at_range_end: false };
}

/// Triangles of a leaf.
const LEAF: usize = 2;

struct Node {
    low: [f64; 3],
    high: [f64; 3],
    /// The first triangle of a leaf; of an inner node the left child, which the right one follows.
    first: u32,
    /// Triangles of a leaf; 0 for an inner node.
    count: u32,
}

/// A triangle that may be hit.
struct Candidate {
    index: usize,
    low: f64,
    high: f64,
    /// Whether it is met, away from its edges, and well within the range; and t is known to all digits but the last
    /// few.
    is_sure: bool,
}

impl<'a> Oracle<'a> {
    /// Takes all primitives where they are at `time`.
    pub fn new(world: &'a World, time: f32) -> Self {
        let is_triangle = |primitive: &Primitive<'_>| matches!(primitive.body, Body::Triangle(_));
        let (triangles, shapes): (Vec<_>, Vec<_>) =
            oracle::primitives(world, time).partition(|(_, primitive)| is_triangle(primitive));
        let mut boxed: Vec<Boxed<'a>> = triangles.into_iter().filter_map(Boxed::new).collect();
        let mut nodes = Vec::new();
        if !boxed.is_empty() {
            nodes.push(Node::around(&boxed));
            build(&mut nodes, 0, &mut boxed, 0);
        }
        Self { triangles: boxed.into_iter().map(|boxed| boxed.item).collect(), nodes, shapes }
    }

    /// The nearest hit.
    pub fn closest(&self, ray: &Ray) -> Exact {
        if !ray.is_valid() {
            return Exact::MISS;
        }
        let candidates = self.candidates(ray);
        if let ([only], true) = (&candidates[..], self.shapes.is_empty())
            && only.is_sure
        {
            let (id, _) = self.triangles[only.index];
            let t = only.low + (only.high - only.low) / 2.0;
            return Exact { nearest: vec![id], t, ..Exact::MISS };
        }
        let doubtful = candidates.iter().map(|candidate| &self.triangles[candidate.index]);
        let meet = |(id, primitive): &(Id, Primitive<'_>)| {
            oracle::meet(ray, primitive).filter(|meeting| meeting.in_range).map(|meeting| (*id, meeting))
        };
        let mut all: Vec<(Id, Meeting)> = doubtful.chain(&self.shapes).filter_map(meet).collect();
        all.sort_by(|(a, x), (b, y)| x.t.cmp(&y.t).then(a.cmp(b)));
        let Some((_, first)) = all.first() else { return Exact::MISS };
        let t = first.t.to_f64();
        let ties = all.partition_point(|(_, meeting)| meeting.t <= first.t);
        Exact {
            t,
            touches: all[..ties].iter().all(|(_, meeting)| meeting.touches),
            at_range_end: first.at_range_end,
            nearest: all[..ties].iter().map(|(id, _)| *id).collect(),
        }
    }

    /// Triangles of which each may be the nearest.
    fn candidates(&self, ray: &Ray) -> Vec<Candidate> {
        let (mut found, mut limit) = (Vec::<Candidate>::new(), f64::INFINITY);
        let line = Line::new(ray);
        let (mut waiting, mut next) =
            (Vec::<(f64, u32)>::new(), self.nodes.first().and_then(|root| root.entry(&line)).map(|entry| (entry, 0)));
        while let Some((entry, index)) = next {
            next = None;
            let node = &self.nodes[index as usize];
            if entry > limit {
                // It has been overtaken since it began to wait.
            } else if node.count == 0 {
                let [left, right] =
                    [node.first, node.first + 1].map(|i| self.nodes[i as usize].entry(&line).map(|entry| (entry, i)));
                // The nearer one is looked at first.
                next = match (left, right) {
                    (Some(left), Some(right)) => {
                        let (near, far) = if right.0 < left.0 { (right, left) } else { (left, right) };
                        waiting.push(far);
                        Some(near)
                    }
                    (one, other) => one.or(other),
                };
            } else {
                for index in node.first as usize..(node.first + node.count) as usize {
                    let primitive = &self.triangles[index].1;
                    if passes_by(&line, primitive) {
                        continue;
                    }
                    if let Some(candidate) = meet_roughly(ray, primitive, index) {
                        if candidate.is_sure {
                            limit = limit.min(candidate.high);
                        }
                        found.push(candidate);
                    }
                }
            }
            next = next.or_else(|| waiting.pop());
        }
        found.retain(|candidate| candidate.low <= limit);
        found
    }
}

/// A ray's line, as boxes are met.
struct Line {
    origin: DVec3,
    direction: DVec3,
    /// 1 / direction.
    inverse: DVec3,
}

impl Line {
    fn new(ray: &Ray) -> Self {
        let [origin, direction] = [ray.origin, ray.direction].map(Vec3::as_dvec3);
        Self { origin, direction, inverse: direction.recip() }
    }
}

/// Whether plain f64 tells already that a line passes a triangle by: most that are asked, at a twentieth of the time.
fn passes_by(line: &Line, primitive: &Primitive<'_>) -> bool {
    // Corners, products and sums are rounded by 2^-53 each; in units of the largest components that is 42 at most, and
    // this is 64. The products of three f32 neither overflow nor underflow.
    const BOUND: f64 = 64.0 * UNIT_ROUNDOFF_64;
    let (Body::Triangle(corners), None) = (primitive.body, primitive.to_world) else { return false };
    let [a, b, c] = corners.map(|corner| corner.as_dvec3() - line.origin);
    let side = |p: DVec3, q: DVec3| {
        let edge = line.direction.dot(p.cross(q));
        let is_sure =
            edge.abs() > BOUND * [line.direction, p, q].map(|v| v.abs().max_element()).iter().product::<f64>();
        if is_sure { edge.signum() } else { 0.0 }
    };
    let sides = [side(b, c), side(c, a), side(a, b)];
    sides.contains(&1.0) && sides.contains(&-1.0)
}

/// Where a ray meets a triangle, within bounds; None where it surely does not, or out of its range.
fn meet_roughly(ray: &Ray, primitive: &Primitive<'_>, index: usize) -> Option<Candidate> {
    let Body::Triangle(corners) = primitive.body else { return None };
    let d = vector::<Approx>(ray.direction);
    let [a, b, c] = oracle::relative::<Approx>(ray, corners, primitive.to_world.as_ref());
    let opposite_a = cross(&b, &c);
    let edges = [dot(&d, &opposite_a), det(&d, &c, &a), det(&d, &a, &b)];
    let signs = edges.map(|edge| edge.signum());
    if signs.contains(&Some(1)) && signs.contains(&Some(-1)) {
        return None;
    }
    let (volume, speed) = (dot(&a, &opposite_a), edges[0].add(&edges[1]).add(&edges[2]));
    let slowest = speed.value.abs() - speed.error;
    if slowest.is_nan() || slowest <= 0.0 {
        return Some(Candidate { index, low: f64::NEG_INFINITY, high: f64::INFINITY, is_sure: false });
    }
    let t = volume.value / speed.value;
    // A quotient of intervals; the last terms are for the rounding of these lines.
    let error = (volume.error + t.abs() * speed.error) / slowest * 1.001 + t.abs() * 1e-15 + f64::MIN_POSITIVE;
    let (low, high) = (t - error, t + error);
    if !(low.is_finite() && high.is_finite()) {
        return Some(Candidate { index, low: f64::NEG_INFINITY, high: f64::INFINITY, is_sure: false });
    }
    let rounded = [low as f32, high as f32];
    if rounded[1] < ray.tmin || rounded[0] > ray.tmax {
        return None;
    }
    let is_well_within = rounded[0] > ray.tmin.next_up() && rounded[1] < ray.tmax.next_down();
    let is_inside = signs.iter().all(|sign| sign.is_some_and(|sign| sign != 0));
    let is_sharp = error <= t.abs() * 1e-12;
    Some(Candidate { index, low, high, is_sure: is_well_within && is_inside && is_sharp })
}

/// A triangle and its box.
struct Boxed<'a> {
    item: (Id, Primitive<'a>),
    low: [f64; 3],
    high: [f64; 3],
}

impl<'a> Boxed<'a> {
    fn new(item: (Id, Primitive<'a>)) -> Option<Self> {
        let Body::Triangle(corners) = item.1.body else { return None };
        if !corners.into_iter().all(is_traceable) {
            return None;
        }
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for corner in corners {
            let placed = oracle::place::<Approx>(corner, item.1.to_world.as_ref());
            for (axis, x) in placed.iter().enumerate() {
                low[axis] = low[axis].min((x.value - x.error).next_down());
                high[axis] = high[axis].max((x.value + x.error).next_up());
            }
        }
        Some(Self { item, low, high })
    }
}

impl Node {
    /// A leaf around triangles, which are not in it yet.
    fn around(items: &[Boxed<'_>]) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for item in items {
            for axis in 0..3 {
                low[axis] = low[axis].min(item.low[axis]);
                high[axis] = high[axis].max(item.high[axis]);
            }
        }
        Self { low, high, first: 0, count: 0 }
    }

    /// Where a line enters the box, or earlier; None where it surely passes by.
    fn entry(&self, line: &Line) -> Option<f64> {
        // Three roundings of 2^-53 each; this is thirty times as much.
        const WIDEN: f64 = 1e-14;
        let (mut entry, mut exit) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let (o, inverse) = (line.origin[axis], line.inverse[axis]);
            if line.direction[axis] == 0.0 {
                if o < self.low[axis] || o > self.high[axis] {
                    return None;
                }
                continue;
            }
            let (one, other) = ((self.low[axis] - o) * inverse, (self.high[axis] - o) * inverse);
            let (near, far) = if one < other { (one, other) } else { (other, one) };
            entry = entry.max(near - near.abs() * WIDEN);
            exit = exit.min(far + far.abs() * WIDEN);
        }
        (entry <= exit).then_some(entry)
    }
}

/// Makes `nodes[node]`, the box around `items`, a leaf or an inner node; `first` is the place of the first item among
/// all.
fn build(nodes: &mut Vec<Node>, node: usize, items: &mut [Boxed<'_>], first: usize) {
    if items.len() <= LEAF {
        nodes[node].first = first as u32;
        nodes[node].count = items.len() as u32;
        return;
    }
    let size = |axis: usize| nodes[node].high[axis] - nodes[node].low[axis];
    let axis = (0..3).max_by(|&i, &j| size(i).total_cmp(&size(j))).unwrap_or(0);
    let middle = items.len() / 2;
    let place = |item: &Boxed<'_>| item.low[axis] + item.high[axis];
    items.select_nth_unstable_by(middle, |a, b| place(a).total_cmp(&place(b)));
    let (left, right) = items.split_at_mut(middle);
    let child = nodes.len();
    nodes[node].first = child as u32;
    nodes.extend([Node::around(left), Node::around(right)]);
    build(nodes, child, left, first);
    build(nodes, child + 1, right, first + middle);
}
