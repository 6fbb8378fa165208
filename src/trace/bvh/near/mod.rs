//! The triangles that may be nearest to points, offered to whoever measures.
//!
//! The nearest child is gone down to first, the others wait with the distance of their boxes and discs (Roussopoulos, Kelley, Vincent 1995,
//! *Nearest neighbor queries*), eight at a time. [`closest_point`](super::closest_point) opens boxes strictly by distance: it
//! opens fewer, and pays for a queue. Of the eight triangles of a block those are left out whose distance, in f32 with a bound on its error, is
//! larger than what was measured ([`bounds`]).
//!
//! Points are in flight together, as rays are ([`super::flight`]): alone, one waits for each node until it knows the next.

mod bounds;
mod waiting;

use super::Bvh;
use super::addresses::Addresses;
use super::discs::Discs;
use super::isa::{self, Kernel};
use super::node::{Child, Node};
use super::set::{Set, TRAVELLERS};
use super::simd::Simd;
use super::triangles::TriangleTree;
use crate::math::{UNIT_ROUNDOFF, Vec3};
use bounds::{Lower, enter, lower_bounds};
use waiting::Waiting;

/// A point in the coordinates of a tree, finite.
#[derive(Clone, Copy, Debug)]
pub(in crate::trace) struct Sought {
    pub point: Vec3,
    /// The point and the corners may be off by so much in each component, both together.
    pub error: f32,
    /// No triangle is wanted beyond this distance.
    pub wanted: f64,
}

/// Who asks for points, and measures. Of each traveller, below [`Bvh::POINTS`], one point after the other is asked for.
pub(in crate::trace) trait Surveyor {
    /// The traveller's next point; everything that may be nearest to the one before was offered.
    fn next(&mut self, traveller: usize) -> Option<Sought>;
    /// Measures the distance of the traveller's point from a triangle, by its geometry, its primitive, and its corners in the tree. Says beyond which distance none is wanted
    /// any more.
    fn measure(&mut self, traveller: usize, geometry: u32, primitive: u32, corners: &[Vec3; 3]) -> f64;
}

impl Bvh {
    /// Points in flight.
    pub(in crate::trace) const POINTS: usize = TRAVELLERS;

    /// What [`near_triangles`](Self::near_triangles) looks at besides boxes.
    pub(in crate::trace) fn discs(&self) -> Discs {
        Discs::new(&self.fixed.triangles)
    }

    /// Offers the surveyor of each point every fixed triangle that may be the nearest, or as near, and no farther than wanted. Up to `most` points are
    /// in flight; where there are no triangles nobody is asked. `discs` are this tree's.
    pub(in crate::trace) fn near_triangles(&self, discs: &Discs, most: usize, surveyor: &mut dyn Surveyor) {
        let triangles = &self.fixed.triangles;
        if !triangles.tree().is_empty() {
            let mut seekers = vec![Seeker::NOBODY; most.min(Self::POINTS)];
            isa::dispatch(self.isa, Near { triangles, discs, seekers: &mut seekers, surveyor });
        }
    }
}

/// A point on its way.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
struct Seeker {
    point: Vec3,
    /// As [`Sought::error`].
    error: f32,
    /// By how much a box is nearer than it seems, along each axis.
    pad: f32,
    /// No triangle is wanted beyond this distance; rounded up.
    limit: f32,
    waiting: Waiting,
}

impl Seeker {
    const NOBODY: Self = Self { point: Vec3::ZERO, error: 0.0, pad: 0.0, limit: 0.0, waiting: Waiting::NOBODY };

    /// Sets out in a tree with this reach.
    #[inline(always)]
    fn start(&mut self, Sought { point, error, wanted }: Sought, reach: Vec3) {
        let span = (point.abs() + reach).max_element();
        (self.point, self.error, self.pad) = (point, error, error + 4.0 * UNIT_ROUNDOFF * span);
        self.limit = self.rounded_up(wanted);
        self.waiting.clear();
    }

    /// For the rounding of what was measured.
    #[inline(always)]
    fn rounded_up(&self, wanted: f64) -> f32 {
        (wanted as f32) * (1.0 + 4.0 * UNIT_ROUNDOFF) + 2.0 * self.error + f32::MIN_POSITIVE
    }

    /// One node. What it reaches next.
    #[inline(always)]
    fn enter<S: Simd>(&mut self, discs: &Discs, parent: Child, node: &Node) -> Child {
        let limit = self.limit * self.limit;
        let (mask, near) = enter::<S>(discs, parent, node, self.point, self.pad, limit);
        self.waiting.enter::<S>(near, mask, &node.child)
    }
}

/// What a seeker has seen at a leaf.
#[derive(Clone, Copy)]
struct Sight<V> {
    seeker: usize,
    leaf: Child,
    lower: Lower<V>,
    /// The triangles that may be near.
    open: u32,
}

/// What comes next will be needed soon.
#[inline(always)]
fn fetch<S: Simd>(addresses: &Addresses, discs: &Discs, next: Child) {
    S::prefetch(addresses.of(next));
    S::prefetch(discs.address::<S>(next));
}

struct Near<'a> {
    triangles: &'a TriangleTree,
    discs: &'a Discs,
    /// One for each traveller.
    seekers: &'a mut [Seeker],
    surveyor: &'a mut dyn Surveyor,
}

impl Near<'_> {
    /// Goes through what a seeker has seen. What it reaches next, if that is another child now.
    #[inline(always)]
    fn measure<S: Simd>(&mut self, sight: &Sight<S::V8>) -> Option<Child> {
        let Sight { seeker: k, leaf, lower, open } = sight;
        let (seeker, mut open, mut scratch) = (&mut self.seekers[*k], *open, None);
        let block = self.triangles.block(leaf.first(), &mut scratch);
        let before = seeker.limit;
        while open != 0 {
            let lane = lower.nearest(open);
            open &= !(1 << lane);
            let geometry = self.triangles.part(block.part[lane]).geometry;
            let wanted = self.surveyor.measure(*k, geometry, block.primitive[lane], &block.triangle(lane));
            let limit = seeker.rounded_up(wanted);
            if limit < seeker.limit {
                seeker.limit = limit;
                open &= lower.within(limit);
            }
        }
        let limit = seeker.limit;
        (limit < before).then(
            #[inline(always)]
            || seeker.waiting.pass_within::<S>(*leaf, limit * limit),
        )
    }
}

impl Kernel for Near<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self) {
        let (triangles, discs) = (self.triangles, self.discs);
        let (tree, reach) = (triangles.tree(), triangles.tree().reach());
        let addresses = Addresses::of_triangles::<S>(triangles);
        let (mut flying, mut next) = (Set::NOBODY, [Child::NONE; TRAVELLERS]);
        (0..self.seekers.len()).for_each(|k| flying.insert(k));
        let nothing = Sight { seeker: 0, leaf: Child::NONE, lower: Lower::none(), open: 0 };
        let mut sights: [Sight<S::V8>; TRAVELLERS] = [nothing; TRAVELLERS];
        while !flying.is_empty() {
            let (leaf, none) =
                (S::highest_bits(bytemuck::cast_ref(&next)), S::equal(bytemuck::cast_ref(&next), Child::NONE.0));
            let mut at_nodes = flying.of(!leaf);
            for k in flying.of(none) {
                if let Some(sought) = self.surveyor.next(k) {
                    self.seekers[k].start(sought, reach);
                    next[k] = Child::ROOT;
                    at_nodes.insert(k);
                } else {
                    flying.remove(k);
                }
            }
            for k in at_nodes {
                next[k] = self.seekers[k].enter::<S>(discs, next[k], tree.node(next[k]));
                fetch::<S>(&addresses, discs, next[k]);
            }
            let mut count = 0;
            for k in flying.of(leaf & !none) {
                let (seeker, leaf, mut scratch) = (&mut self.seekers[k], next[k], None);
                let block = triangles.block(leaf.first(), &mut scratch);
                let lower = lower_bounds::<S>(block, seeker.point, seeker.error);
                let open = lower.within(seeker.limit) & block.lanes;
                sights[count % TRAVELLERS] = Sight { seeker: k, leaf, lower, open };
                count += usize::from(open != 0);
                next[k] = seeker.waiting.pass(leaf);
                fetch::<S>(&addresses, discs, next[k]);
            }
            for sight in &sights[..count.min(TRAVELLERS)] {
                if let Some(child) = self.measure::<S>(sight) {
                    next[sight.seeker] = child;
                    fetch::<S>(&addresses, discs, child);
                }
            }
        }
    }
}
