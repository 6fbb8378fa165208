//! What the rays of a bundle have hit so far: for the most part only noted, and computed at the end, four at a time.

use std::marker::PhantomData;

use super::pencil::Pencil;
use super::rays::Bundle;
use crate::math::Vec3;
use crate::ray::Ray;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::hits::found::NONE;
use crate::trace::bvh::hits::noted::{FourHits, Rays, Shared, splat, widen};
use crate::trace::bvh::levels::placements::FIXED;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::simd::isa::Kernel;
use crate::trace::bvh::simd::{PerRay, RAYS, Simd};
use crate::trace::nearest::Nearest;

/// What the rays of a bundle have hit so far.
pub(super) struct BundleFound {
    /// No hit beyond this t' is wanted; rounded up. Below every t' for a ray that is done.
    pub limit: PerRay,
    /// A hit nearer than this is the nearest for sure.
    pub sure: PerRay,
    /// What was found without doubt, but not computed yet: block and lane.
    pub noted: [u32; RAYS],
    /// Where that triangle is.
    pub place: [u32; RAYS],
    /// What was computed: valid for the rays of the bit mask `computed`.
    pub nearest: [Nearest; RAYS],
    pub computed: u64,
}

/// `sure` and `limit` of a ray that needs no more hits.
pub(super) const DONE: f32 = f32::NEG_INFINITY;

impl BundleFound {
    pub fn new() -> Self {
        let nothing = Nearest::new(&Ray::new(Vec3::ZERO, Vec3::X));
        Self {
            limit: PerRay::ZERO,
            sure: PerRay::ZERO,
            noted: [NONE; RAYS],
            place: [FIXED; RAYS],
            nearest: [nothing; RAYS],
            computed: 0,
        }
    }

    /// Nothing yet.
    #[inline(always)]
    pub fn start(&mut self) {
        (self.noted, self.place, self.computed) = ([NONE; RAYS], [FIXED; RAYS], 0);
    }

    /// In another tree, for which `bundle` was made ready. Rays that are not `wanted` look no farther, so that they
    /// keep none waiting.
    #[inline(always)]
    pub fn enter(&mut self, bundle: &Bundle, wanted: u64) {
        (self.limit, self.sure) = (bundle.limit, bundle.end);
        let mut others = !wanted;
        while others != 0 {
            let ray = others.trailing_zeros() as usize % RAYS;
            others &= others - 1;
            (self.limit.0[ray], self.sure.0[ray]) = (DONE, DONE);
        }
    }

    /// Makes `nearest` valid for a ray, from what is noted.
    pub fn compute(&mut self, bvh: &Bvh, rays: &[Ray; RAYS], ray: usize) {
        let id = std::mem::replace(&mut self.noted[ray], NONE);
        if id != NONE {
            // It is nearer than whatever was computed before.
            self.nearest[ray] = bvh.noted_hit(self.place[ray], id, &rays[ray]);
        } else if self.computed >> ray & 1 == 0 {
            self.nearest[ray] = Nearest::new(&rays[ray]);
        }
        self.computed |= 1 << ray;
    }
}

/// Computes what is noted, and answers for the first `count` rays; `bundle` is theirs in the world.
pub(super) struct Finish<'a, Q: Query, P> {
    pub bvh: &'a Bvh,
    pub found: &'a BundleFound,
    pub bundle: &'a Bundle,
    pub rays: &'a [Ray; RAYS],
    pub count: usize,
    pub answers: &'a mut [Q::Answer; RAYS],
    pub t: &'a mut [f64; RAYS],
    pub pencil: PhantomData<P>,
}

impl<Q: Query, P: Pencil> Kernel for Finish<'_, Q, P> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, found, bundle, rays, count, answers, t, pencil } = self;
        // Neighbours mostly hit the same triangle.
        let (mut shared, mut seen): (Option<Shared<_>>, Option<Shared<_>>) = (None, None);
        let has_placements = bvh.placements.has_triangles();
        let mut mixed = 0;
        for chunk in 0..count.div_ceil(4) {
            let chunk = chunk % (RAYS / 4);
            let ids: &[u32; 4] = &found.noted.as_chunks().0[chunk];
            let places: &[u32; 4] = &found.place.as_chunks().0[chunk];
            let answers: &mut [Q::Answer; 4] = &mut answers.as_chunks_mut().0[chunk];
            let t: &mut [f64; 4] = &mut t.as_chunks_mut().0[chunk];
            let id = ids[0];
            if *ids == [id; 4] && (!has_placements || *places == [FIXED; 4]) {
                if id != NONE {
                    let triangles = &bvh.fixed.triangles;
                    let hits = if P::IS_PARALLEL {
                        let shared = match &shared {
                            Some(shared) if shared.id == id => shared,
                            _ => shared.insert(triangles.shared::<S>(id)),
                        };
                        shared.hits(&four::<S, P>(bundle, rays, chunk))
                    } else {
                        let seen = match &seen {
                            Some(seen) if seen.id == id => seen,
                            _ => {
                                seen.insert(triangles.shared::<S>(id).from(splat::<S>(Vec3::from_array(bundle.origin))))
                            }
                        };
                        seen.along(directions::<S>(bundle, chunk))
                    };
                    answer::<Q>(&hits, t, answers);
                    continue;
                }
                if found.computed >> (4 * chunk) & 0b1111 == 0 {
                    *answers = [Q::MISS; 4];
                    continue;
                }
            }
            mixed |= 1 << chunk;
        }
        if mixed != 0 {
            S::apart(Mixed::<Q, P> { bvh, found, bundle, rays, chunks: mixed, answers, t, pencil });
        }
    }
}

/// Fours of neighbours in a bundle that have not all hit the same fixed triangle, a bit each.
struct Mixed<'a, Q: Query, P> {
    bvh: &'a Bvh,
    found: &'a BundleFound,
    bundle: &'a Bundle,
    rays: &'a [Ray; RAYS],
    chunks: u32,
    answers: &'a mut [Q::Answer; RAYS],
    t: &'a mut [f64; RAYS],
    pencil: PhantomData<P>,
}

impl<Q: Query, P: Pencil> Kernel for Mixed<'_, Q, P> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, found, bundle, rays, mut chunks, answers, t, .. } = self;
        while chunks != 0 {
            let chunk = chunks.trailing_zeros() as usize % (RAYS / 4);
            chunks &= chunks - 1;
            let ids: &[u32; 4] = &found.noted.as_chunks().0[chunk];
            let places: &[u32; 4] = &found.place.as_chunks().0[chunk];
            let answers: &mut [Q::Answer; 4] = &mut answers.as_chunks_mut().0[chunk];
            let t: &mut [f64; 4] = &mut t.as_chunks_mut().0[chunk];
            let noted = named(ids);
            if noted != 0 && *places == [FIXED; 4] {
                let all = noted == 0b1111;
                let known = if all { *ids } else { repeated(ids, noted) };
                // Those of rays that have hit nothing, or what was computed, are replaced below.
                answer::<Q>(&bvh.fixed.triangles.hits::<S>(&four::<S, P>(bundle, rays, chunk), known), t, answers);
                if all {
                    continue;
                }
            } else if noted != 0 {
                answer_some::<S, Q, P>(bvh, bundle, rays, chunk, ids, places, t, answers);
            }
            for lane in (0..4).filter(|lane| noted >> lane & 1 == 0) {
                let ray = 4 * chunk + lane;
                answers[lane] = Q::MISS;
                if found.computed >> ray & 1 != 0 {
                    let nearest = &found.nearest[ray];
                    (t[lane], answers[lane]) = (nearest.t(), Q::answer(nearest.hit()));
                }
            }
        }
    }
}

#[inline(always)]
fn answer<Q: Query>(hits: &FourHits, t: &mut [f64; 4], answers: &mut [Q::Answer; 4]) {
    *t = hits.quad.t;
    for (i, answer) in answers.iter_mut().enumerate() {
        *answer = Q::answer(Some(hits.hit(i)));
    }
}

/// Answers for those of the four rays of a chunk that hit a triangle for sure: first for those that hit a fixed one,
/// then for those that hit a placed one. The other lanes compute something harmless meanwhile.
///
/// For fixed ones what remains of [`triangle::intersect`](crate::shape::triangle::intersect) is whether f64 is precise
/// enough. It is: where a hit is sure, height and slope are known to a quarter of themselves in f32
/// ([`Edges`](super::edges::Edges)). f64 rounds 2^29 times finer, and a t known to 2^-27 is wanted; both count some 50
/// roundings of the same products. For a ray by itself ([`single`](super::single)),
/// [`woop`](crate::trace::bvh::reject::woop) shows it.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "four lanes of everything")]
fn answer_some<S: Simd, Q: Query, P: Pencil>(
    bvh: &Bvh,
    bundle: &Bundle,
    rays: &[Ray; RAYS],
    chunk: usize,
    ids: &[u32; 4],
    places: &[u32; 4],
    t: &mut [f64; 4],
    answers: &mut [Q::Answer; 4],
) {
    let four = four::<S, P>(bundle, rays, chunk);
    let (mut fixed, mut placed) = (0, 0);
    for lane in 0..4 {
        let bit = u32::from(ids[lane] != NONE) << lane;
        (fixed, placed) = if places[lane] == FIXED { (fixed | bit, placed) } else { (fixed, placed | bit) };
    }
    if fixed != 0 {
        let hits = bvh.fixed.triangles.hits::<S>(&four, repeated(ids, fixed));
        for lane in (0..4).filter(|lane| fixed >> lane & 1 != 0) {
            (t[lane], answers[lane]) = (hits.quad.t[lane], Q::answer(Some(hits.hit(lane))));
        }
    }
    if placed != 0 {
        let each: &[Ray; 4] = &rays.as_chunks().0[chunk];
        let (ids, places) = (repeated(ids, placed), repeated(places, placed));
        let (exact, hits) = bvh.placed_hits::<S>(each.each_ref(), placed, &four, ids, places);
        for lane in (0..4).filter(|lane| placed >> lane & 1 != 0) {
            (t[lane], answers[lane]) = (exact[lane], Q::answer(hits[lane]));
        }
    }
}

/// A bit for each lane with a triangle.
#[inline(always)]
fn named(ids: &[u32; 4]) -> u32 {
    let [a, b, c, d] = *ids;
    let bit = |id: u32, lane: u32| u32::from(id != NONE) << lane;
    bit(a, 0) | bit(b, 1) | bit(c, 2) | bit(d, 3)
}

/// The values of the lanes that are named; in the others the first of these.
#[inline(always)]
fn repeated(values: &[u32; 4], lanes: u32) -> [u32; 4] {
    let first = values[lanes.trailing_zeros() as usize % 4];
    let mut all = *values;
    for (lane, value) in all.iter_mut().enumerate() {
        *value = if lanes >> lane & 1 != 0 { *value } else { first };
    }
    all
}

/// The rays of a chunk, as they were given.
#[inline(always)]
fn four<S: Simd, P: Pencil>(bundle: &Bundle, rays: &[Ray; RAYS], chunk: usize) -> Rays<S::D4> {
    if P::IS_PARALLEL {
        return Rays::new::<S>(rays.as_chunks::<4>().0[chunk].each_ref());
    }
    Rays { origin: splat::<S>(Vec3::from_array(bundle.origin)), direction: directions::<S>(bundle, chunk) }
}

#[inline(always)]
fn directions<S: Simd>(bundle: &Bundle, chunk: usize) -> [S::D4; 3] {
    let [x, y, z] = &bundle.direction;
    let lanes = |d: &PerRay| d.0.as_chunks().0[chunk];
    [widen::<S>(&lanes(x)), widen::<S>(&lanes(y)), widen::<S>(&lanes(z))]
}
