//! What a scene file says about the picture that is to be made of it.

use super::search::AcceleratorRequest;
use crate::image::{Curve, Response};

/// Most pixels a picture may have along one side.
pub const MAX_SIDE: u32 = 65_536;
/// Most samples a pixel that can be asked for.
pub const MAX_SPP: u32 = 65_536;
/// How often a ray may be sent on at most. Rays that were sent on together are followed by a call of their own, so that
/// the stack has to have room for as many.
pub const MAX_DEPTH: u32 = 1000;

/// How far light is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// From lights to what the camera sees: no ray is sent on. Mirrors and glass show the environment, if there is one.
    RayCast,
    /// As ray casting, with mirrored and refracted rays followed.
    Whitted,
    /// All light, however often it was scattered.
    Path,
}

impl Integrator {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::RayCast, Self::Whitted, Self::Path];

    /// As flags and scenes have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::RayCast => "ray-cast",
            Self::Whitted => "whitted",
            Self::Path => "path",
        }
    }
}

impl std::fmt::Display for Integrator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Settings of a render that a scene file may carry. They stand where the caller says nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    /// Width and height in pixels, each 1 to [`MAX_SIDE`].
    pub size: Option<[u32; 2]>,
    /// Samples a pixel, 1 to [`MAX_SPP`].
    pub spp: Option<u32>,
    /// Chooses among equally good sample patterns.
    pub seed: Option<u64>,
    /// How far light is followed; none for the cheapest way that shows all the scene contains.
    pub integrator: Option<Integrator>,
    /// How often a ray may be sent on, up to [`MAX_DEPTH`].
    pub max_depth: Option<u32>,
    /// Name of the picture's file, as it stands in the scene file.
    pub output: Option<String>,
    /// Stops that pictures of codes are exposed by; see [`Response`](crate::image::Response), as for the two that
    /// follow.
    pub exposure: Option<f32>,
    /// Kelvin of the light that becomes white.
    pub white_balance: Option<f32>,
    /// From light to codes.
    pub response: Option<Curve>,
    /// How the scene is searched.
    pub search: AcceleratorRequest,
}

impl Request {
    /// What a camera makes of radiance, with what is usual where the file says nothing.
    pub fn camera_response(&self) -> Response {
        Response {
            exposure: self.exposure.unwrap_or(0.0),
            white_balance: self.white_balance,
            curve: self.response.unwrap_or_default(),
        }
    }
}
