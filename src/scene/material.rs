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

/// A Phong material that may also be a mirror, or let light through (Whitted 1980). Colours are linear RGB.
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
    /// Share of what the mirrored ray sees; no ray is traced where it is zero.
    pub reflection: Vec3,
    /// Share of what the refracted ray sees; no ray is traced where it is zero.
    pub transmission: Vec3,
    /// Index of refraction of what is behind the surface, relative to what is in front of it; above 0.
    pub ior: f32,
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
            reflection: Vec3::ZERO,
            transmission: Vec3::ZERO,
            ior: 1.5,
            emission: Vec3::ZERO,
            diffuse_texture: None,
            model: Specular::default(),
        }
    }
}
