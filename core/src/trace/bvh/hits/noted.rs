//! Hits that are noted, four at a time: t, u and v of triangles that rays hit for sure, among the fixed ones or in
//! placed objects.

use super::quad::{Quad, QuadHits, Seen};
use crate::math::Vec3;
use crate::ray::{Hit, Ray};
use crate::trace::bvh::block::Lane;
use crate::trace::bvh::levels::placements::FIXED;
use crate::trace::bvh::levels::triangles::TriangleTree;
use crate::trace::bvh::simd::{Array, Doubles, Simd};
use crate::trace::bvh::{Bvh, PartId};
use crate::trace::leaf::InstanceTransform;
use crate::trace::nearest::Nearest;

/// Four rays, component by component.
pub(in crate::trace::bvh) struct Rays<D> {
    pub origin: [D; 3],
    pub direction: [D; 3],
}

impl<D: Doubles> Rays<D> {
    #[inline(always)]
    pub fn new<S: Simd<D4 = D>>([a, b, c, d]: [&Ray; 4]) -> Self {
        Self {
            origin: columns::<S>([a.origin, b.origin, c.origin, d.origin]),
            direction: columns::<S>([a.direction, b.direction, c.direction, d.direction]),
        }
    }
}

#[inline(always)]
fn columns<S: Simd>([a, b, c, d]: [Vec3; 4]) -> [S::D4; 3] {
    [widen::<S>(&[a.x, b.x, c.x, d.x]), widen::<S>(&[a.y, b.y, c.y, d.y]), widen::<S>(&[a.z, b.z, c.z, d.z])]
}

/// One point for all four.
#[inline(always)]
pub(in crate::trace::bvh) fn splat<S: Simd>(p: Vec3) -> [S::D4; 3] {
    [S::D4::splat(p.x.into()), S::D4::splat(p.y.into()), S::D4::splat(p.z.into())]
}

#[inline(always)]
pub(in crate::trace::bvh) fn widen<S: Simd>(values: &[f32; 4]) -> S::D4 {
    S::D4::widen(S::V4::load(values))
}

/// Hits of four rays, number by number.
pub(in crate::trace::bvh) struct FourHits {
    /// t, u and v.
    pub quad: QuadHits,
    primitive: [u32; 4],
    geometry: [u32; 4],
    instance: [u32; 4],
}

impl FourHits {
    /// That of ray `i`.
    #[inline(always)]
    pub fn hit(&self, i: usize) -> Hit {
        Hit {
            t: self.quad.t32[i],
            u: self.quad.u[i],
            v: self.quad.v[i],
            primitive: self.primitive[i],
            geometry: self.geometry[i],
            instance: self.instance[i],
        }
    }
}

impl TriangleTree {
    /// The hits of four rays, each of which hits a triangle for sure; `ids` as in [`Self::offer_one`].
    ///
    /// The caller knows that f64 is precise enough for what [`triangle::intersect`](crate::shape::triangle::intersect)
    /// would answer.
    #[inline(always)]
    pub fn hits<S: Simd>(&self, rays: &Rays<S::D4>, ids: [u32; 4]) -> FourHits {
        let (mut a, mut b, mut c, mut d) = (None, None, None, None);
        let leaves = self.leaves();
        let triangles = [
            leaves.lane(ids[0], &mut a),
            leaves.lane(ids[1], &mut b),
            leaves.lane(ids[2], &mut c),
            leaves.lane(ids[3], &mut d),
        ];
        let corners = [corner::<S>(&triangles, 0), corner::<S>(&triangles, 1), corner::<S>(&triangles, 2)];
        let quad = Quad::new(rays.origin, rays.direction, corners).hits();
        let (mut primitive, mut geometry, mut instance) = ([0; 4], [0; 4], [0; 4]);
        for i in 0..4 {
            let (part, number) = triangles[i].number();
            let part = self.part(part);
            (primitive[i], geometry[i], instance[i]) = (number, part.geometry, part.instance);
        }
        FourHits { quad, primitive, geometry, instance }
    }

    /// A triangle that several rays hit for sure; `id` is as in [`Self::offer_one`].
    #[inline(always)]
    pub fn shared<S: Simd>(&self, id: u32) -> Shared<[[S::D4; 3]; 3]> {
        let mut scratch = None;
        let triangle = self.leaves().lane(id, &mut scratch);
        let [a, b, c] = triangle.block.triangle(triangle.lane);
        let (part, primitive) = triangle.number();
        let triangle = [splat::<S>(a), splat::<S>(b), splat::<S>(c)];
        Shared { id, triangle, primitive, part: self.part(part) }
    }
}

/// A triangle that is hit by several rays: what they have in common is looked up once, and computed once. It is known
/// by its corners, or as seen from one origin.
pub(in crate::trace::bvh) struct Shared<T> {
    /// The triangle's.
    pub id: u32,
    triangle: T,
    primitive: u32,
    part: PartId,
}

impl<D: Doubles> Shared<[[D; 3]; 3]> {
    /// For rays that all start there.
    #[inline(always)]
    pub fn from(self, origin: [D; 3]) -> Shared<Seen<D>> {
        let Self { id, triangle, primitive, part } = self;
        Shared { id, triangle: Seen::new(origin, triangle), primitive, part }
    }

    /// As [`TriangleTree::hits`].
    #[inline(always)]
    pub fn hits(&self, rays: &Rays<D>) -> FourHits {
        self.hits_of(&Quad::new(rays.origin, rays.direction, self.triangle))
    }
}

impl<D: Doubles> Shared<Seen<D>> {
    /// As [`TriangleTree::hits`].
    #[inline(always)]
    pub fn along(&self, direction: [D; 3]) -> FourHits {
        self.hits_of(&self.triangle.along(direction))
    }
}

impl<T> Shared<T> {
    #[inline(always)]
    fn hits_of<D: Doubles>(&self, quad: &Quad<D>) -> FourHits {
        FourHits {
            quad: quad.hits(),
            primitive: [self.primitive; 4],
            geometry: [self.part.geometry; 4],
            instance: [self.part.instance; 4],
        }
    }
}

impl Bvh {
    /// The triangles at a place, and how rays come to them.
    #[inline(always)]
    pub(in crate::trace::bvh) fn triangles_at(&self, place: u32) -> (&TriangleTree, Option<InstanceTransform<'_>>) {
        if place == FIXED {
            return (&self.fixed.triangles, None);
        }
        let place = self.placements.at(place);
        (&self.objects[place.object as usize].triangles, Some(place.through()))
    }

    /// t in f64 and hits as of [`TriangleTree::hits`], for triangles of placed objects; and where f64 is not precise
    /// enough, exactly. Only lanes of the mask matter.
    #[inline(always)]
    pub(in crate::trace::bvh) fn placed_hits<S: Simd>(
        &self,
        each: [&Ray; 4],
        lanes: u32,
        rays: &Rays<S::D4>,
        ids: [u32; 4],
        places: [u32; 4],
    ) -> ([f64; 4], [Option<Hit>; 4]) {
        let [(a, la), (b, lb), (c, lc), (d, ld)] =
            [self.placed(places[0]), self.placed(places[1]), self.placed(places[2]), self.placed(places[3])];
        let (mut ba, mut bb, mut bc, mut bd) = (None, None, None, None);
        let triangles = [
            a.leaves().lane(ids[0], &mut ba),
            b.leaves().lane(ids[1], &mut bb),
            c.leaves().lane(ids[2], &mut bc),
            d.leaves().lane(ids[3], &mut bd),
        ];
        let columns = gather([la.columns, lb.columns, lc.columns, ld.columns]);
        let corners = [
            world_corner::<S>(&triangles, 0, &columns),
            world_corner::<S>(&triangles, 1, &columns),
            world_corner::<S>(&triangles, 2, &columns),
        ];
        let quad = Quad::new(rays.origin, rays.direction, corners);
        let slack = S::D4::load(&[la.slack, lb.slack, lc.slack, ld.slack]);
        let certain = quad.is_certain(rays.origin, rays.direction, corners, slack);
        let QuadHits { mut t, t32, u, v } = quad.hits();
        let mut hits = [None; 4];
        let (trees, instances) = ([a, b, c, d], [la.instance, lb.instance, lc.instance, ld.instance]);
        for i in (0..4).filter(|i| lanes >> i & 1 != 0) {
            if certain >> i & 1 != 0 {
                hits[i] = Some(Hit { instance: instances[i], ..trees[i].hit(&triangles[i], t32[i], u[i], v[i]) });
            } else {
                let nearest = self.noted_hit(places[i], ids[i], each[i]);
                (t[i], hits[i]) = (nearest.t(), nearest.hit());
            }
        }
        (t, hits)
    }

    #[inline(always)]
    fn placed(&self, place: u32) -> (&TriangleTree, Location) {
        let place = self.placements.at(place);
        let m = &place.to_world;
        let (x, y, z, t) = (m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation);
        let columns = [x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z, t.x, t.y, t.z];
        let location = Location { columns, slack: place.slack, instance: place.instance };
        (&self.objects[place.object as usize].triangles, location)
    }

    /// What is noted for one ray, by [`triangle::intersect`](crate::shape::triangle::intersect).
    #[cold]
    #[inline(never)]
    pub(in crate::trace::bvh) fn noted_hit(&self, place: u32, id: u32, ray: &Ray) -> Nearest {
        let (tree, through) = self.triangles_at(place);
        let mut nearest = Nearest::new(ray);
        tree.offer_one(id, ray, through, &mut nearest);
        debug_assert!(nearest.hit().is_some(), "what is noted is hit without doubt");
        nearest
    }
}

/// What the corners of a placed triangle are computed from.
struct Location {
    /// Of the transform to the world, column by column; then the translation.
    columns: [f32; 12],
    slack: f64,
    instance: u32,
}

/// Component by component.
#[inline(always)]
fn gather<const N: usize>([a, b, c, d]: [[f32; N]; 4]) -> [[f32; 4]; N] {
    let mut rows = [[0.0; 4]; N];
    for (i, row) in rows.iter_mut().enumerate() {
        *row = [a[i], b[i], c[i], d[i]];
    }
    rows
}

/// Corner k of four triangles.
#[inline(always)]
fn corner<S: Simd>(triangles: &[Lane<'_>; 4], k: usize) -> [S::D4; 3] {
    [row::<S>(triangles, 0, k), row::<S>(triangles, 1, k), row::<S>(triangles, 2, k)]
}

#[inline(always)]
fn row<S: Simd>([a, b, c, d]: &[Lane<'_>; 4], axis: usize, k: usize) -> S::D4 {
    widen::<S>(&[a.component(axis, k), b.component(axis, k), c.component(axis, k), d.component(axis, k)])
}

/// The same in the world, with the bits of [`DAffine3::transform_point3`](crate::math::DAffine3::transform_point3).
#[inline(always)]
fn world_corner<S: Simd>(triangles: &[Lane<'_>; 4], k: usize, columns: &[[f32; 4]; 12]) -> [S::D4; 3] {
    let p = corner::<S>(triangles, k);
    [component::<S>(columns, 0, p), component::<S>(columns, 1, p), component::<S>(columns, 2, p)]
}

#[inline(always)]
fn component<S: Simd>(columns: &[[f32; 4]; 12], i: usize, [x, y, z]: [S::D4; 3]) -> S::D4 {
    let [a, b, c] = [widen::<S>(&columns[i]), widen::<S>(&columns[3 + i]), widen::<S>(&columns[6 + i])];
    a.mul(x).add(b.mul(y)).add(c.mul(z)).add(widen::<S>(&columns[9 + i]))
}
