//! t, u and v of four rays, each of which hits a triangle of its own for sure.
//!
//! The same operations in the same order as [`triangle::intersect`], so the same bits; none is fused.

use crate::shape::triangle;
use crate::trace::bvh::simd::doubles::{cross, dot, minus, size};
use crate::trace::bvh::simd::{Array, Doubles};

/// Four triangles, or one for all four, as seen from the origins of four rays: what a ray's direction makes the numbers
/// of a hit with.
pub(in crate::trace::bvh) struct Seen<D> {
    /// Opposite to the second and third corner.
    sides: [[D; 3]; 2],
    normal: [D; 3],
    height: D,
}

impl<D: Doubles> Seen<D> {
    /// Of the corners in the world.
    #[inline(always)]
    pub fn new(origin: [D; 3], [pa, pb, pc]: [[D; 3]; 3]) -> Self {
        let (a, c) = (minus(pa, origin), minus(pc, origin));
        let (eb, ec) = (minus(pa, pc), minus(pb, pa));
        let normal = cross(eb, ec);
        Self { sides: [cross(c, eb), cross(a, ec)], normal, height: dot(a, normal) }
    }

    #[inline(always)]
    pub fn along(&self, direction: [D; 3]) -> Quad<D> {
        let [b, c] = self.sides;
        Quad {
            volumes: [dot(direction, b), dot(direction, c)],
            slope: dot(direction, self.normal),
            height: self.height,
        }
    }
}

/// The same along the rays' directions: numbers as in [`triangle`](crate::shape::triangle).
pub(in crate::trace::bvh) struct Quad<D> {
    /// The volumes opposite to the second and third corner.
    volumes: [D; 2],
    slope: D,
    height: D,
}

/// t, u and v of four hits.
pub(in crate::trace::bvh) struct QuadHits {
    pub t: [f64; 4],
    pub t32: [f32; 4],
    pub u: [f32; 4],
    pub v: [f32; 4],
}

impl<D: Doubles> Quad<D> {
    /// Of the corners in the world.
    #[inline(always)]
    pub fn new(origin: [D; 3], direction: [D; 3], corners: [[D; 3]; 3]) -> Self {
        Seen::new(origin, corners).along(direction)
    }

    /// A bit for each triangle, of those that are hit for sure and whose corners were rounded in f64, for which
    /// [`triangle::intersect`] decides by these numbers, without exact arithmetic. `slack` is at least what the errors
    /// of corners are relative to.
    ///
    /// Its bounds, with largest components in place of all: let s be that of the edges, L of the corners relative to
    /// the origin, d of the direction, k the slack, R its unit of rounding. A vector product of two differences errs by
    /// no more than R C in each component, C = 2 (x (y + y') + x' y + R (x + x') (y + y')), sizes being x and y and
    /// slacks x' and y'. For L and s these are k and 2 k, for s and s 2 k both.
    #[inline(always)]
    pub fn is_certain(&self, origin: [D; 3], direction: [D; 3], [pa, pb, pc]: [[D; 3]; 3], slack: D) -> u32 {
        let splat = D::splat;
        // A little more than the unit, since this is rounded as well.
        let unit = splat(1.01 * triangle::ROUNDING);
        let (two, three) = (splat(2.0), splat(3.0));
        let far = size(minus(pa, origin)).max(size(minus(pb, origin))).max(size(minus(pc, origin)));
        let long = size(minus(pc, pb)).max(size(minus(pa, pc))).max(size(minus(pb, pa)));
        let steep = size(direction).mul(three);
        let loose = slack.add(slack);
        let edge = long.add(loose);
        let error = far.mul(edge).add(slack.mul(long)).add(unit.mul(far.add(slack)).mul(edge)).mul(two);
        let bound = unit.mul(steep).mul(error);
        let w = dot(direction, cross(minus(pb, origin), minus(pc, pb)));
        let least = self.volumes[0].abs().min(self.volumes[1].abs()).min(w.abs());
        let normal_error = long.mul(edge).add(loose.mul(long)).add(unit.mul(edge).mul(edge)).mul(two);
        let normal = long.mul(long).mul(two);
        let height_error =
            far.mul(three).mul(normal_error).add(slack.mul(three).mul(normal.add(unit.mul(normal_error))));
        let t = self.height.div(self.slope).abs();
        let t_error = unit.mul(height_error.add(steep.mul(normal_error).mul(t)));
        bound.less(least) & t_error.less(self.height.abs().mul(splat(triangle::T_PRECISION)))
    }

    #[inline(always)]
    pub fn hits(&self) -> QuadHits {
        let inverse = D::splat(1.0).div(self.slope);
        let t = self.height.mul(inverse);
        let (u, v) = (self.volumes[0].mul(inverse), self.volumes[1].mul(inverse));
        QuadHits { t: t.to_array(), t32: t.narrow().to_array(), u: u.narrow().to_array(), v: v.narrow().to_array() }
    }
}
