//! Some rays that make no bundle, one after the other.
//!
//! A few rays make no flight ([`crate::trace::bvh::flight`]) worth its name: while one waits, none of the others has a
//! step to take.

use super::{Doubted, Noted, SingleRay};
use crate::ray::Ray;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::hits::found::{Found, NONE};
use crate::trace::bvh::levels::place::{EightRays, Place};
use crate::trace::bvh::levels::placements::FIXED;
use crate::trace::bvh::levels::triangles::TriangleTree;
use crate::trace::bvh::query::{Closest, Query};
use crate::trace::bvh::reject::Blur;
use crate::trace::bvh::reject::ready::{ReadyRay, ReadyRays, columns_of, ready_blurred};
use crate::trace::bvh::simd::{Simd, everywhere};
use crate::trace::bvh::walk::{self, Visit};

/// How rays travel that make no bundle. Hits do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Travel {
    /// By how many there are; in packets where they run the same way.
    #[default]
    Auto,
    /// Several of them in turn, however few; but without AVX one after the other.
    InFlight,
    /// One after the other, however many; but shadow rays that bundles leave to placed objects fly.
    Alone,
}

/// As many rays take as long one after the other as in a flight.
const FEW: usize = 12;

impl Bvh {
    /// The same tracer, whose rays travel as told.
    #[must_use]
    pub fn travelling(self, travel: Travel) -> Self {
        Self { travel, ..self }
    }

    /// Whether so many rays, which make no bundle, had better walk alone.
    pub(in crate::trace::bvh) fn travel_alone(&self, rays: usize) -> bool {
        match self.travel {
            Travel::Auto => rays < FEW,
            Travel::InFlight => false,
            Travel::Alone => true,
        }
    }

    /// Answers all rays among triangles that stand still: `done` is told of each that has hit something what it has
    /// found.
    #[inline(always)]
    pub(in crate::trace::bvh) fn walk_one_by_one<S: Simd, Q: Query>(
        &self,
        doubted: &mut Doubted,
        rays: &[Ray],
        mut done: impl FnMut(usize, &Found),
    ) {
        let has_placements = self.placements.has_triangles();
        let reach = self.placements.reach().max(self.fixed.triangles.tree().reach());
        let mut waiting = ReadyRays::new(rays, reach, Blur::NONE);
        while let Some(i) = waiting.next::<S>() {
            let (ray, ready) = (&rays[i], waiting.ready());
            let single = SingleRay::from(ray);
            let Noted { sure, limit, id, place, is_doubted } = if has_placements {
                self.walk_from_place_to_place::<S, Q>(&single, ray, ready, doubted)
            } else {
                self.walk_ready::<S, Q>(&single, ready, doubted)
            };
            if id != NONE || is_doubted {
                let found = doubted.get_or_insert(Found::NONE);
                if id != NONE {
                    found.resume([sure, limit], id, place);
                }
                done(i, found);
            }
        }
    }

    /// As [`Self::walk_ready`], and then through placed objects, which may be all there is. `ray` is the same ray
    /// again, which is `ready` for the world.
    #[inline(always)]
    fn walk_from_place_to_place<S: Simd, Q: Query>(
        &self,
        single: &SingleRay,
        ray: &Ray,
        ready: &ReadyRay,
        doubted: &mut Doubted,
    ) -> Noted {
        let mut noted = Noted::nothing(single);
        let slab = ready.slab();
        let fixed = &self.fixed.triangles;
        if !fixed.tree().is_empty() {
            self.walk_through::<S, Q, false>(
                FIXED,
                fixed,
                &slab,
                #[inline(always)]
                || ready.filter(),
                single,
                &mut noted,
                doubted,
            );
            if Q::ANY && noted.is_hit(doubted) {
                return noted;
            }
        }
        walk::single::<S, Q>(
            self.placements.tree(),
            &slab,
            noted.limit,
            #[inline(always)]
            |leaf| {
                for number in leaf.blocks() {
                    self.walk_place::<S, Q>(number, single, ray, &mut noted, doubted);
                    if Q::ANY && noted.is_hit(doubted) {
                        return Visit::Stop;
                    }
                }
                Visit::Until(noted.limit)
            },
        );
        noted
    }

    /// Goes on through the triangles of one placed object. `ray` is the same ray again.
    #[inline(always)]
    pub(in crate::trace::bvh) fn walk_place<S: Simd, Q: Query>(
        &self,
        number: u32,
        single: &SingleRay,
        ray: &Ray,
        noted: &mut Noted,
        doubted: &mut Doubted,
    ) {
        let (place, triangles) = self.object_at(number);
        if triangles.tree().is_empty() {
            return;
        }
        let (local, blur) = place.local::<S>(ray);
        let local = SingleRay::from(&local);
        let Some((slab, rest)) = local.ready::<S, true>(triangles.tree().reach_row(), blur) else { return };
        self.walk_through::<S, Q, true>(
            number,
            triangles,
            &slab,
            #[inline(always)]
            || rest.filter(),
            single,
            noted,
            doubted,
        );
    }

    /// The closest hit of a ray that is [ready](Self::ready_at), through an object that has triangles.
    #[inline(always)]
    pub(in crate::trace::bvh) fn walk_place_ready<S: Simd>(
        &self,
        number: u32,
        single: &SingleRay,
        ready: &ReadyRay,
        noted: &mut Noted,
        doubted: &mut Doubted,
    ) {
        let (_, triangles) = self.object_at(number);
        self.walk_through::<S, Closest, true>(
            number,
            triangles,
            &ready.slab(),
            #[inline(always)]
            || ready.filter(),
            single,
            noted,
            doubted,
        );
    }

    /// Eight rays made ready for a placed object, and a bit for each for which that could be done.
    #[inline(always)]
    pub(in crate::trace::bvh) fn ready_at<S: Simd>(&self, number: u32, rays: [&Ray; 8]) -> ([ReadyRay; 8], u32) {
        let (place, triangles) = self.object_at(number);
        let EightRays { columns, off, turn, known } = place.eight::<S>(columns_of::<S>(rays));
        let (ready, valid) = ready_blurred::<S>(columns, everywhere(triangles.tree().reach()), off, turn);
        (ready, valid & known)
    }

    #[inline(always)]
    pub(in crate::trace::bvh) fn object_at(&self, number: u32) -> (&Place, &TriangleTree) {
        let place = self.placements.at(number);
        (place, &self.objects[place.object as usize].triangles)
    }
}
