//! Textures, and the pictures they show.
//!
//! A picture is decoded once, when a material first needs it, and shared by all images that are it, and by all textures
//! that show it: one for each sampler, place (`KHR_texture_transform`) and set of coordinates.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use serde::Deserialize;

use super::document::Document;
use super::means;
use super::schema::TextureInfo;
use super::uri::{self, Target};
use crate::error::{Error, Result, Warning};
use crate::io::{Placeless, texture};
use crate::math::{Affine2, Mat2, Vec2, Vec3, Vec4};
use crate::scene::{Filter, Texture, Wrap};

/// The textures of a document that materials have asked for.
pub(super) struct Textures<'a> {
    document: &'a Document<'a>,
    list: Vec<Texture>,
    /// By glTF's texture, where it lies, and whether by the second set of coordinates.
    known: HashMap<(usize, [u32; 6], bool), u32>,
    /// By what glTF's images are made of; None where the file is missing.
    pictures: HashMap<Source<'a>, Option<Texture>>,
    /// The same by the image: to look at what it is made of takes as long as that is.
    images: HashMap<usize, Option<Texture>>,
    /// By the address of a picture's pixels, and whether as numbers.
    means: HashMap<(usize, bool), Vec4>,
    pub(super) warnings: Vec<Warning>,
}

/// What an image is made of: several may be made of the same.
#[derive(PartialEq, Eq, Hash)]
enum Source<'a> {
    Uri(&'a str),
    /// Of a buffer view.
    Bytes(&'a [u8]),
}

impl<'a> Source<'a> {
    fn of(document: &'a Document<'a>, index: usize) -> Result<Self> {
        let image = &document.root.images[index];
        let pointer = format!("/images/{index}");
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) => Ok(Self::Uri(uri)),
            (None, Some(view)) => match document.view(view) {
                Ok((bytes, _)) => Ok(Self::Bytes(bytes)),
                Err(message) => Err(document.error(format!("{pointer}/bufferView"), message)),
            },
            (None, None) => Err(document.error(pointer, "the image has neither a URI nor a buffer view")),
        }
    }
}

/// The sets of texture coordinates of a material, in the order in which its textures name them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sets(pub(super) [Option<u32>; 2]);

impl Sets {
    /// The place of a set, which is made for it if there is room.
    fn place(&mut self, set: u32) -> Option<usize> {
        let place = self.0.iter().position(|known| known.is_none_or(|known| known == set))?;
        self.0[place] = Some(set);
        Some(place)
    }
}

/// `KHR_texture_transform`.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Transform {
    offset: [f32; 2],
    rotation: f32,
    scale: [f32; 2],
    tex_coord: Option<u32>,
}

impl Default for Transform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

impl Transform {
    fn read(info: &TextureInfo) -> Placeless<Self> {
        let Some(value) = info.extensions.get("KHR_texture_transform") else { return Ok(Self::default()) };
        let transform = Self::deserialize(value).map_err(|error| format!("KHR_texture_transform: {error}"))?;
        let Self { offset: [u, v], rotation, scale: [across, down], .. } = transform;
        let are_finite = [u, v, rotation, across, down].into_iter().all(f32::is_finite);
        if are_finite { Ok(transform) } else { Err("KHR_texture_transform: the numbers have to be finite".into()) }
    }

    /// From coordinates to coordinates, both with v up. glTF's v points down, and its angle turns what is then seen
    /// counter-clockwise: that is the usual turn with v up.
    fn matrix(&self) -> Affine2 {
        let flip = Affine2::from_scale_angle_translation(Vec2::new(1.0, -1.0), 0.0, Vec2::Y);
        let (sin, cos) = libm::sincosf(self.rotation);
        let turn = Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos));
        let placed = Affine2::from_mat2_translation(turn, self.offset.into()) * Affine2::from_scale(self.scale.into());
        flip * placed * flip
    }
}

impl<'a> Textures<'a> {
    pub(super) fn new(document: &'a Document<'a>) -> Self {
        Self {
            document,
            list: Vec::new(),
            known: HashMap::new(),
            pictures: HashMap::new(),
            images: HashMap::new(),
            means: HashMap::new(),
            warnings: Vec::new(),
        }
    }

    pub(super) fn into_list(self) -> Vec<Texture> {
        self.list
    }

    /// The scene's index of what a material's slot at `pointer` names, whose coordinates are one of `sets`. None, and a
    /// warning, where its file is missing, or it wants a third set of coordinates.
    pub(super) fn get(&mut self, info: Option<&TextureInfo>, sets: &mut Sets, pointer: &str) -> Result<Option<u32>> {
        let Some(info) = info else { return Ok(None) };
        let document = self.document;
        let transform = Transform::read(info).map_err(|message| document.error(pointer, message))?;
        let Some(picture) = self.picture_of(info.index, &format!("{pointer}/index"))? else { return Ok(None) };
        let set = transform.tex_coord.unwrap_or(info.tex_coord);
        let Some(place) = sets.place(set) else {
            let [first, second] = sets.0.map(Option::unwrap_or_default);
            let message = format!(
                "the texture wants coordinates of set {set}, and others of sets {first} and {second}; rendered without it"
            );
            self.warnings.push(document.warning(pointer, message));
            return Ok(None);
        };
        let matrix = transform.matrix();
        let key = (info.index, matrix.to_cols_array().map(f32::to_bits), place == 1);
        if let Some(known) = self.known.get(&key) {
            return Ok(Some(*known));
        }
        let samplers = &document.root.samplers;
        let sampler = match document.root.textures[info.index].sampler {
            Some(s) => {
                document.check_index(&format!("/textures/{}/sampler", info.index), s, samplers.len(), "sampler")?;
                Some(&samplers[s])
            }
            None => None,
        };
        let wrap = |code: Option<u32>| match code {
            Some(33_071) => Wrap::Clamp,
            Some(33_648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        self.list.push(Texture {
            wrap_u: wrap(sampler.and_then(|s| s.wrap_s)),
            wrap_v: wrap(sampler.and_then(|s| s.wrap_t)),
            filter: if sampler.and_then(|s| s.mag_filter) == Some(9728) { Filter::Nearest } else { Filter::Linear },
            transform: matrix,
            on_second_uvs: place == 1,
            ..picture
        });
        let index = self.list.len() as u32 - 1;
        self.known.insert(key, index);
        Ok(Some(index))
    }

    /// The mean colour of a texture of the scene, linear; white for none.
    pub(super) fn mean_color(&mut self, index: Option<u32>) -> Vec3 {
        self.mean(index, false).truncate()
    }

    /// The mean of a texture of the scene whose colours are numbers; 1 for none.
    pub(super) fn mean_number(&mut self, index: Option<u32>) -> Vec4 {
        self.mean(index, true)
    }

    fn mean(&mut self, index: Option<u32>, are_numbers: bool) -> Vec4 {
        let Some(texture) = index.and_then(|index| self.list.get(index as usize)) else { return Vec4::ONE };
        *self.means.entry((texture.pixels.address(), are_numbers)).or_insert_with(|| match are_numbers {
            true => means::mean_number(texture),
            false => means::mean_color(texture).extend(1.0),
        })
    }

    /// The picture of a glTF texture. None, and a warning, where there is none.
    fn picture_of(&mut self, index: usize, pointer: &str) -> Result<Option<Texture>> {
        let document = self.document;
        let root = &document.root;
        document.check_index(pointer, index, root.textures.len(), "texture")?;
        let Some((image, told_by)) = root.textures[index].image() else {
            let message = "the texture has no image that can be read; the material is rendered without it";
            self.warnings.push(document.warning(format!("/textures/{index}"), message));
            return Ok(None);
        };
        document.check_index(&format!("/textures/{index}/{told_by}"), image, root.images.len(), "image")?;
        if let Some(known) = self.images.get(&image) {
            return Ok(known.clone());
        }
        let picture = match self.pictures.entry(Source::of(document, image)?) {
            Entry::Occupied(known) => known.get().clone(),
            Entry::Vacant(free) => {
                let picture = decoded(document, image, free.key(), &mut self.warnings)?;
                free.insert(picture).clone()
            }
        };
        self.images.insert(image, picture.clone());
        Ok(picture)
    }
}

/// Decodes an image. None, and a warning, where it is somewhere else or in another format, or its file is missing.
fn decoded(
    document: &Document<'_>,
    index: usize,
    source: &Source<'_>,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Texture>> {
    let image = &document.root.images[index];
    let pointer = format!("/images/{index}");
    let decode = |bytes: &[u8]| {
        let shown = if image.name.is_empty() { "the image".to_owned() } else { format!("image {:?}", image.name) };
        let named = |why| format!("{shown} {why}");
        let name = if image.name.is_empty() { &pointer } else { &image.name };
        let decoded = texture::decode(bytes, name).map_err(|why| document.error(&pointer, named(why)))?;
        Ok::<_, Error>(decoded.map_err(named))
    };
    let opened = match *source {
        Source::Uri(uri) => match uri::resolve(document.path, uri) {
            Ok(Target::Data(bytes)) => decode(&bytes)?,
            Ok(Target::File(file)) => texture::open(&file).map_err(|e| about(document, &pointer, e))?,
            Err(why) => Err(why),
        },
        Source::Bytes(bytes) => decode(bytes)?,
    };
    let without = |why| {
        let place = if matches!(source, Source::Uri(_)) { format!("{pointer}/uri") } else { pointer.clone() };
        warnings.push(document.warning(place, format!("{why}; the material is rendered without it")));
    };
    Ok(opened.map_err(without).ok())
}

/// An error about a picture file, as one about the document that names it.
fn about(document: &Document<'_>, pointer: &str, error: Error) -> Error {
    match error {
        Error::Input { path, message, .. } => document.error(pointer, format!("{}: {message}", path.display())),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;

    /// Where a transform takes (u, v), both as glTF has them, with v down.
    fn placed(transform: &Transform, u: f32, v: f32) -> Vec2 {
        let up = transform.matrix().transform_point2(Vec2::new(u, 1.0 - v));
        Vec2::new(up.x, 1.0 - up.y)
    }

    /// The specification's own example: the lower left quadrant of the picture, turned.
    #[test]
    fn the_example_of_the_specification() {
        let transform = Transform { offset: [0.0, 1.0], rotation: FRAC_PI_2, scale: [0.5, 0.5], tex_coord: None };
        for ((u, v), expected) in
            [((0.0, 0.0), [0.0, 1.0]), ((1.0, 0.0), [0.0, 0.5]), ((0.0, 1.0), [0.5, 1.0]), ((1.0, 1.0), [0.5, 0.5])]
        {
            let got = placed(&transform, u, v);
            assert!((got - Vec2::from(expected)).length() < 1e-6, "({u}, {v}) goes to {got}");
        }
    }

    #[test]
    fn scaled_then_turned_then_moved() {
        let transform = Transform { offset: [0.25, 0.5], rotation: FRAC_PI_2, scale: [2.0, 3.0], tex_coord: None };
        // (2 u, 3 v) counter-clockwise by a right angle with v down is (3 v, -2 u).
        let got = placed(&transform, 0.5, 0.25);
        assert!((got - Vec2::new(0.75 + 0.25, -1.0 + 0.5)).length() < 1e-6, "{got}");
        assert_eq!(Transform::default().matrix(), Affine2::IDENTITY);
    }

    #[test]
    fn a_material_has_two_sets_of_coordinates() {
        let mut sets = Sets::default();
        assert_eq!([3, 3, 0, 3, 0, 1].map(|set| sets.place(set)), [Some(0), Some(0), Some(1), Some(0), Some(1), None]);
        assert_eq!(sets, Sets([Some(3), Some(0)]));
    }
}
