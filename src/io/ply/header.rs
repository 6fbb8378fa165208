//! The header of a PLY file: which elements, how many of each, with which properties.

use std::collections::HashSet;
use std::path::Path;

use crate::error::{Error, Result};
use crate::io::Placeless;
use crate::io::text::{Lines, Words, name, quoted, without_mark};

/// What the header says.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Bytes up to the end of the line `end_header`.
    pub(super) length: usize,
    /// Lines in it.
    pub(super) lines: usize,
    /// The pictures that comments name as textures, as MeshLab does, and their lines.
    pub(super) textures: Vec<(usize, String)>,
}

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// One kind of record.
#[derive(Debug, PartialEq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    /// The line that declares it.
    pub(super) line: usize,
    pub(super) properties: Vec<Property>,
}

/// A value or a list of values.
#[derive(Debug, PartialEq)]
pub(super) struct Property {
    pub(super) name: String,
    /// Of the value, or of each entry of the list.
    pub(super) scalar: Scalar,
    /// Of a list: how its length is written.
    pub(super) list: Option<Scalar>,
}

/// A type of number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    /// Not of the format's own, but what NumPy's whole numbers are written as.
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    fn named(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"int64" => Self::I64,
            b"uint64" => Self::U64,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    pub(super) const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The value that stands for the full strength of a colour.
    pub(super) fn full(self) -> f64 {
        match self {
            Self::I8 => f64::from(i8::MAX),
            Self::U8 => f64::from(u8::MAX),
            Self::I16 => f64::from(i16::MAX),
            Self::U16 => f64::from(u16::MAX),
            // Whoever writes 32 bits or more means bytes: nobody measures colours in billions.
            Self::I32 | Self::U32 | Self::I64 | Self::U64 => f64::from(u8::MAX),
            Self::F32 | Self::F64 => 1.0,
        }
    }
}

impl Header {
    /// The element of this name.
    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|element| element.name == name)
    }
}

impl Element {
    /// Bytes that an item takes in a binary file at least: where it has lists, with nothing in them.
    pub(super) fn least_bytes(&self) -> usize {
        self.properties.iter().map(|p| p.list.unwrap_or(p.scalar).size()).sum()
    }

    /// The first property that is a value and has one of the names.
    pub(super) fn index(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|p| p.list.is_none() && names.contains(&p.name.as_str()))
    }

    /// The first property that is a list and has one of the names.
    pub(super) fn list(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|p| p.list.is_some() && names.contains(&p.name.as_str()))
    }
}

/// Reads the header.
pub(super) fn parse(path: &Path, file: &[u8]) -> Result<Header> {
    let bytes = without_mark(file);
    let fail = |line: usize, message: String| Error::input(path, format!("line {line}"), message);
    // So that a binary file of another kind is not searched for lines.
    if !(bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r")) {
        return Err(fail(1, format!("found {} where \"ply\" belongs", quoted(&bytes[..bytes.len().min(8)]))));
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut textures = Vec::new();
    let mut last = 1;
    // Lines without joining: a comment may end in a backslash. All end as the first one does: behind a `\r` alone, with
    // which the format's author has them end, a binary body may begin with `\n`.
    let end = if bytes.starts_with(b"ply\r") && !bytes.starts_with(b"ply\r\n") { b'\r' } else { b'\n' };
    let mut length = file.len() - bytes.len();
    for (index, raw) in bytes.split_inclusive(|&b| b == end).enumerate() {
        length += raw.len();
        last = index + 1;
        let (line, text) = (last, Lines::new(raw).next().map(|(_, text)| text.into_owned()).unwrap_or_default());
        let mut words = Words::new(&text, line);
        match words.next() {
            None | Some(b"ply" | b"obj_info") => {}
            Some(b"comment") => {
                if words.next() == Some(b"TextureFile") && !words.rest().is_empty() {
                    textures.push((line, name(words.rest())));
                }
            }
            Some(b"format") => encoding = Some(format(&mut words).map_err(|message| fail(line, message))?),
            Some(b"element") => elements.push(element(&mut words, line).map_err(|message| fail(line, message))?),
            Some(b"property") => {
                let property = property(&mut words).map_err(|message| fail(line, message))?;
                let owner = elements.last_mut();
                owner
                    .ok_or_else(|| fail(line, "a property before the first element".into()))?
                    .properties
                    .push(property);
            }
            Some(b"end_header") => {
                let encoding = encoding.ok_or_else(|| fail(line, "the header has no format line".into()))?;
                if !elements.iter().any(|element| element.name == "vertex") {
                    return Err(fail(line, "the header has no element vertex".into()));
                }
                if let Some(twice) = repeated(&elements, |element| &element.name) {
                    return Err(fail(twice.line, format!("element {:?} is declared twice", twice.name)));
                }
                for element in &elements {
                    if let Some(twice) = repeated(&element.properties, |property| &property.name) {
                        let message = format!("element {:?} has two properties {:?}", element.name, twice.name);
                        return Err(fail(element.line, message));
                    }
                }
                return Ok(Header { encoding, elements, length, lines: line, textures });
            }
            Some(word) => return Err(fail(line, format!("{} is no statement of a PLY header", quoted(word)))),
        }
    }
    Err(fail(last, "the file ends within the header; end_header is missing".into()))
}

/// The first item whose name one before it has.
fn repeated<T>(items: &[T], name: impl Fn(&T) -> &str) -> Option<&T> {
    let mut seen = HashSet::new();
    items.iter().find(|&item| !seen.insert(name(item)))
}

fn format(words: &mut Words<'_>) -> Placeless<Encoding> {
    match words.next() {
        Some(b"ascii") => Ok(Encoding::Ascii),
        Some(b"binary_little_endian") => Ok(Encoding::Little),
        Some(b"binary_big_endian") => Ok(Encoding::Big),
        word => {
            let found = quoted(word.unwrap_or_default());
            Err(format!("format {found} is not one of ascii, binary_little_endian, binary_big_endian"))
        }
    }
}

fn element(words: &mut Words<'_>, line: usize) -> Placeless<Element> {
    let name = name(words.next().unwrap_or_default());
    let count = words.number().ok_or_else(|| format!("element {name:?} needs a count"))?;
    Ok(Element { name, count, line, properties: Vec::new() })
}

fn property(words: &mut Words<'_>) -> Placeless<Property> {
    let scalar = |words: &mut Words<'_>| {
        let word = words.next().unwrap_or_default();
        let known = Scalar::named(word);
        known.ok_or_else(|| {
            format!(
                "{} is no type; use char, uchar, short, ushort, int, uint, int64, uint64, float or double",
                quoted(word)
            )
        })
    };
    let is_list = Words::new(words.rest(), words.line).next() == Some(b"list");
    let list = if is_list {
        words.next();
        let counter = scalar(words)?;
        if matches!(counter, Scalar::F32 | Scalar::F64) {
            return Err("the length of a list cannot be a float; use uchar or int".into());
        }
        Some(counter)
    } else {
        None
    };
    let scalar = scalar(words)?;
    let name = words.next().map(name).ok_or("a property needs a name")?;
    Ok(Property { name, scalar, list })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_a_header() {
        let text = b"ply\r\nformat binary_big_endian 1.0\ncomment x\\\nelement vertex 12\nproperty double x\n\
            element face 3\nproperty list uchar int vertex_indices\nend_header\n\x01\n";
        let header = parse(Path::new("a.ply"), text).unwrap();
        assert_eq!((header.encoding, header.length, header.lines), (Encoding::Big, text.len() - 2, 8));
        let x = Property { name: "x".into(), scalar: Scalar::F64, list: None };
        assert_eq!(header.elements[0], Element { name: "vertex".into(), count: 12, line: 4, properties: vec![x] });
        assert_eq!(header.elements[1].properties[0].list, Some(Scalar::U8));
    }
}
