//! PLY, text and binary of either byte order (Turk 1994, *The PLY polygon file format*).
//!
//! The header says what the file holds ([`header`]); the rest is read element by element. Binary values are read where
//! they lie in the mapped file ([`binary`]), text word by word ([`ascii`]); both hand the same [`Items`] to what builds
//! the mesh here. Elements and properties that a mesh has no use for are skipped by their declared sizes.

mod ascii;
mod binary;
mod header;

use std::path::Path;
use std::sync::Arc;

use self::header::{Element, Encoding, Header, Scalar};
use super::polygon;
use crate::error::{Error, Result, Warning};
use crate::image::srgb;
use crate::io::Placeless;
use crate::math::{DVec3, Vec2, Vec3, Vec4};
use crate::scene::{Geometry, Material, Mesh, Scene};

/// Where elements come from: the rest of the file, in either encoding.
trait Items {
    /// Where reading is, for messages: `byte 80` or `line 12`.
    fn place(&self) -> String;
    /// Bytes that are left.
    fn remaining(&self) -> usize;
    /// The fewest bytes that an item of this element takes.
    fn least_size(&self, element: &Element) -> usize;
    /// The next value.
    fn scalar(&mut self, scalar: Scalar) -> Placeless<f64>;
    /// All triangles at once where the element is nothing else, as long as they are.
    fn triangles(&mut self, _element: &Element, _most: usize) -> Vec<[u32; 3]> {
        Vec::new()
    }
}

/// Reads a PLY file.
pub(super) fn load(path: &Path, bytes: &[u8], warnings: &mut Vec<Warning>) -> Result<Scene> {
    let header = header::parse(path, bytes)?;
    let body = &bytes[header.length..];
    let mesh = match header.encoding {
        Encoding::Ascii => read(path, &header, ascii::Ascii::new(body, header.lines + 1), warnings)?,
        Encoding::Little => read(path, &header, binary::Binary::<false>::new(body, header.length), warnings)?,
        Encoding::Big => read(path, &header, binary::Binary::<true>::new(body, header.length), warnings)?,
    };
    let base = if mesh.colors.is_empty() { Material::default().diffuse } else { Vec3::ONE };
    let material = Material { ambient: base, diffuse: base, ..Material::default() };
    Ok(Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![material]))
}

fn read(path: &Path, header: &Header, mut items: impl Items, warnings: &mut Vec<Warning>) -> Result<Mesh> {
    let mut mesh = Mesh::default();
    let mut vertices = Vertices::default();
    let mut faces = Faces::default();
    for element in &header.elements {
        let problem = |message| Error::input(path, format!("line {}", element.line), message);
        let least = items.least_size(element);
        let needed = (element.count).checked_mul(least as u64);
        if needed.is_none_or(|needed| needed > items.remaining() as u64) {
            let message = format!(
                "element {:?} promises {} items of at least {least} bytes, but only {} bytes are left",
                element.name,
                element.count,
                items.remaining()
            );
            return Err(problem(message));
        }
        check_properties(element).map_err(problem)?;
        let result = match element.name.as_str() {
            "vertex" => vertices.read(element, &mut items),
            "face" => faces.read(element, &mut items, &vertices.positions),
            "tristrips" => faces.read_strips(element, &mut items, &vertices.positions),
            _ if least == 0 => Ok(()),
            _ => (0..element.count).try_for_each(|_| read_item(element, &mut items, |_| false, |_, _| ())),
        };
        result.map_err(|message| Error::input(path, items.place(), message))?;
    }
    if faces.small > 0 {
        let message = format!("{} faces with fewer than 3 corners are left out", faces.small);
        warnings.push(Warning::new(path, "", message));
    }
    if vertices.is_double {
        mesh.set_positions(&vertices.positions);
    } else {
        mesh.positions = Arc::new(vertices.positions.iter().map(|p| p.as_vec3()).collect());
    }
    (mesh.normals, mesh.uvs, mesh.colors) = (vertices.normals, vertices.uvs, vertices.colors);
    mesh.triangles = Arc::new(faces.triangles);
    Ok(mesh)
}

/// Reads one item and keeps the values of one of its lists, in place of what `values` held.
fn read_list(element: &Element, items: &mut impl Items, list: usize, values: &mut Vec<f64>) -> Placeless<()> {
    values.clear();
    read_item(
        element,
        items,
        |i| i == list,
        |i, value| {
            if i == list {
                values.push(value)
            }
        },
    )
}

/// Reads one item. Lists for which `wanted` holds are kept, and `each` gets the values of the other properties.
fn read_item(
    element: &Element,
    items: &mut impl Items,
    wanted: impl Fn(usize) -> bool,
    mut each: impl FnMut(usize, f64),
) -> Placeless<()> {
    for (index, property) in element.properties.iter().enumerate() {
        let count = match property.list {
            Some(counter) => list_length(items, counter)?,
            None => 1,
        };
        for _ in 0..count {
            let value = items.scalar(property.scalar)?;
            if property.list.is_none() || wanted(index) {
                each(index, value);
            }
        }
    }
    Ok(())
}

/// Reads the length of a list and compares it with what is left of the file.
fn list_length(items: &mut impl Items, counter: Scalar) -> Placeless<usize> {
    let length = items.scalar(counter)?;
    let left = items.remaining();
    // Each entry takes a byte at least, in either encoding.
    if length >= 0.0 && length <= left as f64 && length.fract() == 0.0 {
        return Ok(length as usize);
    }
    Err(format!("a list promises {length} entries, but only {left} bytes are left"))
}

/// The vertex element.
#[derive(Default)]
struct Vertices {
    positions: Vec<DVec3>,
    is_double: bool,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    colors: Vec<Vec4>,
}

impl Vertices {
    fn read(&mut self, element: &Element, items: &mut impl Items) -> Placeless<()> {
        let index = |names: &[&str]| element.index(names);
        let position = coordinates(element)?.map(Some);
        let normal = ["nx", "ny", "nz"].map(|axis| index(&[axis]));
        let uv = [index(&["u", "s", "texture_u", "texcoord_u"]), index(&["v", "t", "texture_v", "texcoord_v"])];
        let rgb = [["red", "r", "diffuse_red"], ["green", "g", "diffuse_green"], ["blue", "b", "diffuse_blue"]];
        let rgb = rgb.map(|names| index(&names));
        let alpha = index(&["alpha", "a", "diffuse_alpha"]);
        let is_double = |index: usize| element.properties[index].scalar == Scalar::F64;
        self.is_double = position.into_iter().flatten().any(is_double);

        // Bounded by the size of the file: `read` has compared them.
        let count = element.count as usize;
        let (has_normals, has_uvs) = (normal.iter().all(Option::is_some), uv.iter().all(Option::is_some));
        let has_colors = rgb.iter().all(Option::is_some);
        self.positions.reserve_exact(count);
        self.normals.reserve_exact(if has_normals { count } else { 0 });
        self.uvs.reserve_exact(if has_uvs { count } else { 0 });
        self.colors.reserve_exact(if has_colors { count } else { 0 });
        // The place of each property among the twelve values of a vertex; unused ones go to the thirteenth.
        let mut slots = vec![12usize; element.properties.len()];
        let roles = position.iter().chain(&normal).chain(&uv).chain(&rgb).chain([&alpha]);
        for (slot, index) in roles.enumerate() {
            if let Some(index) = index {
                slots[*index] = slot;
            }
        }
        let mut v = [0.0f64; 13];
        for _ in 0..count {
            v[11] = 1.0;
            read_item(element, items, |_| false, |index, value| v[slots[index]] = value)?;
            self.positions.push(DVec3::new(v[0], v[1], v[2]));
            if has_normals {
                self.normals.push(DVec3::new(v[3], v[4], v[5]).normalize_or_zero().as_vec3());
            }
            if has_uvs {
                self.uvs.push(Vec2::new(v[6] as f32, v[7] as f32));
            }
            if has_colors {
                let channel = |k: usize| channel(element, rgb[k], v[8 + k]);
                let a = match alpha.map(|i| element.properties[i].scalar) {
                    Some(scalar) => v[11] / scalar.full(),
                    None => 1.0,
                };
                self.colors.push(Vec4::new(channel(0), channel(1), channel(2), a.clamp(0.0, 1.0) as f32));
            }
        }
        Ok(())
    }
}

/// A colour channel as linear light: whole numbers are sRGB-encoded, floats linear already.
fn channel(element: &Element, index: Option<usize>, value: f64) -> f32 {
    match index.map(|i| element.properties[i].scalar) {
        Some(Scalar::U8) => srgb::srgb_to_linear(value as u8),
        Some(scalar @ (Scalar::F32 | Scalar::F64)) => (value / scalar.full()).max(0.0) as f32,
        Some(scalar) => srgb::decode((value / scalar.full()).clamp(0.0, 1.0)) as f32,
        None => 1.0,
    }
}

/// The face and tristrips elements.
#[derive(Default)]
struct Faces {
    triangles: Vec<[u32; 3]>,
    /// Faces with fewer than three corners.
    small: u64,
}

impl Faces {
    fn read(&mut self, element: &Element, items: &mut impl Items, positions: &[DVec3]) -> Placeless<()> {
        let list = indices(element)?;
        // Bounded by the size of the file: `read` has compared them.
        let count = element.count as usize;
        self.triangles = items.triangles(element, count);
        if let Some(index) = self.triangles.iter().flatten().find(|&&i| i as usize >= positions.len()) {
            return Err(past(f64::from(*index), positions.len()));
        }
        let mut corners = Vec::new();
        let (mut around, mut parts) = (Vec::new(), Vec::new());
        for _ in self.triangles.len()..count {
            read_list(element, items, list, &mut corners)?;
            let corners = whole(&corners, positions.len())?;
            match corners[..] {
                [a, b, c] => self.triangles.push([a, b, c]),
                [_, _, _, _, ..] => {
                    around.clear();
                    around.extend(corners.iter().map(|&i| positions[i as usize]));
                    parts.clear();
                    polygon::triangulate(&around, &mut parts)
                        .ok_or_else(|| format!("a face with {} corners is too concave to split", corners.len()))?;
                    self.triangles.extend(parts.iter().map(|t| t.map(|k| corners[k as usize])));
                }
                _ => self.small += 1,
            }
        }
        Ok(())
    }

    /// Strips of triangles, one after the other in each list; -1 ends a strip.
    fn read_strips(&mut self, element: &Element, items: &mut impl Items, positions: &[DVec3]) -> Placeless<()> {
        let list = indices(element)?;
        let mut values = Vec::new();
        for _ in 0..element.count {
            read_list(element, items, list, &mut values)?;
            for strip in values.split(|&i| i == -1.0) {
                let strip = whole(strip, positions.len())?;
                self.triangles.extend(strip.windows(3).enumerate().filter_map(|(k, w)| {
                    // Every other triangle turns the other way; strips are stitched with triangles without area.
                    let triangle = if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
                    (w[0] != w[1] && w[1] != w[2] && w[0] != w[2]).then_some(triangle)
                }));
            }
        }
        Ok(())
    }
}

/// Whether the header gives an element what the mesh needs of it.
fn check_properties(element: &Element) -> Placeless<()> {
    match element.name.as_str() {
        "vertex" => coordinates(element).map(drop),
        "face" | "tristrips" => indices(element).map(drop),
        _ => Ok(()),
    }
}

/// The properties x, y and z.
fn coordinates(element: &Element) -> Placeless<[usize; 3]> {
    match ["x", "y", "z"].map(|axis| element.index(&[axis])) {
        [Some(x), Some(y), Some(z)] => Ok([x, y, z]),
        _ => Err("element vertex needs the properties x, y and z".into()),
    }
}

/// The list of corners among an element's properties.
fn indices(element: &Element) -> Placeless<usize> {
    let names = ["vertex_indices", "vertex_index"];
    let index = element.properties.iter().position(|p| p.list.is_some() && names.contains(&p.name.as_str()));
    index.ok_or_else(|| format!("element {} needs the list property {}", element.name, names[0]))
}

/// Values as indices of vertices.
fn whole(values: &[f64], count: usize) -> Placeless<Vec<u32>> {
    let index = |&value: &f64| {
        let inside = value >= 0.0 && value < count as f64 && value < f64::from(u32::MAX) && value.fract() == 0.0;
        if inside { Ok(value as u32) } else { Err(past(value, count)) }
    };
    values.iter().map(index).collect()
}

fn past(index: f64, count: usize) -> String {
    format!("index {index} is not one of the {count} vertices (the element vertex comes first)")
}
