//! Faces with attributes of their own: texture coordinates at each corner, which MeshLab calls wedges, the number of a
//! texture, a colour.
//!
//! A mesh has its attributes at vertices, so a position becomes a vertex for each set of attributes that faces give it.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::color::Color;
use super::header::{Element, Header};
use super::item::Item;
use super::vertices::Vertices;
use crate::io::Placeless;
use crate::io::compact::{compact, with_vertices};
use crate::io::weld::Weld;
use crate::math::{Vec2, Vec4};
use crate::scene::Mesh;

/// The property that says which of the textures a face has.
pub(super) const NUMBER: &str = "texnumber";

/// In place of that number, where a face has no texture.
const NONE: u32 = u32::MAX;

/// What faces have of their own.
pub(super) struct Wedges {
    /// The property `texcoord`, a list.
    pub(super) coordinates: Option<usize>,
    /// The property `texnumber`.
    texture: Option<usize>,
    color: Option<Color>,
    /// Vertices: the index of their position, the bits of u and v, the index of their colour.
    vertices: Weld<[u32; 4]>,
    /// The bits of colours.
    colors: Weld<[u32; 4]>,
    /// The number of each triangle's texture; empty where faces have none.
    textures: Vec<u32>,
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
        let face = header.element("face").filter(|_| header.element("tristrips").is_none())?;
        let coordinates = face.list(&["texcoord"]);
        let texture = face.index(&[NUMBER]).filter(|_| !header.textures.is_empty());
        let color = Color::of(face).filter(|_| !has_colored_vertices(header));
        if coordinates.is_none() && texture.is_none() && color.is_none() {
            return None;
        }
        let (vertices, colors) = (Weld::new(), Weld::new());
        Some(Self { coordinates, texture, color, vertices, colors, textures: Vec::new() })
    }

    /// Puts vertices in place of the positions of a face's corners, and notes the texture of the triangles that it is made of.
    pub(super) fn face(&mut self, face: &Item, corners: &mut [u32], triangles: usize) -> Placeless<()> {
        let coordinates = self.coordinates.map_or(&[][..], |list| &face.lists[list]);
        let (corner_count, has) = (corners.len(), coordinates.len());
        if has != 0 && has != 2 * corner_count {
            return Err(format!(
                "texcoord has {has} numbers for a face of {corner_count} corners, which takes two each"
            ));
        }
        let color = self.color.as_ref().map_or(Vec4::ONE, |color| color.linear(|index| face.values[index]));
        let color = self.colors.index(color.to_array().map(f32::to_bits));
        for (corner, k) in corners.iter_mut().zip(0..) {
            let uv = coordinates.get(2 * k..2 * k + 2).unwrap_or(&[0.0; 2]);
            *corner = self.vertices.index([*corner, (uv[0] as f32).to_bits(), (uv[1] as f32).to_bits(), color]);
        }
        if let Some(texture) = self.texture {
            // Whatever is no index, as -1 (MeshLab), is none.
            let number = face.values[texture];
            let number = if (0.0..f64::from(NONE)).contains(&number) { number as u32 } else { NONE };
            self.textures.extend(std::iter::repeat_n(number, triangles));
        }
        Ok(())
    }

    /// The meshes, by rising number of their texture, of triangles whose corners this has named.
    pub(super) fn parts(self, vertices: Vertices, triangles: Vec<[u32; 3]>) -> Vec<Part> {
        let keys = self.vertices.into_keys();
        let positions: Vec<u32> = keys.iter().map(|key| key[0]).collect();
        let mut vertices = vertices.of(&positions);
        if self.coordinates.is_some() {
            vertices.uvs = keys.iter().map(|&[_, u, v, _]| Vec2::new(f32::from_bits(u), f32::from_bits(v))).collect();
        }
        if self.color.is_some() {
            let colors: Vec<Vec4> =
                self.colors.into_keys().iter().map(|bits| bits.map(f32::from_bits).into()).collect();
            vertices.colors = keys.iter().map(|key| colors[key[3] as usize]).collect();
        }
        let mesh = vertices.mesh(triangles);
        if self.textures.is_empty() {
            return vec![Part { mesh, texture: Some(0) }];
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
            Part { mesh, texture: (texture != NONE).then_some(texture) }
        };
        by_texture.into_iter().map(part).collect()
    }
}

/// What faces have of their own and the mesh does not get, if anything: the element, and a warning.
pub(super) fn left_out(header: &Header) -> Option<(&Element, &'static str)> {
    let face = header.element("face")?;
    let is_colored = Color::of(face).is_some();
    if header.element("tristrips").is_some() && (is_colored || face.list(&["texcoord"]).is_some()) {
        return Some((
            face,
            "colours and texture coordinates of faces are left out, since the file has tristrips as well",
        ));
    }
    let twice = is_colored && has_colored_vertices(header);
    twice.then_some((face, "colours of faces are left out: vertices have colours as well, which are taken"))
}

fn has_colored_vertices(header: &Header) -> bool {
    header.element("vertex").is_some_and(|vertex| Color::of(vertex).is_some())
}
