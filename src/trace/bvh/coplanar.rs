//! Triangles of one plane, told at a glance.
//!
//! Where surfaces lie on each other, every ray that hits one hits the other at exactly the same t, and the lower id counts. Bounds
//! cannot tell that, and exact arithmetic ([`Distance::order`](crate::shape::distance::Distance::order)) takes a hundred times as long as the rest of a
//! ray. But nearly all such surfaces show it by their corners: faces that a file holds twice, turned or not, have the same three; floors, walls and
//! decals on them share a coordinate. What does not show it is left to exact arithmetic.

use super::Bvh;
use super::block::{Block, Lane};
use crate::math::{Affine3, Vec3};
use crate::shape::distance::are_coplanar;

/// A triangle and where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Spot {
    /// The number of a placement, or [`FIXED`](super::placements::FIXED).
    pub place: u32,
    /// Block and lane.
    pub id: u32,
}

impl Bvh {
    /// Of two triangles that a ray hits for sure the one that counts, where they are seen to lie in one plane.
    #[cold]
    #[inline(never)]
    pub(super) fn first_of_plane(&self, one: Spot, other: Spot) -> Option<Spot> {
        let (mut a, mut b) = (None, None);
        let (one_name, one_corners, one_way) = self.named(one, &mut a);
        let (name, corners, way) = self.named(other, &mut b);
        let is_seen = one_way == way && are_coplanar(&one_corners, &corners);
        is_seen.then_some(if name < one_name { other } else { one })
    }

    /// Instance, geometry and primitive of a triangle, its corners, and the transform that places it.
    #[inline(always)]
    fn named<'a>(
        &'a self,
        Spot { place, id }: Spot,
        scratch: &'a mut Option<Block>,
    ) -> ((u32, u32, u32), [Vec3; 3], Option<&'a Affine3>) {
        let (tree, through) = self.triangles_at(place);
        let triangle = tree.leaves().lane(id, scratch);
        let (part, primitive) = triangle.number();
        let part = tree.part(part);
        let instance = through.as_ref().map_or(part.instance, |through| through.instance);
        let Lane { block, lane } = triangle;
        ((instance, part.geometry, primitive), block.triangle(lane), through.map(|through| through.to_world))
    }
}
