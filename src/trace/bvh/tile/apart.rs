//! Rays of a bundle that go through a placed object each by itself: where they are no bundle in its coordinates, or where a bundle does not pay.

use super::found::{DONE, Found};
use crate::ray::Ray;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::alone::{Noted, SingleRay};
use crate::trace::bvh::bundle::{RAYS, SLACK};
use crate::trace::bvh::found::{Found as Doubted, NONE};
use crate::trace::bvh::query::Query;
use crate::trace::bvh::range::Range;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::walk::Stack;

/// What they need.
pub(super) struct Apart {
    stack: Stack,
    /// Of the ray that walks, what was in doubt.
    doubted: Doubted,
}

impl Apart {
    pub fn new() -> Self {
        Self { stack: Stack::new(), doubted: Doubted::NONE }
    }

    /// Traces the rays of the bit mask `seeing` through one placed object.
    #[inline(always)]
    pub fn trace<S: Simd, Q: Query>(
        &mut self,
        bvh: &Bvh,
        place: u32,
        rays: &[Ray; RAYS],
        mut seeing: u64,
        range: &mut Range,
        found: &mut Found,
    ) {
        let Self { stack, doubted } = self;
        while seeing != 0 {
            let i = seeing.trailing_zeros() as usize % RAYS;
            seeing &= seeing - 1;
            if range.limit.0[i] < 0.0 {
                continue;
            }
            let (ray, single) = (&rays[i], SingleRay::from(&rays[i]));
            let mut noted = Noted::nothing(&single);
            if !Q::ANY {
                // Rounded up, as of a ray that has hit nothing yet.
                noted.limit = range.limit.0[i] * (1.0 + SLACK) + f32::MIN_POSITIVE;
                (noted.sure, noted.id, noted.place) = (range.sure.0[i], found.noted[i], found.place[i]);
                if noted.id == NONE && found.computed >> i & 1 != 0 {
                    noted.is_doubted = true;
                    doubted.take([noted.sure, noted.limit], found.nearest[i]);
                }
            }
            let before = (noted.sure, noted.id);
            bvh.walk_place::<S, Q>(place, &single, ray, stack, &mut noted, doubted);
            if Q::ANY {
                if noted.is_hit(doubted) {
                    range.set(i, DONE, DONE);
                }
            } else if noted.is_doubted || before != (noted.sure, noted.id) {
                range.set(i, noted.sure, noted.limit.min(range.limit.0[i]));
                (found.noted[i], found.place[i]) = (noted.id, noted.place);
                if noted.id == NONE {
                    (found.nearest[i], found.computed) = (doubted.nearest(bvh, ray), found.computed | 1 << i);
                }
            }
        }
    }
}
