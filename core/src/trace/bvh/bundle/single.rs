//! Rays of a bundle one by one, each against eight triangles at once: for leaves that few of them enter.
//!
//! Where triangles are smaller than pixels, eight of them concern a ray or two each, and to make their edges ready for
//! 64 rays ([`Edges`](super::edges::Edges)) costs more than all the tests that follow. A ray's own test ([`Sides`])
//! shears the corners by the ray's slopes, which are at hand, from the origin that all share. Of turned rays, which
//! share their end, it takes the ray's own origin instead: it lies on a surface as a rule, and from the far end nobody
//! could tell on which side. So it does of parallel rays.
//!
//! **Edge functions.** Slopes are off by as much as a single ray's shear in the world, and in an object's coordinates
//! by 2 u of themselves and u / 4 besides (u = 2^-24; [`Bundle`]). The bounds of [`Sides`] hold for any shear k, but
//! that an origin that is off by b counts as (1 + k) b, not 2 b. With k up to 16 the functions may overflow for
//! triangles that are hit; then they say nothing.
//!
//! **t'.** In the world it is the mean of the corners' depths, with the bounds that it has there, and planes are asked
//! only where these are not precise, as for a ray that starts on one. In an object's coordinates that is so for most
//! rays, and planes are asked at once: height over slope. With N the normal computed with all signs positive, and |d|
//! <= D on the bundle's axes, d being (p, q, 1): N is off by 4 u of itself, d by 4.25 u D at most, and the slope, with
//! its products and sums, by 12 u N D; a corner relative to the origin by u and b, and the height by 10 u N times that,
//! and b N.

use super::found::DONE;
use super::pencil::Pencil;
use super::rays::{Bundle, SLACK, TINY};
use super::walk::Walk;
use super::way::Entry;
use crate::math::UNIT_ROUNDOFF;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::levels::placements::FIXED;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::reject::Blur;
use crate::trace::bvh::reject::planes::{Heights, Planes};
use crate::trace::bvh::reject::woop::{Judged, Margin, Met, Sheared, Sides, Span};
use crate::trace::bvh::simd::{Array, Mask, RAYS, Simd, Vector, axes};

/// A block as an origin sees it, on a bundle's axes.
struct Seen<V> {
    /// From each corner to the origin: component by component.
    x: [V; 3],
    y: [V; 3],
    z: [V; 3],
}

/// From where, and up to where, a ray looks along the bundle's axis.
struct DepthInterval {
    /// Rounded down.
    first: f32,
    /// Rounded up.
    begin: f32,
    /// Hits before it are within the range for sure, and the nearest.
    sure: f32,
    /// Rounded up.
    limit: f32,
}

// Functions, not closures: these are inlined into the kernel of the instruction set without fail.

/// One component of all corners.
#[inline(always)]
fn along<V: Vector + Array<LANES>>([a, b, c]: &[[f32; LANES]; 3]) -> [V; 3] {
    [V::load(a), V::load(b), V::load(c)]
}

/// From the corners to the origin, along one axis.
#[inline(always)]
fn towards<V: Vector + Array<LANES>>(origin: f32, corners: &[[f32; LANES]; 3]) -> [V; 3] {
    let (origin, [a, b, c]) = (V::splat(origin), along::<V>(corners));
    [origin.sub(a), origin.sub(b), origin.sub(c)]
}

impl<V: Vector + Array<LANES>> Seen<V> {
    #[inline(always)]
    fn new(block: &Block, axes: [usize; 3], origin: [f32; 3]) -> Self {
        let [x, y, z] = axes;
        Self {
            x: towards(origin[x], &block.corners[x]),
            y: towards(origin[y], &block.corners[y]),
            z: towards(origin[z], &block.corners[z]),
        }
    }
}

/// The planes of a block's triangles, on a bundle's axes.
#[inline(always)]
fn planes_of<V: Vector + Array<LANES>>(block: &Block, [x, y, z]: [usize; 3]) -> Planes<V> {
    let corners = &block.corners;
    Planes::new([along(&corners[x]), along(&corners[y]), along(&corners[z])])
}

impl<Q: Query, P: Pencil> Walk<'_, Q, P> {
    /// Tests the blocks of a leaf ray by ray; true where a limit has changed.
    #[inline(always)]
    pub(super) fn visit_one_by_one<S: Simd>(&mut self, leaf: Entry) -> bool {
        let mut changed = false;
        let bundle = self.bundle;
        let (axes, blur) = (axes(bundle.axis), self.blur());
        let apart = P::IS_PARALLEL || Q::ANY && bundle.is_turned;
        for index in leaf.child.blocks() {
            let mut scratch = None;
            let block = self.tree.block::<S>(index, &mut scratch);
            let mut seen = Seen::new(block, axes, self.start(leaf.rays.trailing_zeros() as usize % RAYS, apart));
            // Made when a ray first asks; they serve every origin.
            let mut planes = None;
            let mut rays = leaf.rays;
            while rays != 0 {
                let ray = rays.trailing_zeros() as usize % RAYS;
                if apart && rays != leaf.rays {
                    seen = Seen::new(block, axes, self.own_origin(ray));
                }
                rays &= rays - 1;
                if self.found.limit.0[ray] < leaf.near {
                    continue;
                }
                let (sides, lanes) = sides::<S, P>(&seen, block, bundle, ray, blur);
                if lanes == 0 {
                    continue;
                }
                let range = if apart { self.own_range(ray) } else { self.range(ray) };
                let met = if P::IS_PARALLEL || self.place == FIXED {
                    meet_between_corners::<S>(&sides, lanes, &seen, &mut planes, block, bundle, &range)
                } else {
                    let planes = planes.get_or_insert_with(
                        #[inline(always)]
                        || planes_of::<S::V8>(block, axes),
                    );
                    let heights = planes.heights([seen.x[0], seen.y[0], seen.z[0]], blur.origin);
                    meet_planes::<S>(&sides, lanes, planes, &heights, bundle, ray, &range)
                };
                if let Some(met) = met {
                    changed |= self.take::<S>(ray, LANES as u32 * index, &met, &range);
                }
            }
        }
        changed
    }

    /// Takes what a ray may hit in the block whose first triangle is `first`; true where its limit has changed.
    #[inline(always)]
    fn take<S: Simd>(&mut self, ray: usize, first: u32, met: &Judged<S::V8>, range: &DepthInterval) -> bool {
        let &Judged { lanes: mut open, sure, low, high } = met;
        let sure = sure.and(S::V8::splat(range.begin).at_most(low));
        let (low, high) = if P::IS_PARALLEL && !Q::ANY { self.in_bundle::<S>(ray, low, high) } else { (low, high) };
        if Q::ANY && sure.and(high.less(S::V8::splat(range.sure))).bits() & open != 0 {
            (self.found.sure.0[ray], self.found.limit.0[ray]) = (DONE, DONE);
            return true;
        }
        let sure = if Q::ANY { 0 } else { sure.bits() };
        let (low, high) = (low.to_array(), high.to_array());
        let mut changed = false;
        while open != 0 {
            let lane = open.trailing_zeros() as usize % LANES;
            open &= open - 1;
            if sure >> lane & 1 != 0 {
                if high[lane] < self.found.sure.0[ray] {
                    (self.found.sure.0[ray], self.found.limit.0[ray]) = (low[lane], high[lane]);
                    (self.found.noted[ray], self.found.place[ray]) = (first + lane as u32, self.place);
                    changed = true;
                    continue;
                }
                if low[lane] > self.found.limit.0[ray] || self.settle(first + lane as u32, ray, 1) != 0 {
                    continue;
                }
            }
            changed |= self.decide(ray, first + lane as u32);
        }
        changed
    }

    /// What lies between these t' from a parallel ray's own origin, as the bundle counts it.
    #[inline(always)]
    fn in_bundle<S: Simd>(&self, ray: usize, low: S::V8, high: S::V8) -> (S::V8, S::V8) {
        let (splat, start) = (S::V8::splat, self.bundle.start_of::<P>(ray));
        let low = low.add(splat(start)).mul_add(splat(1.0 - SLACK), splat(-TINY));
        let high = high.add(splat(start)).mul_add(splat(1.0 + SLACK), splat(TINY));
        (low, high)
    }

    /// Of a ray that starts where the bundle does.
    #[inline(always)]
    fn range(&self, ray: usize) -> DepthInterval {
        let Self { bundle, found, .. } = self;
        DepthInterval {
            first: bundle.first,
            begin: bundle.begin.0[ray],
            sure: found.sure.0[ray],
            limit: found.limit.0[ray],
        }
    }

    /// Of a ray that is looked at from its own origin.
    #[inline(always)]
    fn own_range(&self, ray: usize) -> DepthInterval {
        let Self { bundle, found, .. } = self;
        let (depth, tmin, tmax) = (bundle.depth.0[ray], self.rays[ray].tmin, self.rays[ray].tmax);
        let mut range = DepthInterval {
            // Not a little below 0, whose products are slow.
            first: (tmin * depth * (1.0 - SLACK) - TINY).max(0.0),
            begin: tmin * depth * (1.0 + SLACK) + TINY,
            // A t that overflows is no hit.
            sure: tmax.min(f32::MAX) * depth * (1.0 - SLACK) - TINY,
            limit: tmax * depth * (1.0 + SLACK) + TINY,
        };
        if P::IS_PARALLEL && !Q::ANY {
            range.limit = range.limit.min(found.limit.0[ray] * (1.0 + SLACK) - bundle.start_of::<P>(ray) + TINY);
        }
        range
    }

    /// Where a ray starts, as far as its bundle's way tells: some are looked at from their own origins.
    #[inline(always)]
    fn start(&self, ray: usize, apart: bool) -> [f32; 3] {
        if apart { self.own_origin(ray) } else { self.bundle.origin }
    }

    /// Where a ray of a turned or a parallel bundle starts.
    #[inline(always)]
    fn own_origin(&self, ray: usize) -> [f32; 3] {
        if P::IS_PARALLEL || self.place == FIXED {
            return self.rays[ray].origin.to_array();
        }
        let ([x, y, z], [dx, dy, dz]) = (self.bundle.origin, &self.bundle.direction);
        [x - dx.0[ray], y - dy.0[ray], z - dz.0[ray]]
    }

    /// How far rays may be off, as [`Sides`] counts it. In the world they are as they were given, turned ones from
    /// their own origins, too. In an object's coordinates these are told from the common end, and the difference rounds
    /// by less than the blur, which has room for the rounding of both already.
    #[inline(always)]
    fn blur(&self) -> Blur {
        if P::IS_PARALLEL || self.place == FIXED {
            return Blur::NONE;
        }
        let Bundle { blur, largest, is_turned, .. } = *self.bundle;
        let off = if is_turned { 2.0 * blur } else { blur };
        Blur { origin: 0.5 * (1.0 + largest) * off, direction: 1.1 * UNIT_ROUNDOFF * largest }
    }
}

/// A ray's edge functions, and a bit for every triangle that these leave.
#[inline(always)]
fn sides<S: Simd, P: Pencil>(
    seen: &Seen<S::V8>,
    block: &Block,
    bundle: &Bundle,
    ray: usize,
    blur: Blur,
) -> (Sides<S::V8>, u32) {
    let splat = S::V8::splat;
    let [p, q] = if P::IS_PARALLEL { bundle.common } else { [bundle.across[0].0[ray], bundle.across[1].0[ray]] };
    let (sx, sy) = (splat(-bundle.forward * p), splat(-bundle.forward * q));
    let Seen { x, y, z } = seen;
    let sheared = Sheared {
        x: [z[0].mul_add(sx, x[0]), z[1].mul_add(sx, x[1]), z[2].mul_add(sx, x[2])],
        y: [z[0].mul_add(sy, y[0]), z[1].mul_add(sy, y[1]), z[2].mul_add(sy, y[2])],
        z: *z,
    };
    let width = sx.abs().max(sy.abs()).add(splat(1.0));
    let sides = Sides::new(&sheared, &Margin::new(width, splat(blur.direction)), splat(block.size), Some(blur.origin));
    let lanes = (sides.passed() | !sides.are_finite().bits()) & block.lanes;
    (sides, lanes)
}

/// Where a ray meets the triangles that its edge functions leave: by the mean of the corners' depths.
#[inline(always)]
fn meet_between_corners<S: Simd>(
    sides: &Sides<S::V8>,
    lanes: u32,
    Seen { x, y, z }: &Seen<S::V8>,
    planes: &mut Option<Planes<S::V8>>,
    block: &Block,
    bundle: &Bundle,
    range: &DepthInterval,
) -> Option<Judged<S::V8>> {
    let splat = S::V8::splat;
    // A turned bundle runs against its rays.
    let way = if bundle.is_turned { -bundle.forward } else { bundle.forward };
    let span = Span { begin: splat(range.first), end: splat(range.limit), against: splat(-way) };
    let Met { lanes, sure, area, near, far } = sides.meet::<false>(
        splat(block.size),
        None,
        &span,
        lanes,
        #[inline(always)]
        || {
            // Not by a closure within a closure, which may miss the instruction set.
            let known = match planes {
                Some(known) => known,
                None => planes.insert(planes_of::<S::V8>(block, axes(bundle.axis))),
            };
            known.heights([x[0], y[0], z[0]], 0.0)
        },
    );
    if lanes == 0 {
        return None;
    }
    let inverse = splat(1.0).div(area);
    // What is apart stays so when t is rounded.
    let (nearer, farther) = (inverse.mul(splat(1.0 - SLACK)), inverse.mul(splat(1.0 + SLACK)));
    Some(Judged { lanes, sure, low: near.mul(nearer), high: far.mul(farther) })
}

/// The same by their planes.
#[inline(always)]
fn meet_planes<S: Simd>(
    sides: &Sides<S::V8>,
    lanes: u32,
    planes: &Planes<S::V8>,
    &Heights { height, error }: &Heights<S::V8>,
    bundle: &Bundle,
    ray: usize,
    range: &DepthInterval,
) -> Option<Judged<S::V8>> {
    let (splat, zero) = (S::V8::splat, S::V8::splat(0.0));
    let Planes { normal: [nx, ny, nz], size: [sx, sy, sz] } = planes;
    // A turned bundle runs against its rays.
    let way = if bundle.is_turned { -1.0 } else { 1.0 };
    let (p, q) = (splat(way * bundle.across[0].0[ray]), splat(way * bundle.across[1].0[ray]));
    let slope = p.mul_add(*nx, q.mul_add(*ny, nz.mul(splat(way * bundle.forward))));
    let slope_error = sx.add(*sy).add(*sz).mul(splat(16.0 * UNIT_ROUNDOFF * bundle.largest));
    // t' = -height / slope. Turned so that it is positive where the slope is.
    let turned = S::V8::select(height.less(zero), slope, zero.sub(slope));
    let (height, steep, four) = (height.abs(), turned.abs(), splat(4.0));
    let infinite = splat(f32::INFINITY);
    let known = slope_error.mul(four).less(steep).and(steep.less(infinite)).and(height.less(infinite));
    let low = height.sub(error).div(steep.add(slope_error)).mul(splat(1.0 - SLACK));
    let high = height.add(error).div(steep.sub(slope_error)).mul(splat(1.0 + SLACK));
    let behind = turned.less(zero).and(error.less(height));
    let outside = behind.or(splat(range.limit).less(low)).or(high.less(splat(range.first)));
    let lanes = lanes & !known.and(outside).bits();
    // Known to a quarter in f32, both are precise enough in f64.
    let tame = known.and(error.mul(four).less(height)).and(zero.less(turned));
    (lanes != 0).then(
        #[inline(always)]
        || Judged { lanes, sure: sides.inside().and(sides.are_finite()).and(tame), low, high },
    )
}
