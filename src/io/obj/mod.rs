//! Wavefront OBJ with MTL (Wavefront 1995, *Advanced Visualizer manual*, appendix B).
//!
//! Reading takes four steps, of which all but the third run in parallel over stretches of whole lines: statements are
//! counted, so that each stretch knows its first line and what relative indices count from ([`stretch`]); they are read
//! into lists ([`statement`]); materials, smoothing groups and names, which hold until they are changed, are carried
//! from stretch to stretch ([`Obj::new`]); lists become meshes ([`build`]), one for each material of an object. Faces
//! may name vertices that come after them, so their indices are compared with the counts at the end.
//!
//! Read: v (with colours, sRGB-encoded as Blender and MeshLab write them), vt, vn, f, o, g, s, usemtl, mtllib. Points
//! and lines have no area and are counted in a warning; curves and surfaces are named in one.

mod build;
mod mtl;
mod statement;
mod stretch;

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use self::statement::{Faces, Part, Slots};
use super::text::{quoted, without_mark};
use crate::error::{Error, Result, Warning};
use crate::math::{DVec3, Vec2, Vec3};
use crate::memory;
use crate::memory::Mapped;
use crate::scene::Scene;

/// Stands for an index that is not given.
const NONE: u32 = u32::MAX;

/// A file's lists.
struct Obj {
    positions: Vec<DVec3>,
    /// Linear; as many as positions, or none at all.
    colors: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// Of each stretch.
    faces: Vec<Faces>,
    /// One for each material that a face has, in each object.
    sections: Vec<Section>,
}

/// The faces of one material in one object.
struct Section {
    /// What `usemtl` said; empty before the first.
    material: String,
    /// Of the object; outside of objects, of the group of the first face.
    name: String,
    /// Not empty, in the order of the file.
    pieces: Vec<Piece>,
}

/// Faces of one stretch that follow each other.
struct Piece {
    /// Index into [`Obj::faces`].
    stretch: usize,
    /// Of the stretch's corners.
    corners: Range<usize>,
    /// Smoothing group; 0 is flat.
    smoothing: u32,
}

/// Statements that were left out, or are doubtful: how many, and the first one's line and word.
#[derive(Clone, Default)]
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

    fn warn(parts: &[Part], of: impl Fn(&Part) -> &Self, path: &Path, warnings: &mut Vec<Warning>, what: &str) {
        if let Some(Self { line, word, .. }) = parts.iter().map(&of).find(|skipped| skipped.count > 0) {
            let count: usize = parts.iter().map(|part| of(part).count).sum();
            let message = format!("{count} {what} left out, the first of them {word}");
            warnings.push(Warning::new(path, format!("line {line}"), message));
        }
    }
}

/// Reads an OBJ file, and the MTL files it names.
pub(super) fn load(path: &Path, file: &Mapped<'_>, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let stretches = stretch::divide(without_mark(file));
    let (begins, counts) = stretch::begins(&stretches);
    let mut positions: Vec<DVec3> = memory::zeroed(counts[0]);
    let mut uvs: Vec<Vec2> = memory::zeroed(counts[1]);
    let mut normals: Vec<Vec3> = memory::zeroed(counts[2]);
    let slots = Slots::divide(&mut positions, &mut uvs, &mut normals, &begins, counts);
    let tasks = stretches.par_iter().zip(&begins).zip(slots);
    let parts: Vec<_> = tasks
        .map(|((text, begin), slots)| {
            let part = Part::read(text, begin, slots);
            file.done(text);
            part
        })
        .collect();
    // The first error is the one that is told.
    let parts = parts.into_iter().collect::<std::result::Result<Vec<Part>, (usize, String)>>();
    let parts = parts.map_err(|(line, message)| Error::input(path, format!("line {line}"), message))?;
    check_indices(path, &parts, counts)?;
    Skipped::warn(&parts, |part| &part.flat_elements, path, warnings, "points or lines, which have no area,");
    Skipped::warn(&parts, |part| &part.small_faces, path, warnings, "faces with fewer than 3 corners");
    Skipped::warn(&parts, |part| &part.unknown, path, warnings, "statements that this reader does not know");
    if let Some(line) = parts.iter().find(|part| part.bright.count > 0).map(|part| part.bright.line) {
        let count: usize = parts.iter().map(|part| part.bright.count).sum();
        let message = format!(
            "{count} colours are above 1, which is full strength, and are taken for 1; bytes have to be divided by 255"
        );
        warnings.push(Warning::new(path, format!("line {line}"), message));
    }
    let mut library = mtl::Library::default();
    let mut known: Vec<&str> = Vec::new();
    for (line, name) in parts.iter().flat_map(|part| &part.libraries) {
        if !known.contains(&name.as_str()) {
            known.push(name);
            library.read(path, *line, name, warnings)?;
        }
    }
    build::scene(path, Obj::new(parts, positions, uvs, normals), library, warnings)
}

fn check_indices(path: &Path, parts: &[Part], counts: [usize; 3]) -> Result<()> {
    for (k, what) in ["vertex", "texture coordinate", "normal"].into_iter().enumerate() {
        // The first of the highest.
        let highest = parts.iter().filter_map(|part| part.highest[k]);
        let highest = highest.reduce(|high, next| if next.0 > high.0 { next } else { high });
        if let Some((index, line)) = highest.filter(|(index, _)| *index as usize >= counts[k]) {
            let message = format!("index {} is past the last {what}, {}", u64::from(index) + 1, counts[k]);
            return Err(Error::input(path, format!("line {line}"), message));
        }
    }
    Ok(())
}

impl Obj {
    /// Carries what holds until it is changed from stretch to stretch, and sorts the faces by object and material.
    fn new(parts: Vec<Part>, positions: Vec<DVec3>, uvs: Vec<Vec2>, normals: Vec<Vec3>) -> Self {
        let mut sections: Vec<Section> = Vec::new();
        let mut known: HashMap<[String; 2], usize> = HashMap::new();
        // The object and the material, and what the group is called.
        let (mut key, mut group, mut smoothing) = <([String; 2], String, u32)>::default();
        for (stretch, part) in parts.iter().enumerate() {
            let mut begin = 0;
            for run in &part.runs {
                for (name, index) in key.iter_mut().chain([&mut group]).zip([run.object, run.material, run.group]) {
                    if let Some(index) = index {
                        name.clone_from(&part.names[index as usize]);
                    }
                }
                smoothing = run.smoothing.unwrap_or(smoothing);
                let corners = begin..run.end;
                begin = run.end;
                if corners.is_empty() {
                    continue;
                }
                let section = match known.get(&key) {
                    Some(&section) => section,
                    None => {
                        known.insert(key.clone(), sections.len());
                        let [object, material] = key.clone();
                        let name = if object.is_empty() { group.clone() } else { object };
                        sections.push(Section { material, name, pieces: Vec::new() });
                        sections.len() - 1
                    }
                };
                sections[section].pieces.push(Piece { stretch, corners, smoothing });
            }
        }
        let mut colors = Vec::new();
        if parts.iter().any(|part| !part.colors.is_empty()) {
            colors.reserve_exact(positions.len());
            for part in &parts {
                colors.extend_from_slice(&part.colors);
                colors.resize(colors.len() + part.positions - part.colors.len(), Vec3::ONE);
            }
        }
        let faces = parts.into_iter().map(|part| part.faces).collect();
        Self { positions, colors, uvs, normals, faces, sections }
    }
}
