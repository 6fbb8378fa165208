//! Animations and skins.

use serde::Deserialize;

#[derive(Deserialize)]
pub(in crate::io::gltf) struct Animation {
    #[serde(default)]
    pub(in crate::io::gltf) name: String,
    pub(in crate::io::gltf) channels: Vec<Channel>,
    pub(in crate::io::gltf) samplers: Vec<AnimationSampler>,
}

#[derive(Deserialize)]
pub(in crate::io::gltf) struct Channel {
    pub(in crate::io::gltf) sampler: usize,
    pub(in crate::io::gltf) target: Target,
}

#[derive(Deserialize)]
pub(in crate::io::gltf) struct Target {
    /// None where an extension says what is animated.
    pub(in crate::io::gltf) node: Option<usize>,
    pub(in crate::io::gltf) path: String,
}

#[derive(Deserialize)]
pub(in crate::io::gltf) struct AnimationSampler {
    /// Accessor of the times, seconds.
    pub(in crate::io::gltf) input: usize,
    /// Accessor of the values.
    pub(in crate::io::gltf) output: usize,
    pub(in crate::io::gltf) interpolation: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in crate::io::gltf) struct Skin {
    /// Accessor of matrices, one a joint.
    pub(in crate::io::gltf) inverse_bind_matrices: Option<usize>,
    /// Nodes.
    pub(in crate::io::gltf) joints: Vec<usize>,
}
