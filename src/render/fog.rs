//! Fog along the rays of a picture: from the camera, mirrored, refracted and scattered ones, and those to lights.
//!
//! A ray is in the fog unless it is inside of something that refracts; which of the two is known where it ends, from the side that is seen
//! and from what the ray entered last. Scenes without fog pay one comparison for each of these.

use crate::math::{DVec3, Vec3};
use crate::ray::Ray;
use crate::shade::SurfacePoint;
use crate::shade::fog::{Stretch, stretch, transmittance};
use crate::shade::light::Illumination;

use super::Renderer;
use super::wavefront::Path;

impl Renderer<'_> {
    /// What the fog does on a ray to `point`; none where there is none.
    #[inline]
    pub(super) fn fog_on(&self, path: &Path, ray: &Ray, point: &SurfacePoint) -> Option<Stretch> {
        let fog = self.plan.fog.as_ref()?;
        self.came_from_outside(path, point).then(|| stretch(fog, point.t as f32 * ray.direction.length()))
    }

    /// The same for a ray that hits nothing.
    #[inline]
    pub(super) fn fog_beyond(&self, path: &Path) -> Option<Stretch> {
        let fog = self.plan.fog.as_ref()?;
        path.media.is_outside().then(|| stretch(fog, fog.reach))
    }

    /// What fog and absorption leave of light that arrives at `point`, which the path has come to, on its way from a light; none for all of it.
    #[inline]
    pub(super) fn left_of_light(&self, path: &Path, point: &SurfacePoint, arriving: &Illumination) -> Option<Vec3> {
        // Where there is fog nothing absorbs, and the other way round.
        self.fog_to_light(path, point, arriving).or_else(|| self.transmittance_to_light(path, point, arriving))
    }

    fn fog_to_light(&self, path: &Path, point: &SurfacePoint, arriving: &Illumination) -> Option<Vec3> {
        let fog = self.plan.fog.as_ref()?;
        let way = |end: DVec3| (end - point.position).length() as f32;
        // Light arrives on the side that the path came from.
        self.came_from_outside(path, point).then(|| transmittance(fog, arriving.end.map_or(fog.reach, way)))
    }
}

impl Path {
    /// Goes on behind the fog; what came in on the way is the light that is returned.
    #[inline]
    pub(super) fn pass(&mut self, fog: Option<Stretch>) -> Vec3 {
        let Some(Stretch { left, added }) = fog else { return Vec3::ZERO };
        let added = self.weight * added;
        self.weight *= left;
        added
    }
}
