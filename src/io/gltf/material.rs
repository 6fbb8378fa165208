//! Materials and the pictures they name.
//!
//! What becomes of the numbers is [`phong`](super::phong)'s. Pictures are decoded once each, when a material first needs
//! them.

use std::collections::HashMap;

use super::Document;
use super::extension;
use super::phong::{self, MetallicRoughness};
use super::schema::{self, MetallicRoughness as Source, TextureInfo};
use super::uri::{self, Target};
use crate::error::{Error, Result, Warning};
use crate::io::texture;
use crate::math::{Vec2, Vec3};
use crate::scene::{Alpha, Filter, Interface, Material, Scene, Texture, Wrap};

/// The materials of a document, converted when a primitive first uses them.
pub(super) struct Materials<'a> {
    document: &'a Document<'a>,
    /// By glTF's index; None is the default material.
    known: HashMap<Option<usize>, u32>,
    list: Vec<Material>,
    /// By glTF's texture; None where the file is missing.
    known_textures: HashMap<usize, Option<u32>>,
    textures: Vec<Texture>,
    /// Means of textures of numbers by glTF's image; None where the file is missing.
    known_means: HashMap<usize, Option<Vec3>>,
    warnings: Vec<Warning>,
}

impl<'a> Materials<'a> {
    pub(super) fn new(document: &'a Document<'a>) -> Self {
        Self {
            document,
            known: HashMap::new(),
            list: Vec::new(),
            known_textures: HashMap::new(),
            textures: Vec::new(),
            known_means: HashMap::new(),
            warnings: Vec::new(),
        }
    }

    /// The scene's index of a material, and which set of texture coordinates it needs; `pointer` says who asks.
    pub(super) fn get(&mut self, index: Option<usize>, pointer: &str) -> Result<(u32, Option<u32>)> {
        let document = self.document;
        let materials = &document.root.materials;
        if let Some(index) = index {
            document.check_index(&format!("{pointer}/material"), index, materials.len(), "material")?;
        }
        let source = index.map(|i| &materials[i]);
        let set = source.and_then(coordinate_set);
        if let Some(known) = self.known.get(&index) {
            return Ok((*known, set));
        }
        let material = match (index, source) {
            (Some(index), Some(source)) => self.convert(index, source)?,
            _ => self.values(&Source::default(), None, "")?.phong(),
        };
        self.list.push(material);
        let new = self.list.len() as u32 - 1;
        self.known.insert(index, new);
        Ok((new, set))
    }

    /// Hands materials and textures over to the scene.
    pub(super) fn finish(self, scene: &mut Scene, warnings: &mut Vec<Warning>) {
        warnings.extend(self.warnings);
        scene.materials = self.list;
        scene.textures = self.textures;
    }

    fn convert(&mut self, index: usize, source: &schema::Material) -> Result<Material> {
        let pointer = format!("/materials/{index}");
        let pbr = &source.pbr_metallic_roughness;
        let mut numbers = pbr.base_color_factor.iter().chain(&source.emissive_factor);
        let shares = [pbr.metallic_factor, pbr.roughness_factor];
        if !numbers.all(|x| x.is_finite() && *x >= 0.0) || !shares.iter().all(|x| (0.0..=1.0).contains(x)) {
            return Err(self.document.error(pointer, "factors have to be finite and from 0 up, shares from 0 to 1"));
        }
        let alpha = match (source.alpha_mode.as_deref(), source.alpha_cutoff.unwrap_or(0.5)) {
            (None | Some("OPAQUE"), _) => Alpha::Opaque,
            (Some("MASK"), cutoff) if cutoff >= 0.0 => Alpha::Mask { cutoff },
            (Some("BLEND"), _) => Alpha::Blend,
            (Some(mode), cutoff) => {
                let message = format!(
                    "alphaMode {mode:?} with cutoff {cutoff}; expected OPAQUE, BLEND, or MASK and a cutoff from 0 up"
                );
                return Err(self.document.error(pointer, message));
            }
        };
        let extensions = extension::read(&source.extensions)
            .map_err(|message| self.document.error(format!("{pointer}/extensions"), message))?;
        let texture = match &pbr.base_color_texture {
            Some(info) => {
                self.texture(info.index, &format!("{pointer}/pbrMetallicRoughness/baseColorTexture/index"))?
            }
            None => None,
        };
        let emission = Vec3::from(source.emissive_factor) * extensions.emissive_strength;
        if !(emission.is_finite() && emission.min_element() >= 0.0) {
            return Err(self.document.error(pointer, "the emissive strength has to be finite and from 0 up"));
        }
        let mut values = self.values(pbr, texture, &pointer)?;
        values.ior = extensions.ior;
        values.transmission = extensions.transmission;
        if let Some(info) = &extensions.transmission_texture {
            let pointer = format!("{pointer}/extensions/KHR_materials_transmission/transmissionTexture/index");
            if let Some(means) = self.means(info.index, &pointer)? {
                values.transmission *= means.x;
            }
        }
        let emissive = source.emissive_texture.as_ref().filter(|_| emission != Vec3::ZERO);
        let emission_texture = self.slot(source, emissive, &format!("{pointer}/emissiveTexture"))?;
        let normal_texture = self.slot(source, source.normal_texture.as_ref(), &format!("{pointer}/normalTexture"))?;
        let normal_scale = source.normal_texture.as_ref().and_then(|info| info.scale).unwrap_or(1.0);
        let glass = Material {
            name: source.name.clone(),
            emission,
            diffuse_texture: texture,
            emission_texture,
            normal_texture,
            normal_scale,
            alpha,
            opacity: pbr.base_color_factor[3],
            ..values.phong()
        };
        if extensions.unlit {
            let [r, g, b, _] = pbr.base_color_factor;
            return Ok(Material {
                diffuse: Vec3::new(r, g, b),
                unlit: true,
                emission: Vec3::ZERO,
                emission_texture: None,
                ..glass
            });
        }
        if values.transmission == 0.0 {
            return Ok(glass);
        }
        let interface = if extensions.is_volume { Interface::Fresnel } else { Interface::Thin };
        Ok(Material { interface, absorption: extensions.absorption, ..glass })
    }

    /// What the material is with one value for each texture.
    fn values(&mut self, source: &Source, texture: Option<u32>, pointer: &str) -> Result<MetallicRoughness> {
        let [r, g, b, _] = source.base_color_factor;
        let (metal, roughness) = match &source.metallic_roughness_texture {
            Some(info) => {
                let pointer = format!("{pointer}/pbrMetallicRoughness/metallicRoughnessTexture/index");
                // As without one where it is missing. Metalness is in blue, roughness in green.
                self.means(info.index, &pointer)?.map_or((1.0, 1.0), |mean| (mean.z, mean.y))
            }
            None => (1.0, 1.0),
        };
        Ok(MetallicRoughness {
            base: Vec3::new(r, g, b),
            texture: texture.map_or(Vec3::ONE, |t| phong::mean_color(&self.textures[t as usize])),
            metal: source.metallic_factor * metal,
            roughness: source.roughness_factor * roughness,
            ior: None,
            transmission: 0.0,
        })
    }

    /// The mean of a texture of numbers; none where it is missing.
    fn means(&mut self, index: usize, pointer: &str) -> Result<Option<Vec3>> {
        let Some(image) = self.image_of(index, pointer)? else { return Ok(None) };
        let means = match self.known_means.get(&image) {
            Some(known) => *known,
            None => {
                let means = self.image(image)?.map(|picture| phong::mean_number(&picture));
                self.known_means.insert(image, means);
                means
            }
        };
        Ok(means)
    }

    /// The texture of a slot beside the base colour's. None, and a warning, where its coordinates are others than the mesh has.
    fn slot(&mut self, source: &schema::Material, info: Option<&TextureInfo>, pointer: &str) -> Result<Option<u32>> {
        let Some(info) = info else { return Ok(None) };
        let set = coordinate_set(source).unwrap_or(info.tex_coord);
        if info.tex_coord != set {
            let message = format!(
                "the texture wants coordinates of set {}, but set {set} is read; rendered without it",
                info.tex_coord
            );
            self.warnings.push(self.document.warning(pointer, message));
            return Ok(None);
        }
        self.texture(info.index, &format!("{pointer}/index"))
    }

    fn texture(&mut self, index: usize, pointer: &str) -> Result<Option<u32>> {
        let document = self.document;
        let root = &document.root;
        if let Some(known) = self.known_textures.get(&index) {
            return Ok(*known);
        }
        let Some(image) = self.image_of(index, pointer)? else {
            self.known_textures.insert(index, None);
            return Ok(None);
        };
        let sampler = match root.textures[index].sampler {
            Some(s) => {
                document.check_index(&format!("/textures/{index}/sampler"), s, root.samplers.len(), "sampler")?;
                Some(&root.samplers[s])
            }
            None => None,
        };
        let made = self.image(image)?.map(|picture| {
            let wrap = |code: Option<u32>| match code {
                Some(33_071) => Wrap::Clamp,
                Some(33_648) => Wrap::Mirror,
                _ => Wrap::Repeat,
            };
            let filter =
                if sampler.and_then(|s| s.mag_filter) == Some(9728) { Filter::Nearest } else { Filter::Linear };
            self.textures.push(Texture {
                wrap_u: wrap(sampler.and_then(|s| s.wrap_s)),
                wrap_v: wrap(sampler.and_then(|s| s.wrap_t)),
                filter,
                scale: Vec2::ONE,
                ..picture
            });
            self.textures.len() as u32 - 1
        });
        self.known_textures.insert(index, made);
        Ok(made)
    }

    /// The image of a texture. None, and a warning, where it has none.
    fn image_of(&mut self, index: usize, pointer: &str) -> Result<Option<usize>> {
        let document = self.document;
        let root = &document.root;
        document.check_index(pointer, index, root.textures.len(), "texture")?;
        let image = root.textures[index].source;
        match image {
            Some(image) => {
                document.check_index(&format!("/textures/{index}/source"), image, root.images.len(), "image")?;
            }
            None => {
                let message = "the texture has no image that can be read; the material is rendered without it";
                self.warnings.push(document.warning(format!("/textures/{index}"), message));
            }
        }
        Ok(image)
    }

    /// Decodes an image. None, and a warning, where its file is missing.
    fn image(&mut self, index: usize) -> Result<Option<Texture>> {
        let document = self.document;
        let image = &document.root.images[index];
        let pointer = format!("/images/{index}");
        let decode = |bytes: &[u8]| {
            let name = if image.name.is_empty() { &pointer } else { &image.name };
            let told = |m| document.error(&pointer, format!("image {:?} {m}", image.name));
            texture::decode(bytes, name).map(Some).map_err(told)
        };
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) => match uri::resolve(document.path, uri).map_err(|m| document.error(&pointer, m))? {
                Target::Data(bytes) => decode(&bytes),
                Target::File(file) => {
                    let texture = texture::open(&file).map_err(|e| self.at(&pointer, e))?;
                    if texture.is_none() {
                        let message =
                            format!("texture {:?} is missing; the material is rendered without it", file.display());
                        self.warnings.push(document.warning(format!("{pointer}/uri"), message));
                    }
                    Ok(texture)
                }
            },
            (None, Some(view)) => {
                let (bytes, _) = document.view(view).map_err(|m| document.error(format!("{pointer}/bufferView"), m))?;
                decode(bytes)
            }
            (None, None) => Err(document.error(pointer, "the image has neither a URI nor a buffer view")),
        }
    }

    /// An error about a picture file, as one about the document that names it.
    fn at(&self, pointer: &str, error: Error) -> Error {
        match error {
            Error::Input { path, message, .. } => {
                self.document.error(pointer, format!("{}: {message}", path.display()))
            }
            other => other,
        }
    }
}

/// Which texture coordinates a mesh of this material needs: it has one set, that of the first texture here.
fn coordinate_set(source: &schema::Material) -> Option<u32> {
    let base = source.pbr_metallic_roughness.base_color_texture.as_ref();
    let first = base.or(source.emissive_texture.as_ref()).or(source.normal_texture.as_ref());
    first.map(|info| info.tex_coord)
}
