//! PLY, text and binary of either byte order (Turk 1994, *The PLY polygon file format*).
//!
//! The header says what the file holds ([`header`]); the rest is read element by element. Binary values are read where
//! they lie in the mapped file ([`binary`]), text word by word ([`ascii`]); both hand the same [`Items`] to what builds
//! the mesh ([`vertices`], [`faces`]), or several where faces have different textures ([`wedges`], [`textures`]).
//! Elements and properties that a mesh has no use for are skipped by their declared sizes.
//!
//! What nearly every large file is made of, binary records of one size, is read in parallel; whatever differs is left
//! to the general code, item by item.

mod ascii;
mod binary;
mod color;
mod faces;
mod header;
mod item;
mod textures;
mod vertices;
mod wedges;

use std::path::Path;

use self::faces::Faces;
use self::header::{Element, Encoding, Header, Scalar};
use self::item::Item;
use self::vertices::{Layout, Vertices};
use self::wedges::{AtOnce, Part, Wedges};
use crate::error::{Error, Result, Warning};
use crate::io::{Placeless, Promised};
use crate::memory::Mapped;
use crate::scene::Scene;

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
    /// All triangles at once with what they have of their own, where the faces are records of one size, and all indices
    /// are below `vertices`.
    fn wedges(&mut self, _element: &Element, _wanted: &Wedges, _vertices: usize) -> Option<AtOnce> {
        None
    }
}

/// Reads a PLY file.
pub(super) fn load(path: &Path, file: &Mapped<'_>, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let header = header::parse(path, file)?;
    let begin = header.length;
    let parts = match header.encoding {
        Encoding::Ascii => read(path, &header, ascii::Ascii::new(file, begin, header.lines + 1), warnings)?,
        Encoding::Little => read(path, &header, binary::Binary::<false>::new(file, begin), warnings)?,
        Encoding::Big => read(path, &header, binary::Binary::<true>::new(file, begin), warnings)?,
    };
    textures::scene(path, &header, parts, warnings)
}

/// What the header says of vertices and faces, if the file may hold as many. A face is a triangle at least; of how many
/// in a binary file its length tells, where nothing but the faces' corners is of an unknown size.
pub(super) fn promised(path: &Path, file: &Mapped<'_>) -> Option<Promised> {
    let header = header::parse(path, file).ok()?;
    let count = |name: &str| header.element(name).map_or(0, |element| element.count);
    let (vertices, faces) = (count("vertex"), count("face"));
    // No item takes less than a byte, in either encoding.
    if vertices.checked_add(faces)? > file.len() as u64 {
        return None;
    }
    // A polygon is cut into two triangles fewer than it has corners.
    let cut = corners(&header, file.len() as u64).and_then(|corners| corners.checked_sub(faces.checked_mul(2)?));
    let triangles = cut.unwrap_or(0).max(faces);
    Some(Promised { triangles, bytes: (vertices + triangles) * size_of::<[u32; 3]>() as u64 })
}

/// Corners of all faces of a binary file of so many bytes: what is left when all else is taken away; none if that is
/// not known. What follows the last element, with a warning later, counts as well.
fn corners(header: &Header, bytes: u64) -> Option<u64> {
    let faces = header.element("face").filter(|_| header.encoding != Encoding::Ascii)?;
    let lists = |element: &Element| element.properties.iter().filter(|property| property.list.is_some()).count();
    if header.elements.iter().map(lists).sum::<usize>() != 1 {
        return None;
    }
    let corner = faces.properties.iter().find(|property| property.list.is_some())?.scalar.size() as u64;
    let least = |element: &Element| element.count.checked_mul(element.least_bytes() as u64);
    let mut left = bytes.checked_sub(header.length as u64)?;
    for element in &header.elements {
        left = left.checked_sub(least(element)?)?;
    }
    Some(left / corner)
}

fn read(path: &Path, header: &Header, mut items: impl Items, warnings: &mut Vec<Warning>) -> Result<Vec<Part>> {
    let mut vertices = Vertices::default();
    let mut faces = Faces::new(header);
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
            _ => {
                let mut item = Item::of(element);
                (0..element.count).try_for_each(|_| item.read(element, &mut items, &[]))
            }
        };
        result.map_err(|message| Error::input(path, items.place(), message))?;
    }
    if items.rest() > 0 {
        let message = format!("{} bytes after the last element that the header declares are ignored", items.rest());
        warnings.push(Warning::new(path, items.place(), message));
    }
    if let Some((element, message)) = wedges::left_out(header) {
        warnings.push(Warning::new(path, format!("line {}", element.line), message));
    }
    if faces.triangles.is_empty() && faces.small == 0 && vertices.positions.len() > 0 {
        let message =
            format!("{} vertices without faces: points have no area; make a surface of them", vertices.positions.len());
        warnings.push(Warning::new(path, "", message));
    }
    if let Some(odd) = faces.wedges.as_ref().map(|wedges| wedges.odd).filter(|odd| *odd > 0) {
        let message = format!("{odd} faces whose texcoord has not two numbers for each corner are without coordinates");
        warnings.push(Warning::new(path, "", message));
    }
    if faces.small > 0 {
        let message = format!("{} faces with fewer than 3 corners are left out", faces.small);
        warnings.push(Warning::new(path, "", message));
    }
    Ok(match faces.wedges {
        Some(wedges) => wedges.parts(vertices, faces.triangles),
        None => vec![Part { mesh: vertices.mesh(faces.triangles), texture: Some(0) }],
    })
}

/// Whether the header gives an element what the mesh needs of it.
fn check_properties(element: &Element) -> Placeless<()> {
    match element.name.as_str() {
        "vertex" => Layout::new(element).map(drop),
        "face" | "tristrips" => faces::indices(element).map(drop),
        _ => Ok(()),
    }
}
