//! Faces with attributes of their own: texture coordinates at each corner, which MeshLab calls wedges, the number of a
//! texture, a colour.
//!
//! A mesh has its attributes at vertices, so a position becomes a vertex for each set of attributes that faces give it.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::Items;
use super::color::Color;
use super::header::{Element, Header};
use super::item::Item;
use super::vertices::{Layout, Vertices};
use crate::io::Placeless;
use crate::io::weld::Weld;
use crate::math::{Vec2, Vec4};
use crate::scene::Mesh;
use crate::scene::compact::{compact, with_vertices};

/// The property that says which of the textures a face has.
pub(super) const NUMBER: &str = "texnumber";

/// In place of that number, where a face has no texture.
const NONE: u32 = u32::MAX;

/// Numbers of corners, of which [`Weld`] keeps two.
pub(super) const MAX_CORNERS: u64 = u32::MAX as u64 - 2;

/// What faces have of their own.
pub(super) struct Wedges {
    /// The property `texcoord`, a list.
    pub(super) coordinates: Option<usize>,
    /// The property `texnumber`.
    pub(super) texture: Option<usize>,
    pub(super) color: Option<Color>,
    /// Vertices: the index of their position, the bits of u and v, and their colour: packed, or its index.
    vertices: Weld<[u32; 4]>,
    /// In place of these, where all were read at once.
    at_once: Vec<[u32; 4]>,
    /// The bits of colours that are not packed.
    colors: Weld<[u32; 4]>,
    /// Corners so far.
    corners: u64,
    /// Faces with another number of texture coordinates than their corners take.
    pub(super) odd: u64,
    /// The number of each triangle's texture; empty where faces have none.
    textures: Vec<u32>,
}

/// All triangles of a file whose faces are records of one size.
pub(super) struct AtOnce {
    /// Indices into `vertices`.
    pub(super) triangles: Vec<[u32; 3]>,
    /// As [`Wedges`] tells them apart.
    pub(super) vertices: Vec<[u32; 4]>,
    /// Of each triangle, if it was asked for.
    pub(super) textures: Vec<u32>,
}

/// The triangles that have the same texture.
pub(super) struct Part {
    pub(super) mesh: Mesh,
    /// Its number, 0 unless faces say otherwise; nothing where they say that they have none.
    pub(super) texture: Option<u32>,
}

impl Wedges {
    /// None read yet; nothing where faces have nothing of their own that a mesh would have a use for.
    pub(super) fn of(header: &Header) -> Option<Self> {
        let face = heeded(header)?;
        let coordinates = face.list(&["texcoord"]);
        let has_uvs = || Layout::new(header.element("vertex")?).ok()?.uv;
        let is_textured = !header.textures.is_empty() && (coordinates.is_some() || has_uvs().is_some());
        let texture = face.index(&[NUMBER]).filter(|_| is_textured);
        let color = Color::of(face).filter(|_| !has_colored_vertices(header));
        if coordinates.is_none() && texture.is_none() && color.is_none() {
            return None;
        }
        Some(Self {
            coordinates,
            texture,
            color,
            vertices: Weld::new(),
            at_once: Vec::new(),
            colors: Weld::new(),
            corners: 0,
            odd: 0,
            textures: Vec::new(),
        })
    }

    /// Reads all faces at once, where that can be; gives the triangles.
    pub(super) fn read_at_once(
        &mut self,
        element: &Element,
        items: &mut impl Items,
        positions: usize,
    ) -> Option<Vec<[u32; 3]>> {
        let AtOnce { triangles, vertices, textures } = items.wedges(element, self, positions)?;
        (self.at_once, self.textures) = (vertices, textures);
        Some(triangles)
    }

    /// Puts vertices in place of the positions of a face's corners, and notes the texture of the triangles that it is
    /// made of.
    pub(super) fn face(&mut self, face: &Item, corners: &mut [u32], triangles: usize) -> Placeless<()> {
        self.corners += corners.len() as u64;
        if self.corners >= MAX_CORNERS {
            return Err(format!(
                "more than {MAX_CORNERS} corners of faces with attributes of their own; divide the file"
            ));
        }
        let mut coordinates = self.coordinates.map_or(&[][..], |list| &face.lists[list]);
        if !coordinates.is_empty() && coordinates.len() != 2 * corners.len() {
            self.odd += 1;
            coordinates = &[];
        }
        let value = |index: usize| face.values[index];
        let color = match &self.color {
            Some(color) if color.is_bytes() => color.packed(value),
            Some(color) => self.colors.index(color.linear(value).to_array().map(f32::to_bits)),
            None => 0,
        };
        for (corner, k) in corners.iter_mut().zip(0..) {
            let uv = coordinates.get(2 * k..2 * k + 2).unwrap_or(&[0.0; 2]);
            *corner = self.vertices.index([*corner, (uv[0] as f32).to_bits(), (uv[1] as f32).to_bits(), color]);
        }
        if let Some(texture) = self.texture {
            self.textures.extend(std::iter::repeat_n(texture_number(face.values[texture]), triangles));
        }
        Ok(())
    }

    /// The meshes, by rising number of their texture, of triangles whose corners this has named.
    pub(super) fn parts(self, vertices: Vertices, triangles: Vec<[u32; 3]>) -> Vec<Part> {
        let keys = if self.at_once.is_empty() { self.vertices.into_keys() } else { self.at_once };
        let positions: Vec<u32> = keys.iter().map(|key| key[0]).collect();
        let mut vertices = vertices.of(&positions);
        if self.coordinates.is_some() {
            vertices.uvs = keys.iter().map(|&[_, u, v, _]| Vec2::new(f32::from_bits(u), f32::from_bits(v))).collect();
        }
        if let Some(color) = self.color {
            let table = self.colors.into_keys();
            let of_table = |index: u32| Vec4::from(table[index as usize].map(f32::from_bits));
            let linear = |word| if color.is_bytes() { Color::unpacked(word) } else { of_table(word) };
            vertices.colors = keys.iter().map(|key| linear(key[3])).collect();
        }
        let mesh = vertices.mesh(triangles);
        let numbered = |number: u32| (number != NONE).then_some(number);
        // Of one texture is what has none to choose from, and most of what has.
        let first = self.textures.first().copied().unwrap_or(0);
        if self.textures.iter().all(|number| *number == first) {
            return vec![Part { mesh, texture: numbered(first) }];
        }
        let mut by_texture: BTreeMap<u32, Vec<[u32; 3]>> = BTreeMap::new();
        for (&triangle, texture) in mesh.triangles.iter().zip(self.textures) {
            by_texture.entry(texture).or_default().push(triangle);
        }
        let part = |(texture, mut triangles): (u32, Vec<[u32; 3]>)| {
            let used = compact(triangles.as_flattened_mut(), mesh.positions.len());
            let mesh = match used {
                Some(used) => with_vertices(&mesh, &used, triangles),
                None => Mesh { triangles: Arc::new(triangles), ..mesh.clone() },
            };
            Part { mesh, texture: numbered(texture) }
        };
        by_texture.into_iter().map(part).collect()
    }
}

/// The element face, if its attributes are heeded: not beside strips, which have none.
pub(super) fn heeded(header: &Header) -> Option<&Element> {
    header.element("face").filter(|_| header.element("tristrips").is_none())
}

/// A texture's number by the value of [`NUMBER`]. Whatever is no index, as -1 (MeshLab), is none.
pub(super) fn texture_number(value: f64) -> u32 {
    if (0.0..f64::from(NONE)).contains(&value) { value as u32 } else { NONE }
}

/// What faces have of their own and the mesh does not get, if anything: the element, and a warning.
pub(super) fn left_out(header: &Header) -> Option<(&Element, &'static str)> {
    let face = header.element("face")?;
    let is_colored = Color::of(face).is_some();
    let has_more = face.list(&["texcoord"]).is_some() || face.index(&[NUMBER]).is_some();
    if heeded(header).is_none() && (is_colored || has_more) {
        return Some((face, "colours and textures of faces are left out, since the file has tristrips as well"));
    }
    let twice = is_colored && has_colored_vertices(header);
    twice.then_some((face, "colours of faces are left out: vertices have colours as well, which are taken"))
}

fn has_colored_vertices(header: &Header) -> bool {
    header.element("vertex").is_some_and(|vertex| Color::of(vertex).is_some())
}
