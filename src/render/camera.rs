//! From a point of the film to a ray.

use crate::math::{DMat3, DVec2, DVec3, Vec3};
use crate::ray::Ray;
use crate::scene::Camera;

/// A pinhole camera in front of a film of given size, in world coordinates.
///
/// Directions are computed in f64 and rounded once; every ray starts at the eye, rounded once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pinhole {
    origin: Vec3,
    frame: DMat3,
    /// Pixels.
    size: DVec2,
    /// Half the film at distance 1.
    half: DVec2,
}

impl Pinhole {
    /// `centre` is [`World::centre`](crate::World).
    pub(super) fn new(camera: &Camera, centre: DVec3, width: u32, height: u32) -> Self {
        let size = DVec2::new(f64::from(width), f64::from(height));
        let half_y = libm::tan(camera.fov_y / 2.0);
        let half = DVec2::new(half_y * size.x / size.y, half_y);
        Self { origin: (camera.eye - centre).as_vec3(), frame: camera.frame, size, half }
    }

    /// The ray through a point of the film in pixels, from its top left corner; with a unit direction.
    pub(super) fn ray(&self, film: DVec2) -> Ray {
        let at = (film / self.size * 2.0 - 1.0) * self.half;
        let direction = self.frame * DVec3::new(at.x, -at.y, -1.0);
        Ray::new(self.origin, direction.normalize().as_vec3())
    }
}
