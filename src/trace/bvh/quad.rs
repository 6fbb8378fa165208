//! t, u and v of four rays, each of which hits a triangle of its own for sure.
//!
//! The same operations in the same order as [`triangle::intersect`](crate::shape::triangle::intersect), so the same bits;
//! none is fused.

use super::simd::{Array, Doubles, Simd};

/// Four triangles as seen from the origins of four rays: numbers as in [`triangle`](crate::shape::triangle).
pub(super) struct Quad<D> {
    /// The volumes opposite to the second and third corner.
    volumes: [D; 2],
    slope: D,
    height: D,
}

/// t, u and v of four hits.
pub(super) struct Numbers {
    pub t: [f64; 4],
    pub t32: [f32; 4],
    pub u: [f32; 4],
    pub v: [f32; 4],
}

impl<D: Doubles> Quad<D> {
    /// As in a block: component by component, corner by corner.
    #[inline(always)]
    pub fn new<S: Simd<D4 = D>>(origin: [D; 3], direction: [D; 3], corners: &[[f32; 4]; 9]) -> Self {
        let (pa, pb, pc) = (corner::<S>(corners, 0), corner::<S>(corners, 1), corner::<S>(corners, 2));
        let (a, c) = (minus(pa, origin), minus(pc, origin));
        let (eb, ec) = (minus(pa, pc), minus(pb, pa));
        let normal = cross(eb, ec);
        Self {
            volumes: [dot(direction, cross(c, eb)), dot(direction, cross(a, ec))],
            slope: dot(direction, normal),
            height: dot(a, normal),
        }
    }

    #[inline(always)]
    pub fn numbers(&self) -> Numbers {
        let inverse = D::splat(1.0).div(self.slope);
        let t = self.height.mul(inverse);
        let (u, v) = (self.volumes[0].mul(inverse), self.volumes[1].mul(inverse));
        Numbers { t: t.to_array(), t32: t.narrow().to_array(), u: u.narrow().to_array(), v: v.narrow().to_array() }
    }
}

#[inline(always)]
pub(super) fn widen<S: Simd>(values: &[f32; 4]) -> S::D4 {
    S::D4::widen(S::V4::load(values))
}

#[inline(always)]
fn corner<S: Simd>(corners: &[[f32; 4]; 9], k: usize) -> [S::D4; 3] {
    [widen::<S>(&corners[k]), widen::<S>(&corners[3 + k]), widen::<S>(&corners[6 + k])]
}

#[inline(always)]
fn minus<D: Doubles>(p: [D; 3], q: [D; 3]) -> [D; 3] {
    [p[0].sub(q[0]), p[1].sub(q[1]), p[2].sub(q[2])]
}

#[inline(always)]
fn cross<D: Doubles>(p: [D; 3], q: [D; 3]) -> [D; 3] {
    [p[1].mul(q[2]).sub(q[1].mul(p[2])), p[2].mul(q[0]).sub(q[2].mul(p[0])), p[0].mul(q[1]).sub(q[0].mul(p[1]))]
}

#[inline(always)]
fn dot<D: Doubles>(p: [D; 3], q: [D; 3]) -> D {
    p[0].mul(q[0]).add(p[1].mul(q[1])).add(p[2].mul(q[2]))
}
