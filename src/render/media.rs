//! What a path is inside of, and what that leaves of light: absorption by Beer's law, and whether there is fog.
//!
//! A path knows what it has entered and not left, so that behind a bubble in water there is water again. What it
//! crosses of something thin it is not inside of. Where it ends the side that is seen tells as well, which is all there
//! is for a camera inside of glass.

use crate::math::{DVec3, Vec3};
use crate::scene::{Absorption, Interface, Material};
use crate::shade::light::{LightSample, LightSource};
use crate::shade::{SurfacePoint, fog};

use super::Renderer;
use super::wavefront::Path;

/// How many bodies a path is known to be inside of; of more, those that it entered first are forgotten.
const MAX: usize = 4;

/// The materials of the bodies that a path has entered and not left, the last one first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Media([u32; MAX]);

/// No body.
const NONE: u32 = u32::MAX;

impl Media {
    /// Inside of nothing.
    pub const OUTSIDE: Self = Self([NONE; MAX]);

    #[inline]
    pub fn is_outside(&self) -> bool {
        self.0[0] == NONE
    }

    /// That of the body that was entered last.
    #[inline]
    fn innermost(&self) -> u32 {
        self.0[0]
    }

    fn enter(self, material: u32) -> Self {
        let [a, b, c, _] = self.0;
        Self([material, a, b, c])
    }

    /// Leaves the one of this material that was entered last, wherever it stands, for bodies may overlap; else, since a
    /// body may have several materials, the one that was entered last.
    fn leave(mut self, material: u32) -> Self {
        let at = self.0.iter().position(|&known| known == material).unwrap_or(0);
        self.0.copy_within(at + 1.., at);
        self.0[MAX - 1] = NONE;
        self
    }
}

impl Renderer<'_> {
    /// What a ray is inside of that goes on through the surface at `point`, to which a path has come.
    pub(super) fn media_behind(&self, path: &Path, point: &SurfacePoint) -> Media {
        match (is_solid(self.material(point)), point.front) {
            (false, _) => path.media,
            (true, true) => path.media.enter(point.material),
            (true, false) => path.media.leave(point.material),
        }
    }

    /// What is left of the light of a ray that ends at `point`, on its way there.
    pub(super) fn transmittance(&self, path: &Path, direction: Vec3, point: &SurfacePoint) -> Vec3 {
        match self.surroundings(path, point, true) {
            Surroundings::Inside(Some(medium)) if self.plan.depth > 0 => {
                medium.transmittance(path.way(direction, point))
            }
            _ => Vec3::ONE,
        }
    }

    /// What fog and absorption leave of light that arrives at `point`, which the path has come to, from a light; none
    /// for all of it.
    ///
    /// Of what is absorbed only lights know that cast shadows: the surface of the body that they are outside of hides
    /// them. What comes from infinitely far is absorbed by nothing, as where rays hit nothing.
    pub(super) fn light_transmittance(
        &self,
        path: &Path,
        point: &SurfacePoint,
        source: &LightSource,
        arriving: &LightSample,
    ) -> Option<Vec3> {
        let way = |end: DVec3| (end - point.position).length() as f32;
        // Through what is rough it arrives from behind.
        match self.surroundings(path, point, point.is_above(arriving.to_light)) {
            Surroundings::Outside => {
                let fog = self.plan.fog.as_ref()?;
                Some(fog::transmittance(fog, arriving.end.map_or(fog.reach, way)))
            }
            Surroundings::Inside(Some(medium)) if self.plan.depth > 0 && source.casts_shadows => {
                Some(medium.transmittance(way(arriving.end?)))
            }
            Surroundings::Inside(_) => None,
        }
    }

    /// What is at `point` on the side that a path came from, or on the other one.
    pub(super) fn surroundings(&self, path: &Path, point: &SurfacePoint, came_from: bool) -> Surroundings {
        let media = if came_from {
            let material = self.material(point);
            if !point.front && is_solid(material) {
                return Surroundings::Inside(material.absorption);
            }
            path.media
        } else {
            self.media_behind(path, point)
        };
        if media.is_outside() {
            return Surroundings::Outside;
        }
        let material = self.scene.materials.get(media.innermost() as usize);
        Surroundings::Inside(material.and_then(|material| material.absorption))
    }
}

impl Path {
    /// How long the way of the path's ray is from the surface that it left to `point`.
    pub(super) fn way(&self, direction: Vec3, point: &SurfacePoint) -> f32 {
        (point.t as f32 * direction.length() + self.spawn_offset).max(0.0)
    }
}

/// What is around a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Surroundings {
    /// Fog, where there is any.
    Outside,
    /// Something solid, which may absorb light.
    Inside(Option<Absorption>),
}

/// Whether rays go into it: what keeps the fog out.
fn is_solid(material: &Material) -> bool {
    material.sends_on() && material.transmission != Vec3::ZERO && material.interface != Interface::Thin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_entered_is_left_in_any_order() {
        let [water, glass] = [7, 3];
        let within = Media::OUTSIDE.enter(water).enter(glass);
        assert_eq!((within.innermost(), within.leave(glass)), (glass, Media::OUTSIDE.enter(water)));
        assert_eq!(within.leave(water), Media::OUTSIDE.enter(glass), "they overlap");
        assert_eq!(within.leave(5), Media::OUTSIDE.enter(water), "the same body's other side");
        assert!(Media::OUTSIDE.leave(5).is_outside(), "the camera is inside");
        assert!(within.leave(glass).leave(water).is_outside());
        let twice = within.enter(glass);
        assert_eq!(twice.leave(glass), within, "one body of two that are alike");
        let many = (0..9).fold(Media::OUTSIDE, Media::enter);
        assert_eq!(many.0, [8, 7, 6, 5]);
        assert!([8, 7, 6, 5].into_iter().fold(many, Media::leave).is_outside());
    }
}
