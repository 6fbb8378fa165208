//! The statements of one stretch.

use std::collections::HashMap;

use super::stretch::Begin;
use super::{NONE, Skipped};
use crate::image::srgb;
use crate::io::Placeless;
use crate::io::number::whole;
use crate::io::text::{Lines, Words, name, number, quoted};
use crate::math::{DVec3, Vec2, Vec3};

/// The places of a stretch's vertices in the file's lists.
pub(super) struct Slots<'a> {
    positions: &'a mut [DVec3],
    uvs: &'a mut [Vec2],
    normals: &'a mut [Vec3],
}

/// Corners of faces, and the shape of faces that are not triangles.
#[derive(Default)]
pub(super) struct Faces {
    /// Indices from 0 into positions.
    pub(super) positions: Vec<u32>,
    /// For each corner, into texture coordinates and normals, or [`NONE`]; empty where no corner has any.
    pub(super) attributes: Vec<[u32; 2]>,
    /// Faces with more than three corners, in order.
    pub(super) polygons: Vec<Polygon>,
}

/// A face with more than three corners.
pub(super) struct Polygon {
    /// Its first corner.
    pub(super) first: usize,
    pub(super) corners: usize,
    pub(super) line: usize,
}

/// Faces under one state. What is none holds on from before.
#[derive(Clone, Default)]
pub(super) struct Run {
    /// Indices into [`Part::names`].
    pub(super) material: Option<u32>,
    /// Of the object (`o`).
    pub(super) object: Option<u32>,
    /// Of the group (`g`).
    pub(super) group: Option<u32>,
    pub(super) smoothing: Option<u32>,
    /// Where it ends among the corners; it begins where the one before ends.
    pub(super) end: usize,
}

/// What a stretch holds.
#[derive(Default)]
pub(super) struct Part {
    /// How many.
    pub(super) positions: usize,
    /// Linear; empty, or up to the last that has a colour.
    pub(super) colors: Vec<Vec3>,
    pub(super) faces: Faces,
    pub(super) runs: Vec<Run>,
    /// Of materials, objects and groups.
    pub(super) names: Vec<String>,
    /// The highest index in a face, and its line: of positions, uvs and normals.
    pub(super) highest: [Option<(u32, usize)>; 3],
    /// Names of material libraries, and their lines.
    pub(super) libraries: Vec<(usize, String)>,
    /// Colours above 1.
    pub(super) bright: Skipped,
    pub(super) flat_elements: Skipped,
    pub(super) small_faces: Skipped,
    pub(super) unknown: Skipped,
}

impl<'a> Slots<'a> {
    /// The places of all stretches, which begin as given, in lists of these lengths.
    pub(super) fn divide(
        mut positions: &'a mut [DVec3],
        mut uvs: &'a mut [Vec2],
        mut normals: &'a mut [Vec3],
        begins: &[Begin],
        counts: [usize; 3],
    ) -> Vec<Self> {
        let ends = begins.iter().skip(1).map(|begin| begin.counts).chain([counts]);
        let lengths = begins.iter().zip(ends).map(|(begin, end)| [0, 1, 2].map(|k| end[k] - begin.counts[k]));
        let slots = lengths.map(|[p, t, n]| Self {
            positions: positions.split_off_mut(..p).unwrap_or_default(),
            uvs: uvs.split_off_mut(..t).unwrap_or_default(),
            normals: normals.split_off_mut(..n).unwrap_or_default(),
        });
        slots.collect()
    }
}

/// A stretch while it is read.
struct Reader<'a> {
    slots: Slots<'a>,
    /// Positions, texture coordinates and normals of the whole file so far.
    counts: [usize; 3],
    begin: Begin,
    part: Part,
    /// The faces that are being read.
    run: Run,
    known: HashMap<String, u32>,
}

impl Part {
    /// Reads a stretch.
    ///
    /// # Errors
    /// The line and what is wrong with it.
    pub(super) fn read(text: &[u8], begin: &Begin, slots: Slots<'_>) -> Result<Self, (usize, String)> {
        let (part, run, known) = (Self::default(), Run::default(), HashMap::new());
        let mut reader = Reader { slots, counts: begin.counts, begin: *begin, part, run, known };
        for (line, text) in Lines::new(text) {
            let line = begin.line + line;
            reader.statement(line, &text).map_err(|message| (line, message))?;
        }
        let Reader { mut part, run, counts, .. } = reader;
        part.positions = counts[0] - begin.counts[0];
        part.runs.push(run);
        Ok(part)
    }
}

impl Reader<'_> {
    fn statement(&mut self, line: usize, text: &[u8]) -> Placeless<()> {
        let mut words = Words::new(text, line);
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            b"v" => self.vertex(line, &mut words)?,
            b"vt" => {
                let u = words.number().ok_or("vt needs a number, the texture coordinate u")?;
                let v = words.next().filter(|word| !word.starts_with(b"#"));
                let v = v.map_or(Some(0.0), number).ok_or("vt: v is not a number")?;
                self.slots.uvs[self.counts[1] - self.begin.counts[1]] = Vec2::new(u, v);
                self.counts[1] += 1;
            }
            b"vn" => {
                let normal = three("vn", &mut words)?;
                self.slots.normals[self.counts[2] - self.begin.counts[2]] = normal.normalize_or_zero().as_vec3();
                self.counts[2] += 1;
            }
            b"f" => self.face(line, &mut words)?,
            b"o" => {
                let name = self.name(name(words.rest()));
                self.change().object = Some(name);
            }
            b"g" => {
                let name = self.name(name(words.rest()));
                self.change().group = Some(name);
            }
            b"s" => {
                let group = match words.next() {
                    None => 0,
                    Some(word) if [&b"off"[..], b"null"].iter().any(|off| word.eq_ignore_ascii_case(off)) => 0,
                    Some(word) if word.eq_ignore_ascii_case(b"on") => 1,
                    Some(word) => number(word).ok_or_else(|| {
                        format!("s {} is not a smoothing group; write a number, on or off", quoted(word))
                    })?,
                };
                self.change().smoothing = Some(group);
            }
            b"usemtl" => {
                let name = self.name(name(words.rest()));
                self.change().material = Some(name);
            }
            b"mtllib" => {
                let file = name(words.rest());
                if self.part.libraries.iter().all(|(_, known)| *known != file) {
                    self.part.libraries.push((line, file));
                }
            }
            b"p" | b"l" => self.part.flat_elements.add(line, keyword),
            _ if keyword.starts_with(b"#") => {}
            _ => self.part.unknown.add(line, keyword),
        }
        Ok(())
    }

    /// The index of a name.
    fn name(&mut self, name: String) -> u32 {
        *self.known.entry(name).or_insert_with_key(|name| {
            self.part.names.push(name.clone());
            self.part.names.len() as u32 - 1
        })
    }

    /// The state of the faces that follow.
    fn change(&mut self) -> &mut Run {
        let end = self.part.faces.positions.len();
        let begin = self.part.runs.last().map_or(0, |run| run.end);
        if end > begin {
            self.part.runs.push(Run { end, ..self.run.clone() });
            // What holds on is in the run before.
            self.run = Run { end, ..Run::default() };
        }
        &mut self.run
    }

    /// `x y z`, `x y z w` or `x y z r g b`.
    fn vertex(&mut self, line: usize, words: &mut Words<'_>) -> Placeless<()> {
        let position = three("v", words)?;
        let index = self.counts[0] - self.begin.counts[0];
        self.slots.positions[index] = position;
        self.counts[0] += 1;
        let mut rest = [0.0f32; 3];
        let mut count = 0;
        for (value, word) in rest.iter_mut().zip(words.take_while(|word| !word.starts_with(b"#"))) {
            *value = number(word).ok_or_else(|| format!("{} is not a number", quoted(word)))?;
            count += 1;
        }
        if count == 3 {
            if rest.iter().any(|&channel| channel > 1.0) {
                self.part.bright.add(line, b"v");
            }
            self.part.colors.resize(index, Vec3::ONE);
            self.part.colors.push(Vec3::from(rest.map(|c| srgb::decode(f64::from(c).clamp(0.0, 1.0)) as f32)));
        }
        Ok(())
    }

    fn face(&mut self, line: usize, words: &mut Words<'_>) -> Placeless<()> {
        let faces = &mut self.part.faces;
        let first = faces.positions.len();
        loop {
            let corner = match words.read(plain_corner) {
                Some(corner) => corner,
                None => match words.next() {
                    Some(word) if !word.starts_with(b"#") => corner(word, self.counts)?,
                    _ => break,
                },
            };
            for (highest, index) in self.part.highest.iter_mut().zip(corner) {
                if index != NONE && highest.is_none_or(|(i, _)| index > i) {
                    *highest = Some((index, line));
                }
            }
            let [position, attributes @ ..] = corner;
            if attributes != [NONE; 2] {
                faces.attributes.resize(faces.positions.len(), [NONE; 2]);
                faces.attributes.push(attributes);
            }
            faces.positions.push(position);
        }
        let corners = faces.positions.len() - first;
        if corners < 3 {
            faces.positions.truncate(first);
            faces.attributes.truncate(first);
            self.part.small_faces.add(line, b"f");
        } else if corners > 3 {
            faces.polygons.push(Polygon { first, corners, line });
        }
        if !faces.attributes.is_empty() {
            faces.attributes.resize(faces.positions.len(), [NONE; 2]);
        }
        self.run.end = faces.positions.len();
        Ok(())
    }
}

fn three(keyword: &str, words: &mut Words<'_>) -> Placeless<DVec3> {
    let mut next = || {
        words.number_or_word().map_err(|word| {
            let found = word.map_or(String::new(), |word| format!(", and {} is none", quoted(word)));
            format!("{keyword} needs 3 numbers, x y z{found}")
        })
    };
    Ok(DVec3::new(next()?, next()?, next()?))
}

/// `v`, `v/vt`, `v//vn` or `v/vt/vn`; indices count from 1, or from -1 backwards.
fn corner(word: &[u8], counts: [usize; 3]) -> Placeless<[u32; 3]> {
    let mut corner = [NONE; 3];
    let mut parts = word.split(|&b| b == b'/');
    for ((index, count), part) in corner.iter_mut().zip(counts).zip(&mut parts) {
        if !part.is_empty() {
            *index = resolve(part, count).map_err(|problem| format!("corner {}: {problem}", quoted(word)))?;
        }
    }
    if corner[0] == NONE || parts.next().is_some() {
        return Err(format!("corner {} is not of the form v, v/vt, v//vn or v/vt/vn", quoted(word)));
    }
    Ok(corner)
}

/// The corner that a text begins with, and its length in bytes, where its indices are a few plain digits from 1 up, as
/// nearly all are.
#[inline]
fn plain_corner(text: &[u8]) -> Option<([u32; 3], usize)> {
    let index = |from: usize| match whole(&text[from..], 0) {
        (index @ 1.., digits @ 1..=9) => Some((index as u32 - 1, from + digits)),
        _ => None,
    };
    let is_slash = |at: usize| text.get(at) == Some(&b'/');
    let mut corner = [NONE; 3];
    let mut end;
    (corner[0], end) = index(0)?;
    if is_slash(end) {
        // None between two slashes.
        if !is_slash(end + 1) {
            (corner[1], end) = index(end + 1)?;
        } else {
            end += 1;
        }
        if is_slash(end) {
            (corner[2], end) = index(end + 1)?;
        }
    }
    Some((corner, end))
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
