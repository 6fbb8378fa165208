//! Triangles of one plane, told at a glance.
//!
//! Where surfaces lie on each other, every ray that hits one hits the other at exactly the same t, and the lower id
//! counts. Bounds cannot tell that, and exact arithmetic ([`Distance::order`](crate::shape::distance::Distance::order))
//! takes many times as long as the rest of a ray. But nearly all such surfaces show it by their corners: faces that a
//! file holds twice, turned or not, have the same three; floors, walls and decals on them share a coordinate. What does
//! not show it is left to exact arithmetic.

use super::found::NONE;
use crate::math::{Affine3, Vec3};
use crate::shape::distance::are_coplanar;
use crate::trace::bvh::Bvh;
use crate::trace::bvh::block::{Block, Lane};

/// A triangle and where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::trace::bvh) struct Spot {
    /// The number of a placement, or [`FIXED`](crate::trace::bvh::levels::placements::FIXED).
    pub place: u32,
    /// Block and lane.
    pub id: u32,
}

impl Bvh {
    /// Of a triangle that is noted and another that the ray hits for sure, too, the one that counts, where they are
    /// seen to lie in one plane. Bounds on the t of either hold for both. None if none is noted.
    #[cold]
    #[inline(never)]
    pub(in crate::trace::bvh) fn first_of_plane(&self, noted: Spot, other: Spot) -> Option<Spot> {
        if noted.id == NONE {
            return None;
        }
        let (mut a, mut b) = (None, None);
        let (noted_name, noted_corners, noted_way) = self.named(noted, &mut a);
        let (name, corners, way) = self.named(other, &mut b);
        let is_seen = noted_way == way && are_coplanar(&noted_corners, &corners);
        is_seen.then_some(if name < noted_name { other } else { noted })
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
