//! A bundle of up to 64 rays against a tree at once: the fastest way for camera rays, and for shadow rays of a point
//! light.
//!
//! - **Nodes**: eight boxes are tested against the rectangle of all slopes, an interval test that rejects for all rays
//!   (Wald, Boulos, Shirley 2007, *Ray tracing deformable scenes using dynamic bounding volume hierarchies*). What
//!   remains is tested group by group, up to the first group of rays that hits: the groups before it take no part in
//!   that subtree.
//! - **Triangles**: with a common origin, the edge function of a ray is the scalar product of its direction with a normal
//!   that belongs to the edge. Four triangles are rejected at once by the rectangle of slopes; of the others each group
//!   of rays takes three scalar products.
//! - **Decisions**: edge functions and t' carry bounds on their rounding errors. Where these leave no doubt, a hit is only
//!   noted; where they do, it is decided by [`triangle::intersect`](crate::shape::triangle::intersect). In the end t, u
//!   and v of what was noted are computed four rays at a time ([`TriangleTree::hits`](super::triangles::TriangleTree::hits)), with the bits that a single ray would get.
//! - **Placed objects**: a bundle is one in their coordinates, too. It is brought there when it comes to a placement, and
//!   goes on as in the world. Where it crosses an octant there, which in the world would divide it, its rays go on one by one.

mod found;
mod placed;
mod walk;

use std::marker::PhantomData;

use super::Bvh;
use super::build::MAX_DEPTH;
use super::bundle::{Bundle, Fit, RAYS};
use super::placements::FIXED;
use super::query::{Query, SOMETHING};
use super::range::Range;
use super::simd::{Group, Simd};
use super::walk::Stack;
use crate::math::Vec3;
use crate::ray::Ray;
use found::Found;
use placed::{Tour, one_by_one};
use walk::{Entry, Walk, Way};

/// Fewer rays than this are better traced one by one.
const FEWEST: usize = 6;

/// Working memory, made once a batch.
pub(super) struct Scratch {
    one: One,
    /// t of the closest hits of the last bundle.
    pub t: [f64; RAYS],
    /// Rays of one octant.
    part: [Ray; RAYS],
}

/// Places on a stack.
const STACK: usize = MAX_DEPTH * 7 + 8;

/// One bundle and its way.
struct One {
    /// In the tree of placements, and in one of triangles; of a single ray.
    upper: [Entry; STACK],
    stack: [Entry; STACK],
    single: Stack,
    /// In the world, and in the coordinates of a placed object.
    bundle: Bundle,
    local: Bundle,
    range: Range,
    found: Found,
}

impl Scratch {
    pub fn new() -> Self {
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        let found = Found::new();
        let stack = [Entry::root(0); STACK];
        let (bundle, local, range) = (Bundle::new(), Bundle::new(), Range::new());
        let one = One { upper: stack, stack, single: Stack::new(), bundle, local, range, found };
        Self { one, t: [0.0; RAYS], part: [ray; RAYS] }
    }
}

/// Traces up to 64 rays that start in one point (or, for any hit, that end in one) through all triangles, into `answers` of
/// the same length and, for closest hits, `scratch.t`. A bit is set in the result for every ray that was traced; the others
/// have too little in common.
#[inline(always)]
pub(super) fn trace<S: Simd, Q: Query>(
    scratch: &mut Scratch,
    bvh: &Bvh,
    rays: &[Ray],
    answers: &mut [Q::Answer],
) -> u64 {
    let Scratch { one, t, part } = scratch;
    if let (Ok(rays), Ok(answers)) = (<&[Ray; RAYS]>::try_from(rays), <&mut [Q::Answer; RAYS]>::try_from(&mut *answers))
    {
        match one.bundle.fill::<S, Q>(rays, &mut one.range) {
            Fit::Whole => {
                let is_traced = one.trace::<S, Q>(bvh, rays, RAYS, answers, t);
                return if is_traced { u64::MAX } else { 0 };
            }
            Fit::Parts => {}
            Fit::None => return 0,
        }
    }
    let mut octants = [0u64; 8];
    for (i, ray) in rays.iter().enumerate() {
        let d = ray.direction;
        let octant = usize::from(d.x < 0.0) | usize::from(d.y < 0.0) << 1 | usize::from(d.z < 0.0) << 2;
        octants[octant] |= u64::from(ray.is_valid()) << i;
    }
    let mut done = 0;
    for members in octants {
        if (members.count_ones() as usize) < FEWEST {
            continue;
        }
        let (mut index, mut rest, mut count) = ([0u8; RAYS], members, 0);
        while rest != 0 {
            index[count] = rest.trailing_zeros() as u8;
            part[count] = rays[usize::from(index[count])];
            rest &= rest - 1;
            count += 1;
        }
        // What fills the last group is traced, and forgotten.
        let last = part[count - 1];
        part[count..].fill(last);
        let (mut part_answers, mut part_t) = ([Q::MISS; RAYS], [0.0; RAYS]);
        if one.bundle.fill::<S, Q>(part, &mut one.range) == Fit::Whole
            && one.trace::<S, Q>(bvh, part, count, &mut part_answers, &mut part_t)
        {
            for (k, &i) in index[..count].iter().enumerate() {
                (answers[usize::from(i)], t[usize::from(i)]) = (part_answers[k], part_t[k]);
            }
            done |= members;
        }
    }
    done
}

impl One {
    /// Traces the bundle, which is made of `rays`; the first `count` of them matter. False, and nothing done, where it is
    /// too steep for a tree.
    #[inline(always)]
    fn trace<S: Simd, Q: Query>(
        &mut self,
        bvh: &Bvh,
        rays: &[Ray; RAYS],
        count: usize,
        answers: &mut [Q::Answer; RAYS],
        t: &mut [f64; RAYS],
    ) -> bool {
        let Self { upper, stack, single, bundle, local, range, found } = self;
        let groups = count.div_ceil(S::Wide::LANES);
        let Some(mut tour) = Tour::new(bvh, bundle, groups, upper) else { return false };
        found.start();
        while let Some((place, first)) = tour.next::<S>(range) {
            let (tree, _) = bvh.triangles_at(place);
            if tree.tree().is_empty() {
                continue;
            }
            let is_bundle = place == FIXED || local.place::<S>(bundle, bvh.placements.at(place), range);
            let bundle = if place == FIXED { &*bundle } else { &*local };
            let Some(slab) = bundle.slab(tree.tree().reach()).filter(|_| is_bundle) else {
                one_by_one::<S, Q>(bvh, place, rays, count, single, range, found);
                continue;
            };
            let way = Way { bundle, slab, groups, most: 0.0 };
            match bundle.axis {
                0 => {
                    let query = PhantomData::<Q>;
                    let walk = Walk::<Q, 0> { bvh, place, tree, rays, bundle, found, groups, query };
                    walk.run::<S>(stack, way, first);
                }
                1 => {
                    let query = PhantomData::<Q>;
                    let walk = Walk::<Q, 1> { bvh, place, tree, rays, bundle, found, groups, query };
                    walk.run::<S>(stack, way, first);
                }
                _ => {
                    let query = PhantomData::<Q>;
                    let walk = Walk::<Q, 2> { bvh, place, tree, rays, bundle, found, groups, query };
                    walk.run::<S>(stack, way, first);
                }
            }
            range.shorten::<S>(bundle, &found.sure, &found.limit);
        }
        if Q::ANY {
            for (answer, limit) in answers.iter_mut().zip(&range.limit.0) {
                *answer = Q::answer((*limit < 0.0).then_some(SOMETHING));
            }
        } else {
            found.finish::<S, Q>(bvh, bundle, rays, count, answers, t);
        }
        true
    }
}
