//! Many rays that make no bundle, one after the other.
//!
//! Flights ([`super::super::flight`]) hide the time that memory takes, at the price of a list, a stack in memory and children put in order where
//! only one is entered. Where the tree is in the cache there is little to hide, and a walk that keeps in registers what it is at takes a
//! tenth to a fifth less. A few rays make no flight worth its name, whatever the tree.

use super::{Noted, SingleRay};
use crate::ray::Ray;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::found::{Found, NONE};
use crate::trace::bvh::query::Query;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::walk::Stack;

/// How rays travel that make no bundle. Hits do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Travel {
    /// By the size of the tree, and by how many they are.
    #[default]
    BySize,
    /// Several of them in turn, in every scene.
    InFlight,
    /// One after the other, wherever they can: in scenes without placed triangles.
    Alone,
}

/// A tree of that many bytes stays in the cache, for the most part: with 10 MiB both ways were alike where 32 MiB of cache were shared with
/// others, with 23 MiB flights were faster by a fifteenth, with 110 MiB by a seventh.
const CACHED: usize = 12 << 20;

/// Fewer rays than this do not wait for each other.
const FEW: usize = 8;

impl Bvh {
    /// The same tracer, whose rays travel as told.
    #[must_use]
    pub fn travelling(self, travel: Travel) -> Self {
        Self { travel, ..self }
    }

    /// Whether so many rays that make no bundle had better walk alone.
    pub(in crate::trace::bvh) fn travels_alone(&self, rays: usize) -> bool {
        !self.placements.has_triangles()
            && match self.travel {
                Travel::BySize => rays < FEW || self.fixed.triangles.bytes() <= CACHED,
                Travel::InFlight => false,
                Travel::Alone => true,
            }
    }

    /// Answers all rays among the fixed triangles: `done` is told of each that has hit something what it has found.
    #[inline(always)]
    pub(in crate::trace::bvh) fn walk_one_by_one<S: Simd, Q: Query>(
        &self,
        stack: &mut Stack,
        found: &mut Found,
        rays: &[Ray],
        mut done: impl FnMut(usize, &Found),
    ) {
        for (i, ray) in rays.iter().enumerate() {
            // Of a single ray it would count as 0, and so would NaN.
            let is_valid = ray.tmin >= 0.0;
            if !is_valid {
                continue;
            }
            let Some(noted) = self.walk_alone::<S, Q>(&SingleRay::from(ray), stack, found) else { continue };
            let Noted { sure, limit, id, is_doubted } = noted;
            if id != NONE {
                found.resume([sure, limit], id);
            }
            if id != NONE || is_doubted {
                done(i, found);
            }
        }
    }
}
