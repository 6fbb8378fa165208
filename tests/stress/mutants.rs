//! Tracers that are broken on purpose, in the ways in which tracers break: each of them must be caught.

use twincast::lab::oracle::{self, Body, Id, Primitive, primitives};
use twincast::lab::stress::{Gate, Tally, catalogue};
use twincast::lab::tree::Oracle;
use twincast::math::Vec3;
use twincast::{Hit, Ray, TriangleHit, TriangleMethod, World};

/// What is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mutation {
    /// Nothing: what is left then must be right.
    None,
    /// Woop's edge test with a fused multiply-add, which rounds its two products differently.
    FusedEdges,
    /// Boxes that are met without room for rounding.
    NoPad,
    /// Of equal hits, the last.
    SwappedTies,
    /// A stack of three entries, and what comes on top of them is lost.
    ShortStack,
    /// `tmin < t < tmax`.
    OpenRange,
    /// Triangles are seen from the front alone.
    Culling,
    /// An absolute bound on the determinant.
    AbsoluteEpsilon,
    /// The nearest hit in f32: neighbours fall together.
    SingleDistance,
}

struct Toy {
    mutation: Mutation,
    items: Vec<(Id, [Vec3; 3])>,
    nodes: Vec<Node>,
}

struct Node {
    low: Vec3,
    high: Vec3,
    first: usize,
    /// 0 for an inner node, whose children are `first` and the next.
    count: usize,
}

impl Toy {
    /// None for worlds of anything but triangles in world coordinates.
    fn new(world: &World, mutation: Mutation) -> Option<Self> {
        let mut items = Vec::new();
        for (id, primitive) in primitives(world, 0.0) {
            match (primitive.body, primitive.to_world) {
                (Body::Triangle(corners), None) => {
                    if corners.iter().all(|p| p.abs().max_element() <= 1e18) {
                        items.push((id, corners));
                    }
                }
                _ => return None,
            }
        }
        let mut toy = Self { mutation, items, nodes: Vec::new() };
        toy.nodes.push(toy.node(0, toy.items.len()));
        toy.split(0);
        Some(toy)
    }

    fn node(&self, first: usize, count: usize) -> Node {
        let points = self.items[first..first + count].iter().flat_map(|(_, corners)| *corners);
        let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (low, high) = points.fold(none, |(low, high), p| (low.min(p), high.max(p)));
        Node { low, high, first, count }
    }

    fn split(&mut self, index: usize) {
        let Node { low, high, first, count } = self.nodes[index];
        if count <= 2 {
            return;
        }
        let size = high - low;
        let axis = (0..3).max_by(|&i, &j| size[i].total_cmp(&size[j])).expect("three");
        let middle = |corners: &[Vec3; 3]| corners.iter().map(|p| p[axis]).sum::<f32>();
        self.items[first..first + count].sort_by(|a, b| middle(&a.1).total_cmp(&middle(&b.1)));
        let (half, child) = (count / 2, self.nodes.len());
        let (left, right) = (self.node(first, half), self.node(first + half, count - half));
        self.nodes.extend([left, right]);
        (self.nodes[index].first, self.nodes[index].count) = (child, 0);
        self.split(child);
        self.split(child + 1);
    }

    fn enters(&self, node: &Node, ray: &Ray, limit: f64) -> bool {
        // Twice the two roundings of a difference and a quotient.
        let pad = if self.mutation == Mutation::NoPad { 0.0 } else { 4.0 * f32::EPSILON };
        let (mut entry, mut exit) = (0.0f32, f32::INFINITY);
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis], ray.direction[axis]);
            if d == 0.0 {
                if o < node.low[axis] || o > node.high[axis] {
                    return false;
                }
                continue;
            }
            let planes = [node.low[axis], node.high[axis]];
            let [one, other] = match self.mutation {
                // As it is often written: two products, and their difference.
                Mutation::NoPad => planes.map(|plane| plane * (1.0 / d) - o * (1.0 / d)),
                _ => planes.map(|plane| (plane - o) / d),
            };
            let (near, far) = if one < other { (one, other) } else { (other, one) };
            entry = entry.max(near - near.abs() * pad);
            exit = exit.min(far + far.abs() * pad);
        }
        entry <= exit && f64::from(entry) <= limit
    }

    fn meet(&self, ray: &Ray, corners: [Vec3; 3]) -> Option<TriangleHit> {
        let exact = || TriangleMethod::Exact.intersect(ray, corners);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        match self.mutation {
            Mutation::FusedEdges => fused_woop(ray, corners),
            Mutation::Culling => exact().filter(|_| normal.dot(ray.direction) <= 0.0),
            Mutation::AbsoluteEpsilon => exact().filter(|_| normal.dot(ray.direction).abs() > 1e-7),
            Mutation::OpenRange => exact().filter(|hit| ray.tmin < hit.t as f32 && (hit.t as f32) < ray.tmax),
            _ => exact(),
        }
    }

    fn order_exactly(&self, ray: &Ray, a: Hit, b: Hit) -> std::cmp::Ordering {
        let corners = |hit: Hit| self.items.iter().find(|(id, _)| *id == hit.id()).expect("it was hit").1;
        let (a, b) = (corners(a), corners(b));
        let t = |corners| {
            let triangle = Primitive { body: Body::Triangle(corners), to_world: None };
            oracle::meet(ray, &triangle).map(|meeting| meeting.t)
        };
        if a == b { std::cmp::Ordering::Equal } else { t(a).cmp(&t(b)) }
    }

    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<(f64, Hit)> = None;
        let mut stack = vec![0];
        while let Some(node) = stack.pop().map(|index: usize| &self.nodes[index]) {
            let limit = best.map_or(f64::INFINITY, |(t, _)| t * (1.0 + 1e-6));
            if !self.enters(node, ray, limit) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
                if self.mutation == Mutation::ShortStack {
                    stack.truncate(3);
                }
                continue;
            }
            for &((instance, geometry, primitive), corners) in &self.items[node.first..node.first + node.count] {
                let Some(found) = self.meet(ray, corners) else { continue };
                let single = self.mutation == Mutation::SingleDistance;
                let t = if single { f64::from(found.t as f32) } else { found.t };
                let hit = Hit { t: t as f32, u: found.u as f32, v: found.v as f32, primitive, geometry, instance };
                let order = |nearest: f64, other: Hit| match (t - nearest).abs() < 1e-9 * nearest.abs() && !single {
                    // Closer than f64 can order; that this is done without rounding is not what is broken here.
                    true => self.order_exactly(ray, hit, other),
                    false => t.total_cmp(&nearest),
                };
                let is_better = best.is_none_or(|(nearest, other)| match order(nearest, other) {
                    std::cmp::Ordering::Less => true,
                    std::cmp::Ordering::Greater => false,
                    _ if self.mutation == Mutation::SwappedTies => hit.id() > other.id(),
                    _ => hit.id() < other.id(),
                });
                if is_better {
                    best = Some((t, hit));
                }
            }
        }
        best.map(|(_, hit)| hit)
    }
}

/// Woop, Benthin and Wald's test in f32, its edges by a fused multiply-add.
fn fused_woop(ray: &Ray, corners: [Vec3; 3]) -> Option<TriangleHit> {
    if !ray.is_valid() {
        return None;
    }
    let d = ray.direction;
    let size = d.abs();
    let z = (0..3).max_by(|&i, &j| size[i].total_cmp(&size[j])).expect("three");
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let [a, b, c] = corners.map(|p| {
        let p = p - ray.origin;
        [p[x] - d[x] / d[z] * p[z], p[y] - d[y] / d[z] * p[z], p[z] / d[z]]
    });
    let edge = |p: [f32; 3], q: [f32; 3]| p[0].mul_add(q[1], -(p[1] * q[0]));
    let weights = [edge(c, b), edge(a, c), edge(b, a)];
    let sum: f32 = weights.iter().sum();
    if weights.iter().any(|&w| w < 0.0) && weights.iter().any(|&w| w > 0.0) || sum == 0.0 {
        return None;
    }
    let t = (weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]) / sum;
    let is_in_range = ray.tmin <= t && t <= ray.tmax && t.is_finite();
    let [u, v] = [weights[1] / sum, weights[2] / sum].map(f64::from);
    is_in_range.then(|| TriangleHit { t: t.into(), u, v })
}

/// The cases that a mutation fails, held to a gate.
fn caught(mutation: Mutation, gate: Gate) -> Vec<&'static str> {
    let mut names = Vec::new();
    for case in catalogue() {
        let fails = case.probes(600, 9).iter().any(|probe| {
            let Some(toy) = Toy::new(&probe.world, mutation) else { return false };
            let oracle = Oracle::new(&probe.world, 0.0);
            let exact: Vec<_> = probe.rays.iter().map(|ray| oracle.closest(ray)).collect();
            let found: Vec<_> = probe.rays.iter().map(|ray| toy.closest(ray)).collect();
            let occluded: Vec<_> = found.iter().map(Option::is_some).collect();
            !Tally::default().add(gate, &probe.rays, &exact, &found, &occluded).is_empty()
        });
        if fails {
            names.push(case.name);
        }
    }
    names
}

#[test]
fn what_is_not_broken_is_right() {
    assert_eq!(caught(Mutation::None, Gate::Exact), Vec::<&str>::new());
}

/// Each by a case that is about it.
#[test]
fn what_is_broken_is_caught() {
    use Mutation::*;
    for (mutation, gate, by) in [
        (FusedEdges, Gate::Hits, "edge-leak"),
        (NoPad, Gate::Hits, "flat-boxes"),
        (SwappedTies, Gate::Exact, "coincident"),
        (ShortStack, Gate::Hits, "soups"),
        (OpenRange, Gate::Hits, "t-range"),
        (Culling, Gate::Hits, "edge-leak"),
        (AbsoluteEpsilon, Gate::Hits, "tiny"),
        (SingleDistance, Gate::Exact, "near-coplanar"),
    ] {
        let names = caught(mutation, gate);
        assert!(names.contains(&by), "{mutation:?} is caught by {names:?}");
    }
}
