//! Wavefront OBJ with MTL (Wavefront 1995, *Advanced Visualizer manual*, appendix B).
//!
//! Reading takes two steps: statements become lists ([`Obj`]), then lists become meshes ([`build`]), one for each
//! material. Faces may name vertices that come after them, so their indices are compared with the counts at the end.
//!
//! Read: v (with colours, sRGB-encoded as Blender and MeshLab write them), vt, vn, f, o, g, s, usemtl, mtllib. Points
//! and lines have no area and are counted in a warning; curves and surfaces are named in one.

mod build;
mod mtl;

use std::collections::HashMap;
use std::path::Path;

use super::text::{Lines, Words, name, number, quoted};
use crate::error::{Error, Result, Warning};
use crate::image::srgb;
use crate::io::Placeless;
use crate::math::{DVec3, Vec2, Vec3};
use crate::scene::Scene;

/// Stands for an index that is not given.
const NONE: u32 = u32::MAX;

/// A file's lists.
#[derive(Default)]
struct Obj {
    positions: Vec<DVec3>,
    /// Linear; as many as positions, or none at all.
    colors: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// One for each material in use.
    sections: Vec<Section>,
    /// The highest index in a face, and its line: of positions, uvs and normals.
    highest: [Option<(u32, usize)>; 3],
}

/// The faces of one material.
#[derive(Default)]
struct Section {
    /// What `usemtl` said; empty before the first.
    material: String,
    /// The object or group of the first face.
    name: String,
    corners: Vec<Corner>,
    faces: Vec<Face>,
}

/// Indices from 0 into positions, uvs and normals; the latter two may be [`NONE`].
#[derive(Clone, Copy, Debug, PartialEq)]
struct Corner([u32; 3]);

/// So many of the section's corners, in order.
#[derive(Clone, Copy)]
struct Face {
    corners: u32,
    /// Smoothing group; 0 is flat.
    smoothing: u32,
    line: u32,
}

/// What the statements so far have set.
#[derive(Default)]
struct State {
    section: usize,
    /// The section of each material.
    known: HashMap<String, usize>,
    name: String,
    smoothing: u32,
    libraries: Vec<(usize, String)>,
    flat_elements: Skipped,
    small_faces: Skipped,
    unknown: Skipped,
}

/// Statements that were left out: how many, and the first one's line and word.
#[derive(Default)]
struct Skipped {
    count: usize,
    line: usize,
    word: String,
}

impl Skipped {
    fn add(&mut self, line: usize, word: &[u8]) {
        self.count += 1;
        if self.count == 1 {
            (self.line, self.word) = (line, quoted(word));
        }
    }

    fn warn(&self, path: &Path, warnings: &mut Vec<Warning>, what: &str) {
        if self.count > 0 {
            let message = format!("{} {what} left out, the first of them {}", self.count, self.word);
            warnings.push(Warning::new(path, format!("line {}", self.line), message));
        }
    }
}

/// Reads an OBJ file, and the MTL files it names.
pub(super) fn load(path: &Path, bytes: &[u8], warnings: &mut Vec<Warning>) -> Result<Scene> {
    let mut obj = Obj::default();
    obj.sections.push(Section::default());
    let mut state = State { known: HashMap::from([(String::new(), 0)]), ..State::default() };
    for (line, text) in Lines::new(bytes) {
        obj.statement(&mut state, line, &text)
            .map_err(|message| Error::input(path, format!("line {line}"), message))?;
    }
    obj.check_indices(path)?;
    state.flat_elements.warn(path, warnings, "points or lines, which have no area,");
    state.small_faces.warn(path, warnings, "faces with fewer than 3 corners");
    state.unknown.warn(path, warnings, "statements that this reader does not know");
    let mut library = mtl::Library::default();
    for (line, file) in &state.libraries {
        library.read(path, *line, file, warnings)?;
    }
    build::scene(path, obj, library, warnings)
}

impl Obj {
    fn statement(&mut self, state: &mut State, line: usize, text: &[u8]) -> Placeless<()> {
        let mut words = Words::new(text, line);
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            b"v" => self.vertex(&mut words)?,
            b"vt" => {
                let u = words.number().ok_or("vt needs a number, the texture coordinate u")?;
                let v = words.next().map_or(Some(0.0), number).ok_or("vt: v is not a number")?;
                self.uvs.push(Vec2::new(u, v));
            }
            b"vn" => {
                let normal = three(&mut words).ok_or("vn needs 3 numbers, x y z")?;
                self.normals.push(normal.normalize_or_zero().as_vec3());
            }
            b"f" => self.face(state, line, &mut words)?,
            b"o" | b"g" => state.name = name(words.rest()),
            b"s" => {
                state.smoothing = match words.next() {
                    None | Some(b"off") => 0,
                    Some(b"on") => 1,
                    Some(word) => number(word).ok_or_else(|| {
                        format!("s {} is not a smoothing group; write a number, on or off", quoted(word))
                    })?,
                }
            }
            b"usemtl" => {
                let material = name(words.rest());
                state.section = *state.known.entry(material).or_insert_with_key(|material| {
                    self.sections.push(Section { material: material.clone(), ..Section::default() });
                    self.sections.len() - 1
                });
            }
            b"mtllib" => {
                let file = name(words.rest());
                if state.libraries.iter().all(|(_, known)| *known != file) {
                    state.libraries.push((line, file));
                }
            }
            b"p" | b"l" => state.flat_elements.add(line, keyword),
            _ if keyword.starts_with(b"#") => {}
            _ => state.unknown.add(line, keyword),
        }
        Ok(())
    }

    /// `x y z`, `x y z w` or `x y z r g b`.
    fn vertex(&mut self, words: &mut Words<'_>) -> Placeless<()> {
        let position = three(words).ok_or("v needs 3 numbers, x y z")?;
        self.positions.push(position);
        let mut rest = [0.0f32; 3];
        let mut count = 0;
        for (value, word) in rest.iter_mut().zip(words.take_while(|word| !word.starts_with(b"#"))) {
            *value = number(word).ok_or_else(|| format!("{} is not a number", quoted(word)))?;
            count += 1;
        }
        if count == 3 {
            self.colors.resize(self.positions.len() - 1, Vec3::ONE);
            self.colors.push(Vec3::from(rest.map(|c| srgb::decode(f64::from(c).clamp(0.0, 1.0)) as f32)));
        } else if !self.colors.is_empty() {
            self.colors.push(Vec3::ONE);
        }
        Ok(())
    }

    fn face(&mut self, state: &mut State, line: usize, words: &mut Words<'_>) -> Placeless<()> {
        let counts = [self.positions.len(), self.uvs.len(), self.normals.len()];
        let section = &mut self.sections[state.section];
        let begin = section.corners.len();
        for word in words {
            if word.starts_with(b"#") {
                break;
            }
            let corner = corner(word, counts)?;
            for (highest, index) in self.highest.iter_mut().zip(corner.0) {
                if index != NONE && highest.is_none_or(|(i, _)| index > i) {
                    *highest = Some((index, line));
                }
            }
            section.corners.push(corner);
        }
        let corners = section.corners.len() - begin;
        if corners < 3 {
            section.corners.truncate(begin);
            state.small_faces.add(line, b"f");
            return Ok(());
        }
        if section.faces.is_empty() {
            section.name.clone_from(&state.name);
        }
        // Both fit: a corner takes 2 bytes of a line, a line 1 byte of the file, and `check_indices` refuses larger files.
        section.faces.push(Face { corners: corners as u32, smoothing: state.smoothing, line: line as u32 });
        Ok(())
    }

    fn check_indices(&self, path: &Path) -> Result<()> {
        let counts = [self.positions.len(), self.uvs.len(), self.normals.len()];
        for ((highest, count), what) in self.highest.iter().zip(counts).zip(["vertex", "texture coordinate", "normal"])
        {
            if let Some((index, line)) = highest.filter(|(i, _)| *i as usize >= count) {
                let message = format!("index {} is past the last {what}, {count}", u64::from(index) + 1);
                return Err(Error::input(path, format!("line {line}"), message));
            }
        }
        Ok(())
    }
}

fn three(words: &mut Words<'_>) -> Option<DVec3> {
    Some(DVec3::new(words.number()?, words.number()?, words.number()?))
}

/// `v`, `v/vt`, `v//vn` or `v/vt/vn`; indices count from 1, or from -1 backwards.
fn corner(word: &[u8], counts: [usize; 3]) -> Placeless<Corner> {
    let mut corner = Corner([NONE; 3]);
    let mut parts = word.split(|&b| b == b'/');
    for ((index, count), part) in corner.0.iter_mut().zip(counts).zip(&mut parts) {
        if !part.is_empty() {
            *index = resolve(part, count).map_err(|problem| format!("corner {}: {problem}", quoted(word)))?;
        }
    }
    if corner.0[0] == NONE || parts.next().is_some() {
        return Err(format!("corner {} is not of the form v, v/vt, v//vn or v/vt/vn", quoted(word)));
    }
    Ok(corner)
}

fn resolve(digits: &[u8], count: usize) -> Placeless<u32> {
    let index: i64 = number(digits).ok_or("an index is not a whole number")?;
    let from_zero = match index {
        0 => return Err("index 0; OBJ counts from 1".into()),
        1.. => index - 1,
        _ => count as i64 + index,
    };
    if from_zero < 0 {
        return Err(format!("index {index} is before the first; there are {count} so far"));
    }
    u32::try_from(from_zero)
        .ok()
        .filter(|&i| i != NONE)
        .ok_or_else(|| format!("index {index} is past the last of {count}"))
}
