//! Rays made ready for nodes and triangles eight at a time: as columns, which are turned into a row or four for each.
//!
//! The numbers are those of [`SlabRay`] and [`Filter`]. A ray that comes by itself is made ready in fewer steps
//! ([`crate::trace::bvh::alone`]), but not in an eighth.

use super::Blur;
use super::filter::{Filter, Filters};
use super::slab::{MOST_T_SLACK, SlabRay, Slabs, least_t, most_t};
use super::woop::Margin;
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector, everywhere, size};

/// A ray made ready.
#[derive(Clone, Copy)]
pub(in crate::trace::bvh) struct ReadyRay {
    /// Two that nodes take, a cache line, and two that blocks take, another.
    rows: [[f32; 8]; 4],
}

impl ReadyRay {
    /// None.
    pub const NONE: Self = Self { rows: [[0.0; 8]; 4] };

    #[inline(always)]
    pub fn slab(&self) -> SlabRay {
        let [[rx, ry, rz, tmin, nx, ny, nz, _], [fx, fy, fz, x, y, z, ..], ..] = self.rows;
        SlabRay {
            reciprocal: [rx, ry, rz, 0.0],
            near_offset: [nx, ny, nz, 0.0],
            far_offset: [fx, fy, fz, 0.0],
            first: [x.to_bits(), y.to_bits(), z.to_bits()],
            tmin,
        }
    }

    #[inline(always)]
    pub fn filter(&self) -> Filter {
        let [.., third, fourth] = self.rows;
        let ([x, y, z, p, q, ax, ay, az], [width, of_depth, of_size, against, shorten, begin, origin, direction]) =
            (third, fourth);
        Filter {
            axes: [ax.to_bits(), ay.to_bits(), az.to_bits()],
            origin: [x, y, z],
            shear: [p, q],
            margin: Margin { width, of_depth, of_size },
            against,
            shorten,
            begin,
            blur: Blur { origin, direction },
        }
    }

    /// As [`SlabRay::new`] and [`Filter::new`].
    #[inline(always)]
    pub fn new<S: Simd>(ray: &Ray, reach: Vec3, blur: Blur) -> Self {
        let Slabs { reciprocal, near, far, is_negative } = Slabs::of_ray::<S>(ray, reach, blur);
        let [sx, sy, sz] = SlabRay::first_rows(is_negative.bits());
        let [sx, sy, sz] = [f32::from_bits(sx), f32::from_bits(sy), f32::from_bits(sz)];
        let filter = Filter::new(ray, blur);
        let Filter { axes: [ax, ay, az], origin: [x, y, z], shear: [p, q], against, shorten, begin, .. } = filter;
        let Margin { width, of_depth, of_size } = filter.margin;
        let [ax, ay, az] = [f32::from_bits(ax), f32::from_bits(ay), f32::from_bits(az)];
        let ([rx, ry, rz, _], [nx, ny, nz, _]) = (reciprocal.to_array(), near.to_array());
        let [fx, fy, fz, _] = far.to_array();
        Self {
            rows: [
                [rx, ry, rz, least_t(ray.tmin), nx, ny, nz, 0.0],
                [fx, fy, fz, sx, sy, sz, ray.tmax, most_t(ray.tmax)],
                [x, y, z, p, q, ax, ay, az],
                [width, of_depth, of_size, against, shorten, begin, blur.origin, blur.direction],
            ],
        }
    }

    /// The ray's tmax, and [`most_t`] of it.
    #[inline(always)]
    pub fn end(&self) -> [f32; 2] {
        let [.., tmax, limit] = self.rows[1];
        [tmax, limit]
    }
}

/// Rays one after the other, made ready eight at a time.
pub(in crate::trace::bvh) struct ReadyRays<'a> {
    rays: &'a [Ray],
    reach: Vec3,
    blur: Blur,
    ready: [ReadyRay; 8],
    valid: u32,
    next: usize,
}

impl<'a> ReadyRays<'a> {
    /// `reach` and `blur` are as of [`ready`].
    pub fn new(rays: &'a [Ray], reach: Vec3, blur: Blur) -> Self {
        Self { rays, reach, blur, ready: [ReadyRay::NONE; 8], valid: 0, next: 0 }
    }

    /// The number of the next valid ray.
    #[inline(always)]
    pub fn next<S: Simd>(&mut self) -> Option<usize> {
        while self.next < self.rays.len() {
            let index = self.next;
            if index.is_multiple_of(8) {
                let (_, following) = self.rays[index..].split_at(8.min(self.rays.len() - index));
                S::prefetch_all(&following[..8.min(following.len())]);
                match self.rays[index..].first_chunk() {
                    Some(eight) => (self.ready, self.valid) = ready::<S>(columns::<S>(eight), self.reach, self.blur),
                    None => {
                        let some = &self.rays[index..];
                        let mut eight = [some[0]; 8];
                        eight[..some.len()].copy_from_slice(some);
                        (self.ready, self.valid) = ready::<S>(columns::<S>(&eight), self.reach, self.blur);
                    }
                }
            }
            self.next += 1;
            if self.valid >> (index % 8) & 1 != 0 {
                return Some(index);
            }
        }
        None
    }

    /// The one that came last.
    #[inline(always)]
    pub fn ready(&self) -> &ReadyRay {
        &self.ready[self.next.wrapping_sub(1) % 8]
    }
}

/// As [`SlabRay::new`] and [`Filter::new`] for eight rays, field by field as [`columns`] has them; and a bit for each
/// that [is valid](Ray::is_valid). Origins are off by what the blur says, and besides, as directions are, by its second
/// part of their largest component: that is [`Blur::NONE`], or rays were rounded.
#[inline(always)]
pub(in crate::trace::bvh) fn ready<S: Simd>(columns: [S::V8; 8], reach: Vec3, blur: Blur) -> ([ReadyRay; 8], u32) {
    let splat = S::V8::splat;
    let [x, y, z, ..] = columns;
    let off = size([x, y, z]).mul_add(splat(blur.direction), splat(blur.origin));
    ready_blurred::<S>(columns, everywhere(reach), off, splat(blur.direction))
}

/// The same of rays whose origins are off by `off`, and whose directions by `turn` of their largest component.
#[inline(always)]
pub(in crate::trace::bvh) fn ready_blurred<S: Simd>(
    columns: [S::V8; 8],
    reach: [S::V8; 3],
    off: S::V8,
    turn: S::V8,
) -> ([ReadyRay; 8], u32) {
    let splat = S::V8::splat;
    let zero = splat(0.0);
    let [x, y, z, dx, dy, dz, tmin, tmax] = columns;
    let (origin, direction) = ([x, y, z], [dx, dy, dz]);
    let largest = size(direction);
    let slabs = Slabs::of_rays(origin, direction, reach, off, turn);
    let mut finite = zero;
    let (mut reciprocals, mut near, mut far, mut sides) = ([zero; 3], [zero; 3], [zero; 3], [zero; 3]);
    for axis in 0..3 {
        finite = direction[axis].mul_add(zero, origin[axis].mul_add(zero, finite));
        (reciprocals[axis], near[axis], far[axis]) = (slabs[axis].reciprocal, slabs[axis].near, slabs[axis].far);
        let up = splat(f32::from_bits(SlabRay::first_rows(0)[axis]));
        let down = splat(f32::from_bits(SlabRay::first_rows(0b111)[axis]));
        sides[axis] = S::V8::select(slabs[axis].is_negative, down, up);
    }
    // As `least_t`.
    let least = tmin.mul(splat(1.0 - 4.0 * UNIT_ROUNDOFF)).sub(splat(f32::MIN_POSITIVE)).max(zero);
    let filter = Filters::new(origin, direction, tmin, turn);
    let Margin { width, of_depth, of_size } = filter.margin;
    let [rx, ry, rz] = reciprocals;
    let [nx, ny, nz] = near;
    let [fx, fy, fz] = far;
    let [x, y, z] = filter.origin;
    let [p, q] = filter.shear;
    let [kx, ky, kz] = filter.axes;
    // As `most_t`.
    let limit = tmax.mul(splat(1.0 + MOST_T_SLACK)).add(splat(f32::MIN_POSITIVE));
    let [sx, sy, sz] = sides;
    let Filters { against, shorten, begin, .. } = filter;
    let first = S::transpose([rx, ry, rz, least, nx, ny, nz, zero]);
    let second = S::transpose([fx, fy, fz, sx, sy, sz, tmax, limit]);
    let third = S::transpose([x, y, z, p, q, kx, ky, kz]);
    let fourth = S::transpose([width, of_depth, of_size, against, shorten, begin, off, turn]);
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
pub(in crate::trace::bvh) fn columns<S: Simd>(rays: &[Ray; 8]) -> [S::V8; 8] {
    columns_of::<S>(rays.each_ref())
}

/// The same of rays here and there.
#[inline(always)]
pub(in crate::trace::bvh) fn columns_of<S: Simd>([a, b, c, d, e, f, g, h]: [&Ray; 8]) -> [S::V8; 8] {
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
pub(super) fn row<S: Simd>(ray: &Ray) -> S::V8 {
    // The first eight numbers of a ray, in one load; field by field, it took four instructions.
    let [row @ .., _time] = bytemuck::cast_ref::<Ray, [f32; 9]>(ray);
    S::V8::load(row)
}

/// So many of some rays are made ready together, up to eight; fewer each by itself.
pub(in crate::trace::bvh) const MANY: u32 = 3;

/// The lowest bits of some, as many as there are up to eight.
#[inline(always)]
pub(in crate::trace::bvh) fn lowest_eight(rays: u64) -> u64 {
    let mut rest = rays;
    for _ in 0..8 {
        rest &= rest.wrapping_sub(1);
    }
    rays & !rest
}

/// Up to eight rays; where they are fewer, the last again.
#[inline(always)]
pub(in crate::trace::bvh) fn eight(rays: &[Ray], mut some: u64) -> [&Ray; 8] {
    let mut eight = [&rays[0]; 8];
    for ray in &mut eight {
        *ray = &rays[some.trailing_zeros() as usize];
        let rest = some & some.wrapping_sub(1);
        some = if rest == 0 { some } else { rest };
    }
    eight
}
