//! Triangles as parallel rays see them: shadows across the bundle's axis, with bounds on the rounding.
//!
//! Names are those of [`super`]. With L the largest component of a corner relative to the origin, and s that of an
//! edge:
//!
//! | value | rounding | rays off |
//! | --- | --- | --- |
//! | corner of the shadow | 8 u L | 0 |
//! | edge of the shadow, at most 2 s | 6 u s (not a difference of corners, which would be 16 u L) | 0 |
//! | edge function | s (96 u L + 24 u R): edges' errors times 2 L + R, products and sums, the corner times an edge | 4 e s |
//! | area of the shadow | 60 u s^2 | 0 |
//! | area times t' | s^2 (64 u L + 28 u R): as the height of an origin, and the plane's slopes times (p, q) | 4 e s^2 |
//!
//! Edge functions are taken to be off by s (128 u L + 8 blur), areas by 64 u s^2 and areas times t' by s^2 (128 u L + 8
//! blur); and t' by d, which is this over the area, what the area is off by times L, and a few roundings of L. The area
//! is known to a quarter of itself, or the triangle is left in doubt; and a hit is sure only if t', as computed, is
//! more than 5 d beyond the ray's own origin, so that its t is known to a quarter, too.
//!
//! A ray's own origin is on a surface most often. On which side of the plane, t' is too coarse to tell, but C . N does,
//! C leading from there to a corner, as in [`Edges`].

use crate::math::UNIT_ROUNDOFF;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::bundle::edges::{Corners, Edges, corner, ends, minus, origin};
use crate::trace::bvh::bundle::footprint::Footprints;
use crate::trace::bvh::bundle::rays::Bundle;
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector, axes, size};

/// The edges of a block's triangles, as [`Pencil::edges`].
#[inline(always)]
pub(super) fn edges<S: Simd>(block: &Block, bundle: &Bundle, most: f32) -> Option<(u32, Edges)> {
    let splat = S::V8::splat;
    let Corners { relative: [a, b, c], opposite: [ea, eb, ec], normal: n, height, far, long } =
        Corners::new::<S>(block, bundle);

    let shear = shear_of::<S>(bundle);
    let (sa, sb, sc) = (shadow(a, shear), shadow(b, shear), shadow(c, shear));
    let (fa, fb, fc) = (shadow(ea, shear), shadow(eb, shear), shadow(ec, shear));
    let area = fb[0].mul_sub(fc[1], fb[1].mul(fc[0]));

    let u = UNIT_ROUNDOFF;
    let (zero, tiny) = (splat(0.0), splat(1e-36));
    let reach = far.mul_add(splat(128.0 * u), splat(8.0 * bundle.blur));
    let edge_error = long.mul_add(reach, tiny);
    let square = long.mul(long);
    let area_error = square.mul_add(splat(64.0 * u), tiny);
    let height_error = square.mul_add(reach, tiny);

    let back = area.less(zero);
    let size_of_area = area.abs();
    let clear = area_error.less(size_of_area);
    let sign = S::V8::select(back, splat(-1.0), splat(1.0));
    let inverse = splat(1.0).div(size_of_area);
    // Along the axis the shadow's area is the plane's slope.
    let turn = sign.mul(inverse);
    let onward = turn.mul(splat(bundle.forward));
    let facing = [n[0].mul(onward), n[1].mul(onward), n[2].mul(turn)];
    let normals = [
        line(sb, fa, sign),
        line(sc, fb, sign),
        line(sa, fc, sign),
        [zero.sub(facing[0]), zero.sub(facing[1]), height.mul(onward)],
    ];
    let least_area = size_of_area.sub(area_error);
    let depth_error = far.mul_add(area_error, height_error).div(least_area).mul(splat(1.25));
    let depth_error = far.mul_add(splat(16.0 * u), depth_error);

    let outside = zero.sub(edge_error);
    let misses = ends::<S>(&normals[0], bundle).1.less(outside);
    let misses = misses.or(ends::<S>(&normals[1], bundle).1.less(outside));
    let misses = misses.or(ends::<S>(&normals[2], bundle).1.less(outside));
    let (nearest, farthest) = ends::<S>(&normals[3], bundle);
    let behind = farthest.add(depth_error).less(splat(bundle.first * (1.0 - 1e-6)));
    let beyond = splat(most * (1.0 + 1e-6)).less(nearest.sub(depth_error));
    let culled = misses.or(behind).or(beyond).and(clear).bits();
    let lanes = !culled & block.lanes;
    if lanes == 0 {
        return None;
    }
    let tame = area_error.less(least_area.mul(splat(0.25)));
    let forward = splat(bundle.forward);
    let mut stored = [[[0.0; LANES]; 3]; 4];
    for k in 0..4 {
        let normal = &normals[k];
        stored[k] = [normal[0].to_array(), normal[1].to_array(), normal[2].to_array()];
    }
    let edges = Edges {
        normals: stored,
        near_height: depth_error.mul(splat(-5.0)).to_array(),
        far_height: depth_error.to_array(),
        edge_error: edge_error.to_array(),
        corner: [a[0].to_array(), a[1].to_array(), a[2].mul(forward).to_array()],
        facing: facing[2].to_array(),
        corner_error: far.mul_add(splat(2.0 * u), splat(2.0 * bundle.blur)).to_array(),
        normal_error: square.mul(splat(24.0 * u)).mul(inverse).to_array(),
        is_vague: !tame.bits() & 0xff,
    };
    Some((lanes, edges))
}

/// Where the bundle sees triangles.
#[inline(always)]
pub(super) fn footprints<S: Simd>(corners: &[[[f32; LANES]; 3]; 3], bundle: &Bundle) -> Footprints {
    let splat = S::V8::splat;
    let (axes, origin) = (axes(bundle.axis), origin::<S>(bundle));
    let shear = shear_of::<S>(bundle);
    let (mut least, mut most) = ([splat(f32::INFINITY); 2], [splat(f32::NEG_INFINITY); 2]);
    let mut far = splat(0.0);
    for k in 0..3 {
        let corner = minus(corner::<S>(corners, k, axes), origin);
        far = size(corner).max(far);
        let shadow = shadow(corner, shear);
        for i in 0..2 {
            (least[i], most[i]) = (shadow[i].min(least[i]), shadow[i].max(most[i]));
        }
    }
    // With room for the rounding of what follows.
    let pad = far.mul_add(splat(12.0 * UNIT_ROUNDOFF), splat(1.1 * bundle.blur + f32::MIN_POSITIVE));
    Footprints {
        low: [least[0].sub(pad).to_array(), least[1].sub(pad).to_array()],
        high: [most[0].add(pad).to_array(), most[1].add(pad).to_array()],
    }
}

/// By what a point's third component is multiplied to be added to the other two.
#[inline(always)]
fn shear_of<S: Simd>(bundle: &Bundle) -> [S::V8; 2] {
    let [k, l] = bundle.common;
    [S::V8::splat(-bundle.forward * k), S::V8::splat(-bundle.forward * l)]
}

/// Where what is at that point, or leads along it, has its shadow.
#[inline(always)]
fn shadow<V: Vector>([x, y, z]: [V; 3], [k, l]: [V; 2]) -> [V; 2] {
    [z.mul_add(k, x), z.mul_add(l, y)]
}

/// The edge function of the edge from `corner` along `edge`, the sign turned: its scalar product with (p, q, 1).
#[inline(always)]
fn line<V: Vector>(corner: [V; 2], edge: [V; 2], sign: V) -> [V; 3] {
    let edge = [edge[0].mul(sign), edge[1].mul(sign)];
    [V::splat(0.0).sub(edge[1]), edge[0], corner[0].mul_sub(edge[1], corner[1].mul(edge[0]))]
}
