//! Asking an engine for the hits of prepared rays, chunk by chunk.

use std::hint::black_box;

use rayon::prelude::*;

use super::rays::{Kind, RaySet};
use crate::ray::{Hit, Ray};
use crate::trace::{Batch, Tracer};

/// Rays handed to an engine at a time: enough for it to sort or regroup them, few enough that rays and answers stay in
/// the second-level cache.
pub(super) const CHUNK: usize = 4096;

/// Room for the answers to a chunk, used again and again so that it stays in the cache.
pub(super) struct Room {
    hits: Vec<Option<Hit>>,
    occluded: Vec<bool>,
}

impl Room {
    /// Room for [`CHUNK`] answers.
    pub fn new() -> Self {
        Self { hits: vec![None; CHUNK], occluded: vec![false; CHUNK] }
    }

    /// Traces up to [`CHUNK`] rays and counts the hits.
    pub fn chunk(&mut self, kind: Kind, rays: &[Ray], tracer: &dyn Tracer, batch: Batch) -> u64 {
        let count = if kind.is_shadow() {
            let occluded = &mut self.occluded[..rays.len()];
            tracer.occluded_batch(rays, occluded, batch);
            black_box(&*occluded).iter().filter(|occluded| **occluded).count()
        } else {
            let hits = &mut self.hits[..rays.len()];
            tracer.closest_batch(rays, hits, batch);
            black_box(&*hits).iter().filter(|hit| hit.is_some()).count()
        };
        count as u64
    }
}

/// The answers to all rays of a set.
#[derive(PartialEq)]
pub(super) enum Answers {
    Closest(Vec<Option<Hit>>),
    Occluded(Vec<bool>),
}

impl Answers {
    /// Asks in the chunks that are timed.
    pub fn of(set: &RaySet, tracer: &dyn Tracer, batch: Batch) -> Self {
        let rays = set.rays.par_chunks(CHUNK);
        if set.kind.is_shadow() {
            let mut occluded = vec![false; set.rays.len()];
            let chunks = rays.zip(occluded.par_chunks_mut(CHUNK));
            chunks.for_each(|(rays, occluded)| tracer.occluded_batch(rays, occluded, batch));
            Self::Occluded(occluded)
        } else {
            let mut hits = vec![None; set.rays.len()];
            rays.zip(hits.par_chunks_mut(CHUNK)).for_each(|(rays, hits)| tracer.closest_batch(rays, hits, batch));
            Self::Closest(hits)
        }
    }

    /// Rays that hit something.
    pub fn hits(&self) -> u64 {
        match self {
            Self::Closest(hits) => hits.iter().flatten().count() as u64,
            Self::Occluded(occluded) => occluded.iter().filter(|occluded| **occluded).count() as u64,
        }
    }
}
