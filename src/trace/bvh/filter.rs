//! One ray against a block of eight triangles: rejected in f32 by the ray's own shear.
//!
//! The test is Woop's (Woop, Benthin, Wald 2013, *Watertight ray/triangle intersection*): corners relative to the
//! origin are sheared so that the ray runs along its largest axis, and the edge functions are 2 x 2 determinants. Here it
//! only rejects: a triangle falls out when two edge functions have opposite signs by more than their rounding error, or
//! when t is out of range by more than its own. What remains is noted where there is no doubt, else goes to the exact test.
//!
//! With u = 2^-24, a triangle that is hit has its corners, after the shear, within S = (1 + k) s of the ray, s being the
//! largest component of its edges and k <= 1 of the shear; so no component of a corner relative to the origin is larger
//! than L = Z + S, Z being the largest along the ray. A sheared component errs by e = 8 u L (a subtraction, the shear's
//! two roundings, a product and a subtraction), an edge function by 4 e S + 2 e^2 and its own rounding 4 u S^2, t by
//! three such errors. A triangle that is not hit may be bounded wrongly, to no harm.
//!
//! A ray in an object's coordinates is not quite the one that is meant ([`Blur`]). With its origin off by b, and each component
//! of the direction by r times the largest, r <= 2^-10: the shear is off by (1 + k) r / (1 - r), so that a sheared component errs by 2 b + 2.1 r L
//! besides; the corners' depths by b, which the sum of edges times depths multiplies by the sum of edges, all of one sign
//! but for their errors; and t |along| by r.
//!
//! Corners may be rounded themselves, by c each: the terms above have room for that, with b + 3 c in place of b, since an edge is then off
//! by 2 c. Only the distance from a plane ([`height`]) counts on edges that are exact, and is not asked for such corners.

use super::block::{Block, LANES};
use super::bundle::axes;
use super::place::Blur;
use super::simd::{Array, Mask, Simd, Vector};
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;

/// A ray made ready for the f32 reject test.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    /// The axis along which the direction is largest, before it the two that follow it.
    axes: [usize; 3],
    /// Origin, in the order of `axes`.
    origin: [f32; 3],
    /// Direction along the first two axes over that along the third, negative; at most 1 in magnitude.
    shear: [f32; 2],
    /// 1 more than the larger of the two.
    width: f32,
    /// Direction along the third.
    along: f32,
    /// 1 over its magnitude.
    shorten: f32,
    /// Least t, rounded down, times the magnitude of `along`.
    begin: f32,
    /// How far all that may be from the ray that is meant.
    blur: Blur,
}

/// Triangles of a block that a ray may hit.
pub(super) struct Candidates {
    /// A bit for each of them.
    pub lanes: u32,
    /// A bit for those that it hits without doubt, at a t between `low` and `high`, and so that t, u and v can be computed
    /// in f64.
    pub sure: u32,
    pub low: [f32; LANES],
    pub high: [f32; LANES],
}

impl Candidates {
    const NONE: Self = Self { lanes: 0, sure: 0, low: [0.0; LANES], high: [0.0; LANES] };
}

/// Slack of t for its own rounding and that of products with it.
const SLACK: f32 = 8.0 * UNIT_ROUNDOFF;

/// Of a sheared component, for a ray that is not rounded itself.
const ERROR: f32 = 9.0 * UNIT_ROUNDOFF;

/// Against underflow.
const TINY: f32 = 1e-36;

impl Filter {
    #[inline(always)]
    pub fn new(ray: &Ray, blur: Blur) -> Self {
        let [x, y, z] = axes(largest_axis(ray.direction.abs()));
        let (direction, origin) = (ray.direction.to_array(), ray.origin.to_array());
        let reciprocal = 1.0 / direction[z];
        let shear = [direction[x] * -reciprocal, direction[y] * -reciprocal];
        Self {
            axes: [x, y, z],
            origin: [origin[x], origin[y], origin[z]],
            shear,
            width: 1.0 + shear[0].abs().max(shear[1].abs()),
            along: direction[z],
            shorten: reciprocal.abs(),
            begin: ray.tmin * direction[z].abs() * (1.0 - SLACK),
            blur,
        }
    }

    /// One of those that are made ready together, by its fields.
    #[inline(always)]
    pub fn of_eight(
        axes: [usize; 3],
        origin: [f32; 3],
        shear: [f32; 2],
        [width, along, shorten, begin]: [f32; 4],
        blur: Blur,
    ) -> Self {
        Self { axes, origin, shear, width, along, shorten, begin, blur }
    }

    /// In the order of [`Self::of_eight`].
    #[inline(always)]
    pub fn fields(&self) -> ([usize; 3], [f32; 3], [f32; 2], [f32; 4]) {
        let Self { axes, origin, shear, width, along, shorten, begin, .. } = *self;
        (axes, origin, shear, [width, along, shorten, begin])
    }

    /// The triangles that the ray may hit up to `limit`. If it is not `BLURRED`, it is the ray that is meant.
    #[inline(always)]
    pub fn candidates<S: Simd, const BLURRED: bool>(&self, block: &Block, limit: f32) -> Candidates {
        self.test::<S, BLURRED, false>(block, limit)
    }

    /// The same where the blur's origin has room for corners that are rounded, too.
    #[inline(always)]
    pub fn rounded_candidates<S: Simd>(&self, block: &Block, limit: f32) -> Candidates {
        self.test::<S, true, true>(block, limit)
    }

    #[inline(always)]
    fn test<S: Simd, const BLURRED: bool, const ROUNDED: bool>(&self, block: &Block, limit: f32) -> Candidates {
        let splat = S::V8::splat;
        let [kx, ky, kz] = self.axes;
        let (cx, cy, cz) = (&block.corners[kx], &block.corners[ky], &block.corners[kz]);
        let (ox, oy, oz) = (splat(self.origin[0]), splat(self.origin[1]), splat(self.origin[2]));
        let (sx, sy) = (splat(self.shear[0]), splat(self.shear[1]));
        // From the corners to the origin, not the other way round: that spares loads.
        let mut x = [ox; 3];
        let mut y = [oy; 3];
        let mut z = [oz; 3];
        for k in 0..3 {
            z[k] = oz.sub(S::V8::load(&cz[k]));
            x[k] = z[k].mul_add(sx, ox.sub(S::V8::load(&cx[k])));
            y[k] = z[k].mul_add(sy, oy.sub(S::V8::load(&cy[k])));
        }
        let (u, v, w) = (edge(x, y, 2, 1), edge(x, y, 0, 2), edge(x, y, 1, 0));
        let reach = self.width * block.size;
        let deep = z[0].abs().add(splat(block.size));
        // e, S + e, and (S + e) (5 e + 6 u (S + e)), which is more than wanted, for the rounding of the bound. 6 u (S + e) is
        // less than e.
        let Blur { origin: blur, direction } = if BLURRED { self.blur } else { Blur::NONE };
        let (relative, slack) = (ERROR + 2.2 * direction, SLACK + 2.0 * direction);
        let e = deep.mul_add(splat(relative), splat(reach * relative + 2.2 * blur));
        let bound = e.add(splat(reach)).mul(e).mul_add(splat(6.0), splat(TINY));
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        let zero = splat(0.0);
        // Whatever overflowed is not rejected.
        let passed = !bound.less(most.min(zero.sub(least))).bits() & block.lanes;
        if passed == 0 {
            return Candidates::NONE;
        }
        // t |along| = depth / determinant, both multiplied by the determinant.
        let determinant = u.add(v).add(w);
        let size = determinant.abs();
        let error = bound.mul_add(splat(4.0), size.mul(splat(SLACK))).mul(size);
        let square = determinant.mul(determinant);
        let (least_square, most_square) = (square.sub(error), square.add(error));
        let begin = least_square.mul(splat(if BLURRED { self.begin * (1.0 - slack) } else { self.begin }));
        let end = most_square.mul(splat(limit * self.along.abs() * (1.0 + slack)));
        let turn = determinant.mul(splat(1.0f32.copysign(self.along)));
        let depth = zero.sub(u.mul_add(z[0], v.mul_add(z[1], w.mul(z[2])))).mul(turn);
        // The sum of all edges is at most the determinant and 6 bounds.
        let depth_error = error.mul_add(deep, splat(f32::MIN_POSITIVE));
        let depth_error = if BLURRED { most_square.mul_add(splat(1.6 * blur), depth_error) } else { depth_error };
        let (near, far) = (depth.sub(depth_error), depth.add(depth_error));
        let mut lanes = passed & !far.less(begin).or(end.less(near)).bits();
        let four = splat(4.0);
        let is_precise = depth_error.mul(four).less(depth);
        if !ROUNDED && lanes & !is_precise.bits() != 0 {
            // The origin is close to the plane, for the size of the triangle: mostly a ray that starts on it.
            // That rarely, corners are better loaded again than kept: the black box keeps them from being kept.
            let corners = std::hint::black_box(&block.corners);
            let (height, height_error) = height::<S>([&corners[kx], &corners[ky], &corners[kz]], [ox, oy, oz], blur);
            let (depth, depth_error) = (height.mul(turn), height_error.mul_add(size, splat(f32::MIN_POSITIVE)));
            let (near, far) = (depth.sub(depth_error), depth.add(depth_error));
            // Where rounding leaves the determinant's sign open, as from far away, this has no sign either.
            lanes &= !far.less(begin).or(end.less(near)).and(zero.less(least_square)).bits();
        }
        if lanes == 0 {
            return Candidates::NONE;
        }
        // Precise to a quarter in f32 is more than enough in f64, unless the origin all but touches the triangle: both
        // count the same products of components, but f64 is wanted 2^18 times as precise, and is 2^29 times.
        let precise = error.mul(four).less(square).and(is_precise);
        let apart = splat(block.size / 32.0).less(deep);
        let inside = bound.less(least.max(zero.sub(most)));
        Candidates {
            lanes,
            sure: inside.and(precise).and(apart).bits(),
            low: near.div(most_square).mul(splat(self.shorten * (1.0 - slack))).to_array(),
            high: far.div(least_square).mul(splat(self.shorten * (1.0 + slack))).to_array(),
        }
    }
}

/// The axis of the largest component.
#[inline(always)]
pub(super) fn largest_axis(v: Vec3) -> usize {
    if v.x > v.y && v.x > v.z {
        0
    } else if v.y > v.z {
        1
    } else {
        2
    }
}

/// Filters of eight rays with no blur, field by field.
pub(super) struct Filters<V> {
    /// As bits of numbers.
    pub axes: [V; 3],
    pub origin: [V; 3],
    pub shear: [V; 2],
    pub width: V,
    pub along: V,
    pub shorten: V,
    pub begin: V,
}

impl<V: Vector> Filters<V> {
    /// As [`Filter::new`] for each of them.
    #[inline(always)]
    pub fn new(origin: [V; 3], direction: [V; 3], tmin: V) -> Self {
        let [dx, dy, dz] = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
        let is_x = dy.less(dx).and(dz.less(dx));
        let is_y = dz.less(dy).without(is_x);
        // What stands at the axis, and at those after it.
        let along = pick(is_x, is_y, direction, 0);
        let reciprocal = V::splat(1.0).div(along);
        let negative = V::splat(0.0).sub(reciprocal);
        let shear = [pick(is_x, is_y, direction, 1).mul(negative), pick(is_x, is_y, direction, 2).mul(negative)];
        let numbers = [V::splat(f32::from_bits(0)), V::splat(f32::from_bits(1)), V::splat(f32::from_bits(2))];
        Self {
            axes: [pick(is_x, is_y, numbers, 1), pick(is_x, is_y, numbers, 2), pick(is_x, is_y, numbers, 0)],
            origin: [pick(is_x, is_y, origin, 1), pick(is_x, is_y, origin, 2), pick(is_x, is_y, origin, 0)],
            width: shear[0].abs().max(shear[1].abs()).add(V::splat(1.0)),
            shear,
            along,
            shorten: reciprocal.abs(),
            begin: tmin.mul(along.abs()).mul(V::splat(1.0 - SLACK)),
        }
    }
}

/// The component `next` places after the axis that each lane's masks name.
#[inline(always)]
fn pick<V: Vector>(is_x: V::Mask, is_y: V::Mask, v: [V; 3], next: usize) -> V {
    V::select(is_x, v[next % 3], V::select(is_y, v[(1 + next) % 3], v[(2 + next) % 3]))
}

/// The edge function of the edge from corner `a` to corner `b`, each of which is at (x, y).
#[inline(always)]
fn edge<V: Vector>(x: [V; 3], y: [V; 3], a: usize, b: usize) -> V {
    x[a].mul_sub(y[b], y[a].mul(x[b]))
}

/// Twice the area times the distance of the origin from the plane: the normal's product with p, which leads from the first
/// corner to the origin; and its error. Let u = 2^-24 and N be the normal with all signs positive. Edges err by u,
/// the normal by 4 u N, p by u (and `blur`), and the scalar product by another 3 u N p.
#[inline(always)]
fn height<S: Simd>(corners: [&[[f32; LANES]; 3]; 3], origin: [S::V8; 3], blur: f32) -> (S::V8, S::V8) {
    let (tiny, unit, blur) = (S::V8::splat(TINY), S::V8::splat(12.0 * UNIT_ROUNDOFF), S::V8::splat(1.1 * blur));
    let [(bx, cx), (by, cy), (bz, cz)] = [edges::<S>(corners[0]), edges::<S>(corners[1]), edges::<S>(corners[2])];
    let [cx0, cy0, cz0] = corners;
    let p =
        [origin[0].sub(S::V8::load(&cx0[0])), origin[1].sub(S::V8::load(&cy0[0])), origin[2].sub(S::V8::load(&cz0[0]))];
    let height = by.mul_sub(cz, bz.mul(cy)).mul(p[0]);
    let height = bz.mul_sub(cx, bx.mul(cz)).mul_add(p[1], height);
    let height = bx.mul_sub(cy, by.mul(cx)).mul_add(p[2], height);
    let (bx, by, bz) = (bx.abs(), by.abs(), bz.abs());
    let (cx, cy, cz) = (cx.abs(), cy.abs(), cz.abs());
    let off = [p[0].abs().mul_add(unit, blur), p[1].abs().mul_add(unit, blur), p[2].abs().mul_add(unit, blur)];
    let error = by.mul_add(cz, bz.mul_add(cy, tiny)).mul_add(off[0], S::V8::splat(f32::MIN_POSITIVE));
    let error = bz.mul_add(cx, bx.mul_add(cz, tiny)).mul_add(off[1], error);
    (height, bx.mul_add(cy, by.mul_add(cx, tiny)).mul_add(off[2], error))
}

/// From the first corner to the others, along one axis.
#[inline(always)]
fn edges<S: Simd>(corners: &[[f32; LANES]; 3]) -> (S::V8, S::V8) {
    let a = S::V8::load(&corners[0]);
    (S::V8::load(&corners[1]).sub(a), S::V8::load(&corners[2]).sub(a))
}
