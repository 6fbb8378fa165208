//! A ray against eight boxes at once, conservatively.
//!
//! A slab's t is bound * (1 / direction) - origin * (1 / direction): with u = 2^-24, the reciprocal, both products, the
//! sum and the offset below round by less than 5 u |1/d| (|bound| + |origin|) together, fused or not. The near and far t
//! are moved apart by 6 u |1/d| (reach + |origin|), where the reach is the largest coordinate in the tree: an exact hit
//! is never lost, and there is slack for the rounding of the hit's own t. (Ize 2013, *Robust BVH ray traversal*, moves the
//! far t by a relative 2 ulp instead, which needs bound - origin to be formed first: twice the operations.) What is no normal number
//! rounds by more than that: hence another 2^-126.
//!
//! A direction component that is zero, or small against the largest, is replaced by 1e-18 of it, and the pad by how
//! far the ray strays then: 1/d stays finite, and no 0 * infinity arises. An axis on which something still overflows is left
//! open: [`OPEN`]. An infinite pad would do for boxes, but empty slots, whose bounds are infinite, would pass as well.
//!
//! A ray in an object's coordinates may be off by more ([`Blur`]), its origin by b and its direction by r times the largest
//! component: at the t of a hit, at most the largest span over that component, it is off by b + r span, and the pad is wider
//! by this over the component.

use super::filter::{Filter, Filters};
use super::node::Node;
use super::place::Blur;
use super::simd::{Array, Mask, Simd, Vector};
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;

/// A ray made ready for slab tests in one tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct SlabRay {
    /// Of each axis, and one number more, as a vector is stored.
    pub reciprocal: [f32; 4],
    /// -origin / direction, less the pad.
    pub near_offset: [f32; 4],
    /// -origin / direction, plus the pad.
    pub far_offset: [f32; 4],
    /// On each axis 1 if a box's upper side is met first, else 0.
    pub side: [u32; 3],
    /// Rounded down, for t is rounded before it is held against it; not below 0.
    pub tmin: f32,
}

/// The smallest share of the largest direction component that a component keeps.
pub(super) const SMALLEST: f32 = 1e-18;

/// Products of this size are not trusted to be finite after a sum.
pub(super) const HUGE: f32 = 1e37;

/// The magnitude of 1/d on an axis that is open: products with coordinates are finite, those with the bounds of an empty slot are
/// not. Offsets are the largest numbers then, so that every box is entered at once, and not left.
const OPEN: f32 = f32::MIN_POSITIVE;

impl SlabRay {
    /// `reach` is the tree's.
    #[inline(always)]
    pub fn new<S: Simd>(ray: &Ray, reach: Vec3, blur: Blur) -> Self {
        let Slabs { reciprocal, near, far, is_negative } = Slabs::new::<S>(ray, reach, blur);
        let negative = is_negative.bits();
        Self {
            reciprocal: reciprocal.to_array(),
            near_offset: near.to_array(),
            far_offset: far.to_array(),
            side: [negative & 1, negative >> 1 & 1, negative >> 2 & 1],
            tmin: least_t(ray.tmin),
        }
    }

    /// The children the ray may hit something in, up to `limit`; and where it enters each, not below 0.
    #[inline(always)]
    pub fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        let mut near = S::V8::splat(self.tmin);
        let mut far = S::V8::splat(limit);
        for axis in 0..3 {
            let side = self.side[axis] as usize % 2;
            let first = S::V8::load(&node.bounds[2 * axis + side]);
            let second = S::V8::load(&node.bounds[2 * axis + 1 - side]);
            let reciprocal = S::V8::splat(self.reciprocal[axis]);
            // The accumulator second, so that a NaN (infinity less infinity) is passed over.
            near = first.mul_add(reciprocal, S::V8::splat(self.near_offset[axis])).max(near);
            far = second.mul_add(reciprocal, S::V8::splat(self.far_offset[axis])).min(far);
        }
        (near.at_most(far), near)
    }
}

/// The slabs of a ray, an axis a lane; the fourth means nothing.
struct Slabs<V: Vector> {
    reciprocal: V,
    near: V,
    far: V,
    is_negative: V::Mask,
}

impl<V: Vector> Slabs<V> {
    #[inline(always)]
    fn new<S: Simd<V4 = V>>(ray: &Ray, reach: Vec3, blur: Blur) -> Self {
        let splat = S::V4::splat;
        let (o, d, zero) = (lanes::<S>(ray.origin), lanes::<S>(ray.direction), splat(0.0));
        let largest = ray.direction.abs().max_element();
        let smallest = (SMALLEST * largest).max(f32::MIN_POSITIVE);
        let span = o.abs().add(lanes::<S>(reach));
        let stray = (4.0 * (smallest / largest) + 1.1 * blur.direction) * (ray.origin.abs() + reach).max_element()
            + 1.1 * blur.origin;
        let is_negative = d.less(zero);
        let least = S::V4::select(is_negative, splat(-smallest), splat(smallest));
        let reciprocal = splat(1.0).div(S::V4::select(d.abs().less(splat(smallest)), least, d));
        let steep = reciprocal.abs();
        let width = steep.mul_add(span.mul_add(splat(6.0 * UNIT_ROUNDOFF), splat(stray)), splat(f32::MIN_POSITIVE));
        let is_small = steep.mul(span).less(splat(HUGE)).and(width.less(splat(HUGE)));
        let offset = zero.sub(o).mul(reciprocal);
        let open = S::V4::select(is_negative, splat(-OPEN), splat(OPEN));
        let reciprocal = S::V4::select(is_small, reciprocal, open);
        let near = S::V4::select(is_small, offset.sub(width), splat(-f32::MAX));
        let far = S::V4::select(is_small, offset.add(width), splat(f32::MAX));
        Self { reciprocal, near, far, is_negative }
    }
}

/// A least t, rounded down, for t is rounded before it is held against it; not below 0.
#[inline(always)]
pub(super) fn least_t(tmin: f32) -> f32 {
    (tmin * (1.0 - 4.0 * UNIT_ROUNDOFF) - f32::MIN_POSITIVE).max(0.0)
}

/// A ray made ready for nodes and for triangles of the world, in rows that eight rays are turned into at once.
#[derive(Clone, Copy)]
pub(super) struct ReadyRay {
    rows: [[f32; 8]; 4],
}

impl ReadyRay {
    /// None.
    pub const NONE: Self = Self { rows: [[0.0; 8]; 4] };

    #[inline(always)]
    pub fn slab(&self) -> SlabRay {
        let [[rx, ry, rz, tmin, nx, ny, nz, _], [fx, fy, fz, ..], _, [x, y, z, ..]] = self.rows;
        SlabRay {
            reciprocal: [rx, ry, rz, 0.0],
            near_offset: [nx, ny, nz, 0.0],
            far_offset: [fx, fy, fz, 0.0],
            side: [x.to_bits(), y.to_bits(), z.to_bits()],
            tmin,
        }
    }

    #[inline(always)]
    pub fn filter(&self) -> Filter {
        let [[.., begin], [_, _, _, width, x, y, z, shorten], [p, q, along, ax, ay, az, ..], [_, _, _, b, r, ..]] =
            self.rows;
        let axes = [ax.to_bits() as usize, ay.to_bits() as usize, az.to_bits() as usize];
        let blur = Blur { origin: b, direction: r };
        Filter::of_eight(axes, [x, y, z], [p, q], [width, along, shorten, begin], blur)
    }

    /// As [`SlabRay::new`] and [`Filter::new`]; [`Self::end`] is not asked of it.
    #[inline(always)]
    pub fn new<S: Simd>(ray: &Ray, reach: Vec3, blur: Blur) -> Self {
        let Slabs { reciprocal, near, far, is_negative } = Slabs::new::<S>(ray, reach, blur);
        let sides = S::V4::select(is_negative, S::V4::splat(f32::from_bits(1)), S::V4::splat(0.0));
        let filter = Filter::new(ray, blur);
        let ([ax, ay, az], [x, y, z], [p, q], [width, along, shorten, begin]) = filter.fields();
        let [ax, ay, az] = [axis(ax), axis(ay), axis(az)];
        let ([rx, ry, rz, _], [nx, ny, nz, _]) = (reciprocal.to_array(), near.to_array());
        let ([fx, fy, fz, _], [sx, sy, sz, _]) = (far.to_array(), sides.to_array());
        Self {
            rows: [
                [rx, ry, rz, least_t(ray.tmin), nx, ny, nz, begin],
                [fx, fy, fz, width, x, y, z, shorten],
                [p, q, along, ax, ay, az, 0.0, 0.0],
                [sx, sy, sz, blur.origin, blur.direction, 0.0, 0.0, 0.0],
            ],
        }
    }

    /// The ray's tmax, and that or more: what [`Nearest::limit`](crate::trace::nearest::Nearest::limit) is at first.
    #[inline(always)]
    pub fn end(&self) -> [f32; 2] {
        let [.., tmax, limit] = self.rows[2];
        [tmax, limit]
    }
}

#[inline(always)]
fn lanes<S: Simd>(v: Vec3) -> S::V4 {
    S::V4::load(&[v.x, v.y, v.z, 0.0])
}

/// The number of an axis as bits of a number.
#[inline(always)]
const fn axis(number: usize) -> f32 {
    f32::from_bits(number as u32)
}

/// As [`SlabRay::new`] and [`Filter::new`] for eight rays; and a bit for each that [is valid](Ray::is_valid). Origins are off by what
/// the blur says, and besides, as directions are, by its second part of their largest component: that is [`Blur::NONE`],
/// or rays were rounded.
#[inline(always)]
pub(super) fn ready<S: Simd>(rays: &[Ray; 8], reach: Vec3, blur: Blur) -> ([ReadyRay; 8], u32) {
    let splat = S::V8::splat;
    let zero = splat(0.0);
    let [x, y, z, dx, dy, dz, tmin, tmax] = columns::<S>(rays);
    let (origin, direction) = ([x, y, z], [dx, dy, dz]);
    let largest = dx.abs().max(dy.abs()).max(dz.abs());
    let smallest = largest.mul(splat(SMALLEST)).max(splat(f32::MIN_POSITIVE));
    let span = [x.abs().add(splat(reach.x)), y.abs().add(splat(reach.y)), z.abs().add(splat(reach.z))];
    let farthest = x.abs().max(y.abs()).max(z.abs());
    let off = farthest.mul_add(splat(blur.direction), splat(blur.origin));
    let stray = smallest.div(largest).mul(splat(4.0)).add(splat(1.1 * blur.direction));
    let stray = stray.mul_add(span[0].max(span[1]).max(span[2]), off.mul(splat(1.1)));
    let mut finite = zero;
    let (mut reciprocals, mut near, mut far, mut sides) = ([zero; 3], [zero; 3], [zero; 3], [zero; 3]);
    for axis in 0..3 {
        let d = direction[axis];
        finite = d.mul_add(zero, origin[axis].mul_add(zero, finite));
        let is_negative = d.less(zero);
        let least = S::V8::select(is_negative, zero.sub(smallest), smallest);
        let kept = S::V8::select(d.abs().less(smallest), least, d);
        let reciprocal = splat(1.0).div(kept);
        let steep = reciprocal.abs();
        let width = steep.mul_add(span[axis].mul_add(splat(6.0 * UNIT_ROUNDOFF), stray), splat(f32::MIN_POSITIVE));
        let is_small = steep.mul(span[axis]).less(splat(HUGE)).and(width.less(splat(HUGE)));
        let offset = zero.sub(origin[axis]).mul(reciprocal);
        let open = S::V8::select(is_negative, splat(-OPEN), splat(OPEN));
        reciprocals[axis] = S::V8::select(is_small, reciprocal, open);
        near[axis] = S::V8::select(is_small, offset.sub(width), splat(-f32::MAX));
        far[axis] = S::V8::select(is_small, offset.add(width), splat(f32::MAX));
        sides[axis] = S::V8::select(is_negative, splat(f32::from_bits(1)), zero);
    }
    // As `least_t`.
    let least = tmin.mul(splat(1.0 - 4.0 * UNIT_ROUNDOFF)).sub(splat(f32::MIN_POSITIVE)).max(zero);
    let filter = Filters::new(origin, direction, tmin);
    let [rx, ry, rz] = reciprocals;
    let [nx, ny, nz] = near;
    let [fx, fy, fz] = far;
    let [x, y, z] = filter.origin;
    let first = S::transpose([rx, ry, rz, least, nx, ny, nz, filter.begin]);
    let second = S::transpose([fx, fy, fz, filter.width, x, y, z, filter.shorten]);
    let [p, q] = filter.shear;
    let [kx, ky, kz] = filter.axes;
    // Rounded up, for t is rounded before it is held against it.
    let limit = tmax.mul(splat(1.0 + 4.0 * UNIT_ROUNDOFF)).add(splat(f32::MIN_POSITIVE));
    let third = S::transpose([p, q, filter.along, kx, ky, kz, tmax, limit]);
    let fourth = S::transpose([sides[0], sides[1], sides[2], off, splat(blur.direction), zero, zero, zero]);
    let mut ready = [ReadyRay::NONE; 8];
    for i in 0..8 {
        let rows = [first[i].to_array(), second[i].to_array(), third[i].to_array(), fourth[i].to_array()];
        ready[i] = ReadyRay { rows };
    }
    let in_range = zero.at_most(tmin).and(tmin.at_most(tmax));
    let directed = splat(f32::MIN_POSITIVE).at_most(largest).and(finite.at_most(zero));
    (ready, in_range.and(directed).bits())
}

/// Eight rays, field by field: origin, direction, tmin, tmax.
#[inline(always)]
pub(super) fn columns<S: Simd>([a, b, c, d, e, f, g, h]: &[Ray; 8]) -> [S::V8; 8] {
    // Written out: a closure mapped over the array may miss the instruction set.
    S::transpose([
        row::<S>(a),
        row::<S>(b),
        row::<S>(c),
        row::<S>(d),
        row::<S>(e),
        row::<S>(f),
        row::<S>(g),
        row::<S>(h),
    ])
}

/// Its origin, direction, tmin and tmax.
#[inline(always)]
pub(super) fn row<S: Simd>(&Ray { origin: o, direction: d, tmin, tmax, .. }: &Ray) -> S::V8 {
    S::V8::load(&[o.x, o.y, o.z, d.x, d.y, d.z, tmin, tmax])
}
