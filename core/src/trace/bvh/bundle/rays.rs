//! Up to 64 rays that share an origin, or that end in one point: made ready for tests in common. (Those that share a
//! direction: [`super::parallel`].)
//!
//! **Projection.** All rays run the same way along one axis, the bundle's; a ray is its slopes (p, q) against it, and t
//! is measured along it: t' = t |d|, d being the direction's component. Box and triangle tests then take two products
//! where three were, boxes are entered along the axis at the same t' by all rays, and the rectangle of all slopes
//! bounds the bundle more tightly than a box of directions would.
//!
//! **Turning.** Shadow rays towards a point light do not share their origin but their end. They are turned round: the
//! bundle starts at the light, and t runs from there. The turned rays serve the tests that reject; what decides a hit
//! is asked of the rays as they were given.
//!
//! **Placed.** In the coordinates of an object the same rays are a bundle again ([`Bundle::place`]), with an origin
//! that is not quite the one that is meant, and directions that are rounded: each component by u, so that slopes are
//! off by twice as much as in the world. From bundle to bundle results are handed on in t ([`RayIntervals`]), which all
//! of them share.

use std::marker::PhantomData;

use super::pencil::{Central, Pencil};
use super::range::RayIntervals;
use super::rows::Rows;
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;
use crate::trace::bvh::levels::place::Place;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::reject::filter::largest_axis;
use crate::trace::bvh::reject::ready::columns;
use crate::trace::bvh::reject::slab::HUGE;
use crate::trace::bvh::simd::isa::Kernel;
use crate::trace::bvh::simd::{Array, Group, Mask, PerRay, RAYS, Simd, Vector, axes};

/// How many rays ahead of those of a bundle others are fetched.
pub(super) const AHEAD: usize = 3 * RAYS;

/// The rays of a bundle, component by component.
pub(super) struct Bundle {
    /// Where they start.
    pub origin: [f32; 3],
    /// How far a ray's own origin may be from there, in each component.
    pub blur: f32,
    /// The axis that all rays run along; the other two are the next ones, cyclically.
    pub axis: usize,
    /// 1 or -1: which way they run along it.
    pub forward: f32,
    /// Directions, as given; but for rays that run the same way.
    pub direction: [PerRay; 3],
    /// The axis' component of each direction, without its sign: t' of t = 1.
    pub depth: PerRay,
    /// The least of them.
    pub least_depth: f32,
    /// Where a ray crosses a plane across the axis ([`Pencil`](super::pencil::Pencil)), the smallest and largest of
    /// that. Of rays with a common origin their slopes, directions on the other two axes over `depth`.
    pub across: [PerRay; 2],
    pub low: [f32; 2],
    pub high: [f32; 2],
    /// The largest magnitude of a slope, or 1.
    pub largest: f32,
    /// The least and the largest of each row of eight rays.
    pub rows: Rows,
    /// What slabs are held against: 1 / slope, or of rays that run the same way `across` / slope.
    pub slabs: [PerRay; 2],
    /// Least and most that t' may be; rounded inwards, so that what lies between is within the range for sure.
    pub begin: PerRay,
    pub end: PerRay,
    /// The most that t' may be, rounded outwards; and the least for any ray, likewise.
    pub limit: PerRay,
    pub first: f32,
    /// Whether t runs from the common end back to the rays' own origins.
    pub is_turned: bool,
    /// Of rays that run the same way: their slopes.
    pub common: [f32; 2],
    /// And their own origins, relative to `origin`: on the two axes across, and along, no less than 0.
    pub start: [PerRay; 3],
}

/// How rays make a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    /// All of them make one.
    Whole,
    /// They have a point or a direction in common, but some are not valid or run into another octant.
    Parts,
    /// They have nothing in common.
    None,
}

/// Relative slack for t' that is rounded outwards or inwards: a product and the conversion, four times over.
pub(super) const SLACK: f32 = 8.0 * UNIT_ROUNDOFF;
/// Absolute slack, against underflow.
pub(super) const TINY: f32 = 1e-37;
/// Error of a direction's component, over the component, that counts for nothing beside its rounding.
const NOISE: f32 = UNIT_ROUNDOFF / 8.0;
/// Slopes beyond this spoil the bounds for all rays.
const STEEPEST: f32 = 16.0;

/// Takes the rays, of which the bundle is valid only if they fit as a whole. Those that end in one point fit only if
/// any hit is asked for.
pub(super) struct Fill<'a, Q> {
    pub bundle: &'a mut Bundle,
    pub rays: &'a [Ray; RAYS],
    pub range: &'a mut RayIntervals,
    pub query: PhantomData<Q>,
}

impl<Q: Query> Kernel for Fill<'_, Q> {
    type Output = Fit;

    #[inline(always)]
    fn run<S: Simd>(self) -> Fit {
        let Self { bundle, rays, range, .. } = self;
        let fit = bundle.gather::<S, Q>(rays, range);
        if fit != Fit::Whole {
            return fit;
        }
        range.open::<S>(bundle.is_turned);
        bundle.project::<S>(range)
    }
}

impl Bundle {
    pub fn new() -> Self {
        Self {
            origin: [0.0; 3],
            blur: 0.0,
            axis: 0,
            forward: 1.0,
            direction: [PerRay::ZERO; 3],
            depth: PerRay::ZERO,
            least_depth: 0.0,
            across: [PerRay::ZERO; 2],
            low: [0.0; 2],
            high: [0.0; 2],
            largest: 1.0,
            rows: Rows::NONE,
            slabs: [PerRay::ZERO; 2],
            begin: PerRay::ZERO,
            end: PerRay::ZERO,
            limit: PerRay::ZERO,
            first: 0.0,
            is_turned: false,
            common: [0.0; 2],
            start: [PerRay::ZERO; 3],
        }
    }

    /// Takes the rays of `world` in the coordinates of an object. They start, or end, in one point there, too; but need
    /// not run into one octant. True if they fit as a whole.
    #[inline(always)]
    pub fn place<S: Simd>(&mut self, world: &Self, place: &Place, range: &RayIntervals) -> bool {
        let (origin, blur) = place.point::<S>(Vec3::from_array(world.origin), world.blur);
        (self.origin, self.blur, self.is_turned) = (origin.to_array(), blur, world.is_turned);
        let noise = place.directions::<S>(&world.direction, &mut self.direction);
        if self.is_turned {
            // A ray's own origin is told from the common end and its direction, whose components are rounded.
            let mut longest = S::Wide::splat(0.0);
            for group in 0..RAYS / S::Wide::LANES {
                for direction in &self.direction {
                    longest = S::Wide::at(direction, group).abs().max(longest);
                }
            }
            self.blur += UNIT_ROUNDOFF * 1.01 * longest.largest() + noise;
        }
        let (is_finite, fit) = (self.blur < HUGE && origin.is_finite(), self.project::<S>(range));
        let ([a, b], [c, d]) = (self.low, self.high);
        let least_slope = a.abs().min(b.abs()).min(c.abs()).min(d.abs()).min(1.0);
        is_finite && fit == Fit::Whole && noise <= NOISE * least_slope * self.least_depth
    }

    /// Directions and ranges as they are; where all rays start, or end.
    #[inline(always)]
    fn gather<S: Simd, Q: Query>(&mut self, rays: &[Ray; RAYS], range: &mut RayIntervals) -> Fit {
        let zero = S::V8::splat(0.0);
        let start = splat::<S>(rays[0].origin);
        let last = rays[0].origin + rays[0].direction;
        let end = splat::<S>(last);
        // Zero while every ray is finite, and while all start in one point.
        let (mut finite, mut spread) = (zero, zero);
        let (mut apart, mut size) = (zero, zero);
        let (mut in_range, mut latest) = (u32::MAX, zero);
        // 36 cache lines a bundle, of which four are asked for at a time: the last four here, the others below.
        let ahead = rays.as_ptr().wrapping_add(AHEAD).cast::<u8>();
        S::prefetch(ahead.wrapping_add(256 * 8));
        for (i, rays) in rays.as_chunks::<8>().0.iter().enumerate() {
            let [x, y, z, dx, dy, dz, tmin, tmax] = columns::<S>(rays);
            // Some at a time, for they come from memory mostly, and more than a bundle ahead: all at once, before this
            // one is traced, held up what the tree needs. A hint, whatever follows these rays.
            S::prefetch(ahead.wrapping_add(256 * i));
            let (origin, direction) = ([x, y, z], [dx, dy, dz]);
            for axis in 0..3 {
                store::<S>(&mut self.direction[axis], i, direction[axis]);
                finite = direction[axis].mul_add(zero, finite);
                spread = spread.add(origin[axis].sub(start[axis]).abs());
                if Q::ANY {
                    apart = origin[axis].add(direction[axis]).sub(end[axis]).abs().max(apart);
                    size = origin[axis].abs().add(direction[axis].abs()).max(size);
                    finite = origin[axis].mul_add(zero, finite);
                }
            }
            in_range &= zero.at_most(tmin).and(tmin.at_most(tmax)).bits();
            latest = latest.max(tmax);
            store::<S>(&mut range.begin, i, tmin);
            store::<S>(&mut range.limit, i, tmax);
        }
        let is_shared = spread.at_most(zero).bits() == 0xff;
        (self.origin, self.blur, self.is_turned) = (rays[0].origin.to_array(), 0.0, !is_shared);
        let is_valid = finite.at_most(zero).bits() == 0xff && in_range & 0xff == 0xff;
        if is_shared {
            return if is_valid { Fit::Whole } else { Fit::Parts };
        }
        if !Q::ANY {
            return Fit::None;
        }
        if !is_valid {
            // One ray that is not valid may be what is off.
            return Fit::Parts;
        }
        let (apart, rounding) = (apart.largest(), 4.0 * UNIT_ROUNDOFF * size.largest());
        // A light of some size is no point: its rays are better traced one by one. And farther than the common end, t
        // does not run backwards from it.
        if !(apart <= 4.0 * rounding && latest.largest() <= 1.0 && last.is_finite()) {
            return Fit::None;
        }
        (self.origin, self.blur) = (last.to_array(), apart + rounding);
        Fit::Whole
    }

    /// The most t' that is wanted of each ray.
    #[inline(always)]
    pub fn limit_of<S: Simd, P: Pencil>(&self, range: &RayIntervals, limit: &mut PerRay) {
        for group in 0..RAYS / S::Wide::LANES {
            let (most, depth) = (S::Wide::at(&range.limit, group), S::Wide::at(&self.depth, group));
            let most = self.beyond_start::<S, P>(most.mul(depth), group);
            most.mul_add(S::Wide::splat(1.0 + SLACK), S::Wide::splat(TINY)).put(limit, group);
        }
    }

    /// Everything that is derived from the directions.
    #[inline(always)]
    fn project<S: Simd>(&mut self, range: &RayIntervals) -> Fit {
        let [x, y, z] = &self.direction;
        self.axis = largest_axis(Vec3::new(x.0[0], y.0[0], z.0[0]).abs());
        let [p, q, along] = axes(self.axis);
        let splat = S::Wide::splat;
        let sign = splat(if self.is_turned { -1.0 } else { 1.0 });
        let infinite = splat(f32::INFINITY);
        let (mut low, mut high) = ([infinite; 3], [splat(f32::NEG_INFINITY); 3]);
        let mut first = infinite;
        for group in 0..RAYS / S::Wide::LANES {
            let d = S::Wide::at(&self.direction[along], group).mul(sign);
            (low[2], high[2]) = (d.min(low[2]), d.max(high[2]));
            let depth = d.abs();
            depth.put(&mut self.depth, group);
            let shrink = splat(1.0).div(depth).mul(sign);
            for (i, axis) in [p, q].into_iter().enumerate() {
                let slope = S::Wide::at(&self.direction[axis], group).mul(shrink);
                slope.put(&mut self.across[i], group);
                splat(1.0).div(slope).put(&mut self.slabs[i], group);
                (low[i], high[i]) = (slope.min(low[i]), slope.max(high[i]));
            }
            first = self.bound::<S, Central>(range, group).min(first);
        }
        self.first = first.smallest().max(0.0);
        let low = [low[0].smallest(), low[1].smallest(), low[2].smallest()];
        let high = [high[0].largest(), high[1].largest(), high[2].largest()];
        let one_sided = |i: usize| low[i] > f32::MIN_POSITIVE || high[i] < -f32::MIN_POSITIVE;
        if !(one_sided(0) && one_sided(1) && one_sided(2)) {
            return Fit::Parts;
        }
        (self.forward, self.least_depth) = if low[2] > 0.0 { (1.0, low[2]) } else { (-1.0, -high[2]) };
        (self.low, self.high) = ([low[0], low[1]], [high[0], high[1]]);
        self.largest = high[0].max(-low[0]).max(high[1].max(-low[1])).max(1.0);
        self.rows = Rows::new::<S>(&self.across);
        // NaN and infinity, too: a direction whose smallest component vanishes against the others. In an object's
        // coordinates a depth may be infinite, which leaves no slope.
        let is_small = high[2].max(-low[2]) < HUGE;
        if is_small && self.largest <= STEEPEST { Fit::Whole } else { Fit::None }
    }

    /// Sets which t' of a group are of interest, by `depth`, and tells the least of them, rounded outwards.
    #[inline(always)]
    pub fn bound<S: Simd, P: Pencil>(&mut self, range: &RayIntervals, group: usize) -> S::Wide {
        let splat = S::Wide::splat;
        let (up, down, tiny, less) = (splat(1.0 + SLACK), splat(1.0 - SLACK), splat(TINY), splat(-TINY));
        let depth = S::Wide::at(&self.depth, group);
        let begin = self.beyond_start::<S, P>(S::Wide::at(&range.begin, group).mul(depth), group);
        let end = self.beyond_start::<S, P>(S::Wide::at(&range.sure, group).mul(depth), group);
        let limit = self.beyond_start::<S, P>(S::Wide::at(&range.limit, group).mul(depth), group);
        let first = self.beyond_start::<S, P>(S::Wide::at(&range.start, group).mul(depth), group);
        begin.mul_add(up, tiny).put(&mut self.begin, group);
        end.mul_add(down, less).put(&mut self.end, group);
        limit.mul_add(up, tiny).put(&mut self.limit, group);
        first.mul_add(down, less)
    }

    /// What is so far from where each ray of a group starts, from the bundle's origin. Neither of both is below 0, so
    /// that the sum is not less precise than they are.
    #[inline(always)]
    pub fn beyond_start<S: Simd, P: Pencil>(&self, far: S::Wide, group: usize) -> S::Wide {
        if P::IS_PARALLEL { far.add(S::Wide::at(&self.start[2], group)) } else { far }
    }

    /// How far from the bundle's origin a ray starts, along the axis.
    #[inline(always)]
    pub fn start_of<P: Pencil>(&self, ray: usize) -> f32 {
        if P::IS_PARALLEL { self.start[2].0[ray] } else { 0.0 }
    }

    /// The area across the bundle's axis that belongs to each of `count` rays, at t'.
    #[inline(always)]
    pub fn grain(&self, t: f32, count: usize) -> f32 {
        let [p, q] = [self.high[0] - self.low[0], self.high[1] - self.low[1]];
        p * q * t * t / count as f32
    }

    /// Whether products of three lengths, as of corners and edges, may leave f32 in a tree that reaches that far.
    #[inline(always)]
    pub fn may_overflow<P: Pencil>(&self, reach: Vec3) -> bool {
        // Components of a normal are two products of edges, which are at most twice as long as corners are far; its
        // scalar product with a corner or a direction is three: 24, and rounding. Shadows are twice as large, and their
        // rays' points may be as far away as corners.
        let far = (Vec3::from_array(self.origin).abs() + reach).max_element();
        if P::IS_PARALLEL {
            let far = far + self.widest();
            return 256.0 * far * far * far >= HUGE;
        }
        let most = far.max(self.largest);
        32.0 * most * far * far >= HUGE
    }
}

#[inline(always)]
fn splat<S: Simd>(p: Vec3) -> [S::V8; 3] {
    [S::V8::splat(p.x), S::V8::splat(p.y), S::V8::splat(p.z)]
}

#[inline(always)]
pub(super) fn store<S: Simd>(values: &mut PerRay, i: usize, lanes: S::V8) {
    values.0.as_chunks_mut().0[i] = lanes.to_array();
}
