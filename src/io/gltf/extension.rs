//! What extensions say about a material: `KHR_materials_unlit`, `_emissive_strength`, `_ior`, `_specular`,
//! `_transmission`, `_volume` and `_pbrSpecularGlossiness`.
//!
//! The thickness of a volume only says whether there is one: how far light has to go through it rays find out, so its
//! texture is not read.

use serde::Deserialize;
use serde_json::Value;

use super::schema::{Extensions, TextureInfo};
use crate::io::Placeless;
use crate::math::Vec3;
use crate::scene::Absorption;

/// The extensions of one material, with the specification's defaults.
pub(super) struct MaterialExtensions {
    pub(super) unlit: bool,
    /// Multiplies the emission.
    pub(super) emissive_strength: f32,
    /// None where the file does not say; 0 stands for infinity.
    pub(super) ior: Option<f32>,
    pub(super) specular: Specular,
    pub(super) transmission: Transmission,
    /// Whether there is an inside: without, the surface is a pane without thickness.
    pub(super) is_volume: bool,
    pub(super) absorption: Option<Absorption>,
    /// In place of metallic-roughness.
    pub(super) specular_glossiness: Option<SpecularGlossiness>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct EmissiveStrength {
    emissive_strength: f32,
}

/// Share of what is not mirrored that goes through.
#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Transmission {
    pub(super) transmission_factor: f32,
    pub(super) transmission_texture: Option<TextureInfo>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Volume {
    thickness_factor: f32,
    attenuation_distance: f32,
    attenuation_color: [f32; 3],
}

/// What multiplies the mirrored light of what is not metal.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Specular {
    pub(super) specular_factor: f32,
    pub(super) specular_texture: Option<TextureInfo>,
    pub(super) specular_color_factor: [f32; 3],
    pub(super) specular_color_texture: Option<TextureInfo>,
}

/// A whole material in other words.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct SpecularGlossiness {
    pub(super) diffuse_factor: [f32; 4],
    pub(super) diffuse_texture: Option<TextureInfo>,
    pub(super) specular_factor: [f32; 3],
    pub(super) glossiness_factor: f32,
    pub(super) specular_glossiness_texture: Option<TextureInfo>,
}

impl Default for EmissiveStrength {
    fn default() -> Self {
        Self { emissive_strength: 1.0 }
    }
}

impl Default for Volume {
    fn default() -> Self {
        Self { thickness_factor: 0.0, attenuation_distance: f32::INFINITY, attenuation_color: [1.0; 3] }
    }
}

impl Default for Specular {
    fn default() -> Self {
        Self {
            specular_factor: 1.0,
            specular_texture: None,
            specular_color_factor: [1.0; 3],
            specular_color_texture: None,
        }
    }
}

impl Default for SpecularGlossiness {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

/// Reads the extensions of a material.
///
/// # Errors
/// The extension's name, and what is wrong with it.
pub(super) fn read(extensions: &Extensions) -> Placeless<MaterialExtensions> {
    const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";
    let strength: EmissiveStrength = one(extensions, "KHR_materials_emissive_strength")?;
    let specular: Specular = one(extensions, "KHR_materials_specular")?;
    let transmission: Transmission = one(extensions, "KHR_materials_transmission")?;
    let volume: Volume = one(extensions, "KHR_materials_volume")?;
    let ior = match extensions.get("KHR_materials_ior") {
        None => None,
        Some(value) => {
            let ior = value.get("ior").map_or(Some(1.5), Value::as_f64).map(|ior| ior as f32);
            let possible = ior.filter(|ior| ior.is_finite() && (*ior == 0.0 || *ior >= 1.0));
            Some(possible.ok_or("KHR_materials_ior: the ior has to be a number from 1 up, or 0")?)
        }
    };
    let share = |x: f32| (0.0..=1.0).contains(&x);
    let color = |x: f32| x >= 0.0 && x.is_finite();
    if !share(transmission.transmission_factor) {
        return Err("KHR_materials_transmission: the transmissionFactor has to be from 0 to 1".into());
    }
    if !(share(specular.specular_factor) && specular.specular_color_factor.into_iter().all(color)) {
        return Err("KHR_materials_specular: the factor has to be from 0 to 1, the colour from 0 up".into());
    }
    let specular_glossiness = match extensions.contains_key(SPECULAR_GLOSSINESS) {
        true => Some(one::<SpecularGlossiness>(extensions, SPECULAR_GLOSSINESS)?),
        false => None,
    };
    if let Some(SpecularGlossiness { diffuse_factor, specular_factor, glossiness_factor, .. }) = &specular_glossiness
        && !(diffuse_factor.iter().chain(specular_factor).all(|&x| color(x)) && share(*glossiness_factor))
    {
        return Err(format!("{SPECULAR_GLOSSINESS}: colours have to be from 0 up, the glossiness from 0 to 1"));
    }
    let Volume { thickness_factor, attenuation_distance, attenuation_color } = volume;
    if !(thickness_factor >= 0.0 && attenuation_distance > 0.0 && attenuation_color.into_iter().all(share)) {
        let rule = "the thickness has to be from 0 up, the distance above 0, the colour from 0 to 1";
        return Err(format!("KHR_materials_volume: {rule}"));
    }
    let is_volume = thickness_factor > 0.0;
    let color = Vec3::from(attenuation_color);
    let absorbs = is_volume && attenuation_distance.is_finite() && color != Vec3::ONE;
    Ok(MaterialExtensions {
        unlit: extensions.contains_key("KHR_materials_unlit"),
        emissive_strength: strength.emissive_strength,
        ior,
        specular,
        transmission,
        is_volume,
        absorption: absorbs.then_some(Absorption { color, distance: attenuation_distance }),
        specular_glossiness,
    })
}

fn one<T: Default + for<'a> Deserialize<'a>>(extensions: &Extensions, name: &str) -> Placeless<T> {
    let Some(value) = extensions.get(name) else { return Ok(T::default()) };
    T::deserialize(value).map_err(|error| format!("{name}: {error}"))
}
