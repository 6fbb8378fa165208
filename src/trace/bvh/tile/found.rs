//! What the rays of a bundle have hit so far: for the most part only noted, and computed at the end, four at a time.

use crate::math::Vec3;
use crate::ray::Ray;
use crate::trace::bvh::bundle::{Bundle, PerRay, RAYS};
use crate::trace::bvh::found::NONE;
use crate::trace::bvh::quad::widen;
use crate::trace::bvh::query::Query;
use crate::trace::bvh::simd::{Doubles, Simd};
use crate::trace::bvh::triangles::TriangleTree;
use crate::trace::nearest::Nearest;

/// What the rays of a bundle have hit so far.
pub(super) struct Found {
    /// No hit beyond this t' is wanted; rounded up. Below every t' for a ray that is done.
    pub limit: PerRay,
    /// A hit nearer than this is the nearest for sure.
    pub sure: PerRay,
    /// What was found without doubt, but not computed yet: block and lane.
    pub noted: [u32; RAYS],
    /// What was computed: valid for the rays of the bit mask `computed`.
    pub nearest: [Nearest; RAYS],
    pub computed: u64,
}

/// `sure` and `limit` of a ray that needs no more hits.
pub(super) const DONE: f32 = f32::NEG_INFINITY;

impl Found {
    pub fn new() -> Self {
        let nothing = Nearest::new(&Ray::new(Vec3::ZERO, Vec3::X));
        Self { limit: PerRay::ZERO, sure: PerRay::ZERO, noted: [NONE; RAYS], nearest: [nothing; RAYS], computed: 0 }
    }

    /// Nothing yet.
    #[inline(always)]
    pub fn start(&mut self, bundle: &Bundle) {
        (self.limit, self.sure, self.noted, self.computed) = (bundle.limit, bundle.end, [NONE; RAYS], 0);
    }

    /// Makes `nearest` valid for a ray, from what is noted.
    pub fn compute(&mut self, tree: &TriangleTree, rays: &[Ray; RAYS], ray: usize) {
        let id = std::mem::replace(&mut self.noted[ray], NONE);
        // What is noted is nearer than whatever was computed before.
        if id != NONE || self.computed >> ray & 1 == 0 {
            self.nearest[ray] = Nearest::new(&rays[ray]);
            self.computed |= 1 << ray;
        }
        if id != NONE {
            tree.offer_one(id, &rays[ray], &mut self.nearest[ray]);
            debug_assert!(self.nearest[ray].hit().is_some(), "what is noted is hit without doubt");
        }
    }

    /// Computes what is noted, and answers for the first `count` rays.
    #[inline(always)]
    pub fn finish<S: Simd, Q: Query>(
        &mut self,
        tree: &TriangleTree,
        bundle: &Bundle,
        count: usize,
        answers: &mut [Q::Answer; RAYS],
        t: &mut [f64; RAYS],
    ) {
        for chunk in 0..count.div_ceil(4) {
            let chunk = chunk % (RAYS / 4);
            let ids: [u32; 4] = self.noted.as_chunks().0[chunk];
            let answers: &mut [Q::Answer; 4] = &mut answers.as_chunks_mut().0[chunk];
            let t: &mut [f64; 4] = &mut t.as_chunks_mut().0[chunk];
            // NONE is the largest number.
            let [a, b, c, d] = ids;
            let (some, all) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
            if all != NONE {
                answer_noted::<S, Q>(tree, bundle, chunk, ids, t, answers);
                continue;
            }
            if some != NONE {
                // Lanes without a triangle compute something harmless.
                let or_some = |id: u32| if id == NONE { some } else { id };
                let ids = [or_some(a), or_some(b), or_some(c), or_some(d)];
                answer_noted::<S, Q>(tree, bundle, chunk, ids, t, answers);
            }
            for lane in 0..4 {
                let ray = 4 * chunk + lane;
                if ids[lane] == NONE {
                    let is_hit = self.computed >> ray & 1 != 0;
                    answers[lane] = if is_hit { Q::answer(self.nearest[ray].hit()) } else { Q::MISS };
                    t[lane] = self.nearest[ray].t();
                }
            }
        }
    }
}

/// Answers for the four rays of a chunk, each of which hits a triangle for sure.
///
/// What remains of [`triangle::intersect`](crate::shape::triangle::intersect) is whether f64 is precise enough. It is: where
/// a hit is sure, height and slope are known to a quarter of themselves in f32 ([`Edges`](super::super::edges::Edges)). f64
/// rounds 2^29 times finer, and a t known to 2^-27 is wanted; both count some 50 roundings of the same products.
#[inline(always)]
fn answer_noted<S: Simd, Q: Query>(
    tree: &TriangleTree,
    bundle: &Bundle,
    chunk: usize,
    ids: [u32; 4],
    t: &mut [f64; 4],
    answers: &mut [Q::Answer; 4],
) {
    let [x, y, z] = &bundle.direction;
    let lanes = |d: &PerRay| d.0.as_chunks().0[chunk];
    let direction = [widen::<S>(&lanes(x)), widen::<S>(&lanes(y)), widen::<S>(&lanes(z))];
    let [x, y, z] = bundle.origin;
    let origin = [S::D4::splat(x.into()), S::D4::splat(y.into()), S::D4::splat(z.into())];
    let (exact, hits) = tree.hits::<S>(origin, direction, ids);
    *t = exact;
    for (answer, hit) in answers.iter_mut().zip(hits) {
        *answer = Q::answer(Some(hit));
    }
}
