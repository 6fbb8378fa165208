//! STL, text and binary (3D Systems 1989, *StereoLithography interface specification*).
//!
//! A file is a list of loose triangles. Corners that are equal to the bit become one vertex, so that the mesh is
//! connected as it was before it was written: it takes a third of the memory, and its triangles find each other's
//! corners in the cache. The facets' own normals are left unread: they only repeat the corners' order, or contradict
//! it.

use std::path::Path;
use std::sync::Arc;

use super::Promised;
use super::text::{Words, quoted, without_mark};
use super::weld::{Weld, weld};
use crate::error::{Error, Result, Warning};
use crate::math::{DVec3, Vec3};
use crate::memory::Mapped;
use crate::scene::{Geometry, Material, Mesh, Scene};

const HEADER: usize = 84;
const FACET: usize = 50;
/// Corners are numbered in 32 bits.
const MAX_FACETS: u64 = u32::MAX as u64 / 3;
/// Bytes of a text until the file is told that they have been read.
const TELL: usize = 1 << 21;

/// Reads an STL file.
pub(super) fn load(path: &Path, file: &Mapped<'_>, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let meshes = if is_text(file) { text(path, file, warnings)? } else { vec![binary(path, file, warnings)?] };
    Ok(Scene::from_geometries(meshes.into_iter().map(Geometry::Mesh).collect(), vec![Material::default()]))
}

/// Whether it is a text file. Binary files may begin with `solid` too, so their length is asked first; one whose length
/// is wrong is told by the word that must follow in a text.
fn is_text(bytes: &[u8]) -> bool {
    let fits = promised(bytes).is_some_and(|count| HEADER as u64 + count * FACET as u64 == bytes.len() as u64);
    let head = without_mark(&bytes[..bytes.len().min(1024)]);
    let has = |word: &[u8]| head.windows(word.len()).any(|w| w.eq_ignore_ascii_case(word));
    let begins = head.trim_ascii_start().get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    !fits && begins && (has(b"facet") || has(b"endsolid"))
}

/// The number of triangles that a binary header promises.
fn promised(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER - 4..)?.first_chunk()?;
    Some(u32::from_le_bytes(*count).into())
}

/// What the header of a binary file says, if the file has as much; neighbours share corners, which are left out of
/// account.
pub(super) fn promised_mesh(bytes: &[u8]) -> Option<Promised> {
    let triangles = promised(bytes).filter(|_| !is_text(bytes))?;
    let is_there = HEADER as u64 + triangles * FACET as u64 <= bytes.len() as u64;
    is_there.then(|| Promised { triangles, bytes: triangles * size_of::<[u32; 3]>() as u64 })
}

/// Whether it begins as a text does.
fn is_readable(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(512)];
    head.iter().all(|byte| matches!(byte, b'\t' | b'\n' | b'\r' | b' '..=b'~'))
}

fn binary(path: &Path, file: &Mapped<'_>, warnings: &mut Vec<Warning>) -> Result<Mesh> {
    let bytes: &[u8] = file;
    let there = (bytes.len().saturating_sub(HEADER) / FACET) as u64;
    if promised(bytes).is_none_or(|count| count > there) && is_readable(bytes) {
        let message = "is text, but no STL: that begins with \"solid\" and has \"facet\" or \"endsolid\" next";
        return Err(Error::input(path, "line 1", message));
    }
    let Some(count) = promised(bytes) else {
        let message = format!("is no STL file: neither text that begins with \"solid\" nor {HEADER} bytes long");
        return Err(Error::input(path, "byte 0", message));
    };
    if count > there {
        let message = format!("promises {count} triangles of {FACET} bytes, but the file has room for {there}");
        return Err(Error::input(path, "byte 80", message));
    }
    if count > MAX_FACETS {
        return Err(Error::input(
            path,
            "byte 80",
            format!("holds {count} triangles, more than {MAX_FACETS}; divide the file"),
        ));
    }
    let (facets, rest) = bytes[HEADER..].split_at(count as usize * FACET);
    if !rest.is_empty() {
        let message = format!("{} bytes after the last triangle are ignored", rest.len());
        warnings.push(Warning::new(path, format!("byte {}", bytes.len() - rest.len()), message));
    }
    let facets = facets.as_chunks::<FACET>().0;
    let corner = |at: &[u8; 12]| {
        // Adding 0 makes one zero of the two.
        let float = |k: usize| f32::from_le_bytes([at[k], at[k + 1], at[k + 2], at[k + 3]]) + 0.0;
        [float(0).to_bits(), float(4).to_bits(), float(8).to_bits()]
    };
    let corners = |i: usize| {
        let [_, _, _, _, _, _, _, _, _, _, _, _, corners @ .., _, _]: &[u8; FACET] = &facets[i];
        let (corners, _) = corners.as_chunks();
        [corner(&corners[0]), corner(&corners[1]), corner(&corners[2])]
    };
    let (triangles, positions) = weld(facets.len(), corners, |range| file.done(facets[range].as_flattened()));
    Ok(Mesh::new(vectors(positions), triangles))
}

/// Positions from their bits.
fn vectors(bits: Vec<[u32; 3]>) -> Vec<Vec3> {
    bits.into_iter().map(|bits| Vec3::from_array(bits.map(f32::from_bits))).collect()
}

/// A `solid` of a text.
struct Solid {
    name: String,
    corners: Weld<[u64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Solid {
    fn new(name: String) -> Self {
        Self { name, corners: Weld::new(), triangles: Vec::new() }
    }

    fn mesh(self) -> Mesh {
        let Self { name, corners, triangles } = self;
        let positions: Vec<_> =
            corners.into_keys().into_iter().map(|bits| DVec3::from(bits.map(f64::from_bits))).collect();
        let mut mesh = Mesh { name, triangles: Arc::new(triangles), ..Mesh::default() };
        mesh.set_positions(&positions);
        mesh
    }
}

/// A mesh a solid, but for those without a facet; at least one.
fn text(path: &Path, file: &Mapped<'_>, warnings: &mut Vec<Warning>) -> Result<Vec<Mesh>> {
    let bytes = without_mark(file);
    let mut told = 0;
    let mut words = Words::new(bytes, 1);
    let mut meshes = Vec::new();
    let mut solid = Solid::new(String::new());
    let mut is_open = false;
    while let Some(word) = words.next() {
        match word.to_ascii_lowercase().as_slice() {
            b"solid" => {
                is_open = true;
                let before = words.remaining();
                let text = &bytes[bytes.len() - before..];
                words.skip_line();
                let next = Solid::new(super::text::name(&text[..before - words.remaining()]));
                let last = std::mem::replace(&mut solid, next);
                if !last.triangles.is_empty() {
                    meshes.push(last.mesh());
                }
            }
            b"endsolid" => {
                is_open = false;
                words.skip_line();
            }
            b"facet" => {
                solid.triangles.push(facet(path, &mut words, &mut solid.corners)?);
                let read = bytes.len() - words.remaining();
                if read - told >= TELL {
                    file.done(&bytes[told..read]);
                    told = read;
                }
            }
            _ => return Err(unexpected(path, &words, Some(word), "facet, solid or endsolid")),
        }
    }
    if is_open {
        let message = "the file ends without endsolid: there may have been more of it";
        warnings.push(Warning::new(path, format!("line {}", words.line), message));
    }
    if meshes.is_empty() || !solid.triangles.is_empty() {
        meshes.push(solid.mesh());
    }
    Ok(meshes)
}

/// What follows the word `facet`: its corners, by number.
fn facet(path: &Path, words: &mut Words<'_>, corners: &mut Weld<[u64; 3]>) -> Result<[u32; 3]> {
    expect(path, words, "normal")?;
    // Not read: of a triangle without an area some programs write what is no number at all.
    for _ in 0..3 {
        words.next();
    }
    expect(path, words, "outer")?;
    expect(path, words, "loop")?;
    let mut triangle = [0; 3];
    for corner in &mut triangle {
        expect(path, words, "vertex")?;
        let mut bits = [0; 3];
        for b in &mut bits {
            *b = (number(path, words)? + 0.0).to_bits();
        }
        *corner = corners.index(bits);
    }
    expect(path, words, "endloop")?;
    expect(path, words, "endfacet")?;
    Ok(triangle)
}

fn expect(path: &Path, words: &mut Words<'_>, wanted: &str) -> Result<()> {
    let word = words.next();
    if word.is_some_and(|w| w.eq_ignore_ascii_case(wanted.as_bytes())) {
        return Ok(());
    }
    Err(unexpected(path, words, word, wanted))
}

fn number(path: &Path, words: &mut Words<'_>) -> Result<f64> {
    words.number_or_word().map_err(|word| unexpected(path, words, word, "a number"))
}

fn unexpected(path: &Path, words: &Words<'_>, word: Option<&[u8]>, wanted: &str) -> Error {
    let found = word.map_or("the file ends".to_string(), |w| format!("found {}", quoted(w)));
    Error::input(path, format!("line {}", words.line), format!("{found} where {wanted} belongs"))
}
