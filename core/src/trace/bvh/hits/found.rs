//! What a single ray has hit so far among triangles: for the most part only noted.
//!
//! The reject test ([`crate::trace::bvh::reject::filter`]) knows bounds on t. Where they leave no doubt that a triangle
//! is hit, and is the nearest, its number will do; t, u and v are computed once, of what remains in the end. Where they
//! leave doubt, [`triangle::intersect`](crate::shape::triangle::intersect) decides at once.

use super::coplanar::Spot;
use super::listed::Listed;
use crate::ray::{Hit, Ray};
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::query::Query;
use crate::trace::bvh::reject::filter::Candidates;
use crate::trace::nearest::Nearest;

/// No triangle is noted.
pub(in crate::trace::bvh) const NONE: u32 = u32::MAX;

/// The state of one ray. What is only noted comes first, and is near what steps need as well.
#[repr(C)]
#[derive(Clone, Copy)]
pub(in crate::trace::bvh) struct Found {
    /// No hit beyond this is wanted; rounded up.
    pub limit: f32,
    /// A hit nearer than this is the nearest for sure.
    sure: f32,
    /// Found without doubt, but not computed yet: block and lane.
    pub noted: u32,
    /// Where that triangle is: the number of a placement, or [`FIXED`](crate::trace::bvh::levels::placements::FIXED).
    pub place: u32,
    /// Whether anything was computed.
    is_computed: bool,
    /// That, if `noted` is [`NONE`].
    nearest: Nearest,
    /// Which triangle it is: block and lane.
    computed: u32,
}

impl Found {
    /// Nothing.
    pub const NONE: Self = Self {
        limit: 0.0,
        sure: 0.0,
        noted: NONE,
        place: NONE,
        is_computed: false,
        nearest: Nearest::NONE,
        computed: NONE,
    };

    /// Nothing yet, up to the ray's tmax, and that rounded up. What lies so far that t overflows is in doubt, whose
    /// decision is that it is not hit.
    #[inline(always)]
    pub fn start(&mut self, [tmax, limit]: [f32; 2]) {
        (self.sure, self.limit, self.noted, self.is_computed) = (tmax.min(f32::MAX), limit, NONE, false);
    }

    /// Notes a triangle that is hit for sure between `low` and `high`, if it is for sure within the range, and nearer
    /// than what was noted before. Whether it was.
    #[inline(always)]
    pub fn note(&mut self, id: u32, [low, high]: [f32; 2], tmin: f32) -> bool {
        let is_nearest = tmin <= low && high <= self.sure;
        if is_nearest {
            self.noted = id;
            (self.sure, self.limit) = (low, high);
        }
        is_nearest
    }

    /// Lists a triangle that is hit for sure between `low` and `high`, if it is for sure within the ray's range and may
    /// be the nearest: alone where it is that for sure, with its rivals where bounds do not tell. False where it may be
    /// out of range.
    #[inline(always)]
    pub fn list(&mut self, listed: &mut Listed, id: u32, [low, high]: [f32; 2], ray: &Ray) -> bool {
        if low > self.limit {
            return true;
        }
        // Written so that NaN is a doubt.
        let is_within = ray.tmin <= low && high <= ray.tmax.min(f32::MAX);
        if !is_within {
            return false;
        }
        if high <= self.sure {
            listed.clear();
        }
        listed.push(id, [low, high]);
        (self.sure, self.limit) = (self.sure.min(low), self.limit.min(high));
        true
    }

    /// Whether a hit is noted, but not computed.
    #[inline(always)]
    pub fn is_noted(&self) -> bool {
        self.noted != NONE
    }

    /// The hit that was computed, if none is noted, and which triangle it is: block and lane.
    #[inline(always)]
    pub fn computed(&self) -> Option<(Hit, u32)> {
        let hit = if self.is_computed && !self.is_noted() { self.nearest.hit() } else { None };
        hit.map(|hit| (hit, self.computed))
    }

    /// Whether there is any hit.
    #[inline(always)]
    pub fn is_hit(&self) -> bool {
        self.noted != NONE || self.is_computed && self.nearest.hit().is_some()
    }

    /// Whether there is a hit that was computed, which few are, and none that is noted.
    #[inline(always)]
    pub fn has_only_computed(&self) -> bool {
        self.is_computed && self.noted == NONE && self.nearest.hit().is_some()
    }

    /// Takes the candidates of block `index` of the triangles at `place`.
    #[inline(always)]
    pub fn offer<Q: Query>(
        &mut self,
        bvh: &Bvh,
        place: u32,
        index: u32,
        block: &Block,
        candidates: &Candidates,
        ray: &Ray,
    ) {
        let mut open = candidates.lanes;
        while open != 0 {
            let lane = open.trailing_zeros() as usize % LANES;
            open &= open - 1;
            let (low, high) = (candidates.low[lane], candidates.high[lane]);
            if candidates.sure >> lane & 1 != 0 {
                if self.note(LANES as u32 * index + lane as u32, [low, high], ray.tmin) {
                    self.place = place;
                    if Q::ANY {
                        return;
                    }
                    continue;
                }
                if low > self.limit {
                    continue;
                }
                let (noted, id) = (self.noted, LANES as u32 * index + lane as u32);
                if let Some(first) = bvh.first_of_plane(Spot { place: self.place, id: noted }, Spot { place, id }) {
                    (self.place, self.noted) = (first.place, first.id);
                    continue;
                }
            }
            self.decide(bvh, place, index, block, lane, ray);
        }
    }

    /// As it was when it was left: a ray's [`Self::range`], and what is noted, and where that is.
    #[inline(always)]
    pub fn resume(&mut self, [sure, limit]: [f32; 2], noted: u32, place: u32) {
        (self.sure, self.limit, self.noted, self.place) = (sure, limit, noted, place);
    }

    /// As it was when it was left: a ray's [`Self::range`], and what was computed.
    #[inline(always)]
    pub fn take(&mut self, range: [f32; 2], nearest: Nearest) {
        self.start(range);
        (self.nearest, self.is_computed) = (nearest, true);
    }

    /// Up to where a hit is the nearest for sure, and up to where one is wanted.
    #[inline(always)]
    pub fn range(&self) -> [f32; 2] {
        [self.sure, self.limit]
    }

    /// Decides whether the ray hits one triangle of a block.
    #[cold]
    #[inline(never)]
    pub fn decide(&mut self, bvh: &Bvh, place: u32, index: u32, block: &Block, lane: usize, ray: &Ray) {
        let mut nearest = self.nearest(bvh, ray);
        if self.is_noted() {
            self.computed = self.noted;
        }
        let before = nearest.hit().map(|hit| hit.id());
        let (tree, through) = bvh.triangles_at(place);
        tree.offer(block, lane, ray, through, &mut nearest);
        if nearest.hit().map(|hit| hit.id()) != before {
            self.computed = LANES as u32 * index + lane as u32;
        }
        self.limit = nearest.limit();
        if let Some(hit) = nearest.hit() {
            self.sure = hit.t.next_down();
        }
        (self.nearest, self.is_computed, self.noted) = (nearest, true, NONE);
    }

    /// The nearest of all, computed.
    pub fn nearest(&self, bvh: &Bvh, ray: &Ray) -> Nearest {
        if self.noted != NONE {
            // It is nearer than whatever was computed before.
            bvh.noted_hit(self.place, self.noted, ray)
        } else if self.is_computed {
            self.nearest
        } else {
            Nearest::new(ray)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::trace::bvh::random::Random;

    /// Hits with bounds around their t, in any order: the nearest is listed, alone where bounds tell it from all
    /// others, and nobody who is behind one that came before for sure; or a bound is out of range, and that is said.
    #[test]
    fn the_nearest_is_always_listed() {
        let mut random = Random::new(1);
        let (mut doubts, mut rivals, mut alone) = (0, 0, 0);
        for case in 0..20_000 {
            let wide = [0.0, 0.01, 0.3][case % 3];
            let ray = Ray { tmin: 0.1, tmax: 1.9, ..Ray::new(Vec3::ZERO, Vec3::X) };
            let hits: Vec<(f32, [f32; 2])> = (0..1 + case % 7)
                .map(|_| {
                    let t = 1.0 + random.unit();
                    (t, [t - wide * random.unit().abs(), t + wide * random.unit().abs()])
                })
                .collect();
            let (mut found, mut listed) = (Found::NONE, Listed::NONE);
            found.start([ray.tmax, ray.tmax.next_up()]);
            let is_clear = hits.iter().zip(0..).all(|(&(_, t), id)| found.list(&mut listed, id, t, &ray));
            if !is_clear {
                let is_crossed = |end: f32| hits.iter().any(|(_, [low, high])| *low < end && end < *high);
                let is_outside = hits.iter().any(|(t, _)| !(ray.tmin..=ray.tmax).contains(t));
                assert!(is_outside || is_crossed(ray.tmin) || is_crossed(ray.tmax), "{case}: {hits:?}");
                doubts += 1;
                continue;
            }
            let within = hits.iter().zip(0..).filter(|((t, _), _)| *t <= ray.tmax);
            let nearest = within.min_by(|((a, _), _), ((b, _), _)| a.total_cmp(b)).map(|(_, id)| id);
            let is_listed = nearest.map_or(listed.sure().is_empty(), |id| listed.sure().contains(&id));
            assert!(is_listed, "{case}: {hits:?}, {:?}", listed.sure());
            assert!(!listed.is_in_doubt());
            for &id in listed.sure() {
                let (_, [low, _]) = hits[id as usize];
                let is_behind = hits[..id as usize].iter().any(|(_, [_, high])| *high < low);
                assert!(!is_behind, "{case}: {id} of {hits:?}");
            }
            if let Some(nearest) = nearest {
                let (_, [_, high]) = hits[nearest as usize];
                let others = hits.iter().zip(0..).filter(|(_, id)| *id != nearest);
                let is_clear = others.map(|((_, [low, _]), _)| *low).all(|low| high < low);
                assert!(!is_clear || listed.sure() == [nearest], "{case}: {hits:?}, {:?}", listed.sure());
            }
            *if listed.sure().len() > 1 { &mut rivals } else { &mut alone } += 1;
        }
        assert!(doubts > 1000 && rivals > 1000 && alone > 1000, "{doubts} doubts, {rivals} with rivals, {alone} alone");
    }

    /// What is no number is a doubt.
    #[test]
    fn bounds_that_are_not_a_number_are_a_doubt() {
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        for t in [[f32::NAN, 1.0], [1.0, f32::NAN], [1.0, f32::INFINITY]] {
            let (mut found, mut listed) = (Found::NONE, Listed::NONE);
            found.start([ray.tmax, ray.tmax]);
            assert!(!found.list(&mut listed, 0, t, &ray), "{t:?}");
        }
    }
}
