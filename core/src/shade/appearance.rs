//! What a surface is at one place: by the colours of its vertices, and where textures vary more than its colour.

use std::borrow::Cow;

use super::{SurfacePoint, texture};
use crate::math::{Vec3, Vec4};
use crate::scene::{Material, Texels, Texture};

/// The material at `point`: itself, but where vertices have colours, and for those whose [`Material::physical`]
/// textures multiply there.
pub fn at<'a>(material: &'a Material, point: &SurfacePoint, textures: &[Texture]) -> Cow<'a, Material> {
    let tint = point.color.truncate();
    let Some(physical) = &material.physical else {
        if tint == Vec3::ONE {
            return Cow::Borrowed(material);
        }
        let [ambient, diffuse] = [material.ambient, material.diffuse].map(|color| color * tint);
        return Cow::Owned(Material { name: String::new(), ambient, diffuse, ..*material });
    };
    let texture = |index: Option<u32>| index.and_then(|i| textures.get(i as usize));
    let color = |index| texture(index).map_or(Vec4::ONE, |t| texture::sample(t, point.uv_of(t)));
    let numbers = |index| texture(index).map_or(Vec4::ONE, |t| texture::numbers(t, point.uv_of(t)));
    let slots = &physical.textures;
    let metallic_roughness = numbers(slots.metallic_roughness);
    let here = physical.phong(&Texels {
        color: color(material.diffuse_texture).truncate() * tint,
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
