//! A bundle of 64 rays against a tree at once: the fastest way for camera rays, and for shadow rays of a point light.
//!
//! - **Nodes**: eight boxes are tested against the bundle's two extreme rays, an interval test that rejects for all 64
//!   (Wald, Boulos, Shirley 2007, *Ray tracing deformable scenes using dynamic bounding volume hierarchies*). What
//!   remains is tested for eight rays at a time, up to the first group that hits: the groups before it take no part
//!   in that subtree.
//! - **Triangles**: with a common origin, the edge function of a ray is the scalar product of its direction with a normal
//!   that belongs to the edge. Four triangles are rejected at once by the interval of the directions; of the others each
//!   group of eight rays takes three scalar products.
//! - **Decisions**: edge functions and t carry bounds on their rounding errors. Where these leave no doubt, a hit is only
//!   noted; where they do, it is decided by [`triangle::intersect`](crate::shape::triangle::intersect), as are in the
//!   end the t, u and v of what was noted. So the answers are those of single rays, to the bit.

use super::build::MAX_DEPTH;
use super::bundle::{Bundle, GROUPS, LANES, PerRay, RAYS};
use super::edges::Edges;
use super::node::{Node, Tree};
use super::simd::{Simd, Vector};
use super::slab::SlabRay;
use super::triangles::TriangleTree;
use crate::ray::Ray;
use crate::trace::nearest::Nearest;

/// No triangle is noted.
const NONE: u32 = u32::MAX;

/// A child to be visited.
#[derive(Clone, Copy, Default)]
struct Entry {
    /// Where the bundle enters it, at the earliest.
    near: f32,
    index: u32,
    count: u8,
    /// The first group with a ray that enters it.
    first: u8,
}

/// Working memory, made once a batch.
pub(super) struct Scratch {
    stack: [Entry; MAX_DEPTH * 7 + 8],
    nearest: [Nearest; RAYS],
}

impl Scratch {
    pub fn new() -> Self {
        let nothing = Nearest::new(&Ray::new(crate::math::Vec3::ZERO, crate::math::Vec3::X));
        Self { stack: [Entry::default(); MAX_DEPTH * 7 + 8], nearest: [nothing; RAYS] }
    }

    /// What the last bundle's ray of that number hits.
    #[inline(always)]
    pub fn nearest(&mut self, ray: usize) -> &mut Nearest {
        &mut self.nearest[ray]
    }
}

/// A bundle on its way through a tree of triangles.
struct Walk<'a, const ANY: bool> {
    tree: &'a TriangleTree,
    rays: &'a [Ray; RAYS],
    bundle: Bundle,
    reciprocal: [PerRay; 3],
    near_offset: [PerRay; 3],
    far_offset: [PerRay; 3],
    tmin: PerRay,
    /// No hit beyond this is wanted; rounded up. Below every t for a ray that is done.
    limit: PerRay,
    /// A hit nearer than this is the nearest for sure.
    sure: PerRay,
    /// What was found without doubt, but not computed yet: block and lane.
    noted: [u32; RAYS],
    /// What was computed: valid for the rays of the bit mask `computed`.
    nearest: &'a mut [Nearest; RAYS],
    computed: u64,
    most: f32,
}

/// Traces rays that start in one point (or, for any hit, that end in one) through `tree`, and leaves in `scratch` what
/// each hits. False, and nothing done, where they are no bundle.
#[inline(always)]
pub(super) fn trace<S: Simd, const ANY: bool>(scratch: &mut Scratch, tree: &TriangleTree, rays: &[Ray; RAYS]) -> bool {
    let Some(bundle) = Bundle::new::<S>(rays, ANY) else { return false };
    let Some(slabs) = bundle.slabs(tree.tree().reach()) else { return false };
    let Scratch { stack, nearest } = scratch;
    let mut walk = Walk::<ANY>::new::<S>(tree, rays, bundle, nearest);
    walk.run::<S>(stack, &slabs);
    walk.finish();
    true
}

impl<'a, const ANY: bool> Walk<'a, ANY> {
    #[inline(always)]
    fn new<S: Simd>(
        tree: &'a TriangleTree,
        rays: &'a [Ray; RAYS],
        bundle: Bundle,
        nearest: &'a mut [Nearest; RAYS],
    ) -> Self {
        let empty = [[0.0; LANES]; GROUPS];
        let (limit, sure, tmin) = (bundle.end, bundle.end, bundle.begin);
        let mut walk = Self {
            tree,
            rays,
            bundle,
            reciprocal: [empty; 3],
            near_offset: [empty; 3],
            far_offset: [empty; 3],
            tmin,
            limit,
            sure,
            noted: [NONE; RAYS],
            nearest,
            computed: 0,
            most: 0.0,
        };
        let reach = tree.tree().reach();
        for group in 0..GROUPS {
            // The range is rounded inwards; boxes and doubtful hits are judged by it widened.
            let widen = S::V8::splat(if walk.bundle.is_turned { 4e-6 } else { 0.0 });
            let begin = S::V8::load(&walk.bundle.begin[group]).sub(widen).max(S::V8::splat(0.0));
            let end = S::V8::load(&walk.bundle.end[group]);
            let wider = end.mul_add(S::V8::splat(1e-6), end).add(widen);
            walk.tmin[group] = begin.mul(S::V8::splat(1.0 - 1e-6)).to_array();
            // An end at infinity, rounded inwards, stands at the largest number.
            walk.limit[group] = wider.max(end).to_array();
            for axis in 0..3 {
                let r = S::V8::splat(1.0).div(S::V8::load(&walk.bundle.direction[axis][group]));
                let (near_offset, far_offset) =
                    SlabRay::offsets::<S>(walk.bundle.origin[axis], r, reach[axis], walk.bundle.blur);
                walk.reciprocal[axis][group] = r.to_array();
                walk.near_offset[axis][group] = near_offset.to_array();
                walk.far_offset[axis][group] = far_offset.to_array();
            }
        }
        walk.measure::<S>();
        walk
    }

    /// The largest limit of all rays.
    #[inline(always)]
    fn measure<S: Simd>(&mut self) {
        let mut most = S::V8::load(&self.limit[0]);
        for limit in &self.limit[1..] {
            most = most.max(S::V8::load(limit));
        }
        self.most = most.to_array().into_iter().fold(f32::NEG_INFINITY, |most, t| if t > most { t } else { most });
    }

    #[inline(always)]
    fn run<S: Simd>(&mut self, stack: &mut [Entry; MAX_DEPTH * 7 + 8], slabs: &[SlabRay; 2]) {
        let tree: &Tree = self.tree.tree();
        let mut len = 0;
        let mut next = Entry::default();
        loop {
            if next.count == 0 {
                let node = tree.node(next.index);
                let (mut mask, near) = SlabRay::enter_either::<S>(slabs, node, self.most);
                let base = len;
                while mask != 0 {
                    let slot = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    let Some(first) = self.first_group::<S>(slabs, node, slot, next.first) else { continue };
                    let child = Entry { near: near[slot], index: node.index[slot], count: node.count[slot], first };
                    let mut at = len;
                    while at > base && stack[at - 1].near < child.near {
                        stack[at] = stack[at - 1];
                        at -= 1;
                    }
                    stack[at] = child;
                    len += 1;
                }
            } else if self.visit::<S>(next) {
                self.measure::<S>();
            }
            next = loop {
                if len == 0 {
                    return;
                }
                len -= 1;
                if stack[len].near <= self.most {
                    break stack[len];
                }
            };
        }
    }

    /// The first group, from `from` on, with a ray that enters the child.
    #[inline(always)]
    fn first_group<S: Simd>(&self, slabs: &[SlabRay; 2], node: &Node, slot: usize, from: u8) -> Option<u8> {
        let sides = slabs[0].near_sides();
        let zero = S::V8::splat(0.0);
        let (mut first, mut second) = ([zero; 3], [zero; 3]);
        for axis in 0..3 {
            let side = sides[axis];
            first[axis] = S::V8::splat(node.bounds[side][slot]);
            second[axis] = S::V8::splat(node.bounds[if side < 3 { side + 3 } else { side - 3 }][slot]);
        }
        for group in from as usize..GROUPS {
            let mut near = S::V8::load(&self.tmin[group]);
            let mut far = S::V8::load(&self.limit[group]);
            for axis in 0..3 {
                let r = S::V8::load(&self.reciprocal[axis][group]);
                near = first[axis].mul_add(r, S::V8::load(&self.near_offset[axis][group])).max(near);
                far = second[axis].mul_add(r, S::V8::load(&self.far_offset[axis][group])).min(far);
            }
            if near.at_most(far) != 0 {
                return Some(group as u8);
            }
        }
        None
    }

    /// Tests the blocks of a leaf; true where a limit has changed.
    #[inline(always)]
    fn visit<S: Simd>(&mut self, leaf: Entry) -> bool {
        let mut changed = false;
        for block in leaf.index..leaf.index + u32::from(leaf.count) {
            let (mut lanes, edges) = self.tree.edges::<S>(block, &self.bundle, self.most);
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                changed |= self.triangle::<S>(4 * block + lane as u32, &edges, lane, leaf.first);
            }
        }
        changed
    }

    /// One triangle against the groups from `first` on.
    #[inline(always)]
    fn triangle<S: Simd>(&mut self, id: u32, edges: &Edges, lane: usize, first: u8) -> bool {
        let splat = S::V8::splat;
        let mut normals = [splat(0.0); 12];
        for (normal, lanes) in normals.iter_mut().zip(&edges.normals) {
            *normal = splat(lanes[lane]);
        }
        let bound = splat(edges.edge_error[lane]);
        let below = splat(-edges.edge_error[lane]);
        let (height, height_error) = (splat(edges.height[lane]), splat(edges.height_error[lane]));
        let slope_error = splat(edges.slope_error[lane]);
        let mut changed = false;
        for group in first as usize..GROUPS {
            let dx = S::V8::load(&self.bundle.direction[0][group]);
            let dy = S::V8::load(&self.bundle.direction[1][group]);
            let dz = S::V8::load(&self.bundle.direction[2][group]);
            let u = dz.mul_add(normals[2], dy.mul_add(normals[1], dx.mul(normals[0])));
            let v = dz.mul_add(normals[5], dy.mul_add(normals[4], dx.mul(normals[3])));
            let w = dz.mul_add(normals[8], dy.mul_add(normals[7], dx.mul(normals[6])));
            let least = u.min(v).min(w);
            let mut candidates = below.at_most(least);
            if edges.is_two_sided >> lane & 1 != 0 {
                // The bundle sees both sides: the signs must only agree.
                candidates |= u.max(v).max(w).at_most(bound);
            }
            if candidates == 0 {
                continue;
            }
            let slope = dz.mul_add(normals[11], dy.mul_add(normals[10], dx.mul(normals[9])));
            let least_slope = slope.sub(slope_error);
            let t = height.div(slope);
            let error = t.abs().mul_add(slope_error, height_error).div(least_slope);
            // Half as much again for the rounding of t and of the error itself.
            let error = error.mul_add(splat(1.5), t.abs().mul(splat(1e-6)));
            let (low, high) = (t.sub(error), t.add(error));
            let mut sure = 0;
            if edges.is_two_sided >> lane & 1 == 0 {
                // A slope that may be 0 bounds nothing.
                let steep = splat(0.0).less(least_slope);
                let limit = S::V8::load(&self.limit[group]);
                candidates &= !steep | low.at_most(limit) & S::V8::load(&self.tmin[group]).at_most(high);
                let in_range =
                    high.less(S::V8::load(&self.sure[group])) & S::V8::load(&self.bundle.begin[group]).less(low);
                sure = steep & bound.less(least) & in_range;
            }
            let (low, high) = (low.to_array(), high.to_array());
            while candidates != 0 {
                let i = candidates.trailing_zeros() as usize;
                candidates &= candidates - 1;
                if sure >> i & 1 != 0 {
                    self.note(group, i, id, low[i], high[i]);
                    changed = true;
                } else {
                    changed |= self.decide(group, i, id);
                }
            }
        }
        changed
    }

    /// A hit that is the nearest so far without doubt.
    #[inline(always)]
    fn note(&mut self, group: usize, lane: usize, id: u32, low: f32, high: f32) {
        self.noted[group * LANES + lane] = id;
        (self.sure[group][lane], self.limit[group][lane]) = if ANY { DONE } else { (low, high) };
    }

    /// What the bounds leave open.
    #[cold]
    #[inline(never)]
    fn decide(&mut self, group: usize, lane: usize, id: u32) -> bool {
        let ray = group * LANES + lane;
        if ANY && self.limit[group][lane] < 0.0 {
            return false;
        }
        self.compute(ray);
        let before = self.nearest[ray].limit();
        self.tree.offer_one(id, &self.rays[ray], &mut self.nearest[ray]);
        let Some(hit) = self.nearest[ray].hit() else { return false };
        if ANY {
            (self.sure[group][lane], self.limit[group][lane]) = DONE;
            return true;
        }
        self.sure[group][lane] = hit.t.next_down();
        self.limit[group][lane] = self.nearest[ray].limit();
        self.limit[group][lane] < before
    }

    /// Makes `nearest` valid for a ray, from what is noted.
    #[inline(always)]
    fn compute(&mut self, ray: usize) {
        let id = std::mem::replace(&mut self.noted[ray], NONE);
        // What is noted is nearer than whatever was computed before.
        if id != NONE || self.computed >> ray & 1 == 0 {
            self.nearest[ray] = Nearest::new(&self.rays[ray]);
            self.computed |= 1 << ray;
        }
        if id != NONE {
            let hit = self.tree.hit_one(id, &self.rays[ray]);
            debug_assert!(hit.is_some(), "what is noted is hit without doubt");
            if let Some((t, hit)) = hit {
                self.nearest[ray].offer(t, hit);
            }
        }
    }

    #[inline(always)]
    fn finish(&mut self) {
        for ray in 0..RAYS {
            self.compute(ray);
        }
    }
}

/// `sure` and `limit` of a ray that needs no more hits.
const DONE: (f32, f32) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
