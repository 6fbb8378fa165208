//! Rays through surfaces that are not all there.
//!
//! What is seen through a surface is chosen ray by ray: it is met as often as it covers (Enderton, Sintorn, Shirley and
//! Luebke 2010, *Stochastic transparency*), so that no ray becomes two and every integrator sees the same. Shadow rays
//! lose the share that is covered, and need no chance. Masks are exact in both.
//!
//! A ray that passes goes on from beyond the hit by its range alone: its origin stays, and so does every density that
//! refers to it. What rounds to the same t, a decal in the plane of its wall, is passed with it; a gap keeps them
//! apart. Scenes without such surfaces pay for none of this.

use crate::math::DVec2;
use crate::ray::{Hit, Ray};
use crate::scene::Alpha;
use crate::shade::SurfacePoint;
use crate::shade::coverage::coverage;
use crate::trace::{Batch, Tracer};

use super::Renderer;

impl Renderer<'_> {
    /// The nearest hits of rays that pass through what does not cover; `xi` gives each ray its chance.
    pub(super) fn closest<T: Tracer + ?Sized>(
        &self,
        tracer: &T,
        rays: &mut [Ray],
        hits: &mut [Option<Hit>],
        batch: Batch,
        xi: impl Fn(usize) -> DVec2,
    ) {
        tracer.closest_batch(rays, hits, batch);
        if !self.plan.alpha {
            return;
        }
        // Once a ray has passed with the chance c of a number above c, the rest of the number is as even as all of it
        // was. In f64, where it stays below 1: a number that is rounded to 1 would pass what covers all.
        let mut pending: Vec<(usize, f64)> = (0..rays.len()).map(|i| (i, xi(i).x)).collect();
        loop {
            pending.retain_mut(|(i, chance)| {
                let (ray, hit) = (&mut rays[*i], &hits[*i]);
                let Some((hit, covered)) = hit.as_ref().zip(self.covered(ray, hit.as_ref())) else { return false };
                let covered = f64::from(covered);
                if *chance < covered {
                    return false;
                }
                *chance = (*chance - covered) / (1.0 - covered);
                ray.tmin = hit.t.next_up();
                true
            });
            if pending.is_empty() {
                return;
            }
            let again: Vec<Ray> = pending.iter().map(|(i, _)| rays[*i]).collect();
            let mut found = vec![None; again.len()];
            tracer.closest_batch(&again, &mut found, self.incoherent());
            pending.iter().zip(found).for_each(|((i, _), hit)| hits[*i] = hit);
        }
    }

    /// Of each shadow ray what is left by all that covers its way; their ranges are used up.
    pub(super) fn left_through<T: Tracer + ?Sized>(&self, tracer: &T, shadow_rays: &mut [Ray]) -> Vec<f32> {
        let mut left = vec![1.0f32; shadow_rays.len()];
        let mut pending: Vec<usize> = (0..shadow_rays.len()).collect();
        while !pending.is_empty() {
            let rays: Vec<Ray> = pending.iter().map(|&i| shadow_rays[i]).collect();
            let mut hits = vec![None; rays.len()];
            tracer.closest_batch(&rays, &mut hits, self.incoherent());
            let mut hits = hits.iter();
            pending.retain(|&i| {
                let Some(hit) = hits.next().and_then(Option::as_ref) else { return false };
                let covered = self.covered(&shadow_rays[i], Some(hit)).unwrap_or(1.0);
                left[i] *= 1.0 - covered;
                shadow_rays[i].tmin = hit.t.next_up();
                left[i] > 0.0
            });
        }
        left
    }

    /// How much of the surface is there that was hit; none where it is opaque.
    fn covered(&self, ray: &Ray, hit: Option<&Hit>) -> Option<f32> {
        let hit = hit?;
        let material = self.scene.geometries[hit.geometry as usize].material();
        let material = self.scene.materials.get(material as usize).filter(|m| m.alpha != Alpha::Opaque)?;
        let point = SurfacePoint::new(self.scene, self.world, ray, hit, self.plan.attributes);
        Some(coverage(&point, material, &self.scene.textures))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DVec3, Vec3};
    use crate::render::Settings;
    use crate::scene::{Camera, Geometry, Material, Mesh, Scene};
    use crate::trace::World;
    use crate::trace::bvh::Bvh;

    /// No number that a sampler gives, the largest below 1 neither, lets a ray pass what covers all; and each passes
    /// what covers nothing.
    #[test]
    fn masks_are_exact() {
        let sheet = |z: f32, material| {
            let corners = [[-9.0, -9.0], [9.0, -9.0], [0.0, 9.0]].map(|[x, y]| Vec3::new(x, y, z));
            Geometry::Mesh(Mesh { material, ..Mesh::new(corners.into(), vec![[0, 1, 2]]) })
        };
        let mask = |opacity| Material { alpha: Alpha::Mask { cutoff: 0.5 }, opacity, ..Material::default() };
        let half = Material { alpha: Alpha::Blend, opacity: 0.5, ..Material::default() };
        let geometries = vec![sheet(3.0, 1), sheet(2.0, 2), sheet(1.0, 2), sheet(0.0, 0), sheet(-1.0, 0)];
        let scene = Scene::from_geometries(geometries, vec![mask(1.0), mask(0.0), half]);
        let world = World::new(&scene).unwrap();
        let camera = Camera::framing(&scene.bounds(), 1.0);
        let renderer = Renderer::new(&scene, &world, camera, Settings::default()).unwrap();
        let bvh = Bvh::build(&world);
        for (xi, expected) in [(0.0, 1), (0.25, 1), (0.5, 2), (0.75, 3), (1.0 - 0.5f64.powi(32), 3)] {
            let mut rays = [world.ray(DVec3::new(0.0, 0.0, 5.0), Vec3::NEG_Z)];
            let mut hits = [None];
            renderer.closest(&bvh, &mut rays, &mut hits, Batch::default(), |_| DVec2::splat(xi));
            assert_eq!(hits[0].map(|hit| hit.geometry), Some(expected), "{xi}");
        }
    }
}
