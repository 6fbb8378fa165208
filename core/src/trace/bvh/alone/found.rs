//! The triangle that a ray by itself hits, computed: a component a lane, with the bits of
//! [`triangle`](crate::shape::triangle), whose operations these are, in their order.

use super::SingleRay;
use crate::math::{Vec3, triangle_normal};
use crate::ray::Hit;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::{LANES, Lane};
use crate::trace::bvh::hits::found::Found;
use crate::trace::bvh::simd::{Array, Doubles, Simd, Three, Vector};

/// A triangle that is hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleFound {
    /// Where.
    pub hit: Hit,
    /// [`triangle_normal`]: not of unit length.
    pub normal: Vec3,
}

impl TriangleFound {
    /// No triangle: room for one.
    pub const NONE: Self = Self {
        hit: Hit { t: 0.0, u: 0.0, v: 0.0, primitive: u32::MAX, geometry: u32::MAX, instance: u32::MAX },
        normal: Vec3::ZERO,
    };

    #[inline(always)]
    pub(super) fn new(hit: Hit, corners: [Vec3; 3]) -> Self {
        Self { hit, normal: triangle_normal(corners) }
    }
}

impl Bvh {
    /// What was noted for a ray, block and lane, computed.
    #[inline(always)]
    pub(super) fn sure_triangle<S: Simd>(&self, ray: &SingleRay, id: u32) -> TriangleFound {
        let mut scratch = None;
        let triangle = self.fixed.triangles.leaves().lane(id, &mut scratch);
        let corners = [corner::<S>(&triangle, 0), corner::<S>(&triangle, 1), corner::<S>(&triangle, 2)];
        let [p, q] = [corners[1].sub(corners[0]), corners[2].sub(corners[0])];
        let [nx, ny, nz, _] = cross(p, q).to_array();
        let SingleRay { origin: o, tmin, direction: d, time, .. } = ray;
        let (origin, direction) = (S::V4::load(&[o.x, o.y, o.z, *tmin]), S::V4::load(&[d.x, d.y, d.z, *time]));
        let (origin, direction) = (S::D4::widen(origin), S::D4::widen(direction));
        let [pa, pb, pc] = [S::D4::widen(corners[0]), S::D4::widen(corners[1]), S::D4::widen(corners[2])];
        let (a, c) = (pa.sub(origin), pc.sub(origin));
        let (eb, ec) = (pa.sub(pc), pb.sub(pa));
        let normal = wide_cross(eb, ec);
        // The divisor first: from there it takes one step less to where it is wanted.
        let sums = S::D4::sums([
            direction.mul(normal),
            direction.mul(wide_cross(c, eb)),
            direction.mul(wide_cross(a, ec)),
            a.mul(normal),
        ]);
        let inverse = S::D4::splat(1.0).div(sums).first();
        let [_, u, v, t] = sums.mul(inverse).narrow().to_array();
        TriangleFound { hit: self.fixed.triangles.hit(&triangle, t, u, v), normal: Vec3::new(nx, ny, nz) }
    }

    /// What was in doubt, and computed at once.
    #[cold]
    #[inline(never)]
    pub(in crate::trace::bvh) fn computed_triangle(&self, found: &Found) -> Option<TriangleFound> {
        let (hit, id) = found.computed()?;
        let mut scratch = None;
        let lane = self.fixed.triangles.leaves().lane(id, &mut scratch);
        Some(TriangleFound::new(hit, lane.block.triangle(lane.lane % LANES)))
    }
}

/// Corner k.
#[inline(always)]
fn corner<S: Simd>(triangle: &Lane<'_>, k: usize) -> S::V4 {
    S::V4::load(&[triangle.component(0, k), triangle.component(1, k), triangle.component(2, k), 0.0])
}

/// As [`Vec3::cross`], each component the difference of the same two products.
#[inline(always)]
fn cross<V: Vector + Three>(p: V, q: V) -> V {
    p.mul(q.yzx()).sub(p.yzx().mul(q)).yzx()
}

/// The same in f64.
#[inline(always)]
fn wide_cross<D: Doubles>(p: D, q: D) -> D {
    p.mul(q.yzx()).sub(p.yzx().mul(q)).yzx()
}
