//! The beam of a packet, and its rays one by one: of shadow rays each is asked at the boxes of leaves.
//!
//! A beam is wide for triangles of the size of pixels: it enters leaves that none of its rays enters, and each triangle
//! in them costs as much as three boxes. Closest hits gain less by that than it costs them.

use std::cell::Cell;
use std::marker::PhantomData;

use super::beam::Beam;
use super::octet::Octet;
use super::{Asked, RAYS};
use crate::math::Vec3;
use crate::trace::bvh::node::{Node, WIDTH};
use crate::trace::bvh::query::Query;
use crate::trace::bvh::reject::slab::Slabs;
use crate::trace::bvh::simd::{Array, Mask, Simd, Vector, everywhere};
use crate::trace::bvh::walk::Enter;

/// What walks.
pub(super) struct Party<'a, Q, V: Vector, const N: usize> {
    beam: &'a Beam,
    /// Of each packet, axis by axis.
    slabs: [[Slabs<V>; 3]; N],
    /// How far each ray looks.
    limits: [Cell<[f32; RAYS]>; N],
    /// Whether rays are asked. They are not where one runs against the beam, as its small component counted as none.
    asks: bool,
    query: PhantomData<Q>,
}

impl<'a, Q: Query, V: Vector + Array<RAYS>, const N: usize> Party<'a, Q, V, N> {
    /// `reach` is the tree's; `asks` whether rays are to be asked.
    #[inline(always)]
    pub fn new(beam: &'a Beam, asked: &Asked<'_, N>, reach: Vec3, mut asks: bool) -> Self {
        let zero = V::splat(0.0);
        let nothing = Slabs { reciprocal: zero, near: zero, far: zero, is_negative: zero.less(zero) };
        let mut slabs = [[nothing; 3]; N];
        if asks {
            for ((slabs, packet), lanes) in slabs.iter_mut().zip(asked.packets).zip(asked.lanes) {
                let ([x, y, z], [dx, dy, dz]) = (&packet.origin, &packet.direction);
                let origin = [V::load(x), V::load(y), V::load(z)];
                let direction = [V::load(dx), V::load(dy), V::load(dz)];
                *slabs = Slabs::of_rays(origin, direction, everywhere(reach), zero, zero);
                for (slabs, is_backward) in slabs.iter().zip(beam.is_backward) {
                    let backward = if is_backward { 0xff } else { 0 };
                    asks &= (slabs.is_negative.bits() ^ backward) & lanes == 0;
                }
            }
        }
        Self { beam, slabs, limits: [const { Cell::new([0.0; RAYS]) }; N], asks, query: PhantomData }
    }

    /// Rays look no farther than these want.
    #[inline(always)]
    pub fn shorten(&self, octets: &[Octet<V>; N]) {
        if Q::ANY {
            for (limit, octet) in self.limits.iter().zip(octets) {
                limit.set(octet.limit);
            }
        }
    }

    /// Rays of packet `number` look no farther than these.
    #[inline(always)]
    pub fn limit(&self, number: usize, limits: [f32; RAYS]) {
        self.limits[number].set(limits);
    }

    /// A bit for each ray of each packet that enters the box in that slot; all of them where they cannot be asked.
    #[inline(always)]
    pub fn entering(&self, node: &Node, slot: usize) -> [u32; N] {
        let mut entering = [0xff; N];
        if !self.asks {
            return entering;
        }
        for ((entering, slabs), limit) in entering.iter_mut().zip(&self.slabs).zip(&self.limits) {
            let (mut near, mut far) = (V::splat(0.0), V::load(&limit.get()));
            for (axis, slabs) in slabs.iter().enumerate() {
                let side = usize::from(self.beam.is_backward[axis]);
                let first = V::splat(node.bounds[2 * axis + side][slot]);
                let last = V::splat(node.bounds[2 * axis + 1 - side][slot]);
                near = first.mul_add(slabs.reciprocal, slabs.near).max(near);
                far = last.mul_add(slabs.reciprocal, slabs.far).min(far);
            }
            *entering = near.at_most(far).bits();
        }
        entering
    }
}

impl<Q: Query, V: Vector + Array<RAYS>, const N: usize> Enter for Party<'_, Q, V, N> {
    #[inline(always)]
    fn enter<S: Simd>(&self, node: &Node, limit: f32) -> (<S::V8 as Vector>::Mask, S::V8) {
        self.beam.enter::<S>(node, limit)
    }

    #[inline(always)]
    fn select<S: Simd>(&self, node: &Node, mut children: u32) -> u32 {
        if !self.asks {
            return children;
        }
        let mut open = children;
        while open != 0 {
            let slot = open.trailing_zeros() as usize % WIDTH;
            open &= open - 1;
            if node.child[slot].is_leaf() && self.entering(node, slot) == [0; N] {
                children &= !(1 << slot);
            }
        }
        children
    }
}
