//! Rays of a bundle, of which closest hits are wanted, that go through a placed object each by itself, because they are
//! no bundle in its coordinates.

use super::found::BundleFound;
use super::range::RayIntervals;
use crate::ray::Ray;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::alone::{Doubted, Noted, SingleRay};
use crate::trace::bvh::hits::found::{Found, NONE};
use crate::trace::bvh::query::Closest;
use crate::trace::bvh::reject::ready::{MANY, ReadyRay, eight, lowest_eight};
use crate::trace::bvh::reject::slab::most_t;
use crate::trace::bvh::simd::{RAYS, Simd};

/// The closest hits of the rays of a bit mask in one placed object.
#[inline(always)]
pub(super) fn trace<S: Simd>(
    bvh: &Bvh,
    place: u32,
    rays: &[Ray; RAYS],
    mut open: u64,
    range: &mut RayIntervals,
    found: &mut BundleFound,
) {
    let mut ready = [ReadyRay::NONE; 8];
    while open != 0 {
        let mut some = lowest_eight(open);
        open &= !some;
        let mut known = 0;
        if some.count_ones() >= MANY {
            (ready, known) = bvh.ready_at::<S>(place, eight(rays, some));
        }
        for k in 0..some.count_ones() as usize {
            let i = some.trailing_zeros() as usize % RAYS;
            some &= some - 1;
            let ready = if known >> k & 1 != 0 { Some(&ready[k % 8]) } else { None };
            trace_one::<S>(bvh, place, rays, i, ready, range, found);
        }
    }
}

/// Ray `i` by itself, which may be ready for the object.
#[inline(always)]
fn trace_one<S: Simd>(
    bvh: &Bvh,
    place: u32,
    rays: &[Ray; RAYS],
    i: usize,
    ready: Option<&ReadyRay>,
    range: &mut RayIntervals,
    found: &mut BundleFound,
) {
    let (ray, single) = (&rays[i], SingleRay::from(&rays[i]));
    let (mut noted, mut doubted): (Noted, Doubted) = (Noted::nothing(&single), None);
    // Rounded up, as of a ray that has hit nothing yet.
    noted.limit = most_t(range.limit.0[i]);
    (noted.sure, noted.id, noted.place) = (range.sure.0[i], found.noted[i], found.place[i]);
    if noted.id == NONE && found.computed >> i & 1 != 0 {
        noted.is_doubted = true;
        doubted.insert(Found::NONE).take([noted.sure, noted.limit], found.nearest[i]);
    }
    let before = (noted.sure, noted.place, noted.id);
    match ready {
        Some(ready) => bvh.walk_place_ready::<S>(place, &single, ready, &mut noted, &mut doubted),
        None => bvh.walk_place::<S, Closest>(place, &single, ray, &mut noted, &mut doubted),
    }
    if noted.is_doubted || before != (noted.sure, noted.place, noted.id) {
        range.set(i, noted.sure, noted.limit.min(range.limit.0[i]));
        (found.noted[i], found.place[i]) = (noted.id, noted.place);
        if noted.id == NONE
            && let Some(doubted) = doubted
        {
            (found.nearest[i], found.computed) = (doubted.nearest(bvh, ray), found.computed | 1 << i);
        }
    }
}
