//! One ray against a block of eight triangles: rejected in f32 by the ray's own shear ([`super::woop`]).

use super::block::{Block, LANES};
use super::bundle::axes;
use super::place::Blur;
use super::planes;
use super::simd::{Array, Mask, Simd, Vector};
use super::woop::{self, Aim, Judged, SLACK, Sheared};
use crate::math::Vec3;
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
        let aim = Aim {
            width: splat(self.width),
            along: splat(self.along),
            shorten: splat(self.shorten),
            begin: splat(self.begin),
        };
        let (limit, size) = (splat(limit), splat(block.size));
        let (seen, blur) = (Sheared { x, y, z }, self.blur);
        let judged = woop::judge::<S::V8, BLURRED, ROUNDED>(
            &seen,
            &aim,
            limit,
            size,
            block.lanes,
            blur,
            #[inline(always)]
            || {
                // Asked that rarely, corners are better loaded again than kept: the black box keeps them from being kept.
                let corners = std::hint::black_box(&block.corners);
                let corners = [along::<S>(&corners[kx]), along::<S>(&corners[ky]), along::<S>(&corners[kz])];
                planes::heights(corners, [ox, oy, oz], if BLURRED { blur.origin } else { 0.0 })
            },
        );
        match judged {
            Some(Judged { lanes, sure, low, high }) => {
                Candidates { lanes, sure: sure.bits(), low: low.to_array(), high: high.to_array() }
            }
            None => Candidates::NONE,
        }
    }
}

/// One component of all corners.
#[inline(always)]
fn along<S: Simd>([a, b, c]: &[[f32; LANES]; 3]) -> [S::V8; 3] {
    [S::V8::load(a), S::V8::load(b), S::V8::load(c)]
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
