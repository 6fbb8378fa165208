//! One ray against a block of eight triangles: rejected in f32 by the ray's own shear ([`super::woop`]).

use super::Blur;
use super::planes;
use super::woop::{self, Aim, Judged, Margin, SLACK, Sheared, Sides};
use crate::math::Vec3;
use crate::ray::Ray;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector, axes};

/// A ray made ready for the f32 reject test.
#[derive(Clone, Copy, Debug)]
pub(in crate::trace::bvh) struct Filter {
    /// The axis along which the direction is largest, before it the two that follow it: of each, how many bytes after
    /// the first axis its corners are in a block.
    pub axes: [u32; 3],
    /// Origin, in the order of `axes`.
    pub origin: [f32; 3],
    /// Direction along the first two axes over that along the third, negative; at most 1 in magnitude.
    pub shear: [f32; 2],
    pub margin: Margin<f32>,
    /// Direction along the third, negative.
    pub against: f32,
    /// 1 over its magnitude.
    pub shorten: f32,
    /// Least t, rounded down, times the magnitude of `against`.
    pub begin: f32,
    /// How far all that may be from the ray that is meant.
    pub blur: Blur,
}

/// Triangles of a block that a ray may hit.
pub(in crate::trace::bvh) struct Candidates {
    /// A bit for each of them.
    pub lanes: u32,
    /// A bit for those that it hits without doubt, at a t between `low` and `high`, and so that t, u and v can be
    /// computed in f64.
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
        let axis = largest_axis(ray.direction.abs());
        let [x, y, z] = axes(axis);
        let (direction, origin) = (ray.direction.to_array(), ray.origin.to_array());
        let reciprocal = 1.0 / direction[z];
        let shear = [direction[x] * -reciprocal, direction[y] * -reciprocal];
        Self {
            axes: rows(axis),
            origin: [origin[x], origin[y], origin[z]],
            shear,
            margin: Margin::of_one(1.0 + shear[0].abs().max(shear[1].abs()), blur.direction),
            against: -direction[z],
            shorten: reciprocal.abs(),
            begin: ray.tmin * direction[z].abs() * (1.0 - SLACK),
            blur,
        }
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
        let (sides, passed) = self.look::<S, BLURRED>(block);
        if passed == 0 {
            return Candidates::NONE;
        }
        self.meet::<S, BLURRED, ROUNDED>(block, &sides, passed, limit)
    }

    /// On which sides of the triangles' edges the ray passes, and a bit for each triangle that it may pass within.
    #[inline(always)]
    pub fn look<S: Simd, const BLURRED: bool>(&self, block: &Block) -> (Sides<S::V8>, u32) {
        let splat = S::V8::splat;
        let [kx, ky, kz] = self.axes;
        let (cx, cy, cz) = (S::corners(block, kx), S::corners(block, ky), S::corners(block, kz));
        let [ox, oy, oz] = self.origin_in_lanes::<S>();
        let (sx, sy) = (splat(self.shear[0]), splat(self.shear[1]));
        // From the corners to the origin, not the other way round: that spares loads.
        let mut x = [ox; 3];
        let mut y = [oy; 3];
        let mut z = [oz; 3];
        for k in 0..3 {
            z[k] = oz.sub(cz[k]);
            x[k] = z[k].mul_add(sx, ox.sub(cx[k]));
            y[k] = z[k].mul_add(sy, oy.sub(cy[k]));
        }
        let blur = if BLURRED { Some(self.blur.origin) } else { None };
        let sides = Sides::new(&Sheared { x, y, z }, &self.margin.splat(), splat(block.size), blur);
        let passed = sides.passed() & block.lanes;
        (sides, passed)
    }

    /// The triangles that it may hit, of those that it may pass within, after [`Self::look`]. If they are not
    /// `ROUNDED`, corners are those that are meant; else the blur's origin has room for what they are off by.
    #[inline(always)]
    pub fn meet<S: Simd, const BLURRED: bool, const ROUNDED: bool>(
        &self,
        block: &Block,
        sides: &Sides<S::V8>,
        passed: u32,
        limit: f32,
    ) -> Candidates {
        let splat = S::V8::splat;
        let aim = Aim { against: splat(self.against), shorten: splat(self.shorten), begin: splat(self.begin) };
        let blur = self.blur;
        let judged = woop::judge::<S::V8, BLURRED, ROUNDED>(
            sides,
            &aim,
            splat(limit),
            splat(block.size),
            passed,
            blur,
            #[inline(always)]
            || {
                // Asked that rarely, corners are better loaded again than kept: the black box keeps them from being
                // kept.
                let block = std::hint::black_box(block);
                let [kx, ky, kz] = self.axes;
                let corners = [S::corners(block, kx), S::corners(block, ky), S::corners(block, kz)];
                planes::heights(corners, self.origin_in_lanes::<S>(), if BLURRED { blur.origin } else { 0.0 })
            },
        );
        match judged {
            Some(Judged { lanes, sure, low, high }) => {
                Candidates { lanes, sure: sure.bits(), low: low.to_array(), high: high.to_array() }
            }
            None => Candidates::NONE,
        }
    }

    #[inline(always)]
    fn origin_in_lanes<S: Simd>(&self) -> [S::V8; 3] {
        let [x, y, z] = self.origin;
        [S::V8::splat(x), S::V8::splat(y), S::V8::splat(z)]
    }
}

/// Where in a block the corners' components on an axis are.
#[inline(always)]
const fn at(axis: usize) -> u32 {
    axis as u32 * Block::AXIS
}

/// [`Filter::axes`] of a ray along an axis.
#[inline(always)]
pub(in crate::trace::bvh) const fn rows(axis: usize) -> [u32; 3] {
    let [x, y, z] = axes(axis);
    [at(x), at(y), at(z)]
}

/// The axis of the largest component.
#[inline(always)]
pub(in crate::trace::bvh) fn largest_axis(v: Vec3) -> usize {
    if v.x > v.y && v.x > v.z {
        0
    } else if v.y > v.z {
        1
    } else {
        2
    }
}

/// Filters of eight rays, field by field.
pub(super) struct Filters<V> {
    /// As bits of numbers.
    pub axes: [V; 3],
    pub origin: [V; 3],
    pub shear: [V; 2],
    pub margin: Margin<V>,
    pub against: V,
    pub shorten: V,
    pub begin: V,
}

impl<V: Vector> Filters<V> {
    /// As [`Filter::new`] for each of them; directions are off by `blur` of their largest component.
    #[inline(always)]
    pub fn new(origin: [V; 3], direction: [V; 3], tmin: V, blur: V) -> Self {
        let [dx, dy, dz] = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
        let is_x = dy.less(dx).and(dz.less(dx));
        let is_y = dz.less(dy).without(is_x);
        // What stands at the axis, and at those after it.
        let along = pick(is_x, is_y, direction, 0);
        let reciprocal = V::splat(1.0).div(along);
        let negative = V::splat(0.0).sub(reciprocal);
        let shear = [pick(is_x, is_y, direction, 1).mul(negative), pick(is_x, is_y, direction, 2).mul(negative)];
        let numbers =
            [V::splat(f32::from_bits(at(0))), V::splat(f32::from_bits(at(1))), V::splat(f32::from_bits(at(2)))];
        Self {
            axes: [pick(is_x, is_y, numbers, 1), pick(is_x, is_y, numbers, 2), pick(is_x, is_y, numbers, 0)],
            origin: [pick(is_x, is_y, origin, 1), pick(is_x, is_y, origin, 2), pick(is_x, is_y, origin, 0)],
            margin: Margin::new(shear[0].abs().max(shear[1].abs()).add(V::splat(1.0)), blur),
            shear,
            against: V::splat(0.0).sub(along),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::UNIT_ROUNDOFF;
    use crate::shape::triangle;
    use crate::trace::bvh::hits::noted::{Rays, widen};
    use crate::trace::bvh::hits::quad::Quad;
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::simd::Portable;
    use crate::trace::bvh::simd::isa::{self, Kernel, Present};

    struct Test<'a>(&'a Filter, &'a Block, f32);

    impl Kernel for Test<'_> {
        type Output = Candidates;
        #[inline(always)]
        fn run<S: Simd>(self) -> Candidates {
            self.0.candidates::<S, false>(self.1, self.2)
        }
    }

    /// Eight triangles around `at`, of about that size; `thin` times as wide as long.
    fn block(random: &mut Random, at: Vec3, size: f32, thin: f32) -> Block {
        let mut block = Block::EMPTY;
        for primitive in 0..LANES as u32 {
            let a = at + random.vec3() * size;
            let (along, across) = (random.vec3() * size, random.vec3() * size * thin);
            block.push([a, a + along, a + along * random.unit() + across], 0, primitive);
        }
        block
    }

    /// t, u and v of a hit that is sure.
    fn computed(ray: &Ray, corners: [Vec3; 3]) -> [f32; 3] {
        let corners = corners.map(|p| p.to_array().map(|x| widen::<Portable>(&[x; 4])));
        let Rays { origin, direction } = Rays::new::<Portable>([ray; 4]);
        let hits = Quad::new(origin, direction, corners).hits();
        [hits.t32[0], hits.u[0], hits.v[0]]
    }

    /// Held against the exact test, for triangles from larger than their distance to a millionth of it, at any scale,
    /// thin ones among them, by rays that pass through them, along their edges and beside them: none that is hit is
    /// left out; what is sure is hit, between the bounds, and computed in f64 as there.
    #[test]
    fn bounds_hold() {
        let mut random = Random::new(1);
        let mut pick = |of: [f32; 4]| of[(4.0 * random.unit().abs()) as usize % 4];
        let cases: Vec<[f32; 6]> = (0..30_000)
            .map(|case| {
                let size = if case % 2 == 0 { [3.0, 0.3, 1e-2, 1e-3] } else { [1e-2, 1e-3, 1e-4, 1e-6] };
                let (size, thin) = (pick(size), pick([1.0, 1.0, 0.05, 1e-5]));
                let (scale, long) = (pick([1.0, 1e-9, 1e6, 1e13]), pick([1.0, 1e-3, 10.0, 1.0]));
                [size, thin, scale, long, pick([0.0, 0.0, 0.0, 0.99]), pick([f32::INFINITY, f32::INFINITY, 1.01, 0.5])]
            })
            .collect();
        // Of each instruction set.
        let (mut hits, mut sures, mut slender, mut small) = ([0; 3], [0; 3], [0; 3], [0; 3]);
        for (case, [size, thin, scale, long, tmin, tmax]) in cases.into_iter().enumerate() {
            let (origin, at) = (random.vec3() * scale, random.vec3() * scale);
            let block = block(&mut random, at, size * scale, thin);
            let [a, b, c] = block.triangle(case % LANES);
            let (u, v) = (random.unit().abs(), if case % 5 == 0 { 0.0 } else { random.unit().abs() });
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            // Some start on what they aim at.
            let aim = a + (b - a) * u + (c - a) * v;
            let origin = if case % 7 == 0 { aim } else { origin };
            let direction = if case % 7 == 0 { random.vec3() } else { (aim - origin) * long };
            let ray = Ray { tmin: tmin / long, tmax: tmax / long, ..Ray::new(origin, direction) };
            if !ray.is_valid() {
                continue;
            }
            let filter = Filter::new(&ray, Blur::NONE);
            let limit = ray.tmax.next_up();
            for (set, isa) in Present::all().enumerate() {
                let Candidates { lanes, sure, low, high } = isa::dispatch(isa, Test(&filter, &block, limit));
                for lane in 0..LANES {
                    let hit = triangle::intersect(&ray, &block.triangle(lane));
                    let context = format!("{case} {isa:?} {ray:?} {:?}", block.triangle(lane));
                    hits[set] += u32::from(hit.is_some());
                    assert!(hit.is_none() || lanes >> lane & 1 != 0, "left out: {context}");
                    if (lanes & sure) >> lane & 1 == 0 {
                        continue;
                    }
                    let (low, high) = (low[lane], high[lane]);
                    // Out of range, it may be missed.
                    let Some(hit) = hit else {
                        assert!(low < ray.tmin || high > ray.tmax, "not hit: {context}");
                        continue;
                    };
                    let t = hit.t as f32;
                    assert!(low <= t && t <= high, "{low} {t} {high}: {context}");
                    assert_eq!(computed(&ray, block.triangle(lane)), [t, hit.u as f32, hit.v as f32], "{context}");
                    sures[set] += 1;
                    slender[set] += u32::from(thin < 0.1);
                    small[set] += u32::from(size < 1e-3);
                }
            }
        }
        for (set, _) in Present::all().enumerate() {
            let [hits, sures, slender, small] = [hits[set], sures[set], slender[set], small[set]];
            let found = format!("{hits} hits, {sures} sure, {slender} of them slender, {small} small");
            assert!(hits > 10_000 && sures > 5000 && slender > 300 && small > 200, "{found}");
        }
    }

    /// Triangles that are seen edge-on, from far beside them: edge functions are then but the rounding of their
    /// products, and may agree.
    #[test]
    fn rounding_alone_is_no_hit() {
        let known = [
            (
                Ray::new(
                    Vec3::new(-0.309_933_57, 0.396_746_37, -2.456_245_7e-4),
                    Vec3::new(-1.055_873_1e-3, -3.528_853_4e-4, 1.0),
                ),
                [
                    Vec3::ZERO,
                    Vec3::new(0.013_442_36, -0.017_240_98, 0.019_604_3),
                    Vec3::new(0.012_856_27, -0.016_495_37, 0.022_335),
                ],
            ),
            (
                Ray::new(Vec3::new(0.580_546_1, 0.506_399_1, -0.009_349_72), Vec3::Z),
                [
                    Vec3::ZERO,
                    Vec3::new(0.010_273_74, 0.008_961_57, 0.018_269_79),
                    Vec3::new(-0.004_306_1, -0.003_756_13, 0.033_902_32),
                ],
            ),
        ];
        let mut cases = Vec::from(known);
        let mut random = Random::new(3);
        for _ in 0..200_000 {
            // A triangle in a plane that all but contains the ray.
            let across = random.vec3().with_z(0.0).normalize();
            let far = 0.3 + random.unit().abs();
            let mut in_plane = || across * (random.unit() * 0.03) + Vec3::Z * (random.unit() * 0.03);
            let corners = [in_plane(), in_plane(), in_plane()];
            cases.push((Ray::new(across * far - Vec3::Z * 0.01, Vec3::Z), corners));
        }
        for (ray, corners) in cases {
            let mut block = Block::EMPTY;
            block.push(corners, 0, 0);
            let filter = Filter::new(&ray, Blur::NONE);
            for isa in Present::all() {
                let Candidates { lanes, sure, .. } = isa::dispatch(isa, Test(&filter, &block, f32::INFINITY));
                let hit = triangle::intersect(&ray, &corners);
                assert!(lanes & sure == 0 || hit.is_some(), "{isa:?} {ray:?} {corners:?}");
            }
        }
    }

    /// However small for its distance, a triangle that a ray passes through leaves little doubt about t.
    #[test]
    fn bounds_of_t_are_narrow() {
        let mut random = Random::new(2);
        for case in 0..2000 {
            let size = [1e-1, 1e-2, 1e-3, 1e-4][case % 4];
            let at = Vec3::new(1.0, 2.0, 3.0);
            let a = Vec3::new(0.3, -0.2, 0.1) * size;
            let corners =
                [at + a, at + a + Vec3::new(-1.0, 1.0, 0.0) * size, at + a - Vec3::new(1.0, 1.0, -1.0) * size];
            let mut block = Block::EMPTY;
            block.push(corners, 0, 0);
            let (u, v) = (0.33 + 0.1 * random.unit(), 0.33 + 0.1 * random.unit());
            let target = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
            let ray = Ray::new(Vec3::ZERO, target);
            let Candidates { sure, low, high, .. } =
                isa::dispatch(Present::PORTABLE, Test(&Filter::new(&ray, Blur::NONE), &block, f32::INFINITY));
            assert_eq!(sure, 1, "{case}");
            assert!(high[0] - low[0] < 4096.0 * UNIT_ROUNDOFF, "{case}: {} to {}", low[0], high[0]);
        }
    }
}
