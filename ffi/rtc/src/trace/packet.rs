//! Several rays at a time.
//!
//! Among triangles of which each counts, those that are asked for together travel together, and hide each other's waiting
//! for memory. All else goes ray by ray, through a ray of our own: callbacks are given one ray at a time.

use twincast::math::Vec3;
use twincast::trace::bvh::{Bvh, TriangleFound};
use twincast::{Batch, Hit, Ray, Tracer};

use super::Query;
use super::cast::{Sight, cast_one, name_solid, native, sight};
use super::lanes::Lanes;
use super::offer::{Target, hit_of};
use crate::abi::RTCRayHit;
use crate::scene::{Body, Committed, Record};

/// Rays that are taken together.
const TOGETHER: usize = 16;

/// A ray for lanes that are not asked for.
const NO_RAY: Ray = Ray { origin: Vec3::ZERO, direction: Vec3::ZERO, tmin: 0.0, tmax: 0.0, time: 0.0 };

/// Those of a chunk of lanes that can be answered together, without a gap; and where they were.
struct Chunk {
    rays: [Ray; TOGETHER],
    lanes: [usize; TOGETHER],
    count: usize,
}

impl Chunk {
    fn rays(&self) -> &[Ray] {
        &self.rays[..self.count]
    }

    /// Fills the chunk with rays from lane `next` on, and returns where it stopped; `alone` is told of lanes that must go by themselves.
    #[inline(always)]
    fn fill(
        lanes: &impl Lanes,
        range: std::ops::Range<usize>,
        is_valid: &impl Fn(usize) -> bool,
        see: impl Fn(u32) -> Sight,
        mut alone: impl FnMut(usize),
    ) -> (Self, usize) {
        let mut chunk = Self { rays: [NO_RAY; TOGETHER], lanes: [0; TOGETHER], count: 0 };
        let end = range.end;
        for lane in range {
            if !is_valid(lane) {
                continue;
            }
            let ray = lanes.ray(lane);
            match see(ray.mask) {
                Sight::Nothing => {}
                Sight::Some => alone(lane),
                Sight::Everything => {
                    (chunk.rays[chunk.count], chunk.lanes[chunk.count]) = (native(&ray), lane);
                    chunk.count += 1;
                    if chunk.count == TOGETHER {
                        return (chunk, lane + 1);
                    }
                }
            }
        }
        (chunk, end)
    }
}

/// A hit with the corners of its triangle, fetched from the mesh.
#[inline(always)]
fn with_corners(committed: &Committed, hit: Hit) -> Option<TriangleFound> {
    let Some(Record { body: Body::Surface(surface), .. }) = committed.record(hit.geometry) else { return None };
    Some(TriangleFound { hit, corners: surface.corners_at(hit.primitive as usize, 0.0) })
}

/// The lanes of a query that are asked for.
struct Asked<'a, L, V> {
    lanes: &'a L,
    count: usize,
    is_valid: V,
}

impl<L: Lanes, V: Fn(usize) -> bool> Asked<'_, L, V> {
    /// Calls `together` with the triangles and those rays, a chunk at a time, that see all of them and nothing else, and `alone` with
    /// every other lane.
    #[inline(always)]
    fn each(
        &self,
        committed: &Committed,
        query: &Query,
        any: bool,
        alone: impl Fn(usize) + Copy,
        mut together: impl FnMut(&Bvh, &Chunk),
    ) {
        let Self { lanes, count, is_valid } = self;
        let Some(solid) = committed.solid.as_ref().filter(|_| committed.others.is_none()) else {
            return (0..*count).filter(|&lane| is_valid(lane)).for_each(alone);
        };
        let mut next = 0;
        while next < *count {
            let see = |mask| sight(committed, query, mask, any);
            let (chunk, end) = Chunk::fill(*lanes, next..*count, is_valid, see, alone);
            next = end;
            together(solid, &chunk);
        }
    }
}

/// Nearest hits of `count` rays, of those that are valid.
#[inline(always)]
pub fn intersect_lanes(
    committed: &Committed,
    query: &Query,
    lanes: &impl Lanes,
    count: usize,
    is_valid: impl Fn(usize) -> bool,
) {
    let alone = |lane: usize| {
        // Together, as user geometry wants them.
        let mut own = RTCRayHit { ray: lanes.ray(lane), hit: lanes.hit(lane) };
        let own = &raw mut own;
        // SAFETY: it is ours, and used through this pointer alone.
        let target = unsafe { Target::closest(own) };
        cast_one::<false>(committed, query, &target);
        lanes.set_tfar(lane, target.tfar());
        // SAFETY: as above.
        lanes.set_hit(lane, unsafe { &(*own).hit });
    };
    Asked { lanes, count, is_valid }.each(committed, query, false, alone, |solid, chunk| {
        let mut found: [Option<TriangleFound>; TOGETHER] = [None; TOGETHER];
        if query.is_coherent {
            let mut hits = [None; TOGETHER];
            let batch = Batch { coherent: true, ..Batch::default() };
            solid.closest_batch(chunk.rays(), &mut hits[..chunk.count], batch);
            for (found, hit) in found.iter_mut().zip(hits) {
                *found = hit.and_then(|hit| with_corners(committed, hit));
            }
        } else {
            solid.closest_triangles(chunk.rays(), &mut found[..chunk.count]);
        }
        for (&lane, found) in chunk.lanes.iter().zip(&found[..chunk.count]) {
            if let Some(found) = found
                && let Some((geometry, named)) = name_solid(committed, found)
            {
                lanes.set_tfar(lane, found.hit.t);
                lanes.set_hit(lane, &hit_of(query, geometry, &named));
            }
        }
    });
}

/// Whether each of `count` rays hits anything, of those that are valid.
#[inline(always)]
pub fn occluded_lanes(
    committed: &Committed,
    query: &Query,
    lanes: &impl Lanes,
    count: usize,
    is_valid: impl Fn(usize) -> bool,
) {
    let alone = |lane: usize| {
        let mut ray = lanes.ray(lane);
        // SAFETY: it is ours.
        let target = unsafe { Target::any(&raw mut ray) };
        cast_one::<true>(committed, query, &target);
        lanes.set_tfar(lane, target.tfar());
    };
    Asked { lanes, count, is_valid }.each(committed, query, true, alone, |solid, chunk| {
        let mut occluded = [false; TOGETHER];
        let batch = Batch { coherent: query.is_coherent, ..Batch::default() };
        solid.occluded_batch(chunk.rays(), &mut occluded[..chunk.count], batch);
        for (&lane, _) in chunk.lanes.iter().zip(&occluded[..chunk.count]).filter(|(_, occluded)| **occluded) {
            lanes.set_tfar(lane, f32::NEG_INFINITY);
        }
    });
}
