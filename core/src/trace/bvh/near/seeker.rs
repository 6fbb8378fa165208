//! A point of a flight, and what is nearest to it so far.

use super::bounds::enter;
use super::discs::Discs;
use super::measure::{Corners, Measured};
use super::point_stack::PointStack;
use super::{NearestTriangle, Sought};
use crate::math::{DVec3, UNIT_ROUNDOFF, Vec3};
use crate::shape::closest::TrianglePoint;
use crate::trace::bvh::node::{Child, Node};
use crate::trace::bvh::simd::{Doubles, Simd};

/// A point on its way. What steps need is in one cache line, but for what waits.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub(super) struct Seeker {
    /// In the coordinates of the tree.
    pub local: Vec3,
    /// As [`Sought::error`].
    pub error: f32,
    /// By how much a box is nearer than it seems, along each axis.
    pad: f32,
    /// No triangle is wanted beyond this distance; rounded up.
    pub limit: f32,
    /// As [`Sought::point`].
    point: DVec3,
    /// The squared distance of the nearest triangle so far, in the tree; infinite before there is one;
    square: f64,
    /// its geometry and primitive,
    id: (u32, u32),
    /// and its corners.
    corners: Corners,
    pub waiting: PointStack,
}

impl Seeker {
    pub const IDLE: Self = Self {
        local: Vec3::ZERO,
        error: 0.0,
        pad: 0.0,
        limit: 0.0,
        point: DVec3::ZERO,
        square: f64::INFINITY,
        id: (u32::MAX, u32::MAX),
        corners: [[0.0; 4]; 3],
        waiting: PointStack::EMPTY,
    };

    /// Sets out in a tree with this scale; with the triangle that was nearest to the point before, for it may be near
    /// this one too.
    #[inline(always)]
    pub fn start<S: Simd>(&mut self, Sought { point, local, error }: Sought, scale: f64) {
        // What differences round relative to a box is in the box ([`crate::trace::bvh::node::widened`]).
        let away = local.abs().max_element();
        (self.local, self.error, self.pad) = (local, error, error + 4.0 * UNIT_ROUNDOFF * away);
        self.point = point;
        if self.square < f64::INFINITY {
            self.square = self.measured::<S>(scale).square();
        }
        self.limit = self.rounded_limit();
        self.waiting.clear();
    }

    /// The nearest triangle so far.
    #[inline(always)]
    fn measured<S: Simd>(&self, scale: f64) -> Measured<S::D4> {
        let [x, y, z] = &self.corners;
        Measured::new(self.point, [S::D4::load(x), S::D4::load(y), S::D4::load(z)], scale)
    }

    /// The same as it is told, with its point if `wants_point`.
    #[inline(always)]
    pub fn nearest<S: Simd>(&self, scale: f64, wants_point: bool) -> Option<NearestTriangle> {
        if self.square == f64::INFINITY {
            return None;
        }
        let ((geometry, primitive), inverse) = (self.id, scale.recip());
        let distance_squared = self.square * inverse * inverse;
        let on = wants_point.then(
            #[inline(always)]
            || {
                let TrianglePoint { offset, u, v, .. } = self.measured::<S>(scale).point();
                TrianglePoint { offset: offset * inverse, distance_squared, u, v }
            },
        );
        Some(NearestTriangle { distance_squared, on, geometry, primitive })
    }

    /// Takes a triangle if it is nearer. Whether it is.
    #[inline(always)]
    pub fn take<D: Doubles>(&mut self, corners: [D; 3], id: (u32, u32), scale: f64) -> bool {
        let square = Measured::new(self.point, corners, scale).square();
        let is_nearer = square < self.square || square == self.square && id < self.id;
        if is_nearer {
            (self.square, self.id) = (square, id);
            self.corners = [corners[0].to_array(), corners[1].to_array(), corners[2].to_array()];
        }
        is_nearer
    }

    /// How far the nearest triangle is in the tree, and more for the rounding.
    #[inline(always)]
    pub fn rounded_limit(&self) -> f32 {
        self.square.sqrt() as f32 * (1.0 + 4.0 * UNIT_ROUNDOFF) + 2.0 * self.error + f32::MIN_POSITIVE
    }

    /// One node. What it reaches next.
    #[inline(always)]
    pub fn enter<S: Simd>(&mut self, discs: &Discs, parent: Child, node: &Node) -> Child {
        let (mask, near) = enter::<S>(discs, parent, node, self.local, self.pad, self.limit * self.limit);
        self.waiting.enter::<S>(near, mask, &node.child)
    }
}
