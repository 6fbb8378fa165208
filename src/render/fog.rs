//! Fog along the rays of a picture: from the camera, mirrored, refracted and scattered ones, and those to lights.
//!
//! A ray is in the fog unless it is inside of something that refracts; which of the two is known where it ends, from the side that is seen
//! and from what the ray entered last. Scenes without fog pay one comparison for each of these.

use crate::math::{DVec3, Vec3};
use crate::ray::Ray;
use crate::scene::{Fog, Interface, Material};
use crate::shade::SurfacePoint;
use crate::shade::fog::{Stretch, stretch, transmittance};
use crate::shade::light::Illumination;

use super::Renderer;
use super::wavefront::{OUTSIDE, Path};

impl Renderer<'_> {
    /// The path after the fog on its ray to `point`, and the light that came in on the way.
    #[inline]
    pub(super) fn through_fog(&self, path: Path, ray: &Ray, point: &SurfacePoint) -> (Path, Vec3) {
        let Some(fog) = self.fog_before(&path, point) else { return (path, Vec3::ZERO) };
        let Stretch { left, added } = stretch(fog, point.t as f32 * ray.direction.length());
        (Path { weight: path.weight * left, ..path }, path.weight * added)
    }

    /// The same for a ray that hits nothing.
    #[inline]
    pub(super) fn through_fog_beyond(&self, path: Path) -> (Path, Vec3) {
        let Some(fog) = self.plan.fog.as_ref().filter(|_| path.medium == OUTSIDE) else { return (path, Vec3::ZERO) };
        let Stretch { left, added } = stretch(fog, fog.reach);
        (Path { weight: path.weight * left, ..path }, path.weight * added)
    }

    /// What is left of light that arrives at `point`, which the path has come to, on its way from a light.
    #[inline]
    pub(super) fn fog_to_light(&self, path: &Path, point: &SurfacePoint, arriving: &Illumination) -> Vec3 {
        // Light arrives on the side that the path came from.
        let Some(fog) = self.fog_before(path, point) else { return Vec3::ONE };
        let way = |end: DVec3| (end - point.position).length() as f32;
        transmittance(fog, arriving.end.map_or(fog.reach, way))
    }

    /// The fog that a path came through to `point`; none if there is none, or if it came through something solid.
    fn fog_before(&self, path: &Path, point: &SurfacePoint) -> Option<&Fog> {
        let fog = self.plan.fog.as_ref()?;
        let inside = path.medium != OUTSIDE || !point.front && is_solid(self.material(point));
        (!inside).then_some(fog)
    }
}

/// Whether rays go into it: what keeps the fog out.
pub(super) fn is_solid(material: &Material) -> bool {
    material.sends_on() && material.transmission != Vec3::ZERO && material.interface != Interface::Thin
}
