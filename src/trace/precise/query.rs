//! What rays ask of meshes in f64: the nearest hit, any hit, all hits.
//!
//! Each batch goes through flights first, which name what is hit for sure; t, u and v come from the corners in f64. Then those that are
//! in doubt go one by one.

use super::frame::LocalRay;
use super::{Precise, PreciseHit, PreciseRay};
use crate::math::Vec3;
use crate::ray::Ray;
use crate::shape::crossing::crossing_line;
use crate::shape::triangle::intersect_line;
use crate::trace::bvh::{Certain, Wanted};
use crate::trace::crossings::Crossings;

/// Rays of a batch that are traced together.
const CHUNK: usize = 1024;

/// Misses.
const INVALID: Ray = Ray { origin: Vec3::NAN, direction: Vec3::ZERO, tmin: 0.0, tmax: 0.0, time: 0.0 };

impl Precise {
    /// The nearest hit of each ray, into `hits` of the same length; at equal t that of the lowest id. On the calling thread, as all
    /// queries.
    ///
    /// # Panics
    /// Unless there is one answer a ray.
    pub fn closest_batch(&self, rays: &[PreciseRay], hits: &mut [Option<PreciseHit>]) {
        assert_eq!(rays.len(), hits.len(), "one hit a ray");
        for (rays, hits) in rays.chunks(CHUNK).zip(hits.chunks_mut(CHUNK)) {
            hits.fill(None);
            let mut open = Vec::new();
            self.certain(Wanted::First, rays, |i, certain| match certain {
                Certain::Hits([]) => {}
                Certain::Hits([id, ..]) => match self.hit(&rays[i], *id) {
                    Some(hit) => hits[i] = Some(hit),
                    None => open.push(i),
                },
                Certain::Doubt => open.push(i),
            });
            for i in open {
                hits[i] = self.closest(&rays[i]);
            }
        }
    }

    /// Whether each ray has any hit, into `occluded` of the same length.
    ///
    /// # Panics
    /// Unless there is one answer a ray.
    pub fn occluded_batch(&self, rays: &[PreciseRay], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer a ray");
        for (rays, occluded) in rays.chunks(CHUNK).zip(occluded.chunks_mut(CHUNK)) {
            occluded.fill(false);
            let mut open = Vec::new();
            self.certain(Wanted::Any, rays, |i, certain| match certain {
                Certain::Hits([]) => {}
                // The range was widened: within it for sure is not within the range.
                Certain::Hits([id, ..]) if is_whole(&rays[i]) || self.hit(&rays[i], *id).is_some() => {
                    occluded[i] = true;
                }
                Certain::Hits(_) | Certain::Doubt => open.push(i),
            });
            for i in open {
                occluded[i] = self.occluded(&rays[i]);
            }
        }
    }

    /// How often each ray crosses a triangle, into `counts` of the same length; what counts is said at
    /// [`Bvh::all_hits`](super::super::bvh::Bvh::all_hits).
    ///
    /// # Panics
    /// Unless there is one answer a ray.
    pub fn count_batch(&self, rays: &[PreciseRay], counts: &mut [u32]) {
        assert_eq!(rays.len(), counts.len(), "one count a ray");
        let mut crossings = Crossings::default();
        for (rays, counts) in rays.chunks(CHUNK).zip(counts.chunks_mut(CHUNK)) {
            counts.fill(0);
            let mut open = Vec::new();
            self.certain(Wanted::All, rays, |i, certain| match certain {
                Certain::Hits(ids) if ids.is_empty() || is_whole(&rays[i]) => counts[i] = ids.len() as u32,
                Certain::Hits(ids) => {
                    counts[i] = ids.iter().filter(|&&id| self.hit(&rays[i], id).is_some()).count() as u32;
                }
                Certain::Doubt => open.push(i),
            });
            for i in open {
                counts[i] = self.all(&rays[i], &mut crossings).len() as u32;
            }
        }
    }

    /// All hits of each ray, by t and then by id: those of ray i are the `ends[i]` less the end before it, from there on in `hits`. What
    /// counts is said at [`Bvh::all_hits`](super::super::bvh::Bvh::all_hits). Both are cleared first.
    pub fn all_hits_batch(&self, rays: &[PreciseRay], ends: &mut Vec<usize>, hits: &mut Vec<PreciseHit>) {
        ends.clear();
        hits.clear();
        let mut crossings = Crossings::default();
        // Of each ray where its hits are among those that came in order of arrival.
        let (mut arrived, mut places) = (Vec::new(), Vec::new());
        for rays in rays.chunks(CHUNK) {
            arrived.clear();
            places.clear();
            places.resize(rays.len(), 0..0);
            let mut open = Vec::new();
            self.certain(Wanted::All, rays, |i, certain| match certain {
                Certain::Hits([]) => {}
                Certain::Hits(ids) => {
                    let first = arrived.len();
                    arrived.extend(ids.iter().filter_map(|&id| self.hit(&rays[i], id)));
                    arrived[first..].sort_unstable_by(PreciseHit::order);
                    places[i] = first..arrived.len();
                }
                Certain::Doubt => open.push(i),
            });
            for i in open {
                let first = arrived.len();
                arrived.extend_from_slice(self.all(&rays[i], &mut crossings));
                places[i] = first..arrived.len();
            }
            for place in &places {
                hits.extend_from_slice(&arrived[place.clone()]);
                ends.push(hits.len());
            }
        }
    }

    /// Tells `done` what is certain of each ray of a chunk that may hit something; rays are numbered as in `rays`.
    fn certain(&self, wanted: Wanted, rays: &[PreciseRay], mut done: impl FnMut(usize, Certain<'_>)) {
        let mut local = [INVALID; CHUNK];
        let local = &mut local[..rays.len()];
        let exact = rays.iter().zip(local.iter_mut()).all(|(ray, local)| match self.frame.exact_ray(ray) {
            Some(exact) => {
                *local = exact;
                true
            }
            None => false,
        });
        if !exact {
            for (i, (ray, local)) in rays.iter().zip(local.iter_mut()).enumerate() {
                *local = match self.frame.ray(ray) {
                    Some(LocalRay { ray, is_common: true, .. }) => ray,
                    Some(_) => {
                        done(i, Certain::Doubt);
                        INVALID
                    }
                    None => INVALID,
                };
            }
        }
        self.bvh.certain(wanted, local, self.frame.blur(exact), &mut done);
    }

    /// The hit with one triangle, which the ray hits for sure; none where that is out of range.
    #[inline]
    fn hit(&self, ray: &PreciseRay, id: u32) -> Option<PreciseHit> {
        let (geometry, primitive) = self.bvh.triangle(id);
        self.hit_of(ray, geometry, primitive)
    }

    #[inline]
    fn hit_of(&self, ray: &PreciseRay, geometry: u32, primitive: u32) -> Option<PreciseHit> {
        let hit = intersect_line(ray.origin, ray.direction, &self.corners(geometry, primitive))?;
        let hit = PreciseHit { t: hit.t, u: hit.u, v: hit.v, primitive, geometry, instance: 0 };
        ray.has(hit.t).then_some(hit)
    }

    /// The nearest hit, every candidate decided.
    fn closest(&self, ray: &PreciseRay) -> Option<PreciseHit> {
        let local = self.frame.ray(ray)?;
        let (mut best, mut limit) = (None::<PreciseHit>, local.ray.tmax.next_up());
        self.bvh.candidates(&local.ray, local.blur, &mut |geometry, primitive| {
            if let Some(hit) = self.hit_of(ray, geometry, primitive)
                && best.is_none_or(|best| hit.order(&best).is_lt())
            {
                best = Some(hit);
                limit = local.limit(hit.t).min(limit);
            }
            Some(limit)
        });
        best
    }

    /// Whether there is a hit, every candidate decided until there is.
    fn occluded(&self, ray: &PreciseRay) -> bool {
        let Some(local) = self.frame.ray(ray) else { return false };
        let (mut is_hit, limit) = (false, local.ray.tmax.next_up());
        self.bvh.candidates(&local.ray, local.blur, &mut |geometry, primitive| {
            is_hit = self.hit_of(ray, geometry, primitive).is_some();
            (!is_hit).then_some(limit)
        });
        is_hit
    }

    /// All hits, every candidate decided.
    fn all<'a>(&self, ray: &PreciseRay, crossings: &'a mut Crossings) -> &'a [PreciseHit] {
        crossings.clear();
        if let Some(local) = self.frame.ray(ray) {
            let limit = local.ray.tmax.next_up();
            self.bvh.candidates(&local.ray, local.blur, &mut |geometry, primitive| {
                let corners = self.corners(geometry, primitive);
                if let Some(crossing) = crossing_line(ray.origin, ray.direction, &corners)
                    && ray.has(crossing.hit.t)
                {
                    crossings.take(&corners, crossing, (primitive, geometry, 0));
                }
                Some(limit)
            });
        }
        crossings.finish()
    }
}

/// Whether its range is all there is ahead.
fn is_whole(ray: &PreciseRay) -> bool {
    ray.tmin == 0.0 && ray.tmax == f64::INFINITY
}
