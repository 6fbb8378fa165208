//! Materials, textures, cameras and lights.

use serde::Deserialize;

use super::Extensions;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in crate::io::gltf) struct Material {
    #[serde(default)]
    pub(in crate::io::gltf) name: String,
    #[serde(default)]
    pub(in crate::io::gltf) pbr_metallic_roughness: MetallicRoughness,
    #[serde(default)]
    pub(in crate::io::gltf) emissive_factor: [f32; 3],
    pub(in crate::io::gltf) emissive_texture: Option<TextureInfo>,
    pub(in crate::io::gltf) normal_texture: Option<TextureInfo>,
    pub(in crate::io::gltf) alpha_mode: Option<String>,
    pub(in crate::io::gltf) alpha_cutoff: Option<f32>,
    #[serde(default, deserialize_with = "super::plain_members")]
    pub(in crate::io::gltf) extensions: Extensions,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in crate::io::gltf) struct MetallicRoughness {
    pub(in crate::io::gltf) base_color_factor: [f32; 4],
    pub(in crate::io::gltf) base_color_texture: Option<TextureInfo>,
    pub(in crate::io::gltf) metallic_factor: f32,
    pub(in crate::io::gltf) roughness_factor: f32,
    pub(in crate::io::gltf) metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for MetallicRoughness {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in crate::io::gltf) struct TextureInfo {
    pub(in crate::io::gltf) index: usize,
    #[serde(default)]
    pub(in crate::io::gltf) tex_coord: u32,
    /// Of a normal texture.
    pub(in crate::io::gltf) scale: Option<f32>,
    #[serde(default, deserialize_with = "super::plain_members")]
    pub(in crate::io::gltf) extensions: Extensions,
}

#[derive(Deserialize)]
pub(in crate::io::gltf) struct Texture {
    pub(in crate::io::gltf) sampler: Option<usize>,
    source: Option<usize>,
    #[serde(default)]
    extensions: TextureExtensions,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct TextureExtensions {
    #[serde(rename = "EXT_texture_webp")]
    webp: Option<WebpSource>,
}

#[derive(Deserialize)]
struct WebpSource {
    source: usize,
}

impl Texture {
    /// The image it shows, and where in the texture that is said; none where it is of a kind that is not known. A WebP
    /// picture comes before another, which is for those who cannot read it.
    pub(in crate::io::gltf) fn image(&self) -> Option<(usize, &'static str)> {
        let webp = self.extensions.webp.as_ref().map(|webp| (webp.source, "extensions/EXT_texture_webp/source"));
        webp.or(self.source.map(|source| (source, "source")))
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in crate::io::gltf) struct Image {
    #[serde(default)]
    pub(in crate::io::gltf) name: String,
    pub(in crate::io::gltf) uri: Option<String>,
    pub(in crate::io::gltf) buffer_view: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in crate::io::gltf) struct Sampler {
    pub(in crate::io::gltf) mag_filter: Option<u32>,
    pub(in crate::io::gltf) wrap_s: Option<u32>,
    pub(in crate::io::gltf) wrap_t: Option<u32>,
}

#[derive(Deserialize)]
pub(in crate::io::gltf) struct Camera {
    #[serde(default)]
    pub(in crate::io::gltf) name: String,
    pub(in crate::io::gltf) perspective: Option<Perspective>,
    pub(in crate::io::gltf) orthographic: Option<Orthographic>,
}

#[derive(Deserialize)]
pub(in crate::io::gltf) struct Orthographic {
    /// Half the height of the view.
    pub(in crate::io::gltf) ymag: f64,
}

#[derive(Deserialize)]
pub(in crate::io::gltf) struct Perspective {
    pub(in crate::io::gltf) yfov: f64,
}

/// `KHR_lights_punctual` at the root.
#[derive(Deserialize)]
pub(in crate::io::gltf) struct Lights {
    pub(in crate::io::gltf) lights: Vec<Light>,
}

#[derive(Deserialize)]
pub(in crate::io::gltf) struct Light {
    #[serde(rename = "type")]
    pub(in crate::io::gltf) kind: String,
    #[serde(default = "white")]
    pub(in crate::io::gltf) color: [f32; 3],
    #[serde(default = "one")]
    pub(in crate::io::gltf) intensity: f32,
    pub(in crate::io::gltf) range: Option<f64>,
    #[serde(default)]
    pub(in crate::io::gltf) spot: Spot,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in crate::io::gltf) struct Spot {
    pub(in crate::io::gltf) inner_cone_angle: f32,
    pub(in crate::io::gltf) outer_cone_angle: f32,
}

impl Default for Spot {
    fn default() -> Self {
        Self { inner_cone_angle: 0.0, outer_cone_angle: std::f32::consts::FRAC_PI_4 }
    }
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

fn one() -> f32 {
    1.0
}
