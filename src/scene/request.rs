//! What a scene file says about the picture that is to be made of it.

use super::search::Search;

/// Settings of a render that a scene file may carry. They stand where the caller says nothing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Request {
    /// Width and height in pixels.
    pub size: Option<[u32; 2]>,
    /// Samples a pixel.
    pub spp: Option<u32>,
    /// Chooses among equally good sample patterns.
    pub seed: Option<u64>,
    /// How often a ray may be mirrored or refracted.
    pub max_depth: Option<u32>,
    /// Name of the picture's file, as it stands in the scene file.
    pub output: Option<String>,
    /// How the scene is searched.
    pub search: Search,
}
