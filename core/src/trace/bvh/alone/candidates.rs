//! The triangles that one ray may hit, offered to whoever decides.
//!
//! A walk by itself, for what flights leave open: rounding, or what the caller knows about triangles and the tree does
//! not.

use crate::ray::Ray;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::levels::triangles::TriangleTree;
use crate::trace::bvh::query::Closest;
use crate::trace::bvh::reject::Blur;
use crate::trace::bvh::reject::filter::{self, Filter};
use crate::trace::bvh::reject::slab::SlabRay;
use crate::trace::bvh::simd::Simd;
use crate::trace::bvh::simd::isa::{self, Kernel};
use crate::trace::bvh::walk::{self, Visit};

/// What is done with a candidate: its geometry and its primitive; says up to which t more are wanted, none where no
/// more are.
pub(in crate::trace) type Offer<'a> = &'a mut dyn FnMut(u32, u32) -> Option<f32>;

impl Bvh {
    /// Offers every fixed triangle that `ray` may hit up to its tmax, near ones first but for the order within a leaf;
    /// some several times. The ray, and the triangles, may be off from those that are meant by the blur.
    pub(in crate::trace) fn candidates(&self, ray: &Ray, blur: Blur, offer: Offer<'_>) {
        if ray.is_valid() && !self.fixed.triangles.tree().is_empty() {
            isa::dispatch(self.isa, Candidates { bvh: self, ray, blur, offer });
        }
    }
}

struct Candidates<'a> {
    bvh: &'a Bvh,
    ray: &'a Ray,
    blur: Blur,
    offer: Offer<'a>,
}

impl Kernel for Candidates<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { bvh, ray, blur, offer } = self;
        let triangles = &bvh.fixed.triangles;
        walk::<S>(
            triangles,
            ray,
            blur,
            #[inline(always)]
            |filter, block, limit| filter.rounded_candidates::<S>(block, limit),
            #[inline(always)]
            |block, lane, _| offer(triangles.part(block.part[lane]).geometry, block.primitive[lane]),
        );
    }
}

/// Calls `each` with every triangle that `test` leaves of the blocks that the ray comes to, by block and lane, and with
/// how far it looks so far; it gives how far it looks from there on, none where it has seen enough.
#[inline(always)]
pub(super) fn walk<S: Simd>(
    triangles: &TriangleTree,
    ray: &Ray,
    blur: Blur,
    test: impl Fn(&Filter, &Block, f32) -> filter::Candidates,
    mut each: impl FnMut(&Block, usize, f32) -> Option<f32>,
) {
    let tree = triangles.tree();
    let (slab, filter) = (SlabRay::new::<S>(ray, tree.reach(), blur), Filter::new(ray, blur));
    let mut limit = ray.tmax.next_up();
    walk::single::<S, Closest>(
        tree,
        &slab,
        limit,
        #[inline(always)]
        |leaf| {
            for index in leaf.blocks() {
                let mut scratch = None;
                let block = triangles.block::<S>(index, &mut scratch);
                let mut open = test(&filter, block, limit).lanes;
                while open != 0 {
                    let lane = open.trailing_zeros() as usize % LANES;
                    open &= open - 1;
                    match each(block, lane, limit) {
                        Some(wanted) => limit = wanted,
                        None => return Visit::Stop,
                    }
                }
            }
            Visit::Until(limit)
        },
    );
}
