//! How much of a surface is there: alpha, as glTF has it (Khronos Group 2021, *glTF 2.0 specification*, 3.9.4).

use super::{SurfacePoint, texture};
use crate::scene::{Alpha, Material, Texture};

/// The share of the light through `point` that meets the surface, from 0 to 1.
pub fn coverage(point: &SurfacePoint, material: &Material, textures: &[Texture]) -> f32 {
    let alpha = || {
        let texture = material.diffuse_texture.and_then(|i| textures.get(i as usize));
        material.opacity * point.color.w * texture.map_or(1.0, |t| texture::sample(t, point.uv_of(t)).w)
    };
    match material.alpha {
        Alpha::Opaque => 1.0,
        Alpha::Mask { cutoff } => f32::from(u8::from(alpha() >= cutoff)),
        Alpha::Blend => alpha().clamp(0.0, 1.0),
    }
}
