//! What rays ask of meshes in f64: the nearest hit, any hit, all hits.
//!
//! Each batch goes through flights first, which name what is hit for sure, and what may be where all hits are wanted;
//! t, u and v come from the corners in f64, in a step of its own ([`Pairs`]). Then those that are in doubt go one by
//! one.

use std::ops::Range;

use super::frame::{self, LocalRay};
use super::{PreciseHit, PreciseRay, PreciseScene, is_traceable};
use crate::math::{DVec3, Vec3};
use crate::ray::Ray;
use crate::shape::crossing::{Crossing, crossing_line};
use crate::shape::triangle::{TriangleHit, intersect_line};
use crate::trace::bvh::{Blur, Certain, Verdict, Wanted};
use crate::trace::crossings::Crossings;

/// Rays of a batch that are traced together.
const CHUNK: usize = 1024;

/// Misses.
const INVALID: Ray = Ray { origin: Vec3::NAN, direction: Vec3::ZERO, tmin: 0.0, tmax: 0.0, time: 0.0 };

impl PreciseScene {
    /// The nearest hit of each ray, into `hits` of the same length; at equal t that of the lowest id. On the calling
    /// thread, as all queries.
    ///
    /// # Panics
    /// Unless there is one answer a ray.
    pub fn closest_batch(&self, rays: &[PreciseRay], hits: &mut [Option<PreciseHit>]) {
        assert_eq!(rays.len(), hits.len(), "one hit a ray");
        let mut pairs = Pairs::default();
        for (rays, hits) in rays.chunks(CHUNK).zip(hits.chunks_mut(CHUNK)) {
            self.nearest_of_chunk(rays, &mut pairs, hits, |_, _| false);
        }
    }

    /// The geometry and the primitive of each ray's nearest hit, into `names` of the same length: those of
    /// [`Self::closest_batch`], without computing t, u and v where there is no doubt. (Where sizes squared times a
    /// direction vanish in f64, [`Self::closest_batch`] may miss what is named here.)
    ///
    /// # Panics
    /// Unless there is one answer a ray.
    pub fn closest_ids_batch(&self, rays: &[PreciseRay], names: &mut [Option<(u32, u32)>]) {
        assert_eq!(rays.len(), names.len(), "one name a ray");
        let (mut pairs, mut found) = (Pairs::default(), Vec::new());
        let mut hits = vec![None; rays.len().min(CHUNK)];
        for (rays, names) in rays.chunks(CHUNK).zip(names.chunks_mut(CHUNK)) {
            found.clear();
            let hits = &mut hits[..rays.len()];
            self.nearest_of_chunk(rays, &mut pairs, hits, |i, id| {
                found.push((i, id));
                true
            });
            for (name, hit) in names.iter_mut().zip(hits) {
                *name = hit.map(|hit| (hit.geometry, hit.primitive));
            }
            // All of them together, so that the processor waits for many at once.
            found.iter().for_each(|&(i, id)| names[i] = Some(self.bvh.triangle(id)));
        }
    }

    /// The nearest hit of each ray of a chunk, but of those that `take` takes: it is told the ray and the triangle that
    /// it hits first for sure.
    fn nearest_of_chunk(
        &self,
        rays: &[PreciseRay],
        pairs: &mut Pairs,
        hits: &mut [Option<PreciseHit>],
        mut take: impl FnMut(usize, u32) -> bool,
    ) {
        hits.fill(None);
        let mut open = Vec::new();
        pairs.clear();
        self.certain(Wanted::First, rays, |i, certain| match certain {
            Certain::Hits { sure: &[id], .. } if is_whole(&rays[i]) && take(i, id) => {}
            Certain::Hits { sure, .. } => pairs.extend(i, sure, true),
            Certain::Doubt => open.push(i),
        });
        for (i, met) in pairs.meet(self, rays) {
            match met {
                Met::Hit(hit) if hits[i].is_none_or(|other| hit.order(&other).is_lt()) => hits[i] = Some(hit),
                Met::Hit(_) => {}
                // The range was widened: within it for sure is not within the range.
                Met::Nothing | Met::Touch => push_once(&mut open, i),
            }
        }
        for i in open {
            hits[i] = self.closest(&rays[i]);
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
                Certain::Hits { sure: [], .. } => {}
                // The range was widened: within it for sure is not within the range.
                Certain::Hits { sure: [id, ..], .. } if is_whole(&rays[i]) || self.hit(&rays[i], *id).is_some() => {
                    occluded[i] = true;
                }
                Certain::Hits { .. } | Certain::Doubt => open.push(i),
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
        let (mut crossings, mut pairs) = (Crossings::default(), Pairs::default());
        for (rays, counts) in rays.chunks(CHUNK).zip(counts.chunks_mut(CHUNK)) {
            counts.fill(0);
            let mut again = Vec::new();
            pairs.clear();
            self.certain(Wanted::All, rays, |i, certain| match certain {
                Certain::Hits { sure, open, .. } => {
                    if is_whole(&rays[i]) {
                        counts[i] = sure.len() as u32;
                    } else {
                        pairs.extend(i, sure, true);
                    }
                    pairs.extend(i, open, false);
                }
                Certain::Doubt => again.push(i),
            });
            for (i, met) in pairs.meet(self, rays) {
                match met {
                    Met::Hit(_) => counts[i] += 1,
                    Met::Nothing => {}
                    Met::Touch => push_once(&mut again, i),
                }
            }
            for i in again {
                counts[i] = self.all(&rays[i], &mut crossings).len() as u32;
            }
        }
    }

    /// All hits of each ray, by t and then by id: those of ray i are the `ends[i]` less the end before it, from there
    /// on in `hits`. What counts is said at [`Bvh::all_hits`](super::super::bvh::Bvh::all_hits). Both are cleared
    /// first.
    pub fn all_hits_batch(&self, rays: &[PreciseRay], ends: &mut Vec<usize>, hits: &mut Vec<PreciseHit>) {
        ends.clear();
        hits.clear();
        let mut arrivals = Arrivals::default();
        for rays in rays.chunks(CHUNK) {
            self.all_of_chunk(rays, &mut arrivals, |_, _, _| false);
            for i in 0..rays.len() {
                arrivals.put_in_order(i, hits);
                ends.push(hits.len());
            }
        }
    }

    /// The geometry and the primitive of each hit of [`Self::all_hits_batch`], in the same order, without computing t,
    /// u and v of a ray whose hits lie so far apart that they are in order without. (Where sizes squared times a
    /// direction vanish in f64, [`Self::all_hits_batch`] may miss what is named here.)
    pub fn all_ids_batch(&self, rays: &[PreciseRay], ends: &mut Vec<usize>, names: &mut Vec<(u32, u32)>) {
        ends.clear();
        names.clear();
        let (mut arrivals, mut hits) = (Arrivals::default(), Vec::new());
        // Hits that are in order, and of each ray where its own are among them.
        let (mut ids, mut clear) = (Vec::new(), Vec::new());
        for rays in rays.chunks(CHUNK) {
            ids.clear();
            clear.clear();
            clear.resize(rays.len(), 0..0);
            self.all_of_chunk(rays, &mut arrivals, |i, sure, t| {
                let first = ids.len();
                ids.extend(sure.iter().copied().zip(t.iter().copied()));
                clear[i] = first..ids.len();
                let own = &mut ids[first..];
                own.sort_unstable_by(|(_, [a, _]), (_, [b, _])| a.total_cmp(b));
                let are_apart = own.windows(2).all(|pair| pair[0].1[1] < pair[1].1[0]);
                if !are_apart {
                    ids.truncate(first);
                    clear[i] = 0..0;
                }
                are_apart
            });
            // All of them together, so that the processor waits for many at once.
            let named: Vec<(u32, u32)> = ids.iter().map(|&(id, _)| self.bvh.triangle(id)).collect();
            for (i, clear) in clear.iter().enumerate() {
                names.extend(&named[clear.clone()]);
                hits.clear();
                arrivals.put_in_order(i, &mut hits);
                names.extend(hits.iter().map(|hit| (hit.geometry, hit.primitive)));
                ends.push(names.len());
            }
        }
    }

    /// All hits of each ray of a chunk, but of those that `take` takes: it is told the ray, and what it hits for sure,
    /// with bounds on t, where there is nothing else.
    fn all_of_chunk(
        &self,
        rays: &[PreciseRay],
        arrivals: &mut Arrivals,
        mut take: impl FnMut(usize, &[u32], &[[f32; 2]]) -> bool,
    ) {
        let Arrivals { pairs, crossings, hits, places } = arrivals;
        pairs.clear();
        hits.clear();
        places.clear();
        places.resize(rays.len(), 0..0);
        let mut again = Vec::new();
        self.certain(Wanted::All, rays, |i, certain| match certain {
            Certain::Hits { sure, t, open: [] } if is_whole(&rays[i]) && take(i, sure, t) => {}
            Certain::Hits { sure, open, .. } => {
                let first = pairs.len();
                pairs.extend(i, sure, true);
                pairs.extend(i, open, false);
                places[i] = first..pairs.len();
            }
            Certain::Doubt => again.push(i),
        });
        for (i, met) in pairs.meet(self, rays) {
            hits.push(if let Met::Hit(hit) = met { Some(hit) } else { None });
            if let Met::Touch = met {
                push_once(&mut again, i);
            }
        }
        for i in again {
            let first = hits.len();
            hits.extend(self.all(&rays[i], crossings).iter().copied().map(Some));
            places[i] = first..hits.len();
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
        let mut most_off = 0.0f64;
        if !exact {
            for (i, (ray, local)) in rays.iter().zip(local.iter_mut()).enumerate() {
                *local = match self.frame.ray(ray) {
                    Some(LocalRay { ray, is_common: true, off, .. }) => {
                        most_off = most_off.max(off);
                        ray
                    }
                    Some(_) => {
                        done(i, Certain::Doubt);
                        INVALID
                    }
                    None => INVALID,
                };
            }
        }
        let decide = |i: usize, geometry: u32, primitive: u32| {
            let ray: &PreciseRay = &rays[i];
            let corners = self.corners(geometry, primitive);
            match intersect_line(ray.origin, ray.direction, &corners) {
                Some(hit) if ray.has(hit.t) => {
                    let bounds = if exact { frame::around(hit.t) } else { self.frame.bounds(ray, hit.t) };
                    bounds.map_or(Verdict::Doubt, Verdict::Hit)
                }
                _ => Verdict::Miss,
            }
        };
        let blur = if exact { Blur::NONE } else { self.frame.blur(most_off) };
        self.bvh.certain(wanted, local, blur, &decide, &mut done);
    }

    /// The hit with one triangle, which the ray hits for sure; none where that is out of range.
    #[inline]
    fn hit(&self, ray: &PreciseRay, id: u32) -> Option<PreciseHit> {
        let (geometry, primitive) = self.bvh.triangle(id);
        self.hit_of(ray, geometry, primitive)
    }

    #[inline]
    fn hit_of(&self, ray: &PreciseRay, geometry: u32, primitive: u32) -> Option<PreciseHit> {
        hit_of(ray, &self.corners(geometry, primitive), geometry, primitive)
    }

    /// Offers every triangle that the ray may hit, as [`Bvh::candidates`](super::super::bvh::Bvh) does; all of them
    /// where the ray is lost in the frame.
    fn candidates(&self, local: &LocalRay, offer: &mut dyn FnMut(u32, u32) -> Option<f32>) {
        if !local.is_lost {
            return self.bvh.candidates(&local.ray, local.blur, offer);
        }
        for (mesh, geometry) in self.meshes.iter().zip(0..) {
            for (triangle, primitive) in mesh.triangles.iter().zip(0..) {
                let is_there = triangle.iter().all(|&i| is_traceable(mesh.positions[i as usize]));
                if is_there && offer(geometry, primitive).is_none() {
                    return;
                }
            }
        }
    }

    /// The nearest hit, every candidate decided.
    fn closest(&self, ray: &PreciseRay) -> Option<PreciseHit> {
        let local = self.frame.ray(ray)?;
        let (mut best, mut limit) = (None::<PreciseHit>, local.ray.tmax.next_up());
        self.candidates(&local, &mut |geometry, primitive| {
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
        self.candidates(&local, &mut |geometry, primitive| {
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
            self.candidates(&local, &mut |geometry, primitive| {
                let corners = self.corners(geometry, primitive);
                if let Some(Crossing { hit, touch }) = crossing_line(ray.origin, ray.direction, &corners)
                    && ray.has(hit.t)
                {
                    crossings.take(&corners, Crossing { hit: hit.within(), touch }, (primitive, geometry, 0));
                }
                Some(limit)
            });
        }
        crossings.finish()
    }
}

/// Rays of a chunk, and triangles that they hit for sure or may hit.
///
/// Corners are looked up for all of them at once, one step of the way at a time: the processor then waits for many
/// cache lines together, where pair by pair it would wait for each.
#[derive(Default)]
struct Pairs {
    /// Ray, block and lane, and whether the ray hits for sure.
    found: Vec<(u32, u32, bool)>,
    names: Vec<(u32, u32)>,
    indices: Vec<[u32; 3]>,
    corners: Vec<[DVec3; 3]>,
}

/// All hits of a chunk's rays.
#[derive(Default)]
struct Arrivals {
    pairs: Pairs,
    crossings: Crossings,
    /// In order of arrival; nothing where a pair came to nothing.
    hits: Vec<Option<PreciseHit>>,
    /// Of each ray where its hits are among them.
    places: Vec<Range<usize>>,
}

impl Arrivals {
    /// Adds those of a ray, by t and then by id.
    fn put_in_order(&self, ray: usize, all: &mut Vec<PreciseHit>) {
        let first = all.len();
        all.extend(self.hits[self.places[ray].clone()].iter().flatten());
        all[first..].sort_unstable_by(PreciseHit::order);
    }
}

/// What a pair comes to.
enum Met {
    Hit(PreciseHit),
    /// A miss, or a hit out of range.
    Nothing,
    /// A hit on an edge or in a corner, of which it was not sure that it is a hit.
    Touch,
}

impl Pairs {
    fn clear(&mut self) {
        self.found.clear();
    }

    fn len(&self) -> usize {
        self.found.len()
    }

    fn extend(&mut self, ray: usize, ids: &[u32], is_sure: bool) {
        self.found.extend(ids.iter().map(|&id| (ray as u32, id, is_sure)));
    }

    /// Of each the ray, and what it comes to; in their order.
    fn meet<'a>(
        &'a mut self,
        precise: &'a PreciseScene,
        rays: &'a [PreciseRay],
    ) -> impl Iterator<Item = (usize, Met)> + 'a {
        let Self { found, names, indices, corners } = self;
        names.clear();
        names.extend(found.iter().map(|&(_, id, _)| precise.bvh.triangle(id)));
        indices.clear();
        indices.extend(names.iter().map(|&(mesh, i)| precise.meshes[mesh as usize].triangles[i as usize]));
        corners.clear();
        corners.extend(names.iter().zip(&*indices).map(|(&(mesh, _), indices)| {
            let positions = &precise.meshes[mesh as usize].positions;
            indices.map(|i| positions[i as usize])
        }));
        let named = names.iter().zip(&*corners);
        found.iter().zip(named).map(|(&(i, _, is_sure), (&(geometry, primitive), corners))| {
            let ray = &rays[i as usize];
            let met = if is_sure {
                hit_of(ray, corners, geometry, primitive).map_or(Met::Nothing, Met::Hit)
            } else {
                open(ray, corners, geometry, primitive)
            };
            (i as usize, met)
        })
    }
}

/// What a ray and a triangle that it may hit come to.
#[cold]
fn open(ray: &PreciseRay, corners: &[DVec3; 3], geometry: u32, primitive: u32) -> Met {
    match crossing_line(ray.origin, ray.direction, corners) {
        Some(Crossing { touch: Some(_), .. }) => Met::Touch,
        Some(Crossing { hit, .. }) => in_range(ray, hit, geometry, primitive).map_or(Met::Nothing, Met::Hit),
        None => Met::Nothing,
    }
}

#[inline]
fn hit_of(ray: &PreciseRay, corners: &[DVec3; 3], geometry: u32, primitive: u32) -> Option<PreciseHit> {
    in_range(ray, intersect_line(ray.origin, ray.direction, corners)?, geometry, primitive)
}

#[inline]
fn in_range(ray: &PreciseRay, hit: TriangleHit, geometry: u32, primitive: u32) -> Option<PreciseHit> {
    let hit = PreciseHit::new(hit.within(), (primitive, geometry, 0));
    ray.has(hit.t).then_some(hit)
}

/// Adds a ray, whose pairs come one after the other, once for all of them.
fn push_once(rays: &mut Vec<usize>, ray: usize) {
    if rays.last() != Some(&ray) {
        rays.push(ray);
    }
}

/// Whether its range is all there is ahead.
fn is_whole(ray: &PreciseRay) -> bool {
    ray.tmin == 0.0 && ray.tmax == f64::INFINITY
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::precise::PreciseMesh;

    /// Squares one behind the other, as far apart as is said.
    fn squares(apart: f64) -> PreciseScene {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let positions = (0..3).flat_map(|k| corners.map(|[x, y]| DVec3::new(x, y, apart * f64::from(k)))).collect();
        let triangles = (0..3).flat_map(|k| [[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|i| 4 * k + i))).collect();
        PreciseScene::new(vec![PreciseMesh { positions, triangles }]).expect("squares")
    }

    /// A ray that starts on an edge, or in a corner, meets all that touch there at t = 0, of which some compute -0.
    #[test]
    fn zeros_of_both_signs_are_one_distance() {
        let rim = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [-1.0, 0.0, 1.0], [0.0, -1.0, -0.5]].map(DVec3::from);
        let positions = std::iter::once(DVec3::ZERO).chain(rim).collect();
        let triangles = vec![[0, 1, 2], [2, 3, 0], [0, 3, 4], [4, 1, 0], [0, 2, 1]];
        let precise = PreciseScene::new(vec![PreciseMesh { positions, triangles }]).expect("a fan");
        let starts = [DVec3::ZERO, rim[0] * 0.5, rim[1] * 0.5, rim[2] * 0.5, rim[3] * 0.5];
        let ways = [[0.1, 0.2, 1.0], [-0.3, 0.2, -1.0], [0.1, -0.7, 1.0], [0.3, 0.2, -0.9], [0.5, 0.1, 0.7]];
        for (start, way) in starts.iter().flat_map(|&start| ways.map(|way| (start, DVec3::from(way)))) {
            let ray = PreciseRay::new(start, way);
            let hits = (0..5).filter_map(|i| precise.hit_of(&ray, 0, i));
            let lowest = hits.filter(|hit| hit.t == 0.0).map(|hit| hit.primitive).min().expect("it starts on one");
            let mut nearest = [None];
            precise.closest_batch(&[ray], &mut nearest);
            let nearest = nearest[0].expect("a hit");
            assert_eq!((nearest.t.to_bits(), nearest.primitive), (0, lowest), "{ray:?}");
            let mut names = [None];
            precise.closest_ids_batch(&[ray], &mut names);
            assert_eq!(names, [Some((0, lowest))], "{ray:?}");
            let (mut ends, mut all) = (Vec::new(), Vec::new());
            precise.all_hits_batch(&[ray], &mut ends, &mut all);
            assert!(all.iter().all(|hit| hit.t.is_sign_positive()), "{all:?}");
        }
    }

    /// Hits that lie apart are named by the flight; for those that do not, t is computed.
    #[test]
    fn t_is_computed_where_bounds_do_not_tell() {
        let (forth, back) = ([(0, 0), (0, 2), (0, 4)], [(0, 4), (0, 2), (0, 0)]);
        for (apart, is_known, expected) in
            [(0.3, true, forth), (1e-9, false, forth), (-0.3, true, back), (-1e-9, false, back)]
        {
            let precise = squares(apart);
            let ray = PreciseRay::new(DVec3::new(0.31, 0.17, -2.0), DVec3::new(0.01, 0.02, 1.0));
            let mut told = Vec::new();
            precise.all_of_chunk(&[ray], &mut Arrivals::default(), |i, sure, t| {
                assert_eq!((i, sure.len(), t.len()), (0, 3, 3));
                told = t.to_vec();
                true
            });
            assert_eq!(told.len(), 3);
            told.sort_by(|[a, _], [b, _]| a.total_cmp(b));
            assert_eq!(told.windows(2).all(|pair| pair[0][1] < pair[1][0]), is_known, "{told:?}");
            let (mut ends, mut names) = (Vec::new(), Vec::new());
            precise.all_ids_batch(&[ray], &mut ends, &mut names);
            assert_eq!((ends, names), (vec![3], expected.to_vec()));
        }
    }
}
