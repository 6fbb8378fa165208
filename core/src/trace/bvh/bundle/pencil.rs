//! What the rays of a bundle have in common: a point ([`Central`]), or a direction
//! ([`Parallel`](super::parallel::Parallel)).
//!
//! Either way a ray is two numbers, where it crosses a plane across the bundle's axis, and everything that a bundle
//! asks is linear in them. A point (x, y, z) on the bundle's axes, z along them and relative to the bundle's origin, is
//! on the ray (p, q)
//!
//! | | with a common point | with a common direction (k, l, 1) |
//! | --- | --- | --- |
//! | where | x / z = p, y / z = q | x - k z = p, y - l z = q |
//! | as the cross-section of z = 1 | (x, y, z) | (x - k z, y - l z, 1) |
//! | a plane x = c is met at t' | c / p: a product with 1 / p | c / k - p / k: a difference from p / k |
//! | a triangle's t' | height / (normal . (p, q, 1)) | depth . (p, q, 1) |

use super::edges::Edges;
use super::footprint::Footprints;
use super::rays::Bundle;
use super::slab::BundleSlab;
use crate::math::Vec3;
use crate::trace::bvh::block::{Block, LANES};
use crate::trace::bvh::simd::{Simd, Vector};

/// The geometry of a kind of bundle.
pub(super) trait Pencil {
    /// Whether it is a direction that rays have in common, and each has an origin of its own.
    const IS_PARALLEL: bool;
    /// Made ready for slab tests in a tree that reaches that far. None where numbers are too large.
    fn slab(bundle: &Bundle, reach: Vec3) -> Option<BundleSlab>;
    /// The t' at which a ray meets a plane, each as it is made ready for the other: in [`Boxes`](super::slab::Boxes)
    /// and [`Bundle::slabs`].
    fn meet<V: Vector>(plane: V, ray: V) -> V;
    /// The edges of a block's triangles, and a bit for every one that some ray of the bundle may hit before `most`;
    /// none if there is none.
    fn edges<S: Simd>(block: &Block, bundle: &Bundle, most: f32) -> Option<(u32, Edges)>;
    /// Where the bundle sees triangles.
    fn footprints<S: Simd>(corners: &[[[f32; LANES]; 3]; 3], bundle: &Bundle) -> Footprints;
    /// The least and the most that t' of a triangle may be, by what its fourth normal is along rays.
    fn depths<V: Vector>(edges: &Edges, lane: usize, along: V) -> [V; 2];
}

/// Rays through one point.
pub(super) struct Central;

impl Pencil for Central {
    const IS_PARALLEL: bool = false;

    #[inline(always)]
    fn slab(bundle: &Bundle, reach: Vec3) -> Option<BundleSlab> {
        bundle.slab(reach)
    }

    #[inline(always)]
    fn meet<V: Vector>(plane: V, ray: V) -> V {
        plane.mul(ray)
    }

    #[inline(always)]
    fn edges<S: Simd>(block: &Block, bundle: &Bundle, most: f32) -> Option<(u32, Edges)> {
        Edges::new::<S>(block, bundle, most)
    }

    #[inline(always)]
    fn footprints<S: Simd>(corners: &[[[f32; LANES]; 3]; 3], bundle: &Bundle) -> Footprints {
        Footprints::new::<S>(corners, bundle)
    }

    #[inline(always)]
    fn depths<V: Vector>(edges: &Edges, lane: usize, along: V) -> [V; 2] {
        let inverse = V::splat(1.0).div(along);
        [V::splat(edges.near_height[lane]).mul(inverse), V::splat(edges.far_height[lane]).mul(inverse)]
    }
}
