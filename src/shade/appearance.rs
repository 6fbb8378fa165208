//! What a surface is at one place, where textures vary more than its colour.

use std::borrow::Cow;

use super::{SurfacePoint, texture};
use crate::math::Vec4;
use crate::scene::{Material, Texels, Texture};

/// The material at `point`: itself, but for those whose [`Material::physical`] textures multiply there.
pub fn at<'a>(material: &'a Material, point: &SurfacePoint, textures: &[Texture]) -> Cow<'a, Material> {
    let Some(physical) = &material.physical else { return Cow::Borrowed(material) };
    let texture = |index: Option<u32>| index.and_then(|i| textures.get(i as usize));
    let color = |index| texture(index).map_or(Vec4::ONE, |t| texture::sample(t, point.uv_of(t)));
    let numbers = |index| texture(index).map_or(Vec4::ONE, |t| texture::numbers(t, point.uv_of(t)));
    let slots = &physical.textures;
    let metallic_roughness = numbers(slots.metallic_roughness);
    let here = physical.phong(&Texels {
        color: color(material.diffuse_texture).truncate(),
        metalness: metallic_roughness.z,
        roughness: metallic_roughness.y,
        transmission: numbers(slots.transmission).x,
        specular: numbers(slots.specular).w,
        specular_color: color(slots.specular_color).truncate(),
    });
    Cow::Owned(Material {
        // No copy of a text for each hit.
        name: String::new(),
        ambient: here.ambient,
        diffuse: here.diffuse,
        specular: here.specular,
        shininess: here.shininess,
        reflection: here.reflection,
        transmission: here.transmission,
        gloss: here.gloss,
        // It is in the colours now.
        diffuse_texture: None,
        physical: None,
        ..*material
    })
}
