//! Materials.
//!
//! What becomes of the numbers is [`Physical`]'s. A material has Phong's values for the mean of its textures; where
//! more than its colour varies, it keeps what they follow from as well, so that they are found again at each hit.
//!
//! Occlusion textures are not read: what they hold, how much of its surroundings a point sees, rays find out.

use std::collections::HashMap;

use super::document::Document;
use super::extension::{self, MaterialExtensions, SpecularGlossiness as SpecularGlossinessSource};
use super::schema::{self, MetallicRoughness as Source};
use super::textures::{Sets, Textures};
use crate::error::{Result, Warning};
use crate::math::Vec3;
use crate::scene::{
    Alpha, Interface, Material, MetallicRoughness, Physical, PhysicalTextures, Scene, SpecularGlossiness, Texels,
    Workflow,
};

/// The materials of a document, converted when a primitive first uses them.
pub(super) struct Materials<'a> {
    document: &'a Document<'a>,
    /// By glTF's index, of which None is the default material, and whether the vertices have colours.
    known: HashMap<(Option<usize>, bool), (u32, Sets)>,
    list: Vec<Material>,
    textures: Textures<'a>,
}

/// What a material is before its extras: emission, normals, alpha.
struct Surface {
    physical: Physical,
    /// Of all textures but the colour's.
    means: Texels,
    color_texture: Option<u32>,
    /// Whether the vertices have colours, which multiply that.
    is_colored: bool,
    mean_color: Vec3,
    opacity: f32,
}

impl Surface {
    /// The material with the means of its textures; of the colour's, for all but the diffuse colour, which it
    /// multiplies.
    fn phong(&self) -> Material {
        let diffuse = self.physical.phong(&self.means).diffuse;
        Material {
            ambient: diffuse,
            diffuse,
            diffuse_texture: self.color_texture,
            opacity: self.opacity,
            physical: Some(self.physical)
                .filter(|physical| physical.varies(self.is_colored || self.color_texture.is_some())),
            ..self.physical.phong(&Texels { color: self.mean_color, ..self.means })
        }
    }
}

impl<'a> Materials<'a> {
    pub(super) fn new(document: &'a Document<'a>) -> Self {
        Self { document, known: HashMap::new(), list: Vec::new(), textures: Textures::new(document) }
    }

    /// The scene's index of a material where vertices have colours or not, and which sets of texture coordinates it
    /// needs; `pointer` says who asks.
    pub(super) fn get(&mut self, index: Option<usize>, is_colored: bool, pointer: &str) -> Result<(u32, Sets)> {
        let document = self.document;
        let materials = &document.root.materials;
        if let Some(index) = index {
            document.check_index(&format!("{pointer}/material"), index, materials.len(), "material")?;
        }
        if let Some(known) = self.known.get(&(index, is_colored)) {
            return Ok(*known);
        }
        let mut sets = Sets::default();
        let material = match index {
            Some(index) => self.convert(&materials[index], is_colored, &mut sets, &format!("/materials/{index}"))?,
            None => {
                let extensions = extension::read(&schema::Extensions::new()).map_err(|m| document.error("", m))?;
                let surface = self.metallic_roughness(&Source::default(), &extensions, &mut sets, "")?;
                Surface { is_colored, ..surface }.phong()
            }
        };
        // Most are the same with colours and without.
        let other = self.known.get(&(index, !is_colored)).map(|(other, _)| *other);
        let same = other.filter(|other| self.list[*other as usize] == material);
        let new = same.unwrap_or(self.list.len() as u32);
        if same.is_none() {
            self.list.push(material);
        }
        self.known.insert((index, is_colored), (new, sets));
        Ok((new, sets))
    }

    /// Hands materials and textures over to the scene.
    pub(super) fn finish(mut self, scene: &mut Scene, warnings: &mut Vec<Warning>) {
        warnings.append(&mut self.textures.warnings);
        scene.materials = self.list;
        scene.textures = self.textures.into_list();
    }

    fn convert(
        &mut self,
        source: &schema::Material,
        is_colored: bool,
        sets: &mut Sets,
        pointer: &str,
    ) -> Result<Material> {
        let document = self.document;
        let pbr = &source.pbr_metallic_roughness;
        let factors = [
            ("pbrMetallicRoughness/baseColorFactor", &pbr.base_color_factor[..], f32::MAX),
            ("emissiveFactor", &source.emissive_factor, f32::MAX),
            ("pbrMetallicRoughness/metallicFactor", &[pbr.metallic_factor], 1.0),
            ("pbrMetallicRoughness/roughnessFactor", &[pbr.roughness_factor], 1.0),
        ];
        for (name, numbers, most) in factors {
            if let Some(wrong) = numbers.iter().find(|x| !(0.0..=most).contains(*x)) {
                let range = if most == 1.0 { "from 0 to 1" } else { "finite and from 0 up" };
                let message = format!("it has to be {range}, and is {wrong}");
                return Err(document.error(format!("{pointer}/{name}"), message));
            }
        }
        let alpha = self.alpha(source, pointer)?;
        let extensions = extension::read(&source.extensions)
            .map_err(|message| document.error(format!("{pointer}/extensions"), message))?;
        let emission = Vec3::from(source.emissive_factor) * extensions.emissive_strength;
        if !(emission.is_finite() && emission.min_element() >= 0.0) {
            return Err(document.error(pointer, "the emissive strength has to be finite and from 0 up"));
        }
        let surface = match &extensions.specular_glossiness {
            None => self.metallic_roughness(pbr, &extensions, sets, pointer)?,
            Some(source) => self.specular_glossiness(source, sets, pointer)?,
        };
        let surface = Surface { is_colored, ..surface };
        let emissive = source.emissive_texture.as_ref().filter(|_| emission != Vec3::ZERO);
        let emission_texture = self.textures.get(emissive, sets, &format!("{pointer}/emissiveTexture"))?;
        let normal = source.normal_texture.as_ref();
        let normal_texture = self.textures.get(normal, sets, &format!("{pointer}/normalTexture"))?;
        let material = Material {
            name: source.name.clone(),
            emission,
            emission_texture,
            normal_texture,
            normal_scale: normal.and_then(|info| info.scale).unwrap_or(1.0),
            alpha,
            ..surface.phong()
        };
        if extensions.unlit {
            let [r, g, b, _] = pbr.base_color_factor;
            return Ok(Material {
                diffuse: Vec3::new(r, g, b),
                unlit: true,
                emission: Vec3::ZERO,
                emission_texture: None,
                physical: None,
                ..material
            });
        }
        if !material.sends_on() {
            return Ok(material);
        }
        let interface = if extensions.is_volume { Interface::Fresnel } else { Interface::Thin };
        Ok(Material { interface, absorption: extensions.absorption, ..material })
    }

    fn alpha(&self, source: &schema::Material, pointer: &str) -> Result<Alpha> {
        match (source.alpha_mode.as_deref(), source.alpha_cutoff.unwrap_or(0.5)) {
            (None | Some("OPAQUE"), _) => Ok(Alpha::Opaque),
            (Some("MASK"), cutoff) if cutoff >= 0.0 => Ok(Alpha::Mask { cutoff }),
            (Some("BLEND"), _) => Ok(Alpha::Blend),
            (Some(mode), cutoff) => {
                let message = format!(
                    "alphaMode {mode:?} with cutoff {cutoff}; expected OPAQUE, BLEND, or MASK and a cutoff from 0 up"
                );
                Err(self.document.error(pointer, message))
            }
        }
    }

    fn metallic_roughness(
        &mut self,
        source: &Source,
        extensions: &MaterialExtensions,
        sets: &mut Sets,
        pointer: &str,
    ) -> Result<Surface> {
        let [r, g, b, alpha] = source.base_color_factor;
        let (specular, transmission) = (&extensions.specular, &extensions.transmission);
        let mut texture = |info: &Option<schema::TextureInfo>, place: &str| {
            self.textures.get(info.as_ref(), sets, &format!("{pointer}/{place}"))
        };
        let color_texture = texture(&source.base_color_texture, "pbrMetallicRoughness/baseColorTexture")?;
        let metallic_roughness =
            texture(&source.metallic_roughness_texture, "pbrMetallicRoughness/metallicRoughnessTexture")?;
        let mut extra = |info: &Option<schema::TextureInfo>, extension: &str, slot: &str| {
            texture(info, &format!("extensions/KHR_materials_{extension}/{slot}"))
        };
        let textures = PhysicalTextures {
            metallic_roughness,
            transmission: extra(&transmission.transmission_texture, "transmission", "transmissionTexture")?,
            specular: extra(&specular.specular_texture, "specular", "specularTexture")?,
            specular_color: extra(&specular.specular_color_texture, "specular", "specularColorTexture")?,
        };
        let values = MetallicRoughness {
            base: Vec3::new(r, g, b),
            metalness: source.metallic_factor,
            roughness: source.roughness_factor,
            ior: extensions.ior,
            specular: specular.specular_factor,
            specular_color: specular.specular_color_factor.into(),
            transmission: transmission.transmission_factor,
        };
        Ok(self.surface(Workflow::MetallicRoughness(values), textures, color_texture, alpha))
    }

    fn specular_glossiness(
        &mut self,
        source: &SpecularGlossinessSource,
        sets: &mut Sets,
        pointer: &str,
    ) -> Result<Surface> {
        let pointer = format!("{pointer}/extensions/KHR_materials_pbrSpecularGlossiness");
        let [r, g, b, alpha] = source.diffuse_factor;
        let color = self.textures.get(source.diffuse_texture.as_ref(), sets, &format!("{pointer}/diffuseTexture"))?;
        let both = source.specular_glossiness_texture.as_ref();
        let both = self.textures.get(both, sets, &format!("{pointer}/specularGlossinessTexture"))?;
        let values = SpecularGlossiness {
            diffuse: Vec3::new(r, g, b),
            specular: source.specular_factor.into(),
            glossiness: source.glossiness_factor,
        };
        let textures = PhysicalTextures { specular: both, specular_color: both, ..PhysicalTextures::default() };
        Ok(self.surface(Workflow::SpecularGlossiness(values), textures, color, alpha))
    }

    fn surface(
        &mut self,
        workflow: Workflow,
        textures: PhysicalTextures,
        color_texture: Option<u32>,
        alpha: f32,
    ) -> Surface {
        // Metalness is in blue, roughness in green.
        let metallic_roughness = self.textures.mean_number(textures.metallic_roughness);
        let means = Texels {
            color: Vec3::ONE,
            metalness: metallic_roughness.z,
            roughness: metallic_roughness.y,
            transmission: self.textures.mean_number(textures.transmission).x,
            specular: self.textures.mean_number(textures.specular).w,
            specular_color: self.textures.mean_color(textures.specular_color),
        };
        let mean_color = self.textures.mean_color(color_texture);
        Surface {
            physical: Physical { workflow, textures },
            means,
            color_texture,
            is_colored: false,
            mean_color,
            // Exporters round, and more than all of it is not there.
            opacity: alpha.min(1.0),
        }
    }
}
