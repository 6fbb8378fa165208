//! Fog that fills all space.

use crate::math::Vec3;

/// Fog that is the same everywhere but inside of what refracts, linear RGB. Light is lost on its way by Beer's law, and
/// light that is scattered towards the viewer comes in instead, as much from every place and direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fog {
    /// 1/m, at least 0: of a ray's light exp(-absorption d) is left after d metres.
    pub absorption: Vec3,
    /// Radiance that a very thick layer shows; black only absorbs.
    pub color: Vec3,
    /// Metres of fog before what is infinitely far away: the environment, the background and directional lights.
    /// Infinite where the fog has no end, and nothing of them gets through.
    pub reach: f32,
}

impl Fog {
    /// Moves along with a scene whose lengths are scaled.
    pub(super) fn scale(&mut self, scale: f32) {
        self.absorption /= scale;
        self.reach *= scale;
    }
}
