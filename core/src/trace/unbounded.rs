//! Shapes that no box contains: planes.
//!
//! They are kept in a list that is asked for every ray, beside the accelerator. A box of the largest coordinates, the
//! simpler alternative, would make the pads of all boxes in its tree as large ([`bvh`](super::bvh) pads by the largest
//! coordinate), so that a ray would meet every leaf; placed by a transform it would overflow. Bounds of scenes leave
//! planes out, so that one plane does not move the centre or the camera.

use super::leaf::{Id, offer_shape};
use super::nearest::Nearest;
use super::{Placement, Primitives, World};
use crate::ray::{Hit, Ray};
use crate::shape::Shape;

/// All of them in a world.
pub struct Unbounded(Vec<Entry>);

struct Entry {
    shape: Shape,
    /// None where the shape stands in world coordinates.
    placement: Option<Placement>,
    id: Id,
}

impl Unbounded {
    pub fn new(world: &World) -> Self {
        let fixed = world.fixed.clone().map(|part| (part, None));
        let placed = world.placements.iter().flat_map(|placement| {
            let parts = world.objects[placement.object as usize].clone();
            parts.map(move |part| (part, Some(placement)))
        });
        let mut entries = Vec::new();
        for (part, placement) in fixed.chain(placed) {
            let part = &world.parts[part];
            let Primitives::Shapes(shapes) = &part.primitives else { continue };
            let instance = placement.map_or(part.instance, |placement| placement.instance);
            for (shape, primitive) in shapes.iter().zip(0..).filter(|(shape, _)| shape.is_unbounded()) {
                let id = Id { instance, geometry: part.geometry, primitive };
                entries.push(Entry { shape: shape.clone(), placement: placement.cloned(), id });
            }
        }
        Self(entries)
    }

    #[inline]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Offers what the ray, in the world, hits.
    pub fn offer(&self, ray: &Ray, nearest: &mut Nearest) {
        for entry in &self.0 {
            let local = entry.placement.as_ref().map(|placement| placement.at(ray.moment()).object_ray(ray));
            offer_shape(nearest, ray, local.as_ref(), &entry.shape, entry.id);
        }
    }

    /// Adds everything that the ray, in the world, hits, with t in f64.
    pub fn gather(&self, ray: &Ray, hits: &mut Vec<(f64, Hit)>) {
        for entry in &self.0 {
            let local = entry.placement.as_ref().map_or(*ray, |placement| placement.at(ray.moment()).object_ray(ray));
            hits.extend(entry.shape.intersect_all(&local).map(|hit| (hit.t, entry.id.of_shape(&hit))));
        }
    }
}
