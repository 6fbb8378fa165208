//! Rays that run the same way, as an orthographic camera's and those towards a distant light: a bundle whose common
//! point is infinitely far away ([`Pencil`]).
//!
//! Everything is sheared so that the rays run along the bundle's axis: a ray is a point of the plane across it, a
//! triangle its shadow there. Edge functions of the shadow do not ask how far away anything is, and t' is linear in the
//! point, so that it needs no division.
//!
//! The bundle's origin is beside one ray's, as far back as the rearmost, so that no t' is below 0. Let u = 2^-24, (k,
//! l) be the slopes, at most 1 and off by u of themselves, X and Z the largest components of rays' origins relative to
//! the bundle's, across its axis and along it, and R the largest component of rays' points. A point x - k z is off by
//! e = u (3 X + 6 Z) (both differences, slope, product and difference: 2 X + 4 Z; the rest is spare), and R <= X + Z. The
//! bundle's blur is e + 8 u R, rounded up.
//!
//! **Boxes.** A ray meets x = c at c / k - p / k. In lengths, 1 / k, product and difference round p by 4 u R; what they
//! round c by is that of a bundle with a point in common. A slope next to zero is taken for 2^-40, for which boxes are
//! wider by 2^-39 of how far rays go in the tree.
//!
//! **Placed objects.** In the tree of placements they are a bundle; from there on each goes by itself, for in an
//! object's coordinates each of their origins would be off in its own way. Shadow rays wait there for those of other
//! bundles, and fly.
//!
//! **Triangles**: [`triangles`].

mod triangles;

use super::edges::Edges;
use super::footprint::Footprints;
use super::pencil::Pencil;
use super::range::RayIntervals;
use super::rays::{AHEAD, Bundle, Fit, store};
use super::rows::Rows;
use super::slab::BundleSlab;
use crate::math::{UNIT_ROUNDOFF, Vec3};
use crate::ray::Ray;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::reject::filter::largest_axis;
use crate::trace::bvh::reject::ready::columns;
use crate::trace::bvh::reject::slab::HUGE;
use crate::trace::bvh::simd::isa::Kernel;
use crate::trace::bvh::simd::{Group, Mask, RAYS, Simd, Vector, axes, everywhere};

/// Rays of one direction.
pub(super) struct Parallel;

/// Slopes nearer to zero than this are taken for it, where they are divided by.
const MIN_SLOPE: f32 = 1.0 / (1_u64 << 40) as f32;

/// Directions that are shorter along the bundle's axis make none, for t' counts in units of it.
const SHORTEST: f32 = 1e-30;

/// Nor do directions that are longer: a t next to 0 is rounded by half of the least number there is, and in t' that is
/// so many times as much, which has to be nothing beside [`TINY`](super::rays::TINY).
const LONGEST: f32 = 1e8;

/// Whether rays may have a direction in common, and no point.
#[inline(always)]
pub(super) fn may_be_parallel(rays: &[Ray; RAYS]) -> bool {
    let (first, last) = (&rays[0], &rays[RAYS - 1]);
    first.direction == last.direction && first.origin != last.origin
}

/// Takes the rays, of which the bundle is valid only if they fit as a whole.
pub(super) struct FillParallel<'a> {
    pub bundle: &'a mut Bundle,
    pub rays: &'a [Ray; RAYS],
    pub range: &'a mut RayIntervals,
}

impl Kernel for FillParallel<'_> {
    type Output = Fit;

    #[inline(always)]
    fn run<S: Simd>(self) -> Fit {
        let Self { bundle, rays, range } = self;
        let fit = bundle.gather_parallel::<S>(rays, range);
        if fit == Fit::Whole {
            range.open::<S>(false);
            bundle.shear::<S>(range)
        } else {
            fit
        }
    }
}

impl Bundle {
    /// Origins and ranges as they are; and the direction that all rays have.
    #[inline(always)]
    fn gather_parallel<S: Simd>(&mut self, rays: &[Ray; RAYS], range: &mut RayIntervals) -> Fit {
        let direction = rays[0].direction;
        self.axis = largest_axis(direction.abs());
        let order = axes(self.axis);
        let [p, q, along] = order;
        let (zero, all) = (S::V8::splat(0.0), everywhere::<S::V8>(direction));
        let (mut finite, mut turned, mut in_range) = (zero, zero, u32::MAX);
        let ahead = rays.as_ptr().wrapping_add(AHEAD).cast::<u8>();
        S::prefetch(ahead.wrapping_add(256 * 8));
        for (i, rays) in rays.as_chunks::<8>().0.iter().enumerate() {
            let [x, y, z, dx, dy, dz, tmin, tmax] = columns::<S>(rays);
            S::prefetch(ahead.wrapping_add(256 * i));
            let (origin, direction) = ([x, y, z], [dx, dy, dz]);
            for axis in 0..3 {
                turned = turned.add(direction[axis].sub(all[axis]).abs());
                finite = origin[axis].mul_add(zero, direction[axis].mul_add(zero, finite));
                store::<S>(&mut self.start[axis], i, origin[order[axis]]);
            }
            in_range &= zero.at_most(tmin).and(tmin.at_most(tmax)).bits();
            store::<S>(&mut range.begin, i, tmin);
            store::<S>(&mut range.limit, i, tmax);
        }
        if finite.at_most(zero).bits() != 0xff || in_range & 0xff != 0xff {
            return Fit::Parts;
        }
        let depth = direction[along].abs();
        if turned.at_most(zero).bits() != 0xff || !(SHORTEST..LONGEST).contains(&depth) {
            return Fit::None;
        }
        (self.forward, self.least_depth, self.is_turned) = (direction[along].signum(), depth, false);
        self.common = [direction[p] / depth, direction[q] / depth];
        self.origin = rays[0].origin.to_array();
        Fit::Whole
    }

    /// Everything that is derived from the origins.
    #[inline(always)]
    fn shear<S: Simd>(&mut self, range: &RayIntervals) -> Fit {
        let splat = S::Wide::splat;
        let [p, q, along] = axes(self.axis);
        let (forward, depth) = (splat(self.forward), splat(self.least_depth));
        let infinite = splat(f32::INFINITY);
        let mut back = infinite;
        for group in 0..RAYS / S::Wide::LANES {
            back = S::Wide::at(&self.start[2], group).mul(forward).min(back);
        }
        let back = back.smallest();
        self.origin[along] = back * self.forward;
        let (beside, back) = ([splat(self.origin[p]), splat(self.origin[q])], splat(back));
        let slopes = [splat(self.common[0]), splat(self.common[1])];
        let inverse = [splat(1.0 / divisor(self.common[0])), splat(1.0 / divisor(self.common[1]))];
        let zero = splat(0.0);
        let (mut low, mut high) = ([infinite; 2], [splat(f32::NEG_INFINITY); 2]);
        let (mut first, mut far, mut wide) = (infinite, zero, zero);
        for group in 0..RAYS / S::Wide::LANES {
            let z = S::Wide::at(&self.start[2], group).mul_sub(forward, back);
            z.put(&mut self.start[2], group);
            far = z.max(far);
            for i in 0..2 {
                let x = S::Wide::at(&self.start[i], group).sub(beside[i]);
                x.put(&mut self.start[i], group);
                wide = x.abs().max(wide);
                let across = x.sub(slopes[i].mul(z));
                across.put(&mut self.across[i], group);
                across.mul(inverse[i]).put(&mut self.slabs[i], group);
                (low[i], high[i]) = (across.min(low[i]), across.max(high[i]));
            }
            depth.put(&mut self.depth, group);
            first = self.bound::<S, Parallel>(range, group).min(first);
        }
        self.first = first.smallest().max(0.0);
        (self.low, self.high) = ([low[0].smallest(), low[1].smallest()], [high[0].largest(), high[1].largest()]);
        self.largest = 1.0;
        let (wide, far) = (wide.largest(), far.largest());
        // e and 8 u R.
        self.blur = UNIT_ROUNDOFF * 1.01 * (11.0 * wide + 14.0 * far);
        self.rows = Rows::new::<S>(&self.across);
        if wide + far < HUGE { Fit::Whole } else { Fit::None }
    }

    /// The largest component of a ray's point.
    #[inline(always)]
    pub fn widest(&self) -> f32 {
        let ([a, b], [c, d]) = (self.low, self.high);
        a.abs().max(b.abs()).max(c.abs().max(d.abs()))
    }
}

/// A slope that may be divided by.
#[inline(always)]
fn divisor(slope: f32) -> f32 {
    if slope.abs() < MIN_SLOPE { MIN_SLOPE.copysign(slope) } else { slope }
}

impl Pencil for Parallel {
    const IS_PARALLEL: bool = true;

    #[inline(always)]
    fn slab(bundle: &Bundle, reach: Vec3) -> Option<BundleSlab> {
        let [p, q, along] = axes(bundle.axis);
        let away = Vec3::from_array(bundle.origin).abs();
        let (span, wide) = (away + reach, bundle.widest());
        let slopes = [divisor(bundle.common[0]), divisor(bundle.common[1])];
        let scale = [1.0 / slopes[0], 1.0 / slopes[1]];
        let stray = 2.0 * MIN_SLOPE * (span[along] + wide);
        let ends = |i: usize| [bundle.low[i] * scale[i], bundle.high[i] * scale[i]];
        let steepest = [scale[0].abs() * (span[p] + wide), scale[1].abs() * (span[q] + wide), span[along]];
        let is_finite = steepest[0].max(steepest[1]).max(steepest[2]) < HUGE;
        let sign = [slopes[0].signum(), slopes[1].signum(), bundle.forward];
        is_finite.then(
            #[inline(always)]
            || BundleSlab::new(bundle, sign, bundle.blur + stray, scale, [ends(0), ends(1)]),
        )
    }

    #[inline(always)]
    fn meet<V: Vector>(plane: V, ray: V) -> V {
        plane.sub(ray)
    }

    #[inline(always)]
    fn edges<S: Simd>(block: &Block, bundle: &Bundle, most: f32) -> Option<(u32, Edges)> {
        triangles::edges::<S>(block, bundle, most)
    }

    #[inline(always)]
    fn footprints<S: Simd>(corners: &[[[f32; LANES]; 3]; 3], bundle: &Bundle) -> Footprints {
        triangles::footprints::<S>(corners, bundle)
    }

    #[inline(always)]
    fn depths<V: Vector>(edges: &Edges, lane: usize, along: V) -> [V; 2] {
        [along.add(V::splat(edges.near_height[lane])), along.add(V::splat(edges.far_height[lane]))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::bvh::simd::Portable;

    fn fit(rays: &[Ray; RAYS]) -> Option<Fit> {
        let (mut bundle, mut range) = (Bundle::new(), RayIntervals::new());
        let fill = FillParallel { bundle: &mut bundle, rays, range: &mut range };
        may_be_parallel(rays).then(|| fill.run::<Portable>())
    }

    fn side_by_side(direction: Vec3) -> [Ray; RAYS] {
        std::array::from_fn(|i| Ray::new(Vec3::new((i % 8) as f32, (i / 8) as f32, (i % 3) as f32), direction))
    }

    #[test]
    fn what_runs_the_same_way_makes_a_bundle() {
        let ways = [Vec3::NEG_Z, Vec3::new(0.0, 3.0, -0.0), Vec3::new(1e-42, -1.0, 1e-9), Vec3::new(-1e-6, 2e-6, 1e-6)];
        for way in ways.into_iter().chain([Vec3::ONE * 1e7]) {
            assert_eq!(fit(&side_by_side(way)), Some(Fit::Whole), "{way}");
        }
        let with = |change: fn(&mut Ray)| {
            let mut rays = side_by_side(Vec3::ONE);
            change(&mut rays[20]);
            fit(&rays)
        };
        assert_eq!(with(|ray| ray.tmax = 0.5), Some(Fit::Whole));
        assert_eq!(with(|ray| ray.direction.x = 1.0_f32.next_up()), Some(Fit::None), "one is out of step");
        assert_eq!(with(|ray| ray.origin.x = 1e38), Some(Fit::None));
        assert_eq!(with(|ray| ray.origin.x = f32::NAN), Some(Fit::Parts));
        assert_eq!(with(|ray| ray.direction.z = f32::NAN), Some(Fit::Parts));
        assert_eq!(with(|ray| (ray.tmin, ray.tmax) = (2.0, 1.0)), Some(Fit::Parts));
        assert_eq!(fit(&side_by_side(Vec3::X * 1e9)), Some(Fit::None), "t may be rounded to what it is not");
        assert_eq!(fit(&side_by_side(Vec3::X * 1e-31)), Some(Fit::None));
        assert_eq!(fit(&[Ray::new(Vec3::ONE, Vec3::X); RAYS]), None, "they have a point in common");
    }
}
