//! Fog along the rays of a picture: from the camera, mirrored, refracted and scattered ones. On the way to lights
//! [`media`](super::media) knows of it.
//!
//! A ray is in the fog unless it is inside of something that refracts; which of the two is known where it ends, from
//! the side that is seen and from what the ray entered last. Scenes without fog pay one comparison for each of these.

use crate::math::Vec3;
use crate::ray::Ray;
use crate::shade::SurfacePoint;
use crate::shade::fog::{FogSegment, segment};

use super::Renderer;
use super::media::Surroundings;
use super::wavefront::Path;

impl Renderer<'_> {
    /// What the fog does on a ray to `point`; none where there is none.
    #[inline]
    pub(super) fn fog_on(&self, path: &Path, ray: &Ray, point: &SurfacePoint) -> Option<FogSegment> {
        let fog = self.plan.fog.as_ref()?;
        (self.surroundings(path, point, true) == Surroundings::Outside)
            .then(|| segment(fog, path.way(ray.direction, point)))
    }

    /// The same for a ray that hits nothing.
    #[inline]
    pub(super) fn fog_beyond(&self, path: &Path) -> Option<FogSegment> {
        let fog = self.plan.fog.as_ref()?;
        path.media.is_outside().then(|| segment(fog, fog.reach))
    }
}

impl Path {
    /// Goes on behind the fog; what came in on the way is the light that is returned.
    #[inline]
    pub(super) fn pass(&mut self, fog: Option<FogSegment>) -> Vec3 {
        let Some(FogSegment { left, added }) = fog else { return Vec3::ZERO };
        let added = self.throughput * added;
        self.throughput *= left;
        added
    }
}
