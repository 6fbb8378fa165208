//! PLY, text and binary of either byte order (Turk 1994, *The PLY polygon file format*).
//!
//! The header says what the file holds ([`header`]); the rest is read element by element. Binary values are read where
//! they lie in the mapped file ([`binary`]), text word by word ([`ascii`]); both hand the same [`Items`] to what builds
//! the mesh ([`vertices`], [`faces`]). Elements and properties that a mesh has no use for are skipped by their declared
//! sizes.
//!
//! What nearly every large file is made of, binary records of one size, is read in parallel; whatever differs is left to
//! the general code, item by item.

mod ascii;
mod binary;
mod faces;
mod header;
mod vertices;

use std::path::Path;
use std::sync::Arc;

use self::faces::Faces;
use self::header::{Element, Encoding, Header, Scalar};
use self::vertices::{Layout, Positions, Vertices};
use crate::error::{Error, Result, Warning};
use crate::io::{Placeless, Promised, texture};
use crate::math::Vec3;
use crate::memory::Mapped;
use crate::scene::{Geometry, Material, Mesh, Scene, Texture, Wrap};

/// Items that are read one by one until the file is told.
const TELL: usize = 1 << 16;

/// Where elements come from: the rest of the file, in either encoding.
trait Items {
    /// Where reading is, for messages: `byte 80` or `line 12`.
    fn place(&self) -> String;
    /// Bytes that are left.
    fn remaining(&self) -> usize;
    /// Bytes after the last item, white space apart.
    fn rest(&self) -> usize;
    /// The fewest bytes that an item of this element takes.
    fn least_size(&self, element: &Element) -> usize;
    /// Tells the file how far reading is; called every [`TELL`] items.
    fn tell(&mut self);
    /// The next value.
    fn scalar(&mut self, scalar: Scalar) -> Placeless<f64>;
    /// All vertices at once where they are records of one size. There is room for all of them.
    fn vertices(&mut self, _element: &Element, _layout: &Layout) -> Option<Vertices> {
        None
    }
    /// All triangles at once where the faces are records of one size, up to the first that is not, or that has an index
    /// not below `vertices`.
    fn triangles(&mut self, _element: &Element, _vertices: usize) -> Vec<[u32; 3]> {
        Vec::new()
    }
}

/// Reads a PLY file.
pub(super) fn load(path: &Path, file: &Mapped<'_>, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let header = header::parse(path, file)?;
    let begin = header.length;
    let mesh = match header.encoding {
        Encoding::Ascii => read(path, &header, ascii::Ascii::new(file, begin, header.lines + 1), warnings)?,
        Encoding::Little => read(path, &header, binary::Binary::<false>::new(file, begin), warnings)?,
        Encoding::Big => read(path, &header, binary::Binary::<true>::new(file, begin), warnings)?,
    };
    let texture = texture_of(path, &header, &mesh, warnings)?;
    let is_plain = mesh.colors.is_empty() && texture.is_none();
    let base = if is_plain { Material::default().diffuse } else { Vec3::ONE };
    let diffuse_texture = texture.is_some().then_some(0);
    let material = Material { ambient: base, diffuse: base, diffuse_texture, ..Material::default() };
    let mut scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![material]);
    if let Some(texture) = texture {
        scene.files.push(texture::beside(path, &header.textures[0].1));
        scene.textures.push(Texture { wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, ..texture });
    }
    Ok(scene)
}

/// The picture that a comment names, for texture coordinates of vertices; a warning where it is left out.
fn texture_of(path: &Path, header: &Header, mesh: &Mesh, warnings: &mut Vec<Warning>) -> Result<Option<Texture>> {
    let [(line, name), ..] = &header.textures[..] else { return Ok(None) };
    let place = format!("line {line}");
    let of_faces = header.elements.iter().any(|element| element.name == "face" && element.has("texcoord"));
    let opened = if header.textures.len() > 1 {
        Err("several textures (TextureFile) are named, of which none is read".to_owned())
    } else if of_faces || mesh.uvs.is_empty() {
        let has = if of_faces { "faces have" } else { "vertices do not have" };
        Err(format!("texture {name:?} would need texture coordinates of vertices, and here {has} them"))
    } else {
        texture::open(&texture::beside(path, name)).map_err(|error| error.named_in(path, &place))?
    };
    let without = |why| warnings.push(Warning::new(path, place, format!("{why}; the mesh is rendered without it")));
    Ok(opened.map_err(without).ok())
}

/// What the header says of vertices and faces, if the file may hold as many; a face is a triangle at least.
pub(super) fn promised(path: &Path, file: &Mapped<'_>) -> Option<Promised> {
    let header = header::parse(path, file).ok()?;
    let count =
        |name: &str| header.elements.iter().find(|element| element.name == name).map_or(0, |element| element.count);
    let (vertices, triangles) = (count("vertex"), count("face"));
    let items = vertices.checked_add(triangles)?;
    // No item takes less than a byte, in either encoding.
    (items <= file.len() as u64).then(|| Promised { triangles, bytes: items * size_of::<[u32; 3]>() as u64 })
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
            "vertex" => Vertices::read(element, &mut items).map(|read| vertices = read),
            "face" => faces.read(element, &mut items, &vertices.positions),
            "tristrips" => faces.read_strips(element, &mut items, &vertices.positions),
            _ if least == 0 => Ok(()),
            _ => (0..element.count).try_for_each(|_| read_item(element, &mut items, |_| false, |_, _| ())),
        };
        result.map_err(|message| Error::input(path, items.place(), message))?;
    }
    if items.rest() > 0 {
        let message = format!("{} bytes after the last element that the header declares are ignored", items.rest());
        warnings.push(Warning::new(path, items.place(), message));
    }
    if let Some(element) = header.elements.iter().find(|e| e.name == "face" && ["red", "r"].iter().any(|r| e.has(r))) {
        let message = "colours of faces are not read, those of vertices are; the mesh is rendered without them";
        warnings.push(Warning::new(path, format!("line {}", element.line), message));
    }
    if faces.small > 0 {
        let message = format!("{} faces with fewer than 3 corners are left out", faces.small);
        warnings.push(Warning::new(path, "", message));
    }
    mesh.triangles = Arc::new(faces.triangles);
    match vertices.positions {
        Positions::Single(positions) => mesh.positions = Arc::new(positions),
        Positions::Double(positions) => mesh.set_positions(&positions),
    }
    (mesh.normals, mesh.uvs, mesh.colors) = (vertices.normals, vertices.uvs, vertices.colors);
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

/// Whether the header gives an element what the mesh needs of it.
fn check_properties(element: &Element) -> Placeless<()> {
    match element.name.as_str() {
        "vertex" => Layout::new(element).map(drop),
        "face" | "tristrips" => faces::indices(element).map(drop),
        _ => Ok(()),
    }
}
