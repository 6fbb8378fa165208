//! Discs around pieces of a surface, by which a tree knows better than by its boxes how far a point is from them.
//!
//! The box around a piece of a surface that is tilted is as thick as the piece is wide. A point at the distance d from
//! the surface is in reach of the boxes of all pieces within sqrt(2 d w) of where it is nearest, w being their width: a
//! hundred blocks on a mesh of 100,000 triangles. A disc, a cylinder whose axis is the normal, is as thin as the piece
//! is flat. Both together leave a handful.
//!
//! Only points ask for discs, so they are made when the first does, from the tree, eight a node and 256 bytes, and not
//! kept in files. Oriented boxes (Gottschalk, Lin, Manocha 1996, *OBBTree*), the alternative, take twice the memory and
//! arithmetic.
//!
//! Discs are made in f64 around what f32 keeps of their centres and normals, and rounded up. With u = 2^-24 and q the
//! vector from a centre to a point, height and distance from the axis are off by less than 12 u |q|, the square of the
//! latter by less than 40 u |q|^2. Corners that are rounded are off by u times their distance from the point in each
//! component, besides what does not grow with that; so by 1.8 u (|q| + height + radius) at most, of which the last two
//! are in the disc.

use crate::math::{Aabb, DVec3, UNIT_ROUNDOFF, Vec3};
use crate::trace::bvh::levels::triangles::TriangleTree;
use crate::trace::bvh::node::{Child, Node, WIDTH};
use crate::trace::bvh::simd::{Array, Portable, Simd, Vector};

/// Of each node of a tree, in their order, the discs around its children.
pub(in crate::trace) struct Discs(Vec<Eight>);

/// Component by component.
#[derive(Clone, Copy)]
struct Eight {
    centre: [[f32; WIDTH]; 3],
    /// Of about unit length.
    normal: [[f32; WIDTH]; 3],
    /// Along the normal, to either side.
    height: [f32; WIDTH],
    radius: [f32; WIDTH],
}

/// A disc around some triangles, or around several of these.
#[derive(Clone, Copy)]
struct Disc {
    centre: DVec3,
    normal: DVec3,
    height: f64,
    radius: f64,
    /// The sum of the triangles' normals, each twice as long as the triangle is large.
    facing: DVec3,
}

/// Of so many corners a disc is made around these; of more, around the discs of its children, by which it comes to be
/// wider than it need be. With all discs but leaves' made so, a distance takes a fifteenth longer.
const MAX_CORNERS: usize = 4096;

impl Discs {
    pub(super) fn new(triangles: &TriangleTree) -> Self {
        Self::around(triangles, MAX_CORNERS)
    }

    /// With discs around as many corners.
    fn around(triangles: &TriangleTree, most_corners: usize) -> Self {
        let tree = triangles.tree();
        let none =
            Eight { centre: [[0.0; WIDTH]; 3], normal: [[0.0; WIDTH]; 3], height: [0.0; WIDTH], radius: [0.0; WIDTH] };
        let mut maker = Maker { triangles, discs: vec![none; tree.nodes().len()], most_corners, corners: Vec::new() };
        if !tree.is_empty() {
            maker.fill(Child::ROOT);
        }
        Self(maker.discs)
    }

    /// Where in memory those of a node are; of another child, anywhere.
    #[inline(always)]
    pub(super) fn address<S: Simd>(&self, child: Child) -> *const u8 {
        S::address(&self.0, if child.is_leaf() { 0 } else { child.node() })
    }

    /// The squares of distances that no point of a child is nearer than, if the point and all corners together are off
    /// by at most `pad` in each component, and corners by u times their distance from the point besides.
    #[inline(always)]
    pub(super) fn near<S: Simd>(&self, node: Child, point: Vec3, pad: f32) -> S::V8 {
        let discs = &self.0[node.node() as usize];
        let zero = S::V8::splat(0.0);
        let (mut along, mut square, mut length) = (zero, zero, zero);
        for axis in 0..3 {
            let q = S::V8::splat(point[axis]).sub(S::V8::load(&discs.centre[axis]));
            along = q.mul_add(S::V8::load(&discs.normal[axis]), along);
            square = q.mul_add(q, square);
            length = length.add(q.abs());
        }
        // `length` is more than |q|, and 1.75 more than the length of three components of 1.
        let across = square.mul(S::V8::splat(1.0 - 40.0 * UNIT_ROUNDOFF)).sub(along.mul(along)).max(zero).sqrt();
        let off = length.mul_add(S::V8::splat(14.0 * UNIT_ROUNDOFF), S::V8::splat(1.75 * pad));
        let above = along.abs().sub(S::V8::load(&discs.height)).sub(off).max(zero);
        let beside = across.sub(S::V8::load(&discs.radius)).sub(off).max(zero);
        let near = above.mul_add(above, beside.mul(beside)).mul(S::V8::splat(1.0 - 8.0 * UNIT_ROUNDOFF));
        near.min(S::V8::splat(f32::MAX))
    }
}

/// Discs that are being made.
struct Maker<'a> {
    triangles: &'a TriangleTree,
    discs: Vec<Eight>,
    most_corners: usize,
    /// Of what has been gone through, if it is part of a disc yet to be made.
    corners: Vec<DVec3>,
}

impl Maker<'_> {
    /// Makes the discs of a node's children, and one around these; and whether the corners of all triangles below have
    /// been added.
    fn fill(&mut self, parent: Child) -> (Disc, bool) {
        let node: &Node = self.triangles.tree().node(parent);
        let first = self.corners.len();
        let (mut all, mut are_there) = (Vec::with_capacity(WIDTH), true);
        for (slot, child) in node.children() {
            let (disc, is_there) = if child.is_leaf() { (self.leaf(child), true) } else { self.fill(child) };
            self.discs[parent.node() as usize].put(slot, &disc);
            are_there &= is_there;
            all.push(disc);
        }
        are_there &= self.corners.len() - first <= self.most_corners;
        let facing = all.iter().map(|disc| disc.facing).sum();
        if are_there {
            return (Disc::around_corners(node.bounds(), facing, &self.corners[first..]), true);
        }
        self.corners.truncate(first);
        (Disc::around(node.bounds(), facing, &all), false)
    }

    /// The disc around a leaf, whose corners are added.
    fn leaf(&mut self, leaf: Child) -> Disc {
        let (first, mut scratch) = (self.corners.len(), None);
        let mut bounds = Aabb::EMPTY;
        let mut facing = DVec3::ZERO;
        for index in leaf.blocks() {
            let block = self.triangles.block::<Portable>(index, &mut scratch);
            for lane in block.used() {
                let triangle = block.triangle(lane);
                bounds = triangle.iter().fold(bounds, |bounds, &corner| bounds.include(corner));
                let [a, b, c] = triangle.map(|corner| corner.as_dvec3());
                facing += (b - a).cross(c - a);
                self.corners.extend([a, b, c]);
            }
        }
        Disc::around_corners(bounds, facing, &self.corners[first..])
    }
}

impl Eight {
    fn put(&mut self, slot: usize, disc: &Disc) {
        for axis in 0..3 {
            // f32 already.
            self.centre[axis][slot] = disc.centre[axis] as f32;
            self.normal[axis][slot] = disc.normal[axis] as f32;
        }
        let off = 1.8 * f64::from(UNIT_ROUNDOFF) * (disc.height + disc.radius);
        (self.height[slot], self.radius[slot]) = (rounded_up(disc.height + off), rounded_up(disc.radius + off));
    }
}

/// No less, for what f64 has rounded, too.
fn rounded_up(x: f64) -> f32 {
    ((x * (1.0 + 1e-9)) as f32).next_up()
}

fn of_f32(v: DVec3) -> DVec3 {
    v.as_vec3().as_dvec3()
}

/// How far a vector leads along and across a unit vector.
fn parts(v: DVec3, unit: DVec3) -> (f64, f64) {
    let along = v.dot(unit);
    (along, (v - unit * along).length())
}

impl Disc {
    /// Around corners in a box, of triangles that face there.
    fn around_corners(bounds: Aabb, facing: DVec3, corners: &[DVec3]) -> Self {
        let mut disc = Self::empty(bounds, facing);
        // f32 keeps the direction of a normal, not its length.
        let unit = disc.normal.normalize();
        let along = corners.iter().map(|&corner| parts(corner - disc.centre, unit).0);
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (x.min(low), x.max(high)));
        disc.shift(low, high);
        for &corner in corners {
            let (along, across) = parts(corner - disc.centre, unit);
            disc.height = disc.height.max(along.abs());
            disc.radius = disc.radius.max(across);
        }
        disc.within(bounds)
    }

    /// Around discs that are in a box together.
    fn around(bounds: Aabb, facing: DVec3, discs: &[Self]) -> Self {
        let mut all = Self::empty(bounds, facing);
        let unit = all.normal.normalize();
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for disc in discs {
            let (along, across) = parts(disc.centre - all.centre, unit);
            let cosine = disc.normal.normalize().dot(unit).abs().min(1.0);
            let sine = (1.0 - cosine * cosine).sqrt() + 1e-7;
            let height = disc.height * cosine + disc.radius * sine;
            (low, high) = (low.min(along - height), high.max(along + height));
            all.radius = all.radius.max(across + disc.height * sine + disc.radius);
        }
        // The middle of a box need not be near the surface.
        all.height = all.shift(low, high);
        all.within(bounds)
    }

    /// No larger than to the farthest corner of a box that holds all that counts: of a triangle that was cut, another
    /// box holds the rest.
    fn within(self, bounds: Aabb) -> Self {
        let farthest = (bounds.max.as_dvec3() - self.centre).max(self.centre - bounds.min.as_dvec3()).length();
        Self { height: self.height.min(farthest), radius: self.radius.min(farthest), ..self }
    }

    /// Moves the centre along the normal to where there is as much on one side as on the other, of what reaches from
    /// `low` to `high`; and how much that is, roundings included.
    fn shift(&mut self, low: f64, high: f64) -> f64 {
        let (unit, middle) = (self.normal.normalize(), 0.5 * (low + high));
        let wanted = self.centre + unit * middle;
        self.centre = of_f32(wanted);
        let off = (self.centre - wanted).length();
        self.radius += off;
        0.5 * (high - low) + off
    }

    fn empty(bounds: Aabb, facing: DVec3) -> Self {
        let normal = of_f32(facing.normalize_or(DVec3::Z));
        let centre = of_f32(0.5 * (bounds.min.as_dvec3() + bounds.max.as_dvec3()));
        Self { centre, normal, height: 0.0, radius: 0.0, facing }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Geometry, Material, Mesh, Scene};
    use crate::shape::closest::closest_point;
    use crate::trace::World;
    use crate::trace::bvh::Bvh;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::Portable;

    fn built(triangles: &[[Vec3; 3]]) -> Bvh {
        let count = triangles.len() as u32;
        let mesh = Mesh::new(triangles.concat(), (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect());
        let scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]);
        Bvh::build(&World::new(&scene).expect("a mesh"))
    }

    fn below(triangles: &TriangleTree, child: Child, all: &mut Vec<[DVec3; 3]>) {
        if !child.is_leaf() {
            let node = triangles.tree().node(child);
            return node.children().for_each(|(_, child)| below(triangles, child, all));
        }
        for index in child.blocks() {
            let mut scratch = None;
            let block = triangles.block::<Portable>(index, &mut scratch);
            all.extend(block.used().map(|lane| block.triangle(lane).map(|corner| corner.as_dvec3())));
        }
    }

    /// Of every child of every node what the disc says and the distance, squared.
    fn compare(bvh: &Bvh, most_corners: usize, points: &[Vec3], mut with: impl FnMut(f64, f64)) {
        let triangles = &bvh.fixed.triangles;
        let discs = Discs::around(triangles, most_corners);
        for (i, node) in triangles.tree().nodes().iter().enumerate() {
            for (slot, child) in node.children() {
                let mut all = Vec::new();
                below(triangles, child, &mut all);
                for &point in points {
                    let near = discs.near::<Portable>(Child::inner(i as u32), point, 0.0).to_array()[slot];
                    let squares = all.iter().map(|&corners| closest_point(point.as_dvec3(), corners).distance_squared);
                    with(f64::from(near), squares.fold(f64::INFINITY, f64::min));
                }
            }
        }
    }

    /// The corners of each node that has a disc.
    fn inner(bvh: &Bvh) -> Vec<usize> {
        let triangles = &bvh.fixed.triangles;
        let children = triangles.tree().nodes().iter().flat_map(|node| node.children());
        let corners = |child| {
            let mut all = Vec::new();
            below(triangles, child, &mut all);
            3 * all.len()
        };
        children.filter(|(_, child)| !child.is_leaf()).map(|(_, child)| corners(child)).collect()
    }

    /// Of a ball, those around corners are less wide.
    #[test]
    fn discs_around_corners_are_smaller() {
        let at = |i: usize, k: usize| {
            let (around, up) = (i as f32 * 0.1, (k as f32 - 15.0) * 0.1);
            Vec3::new(up.cos() * around.cos(), up.cos() * around.sin(), up.sin())
        };
        let faces = (0..63).flat_map(|i| (0..30).map(move |k| (i, k)));
        let quad = |(i, k)| [[at(i, k), at(i + 1, k), at(i, k + 1)], [at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)]];
        let bvh = built(&faces.flat_map(quad).collect::<Vec<_>>());
        let triangles = &bvh.fixed.triangles;
        let [around_corners, around_discs] = [MAX_CORNERS, 0].map(|most| Discs::around(triangles, most));
        let (mut smaller, mut sums) = (0, [0.0, 0.0]);
        for (i, node) in triangles.tree().nodes().iter().enumerate() {
            for (slot, _) in node.children().filter(|(_, child)| !child.is_leaf()) {
                let [a, b] = [&around_corners, &around_discs].map(|discs| f64::from(discs.0[i].radius[slot]));
                (sums[0], sums[1]) = (sums[0] + a, sums[1] + b);
                smaller += usize::from(a < b);
            }
        }
        assert!(smaller > 5 && sums[0] < 0.95 * sums[1], "{smaller} smaller, {sums:?}");
    }

    #[test]
    fn no_disc_is_farther_than_what_it_holds() {
        let mut random = Random::new(3);
        for (size, thin, away) in [(0.2, 1.0, 0.0), (0.05, 1e-6, 0.0), (1.0, 0.0, 0.0), (1e-3, 1e-3, 40.0)] {
            let mut triangle = || {
                let a = random.vec3() + Vec3::splat(away);
                let edge = random.vec3() * size;
                [a, a + edge, a + edge * 0.5 + random.vec3() * (size * thin)]
            };
            let triangles: Vec<_> = (0..1500).map(|_| triangle()).collect();
            let mut points: Vec<Vec3> = (0..20).map(|_| random.vec3() * 3.0 + Vec3::splat(away)).collect();
            points.extend(triangles.iter().take(20).flatten());
            // Each around corners, some around corners and others around discs, all but leaves' around discs.
            let bvh = built(&triangles);
            let inner = inner(&bvh);
            assert!(
                inner.iter().any(|&corners| corners <= 300) && inner.iter().any(|&corners| corners > 300),
                "{inner:?}"
            );
            for most in [usize::MAX, 300, 0] {
                compare(&bvh, most, &points, |near, square| assert!(near <= square, "{near} > {square} of {most}"));
            }
        }
    }

    #[test]
    fn a_disc_is_as_thin_as_a_plane_is() {
        // A plane that no axis is along or across.
        let (across, along) = (Vec3::new(1.0, 0.5, 0.3), Vec3::new(-0.4, 1.0, 0.7));
        let at = |i: usize, k: usize| across * i as f32 * 0.1 + along * k as f32 * 0.1;
        let triangles: Vec<_> = (0..20)
            .flat_map(|i| {
                (0..20).flat_map(move |k| {
                    [[at(i, k), at(i + 1, k), at(i, k + 1)], [at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)]]
                })
            })
            .collect();
        let normal = across.cross(along).normalize();
        let bvh = built(&triangles);
        for height in [0.1, 1.0, 10.0] {
            for most in [MAX_CORNERS, 0] {
                compare(&bvh, most, &[at(10, 10) + normal * height], |near, square| {
                    // A box that the point is in says nothing.
                    assert!(near <= square && near >= 0.999 * f64::from(height * height), "{near}, {square}");
                });
            }
        }
    }
}
