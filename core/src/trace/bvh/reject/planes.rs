//! The planes of triangles, a lane each, and how high an origin lies over them.
//!
//! Let u = 2^-24 and N be the normal with all signs positive. Edges err by u, the normal by 4 u N, the way p from the
//! first corner to the origin by u (and `blur`), and the scalar product of both by another 3 u N p. Corners are taken
//! to be exact.

use crate::math::UNIT_ROUNDOFF;
use crate::trace::bvh::simd::Vector;

/// Against underflow of products.
const TINY: f32 = 1e-36;

/// The planes of triangles; components on any three axes in their order.
pub(in crate::trace::bvh) struct Planes<V> {
    /// Twice the area long.
    pub normal: [V; 3],
    /// The normal computed with all signs positive.
    pub size: [V; 3],
}

/// The distances of an origin from planes, times their normals' length.
pub(in crate::trace::bvh) struct Heights<V> {
    pub height: V,
    pub error: V,
}

impl<V: Vector> Planes<V> {
    /// `corners` are component by component.
    #[inline(always)]
    pub fn new(corners: [[V; 3]; 3]) -> Self {
        let [(bx, cx), (by, cy), (bz, cz)] = [edges(corners[0]), edges(corners[1]), edges(corners[2])];
        let normal = [by.mul_sub(cz, bz.mul(cy)), bz.mul_sub(cx, bx.mul(cz)), bx.mul_sub(cy, by.mul(cx))];
        let (bx, by, bz, tiny) = (bx.abs(), by.abs(), bz.abs(), V::splat(TINY));
        let (cx, cy, cz) = (cx.abs(), cy.abs(), cz.abs());
        let size = [
            by.mul_add(cz, bz.mul_add(cy, tiny)),
            bz.mul_add(cx, bx.mul_add(cz, tiny)),
            bx.mul_add(cy, by.mul_add(cx, tiny)),
        ];
        Self { normal, size }
    }

    /// `p` leads from each first corner to the origin, which may be off by `blur` in each component.
    #[inline(always)]
    pub fn heights(&self, p: [V; 3], blur: f32) -> Heights<V> {
        let Self { normal: n, size } = self;
        let (unit, blur) = (V::splat(12.0 * UNIT_ROUNDOFF), V::splat(1.1 * blur));
        let height = p[2].mul_add(n[2], p[1].mul_add(n[1], p[0].mul(n[0])));
        let off = [p[0].abs().mul_add(unit, blur), p[1].abs().mul_add(unit, blur), p[2].abs().mul_add(unit, blur)];
        let error = off[0].mul_add(size[0], V::splat(f32::MIN_POSITIVE));
        Heights { height, error: off[2].mul_add(size[2], off[1].mul_add(size[1], error)) }
    }
}

/// Of triangles with `corners`, component by component.
#[inline(always)]
pub(in crate::trace::bvh) fn heights<V: Vector>(corners: [[V; 3]; 3], origin: [V; 3], blur: f32) -> Heights<V> {
    let p = [origin[0].sub(corners[0][0]), origin[1].sub(corners[1][0]), origin[2].sub(corners[2][0])];
    Planes::new(corners).heights(p, blur)
}

/// From the first corner to the others, along one axis.
#[inline(always)]
fn edges<V: Vector>([a, b, c]: [V; 3]) -> (V, V) {
    (b.sub(a), c.sub(a))
}
