//! What a surface is made of.

use crate::math::Vec3;

/// How the highlight is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Specular {
    /// (r . v)^n with r the mirrored light direction (Phong 1975, *Illumination for computer generated pictures*).
    Phong,
    /// (n . h)^n with h half-way between light and viewer (Blinn 1977, *Models of light reflection for computer
    /// synthesized pictures*).
    #[default]
    BlinnPhong,
}

/// A Phong material. Colours are linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, for messages; may be empty.
    pub name: String,
    /// Share of the scene's ambient light that is sent on.
    pub ambient: Vec3,
    /// Diffuse reflectance, before the texture.
    pub diffuse: Vec3,
    /// Specular reflectance.
    pub specular: Vec3,
    /// Exponent of the highlight, at least 0.
    pub shininess: f32,
    /// Light the surface gives off by itself.
    pub emission: Vec3,
    /// Multiplies `diffuse` (and `ambient`); index into [`Scene::textures`](crate::Scene::textures).
    pub diffuse_texture: Option<u32>,
    /// Which highlight.
    pub model: Specular,
}

impl Default for Material {
    /// Matte light grey.
    fn default() -> Self {
        Self {
            name: String::new(),
            ambient: Vec3::splat(0.8),
            diffuse: Vec3::splat(0.8),
            specular: Vec3::ZERO,
            shininess: 1.0,
            emission: Vec3::ZERO,
            diffuse_texture: None,
            model: Specular::default(),
        }
    }
}
