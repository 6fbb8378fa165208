//! glTF 2.0 and GLB (Khronos Group 2021, *glTF 2.0 specification*).
//!
//! The JSON is read into [`schema`], buffers are mapped or decoded ([`Document`]), and from then on every index is
//! compared with what it points into at the moment it is used, so that each error has its JSON pointer and nothing
//! unused is refused. A mesh becomes a group, each primitive with area a geometry of it, each node with a mesh an
//! instance.
//!
//! Not rendered, and told in warnings: animation poses other than the rest pose, points and lines.

mod accessor;
mod container;
mod extension;
mod material;
mod mesh;
mod node;
mod phong;
mod schema;
mod uri;

use std::cell::Cell;
use std::path::Path;

use self::uri::Target;
use super::{Placeless, system_message};
use crate::error::{Error, Result, Warning};
use crate::memory::Mapped;
use crate::scene::Scene;

/// The extensions that are honoured; a file that requires another is refused.
pub(super) const SUPPORTED_EXTENSIONS: [&str; 7] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
];

/// A parsed file with its buffers.
struct Document<'a> {
    path: &'a Path,
    root: schema::Root,
    buffers: Vec<Bytes<'a>>,
    /// Bytes that accessors without data stand for so far.
    zeros: Cell<u64>,
    /// Bytes that meshes have taken so far, and the most they may.
    taken: Cell<u64>,
    most: u64,
}

/// The bytes of a buffer.
enum Bytes<'a> {
    /// A part of the GLB file.
    Part(&'a Mapped<'a>, &'a [u8]),
    /// A file of its own.
    File(Mapped<'a>),
    Memory(Vec<u8>),
}

impl Bytes<'_> {
    /// The file that they are mapped from.
    fn file(&self) -> Option<&Mapped<'_>> {
        match self {
            Self::Part(file, _) => Some(file),
            Self::File(file) => Some(file),
            Self::Memory(_) => None,
        }
    }
}

impl std::ops::Deref for Bytes<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Part(_, bytes) => bytes,
            Self::File(bytes) => bytes,
            Self::Memory(bytes) => bytes,
        }
    }
}

/// Reads a glTF or GLB file.
pub(super) fn load(path: &Path, file: &Mapped<'_>, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let parts = container::split(file).map_err(|(place, message)| Error::input(path, place, message))?;
    let root: schema::Root = serde_json::from_slice(parts.json).map_err(|e| {
        let place = format!("line {}, column {}", e.line(), e.column());
        // The place is in the library's own message too.
        let message = e.to_string();
        let short = message.split(" at line ").next().unwrap_or_default();
        Error::input(path, place, format!("not valid glTF: {short}"))
    })?;
    check_version(path, &root, warnings)?;
    let mut document = Document {
        path,
        root,
        buffers: Vec::new(),
        zeros: Cell::new(0),
        taken: Cell::new(0),
        // Decoding makes data a few times larger, sharing between primitives a few times more; a file far beyond that
        // is made to exhaust memory.
        most: (1 << 28) + 64 * file.len() as u64,
    };
    for index in 0..document.root.buffers.len() {
        let buffer = document.open_buffer(index, parts.binary.map(|bytes| (file, bytes)))?;
        document.most += 64 * buffer.len() as u64;
        document.buffers.push(buffer);
    }
    let mut scene = Scene::default();
    let mut materials = material::Materials::new(&document);
    let groups = mesh::groups(&document, &mut materials, &mut scene, warnings)?;
    materials.finish(&mut scene, warnings);
    node::place(&document, &groups, &mut scene, warnings)?;
    Ok(scene)
}

fn check_version(path: &Path, root: &schema::Root, warnings: &mut Vec<Warning>) -> Result<()> {
    if !root.asset.version.starts_with("2.") {
        let message = format!("glTF version {:?}; only 2.x can be read", root.asset.version);
        return Err(Error::input(path, "/asset/version", message));
    }
    let is_unknown = |name: &&String| !SUPPORTED_EXTENSIONS.contains(&name.as_str());
    if let Some(index) = root.extensions_required.iter().position(|name| is_unknown(&name)) {
        let message = format!(
            "requires the extension {:?}, which is not supported; supported are {}",
            root.extensions_required[index],
            SUPPORTED_EXTENSIONS.join(", ")
        );
        return Err(Error::input(path, format!("/extensionsRequired/{index}"), message));
    }
    let unknown: Vec<&str> = root.extensions_used.iter().filter(is_unknown).map(String::as_str).collect();
    if !unknown.is_empty() {
        let message = format!("uses extensions that are not supported and left out: {}", unknown.join(", "));
        warnings.push(Warning::new(path, "/extensionsUsed", message));
    }
    Ok(())
}

impl<'a> Document<'a> {
    fn error(&self, pointer: impl Into<String>, message: impl Into<String>) -> Error {
        Error::input(self.path, pointer, message)
    }

    fn warning(&self, pointer: impl Into<String>, message: impl Into<String>) -> Warning {
        Warning::new(self.path, pointer, message)
    }

    /// An error unless `index` is below `count`.
    fn check_index(&self, pointer: &str, index: usize, count: usize, what: &str) -> Result<()> {
        if index < count {
            return Ok(());
        }
        Err(self.error(pointer, format!("there is no {what} {index}; there are {count}")))
    }

    fn open_buffer(&self, index: usize, binary: Option<(&'a Mapped<'a>, &'a [u8])>) -> Result<Bytes<'a>> {
        let buffer = &self.root.buffers[index];
        let pointer = format!("/buffers/{index}/uri");
        let bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => match uri::resolve(self.path, uri).map_err(|m| self.error(&pointer, m))? {
                Target::Data(bytes) => Bytes::Memory(bytes),
                Target::File(file) => {
                    let opened = Mapped::open(&file);
                    let say = |e| self.error(&pointer, format!("{}: {}", file.display(), system_message(&e)));
                    Bytes::File(opened.map_err(say)?)
                }
            },
            (None, Some((file, bytes))) if index == 0 => Bytes::Part(file, bytes),
            (None, _) => return Err(self.error(pointer, "the buffer has neither a URI nor a binary chunk of a GLB")),
        };
        if buffer.byte_length > bytes.len() as u64 {
            let message = format!("the buffer promises {} bytes, but has {}", buffer.byte_length, bytes.len());
            return Err(self.error(format!("/buffers/{index}/byteLength"), message));
        }
        Ok(bytes)
    }

    /// The file that a buffer view is mapped from.
    fn view_file(&self, index: usize) -> Option<&Mapped<'_>> {
        self.root.buffer_views.get(index).and_then(|view| self.buffers.get(view.buffer)).and_then(Bytes::file)
    }

    /// The bytes of a buffer view, and its stride.
    fn view(&self, index: usize) -> Placeless<(&[u8], Option<usize>)> {
        let views = &self.root.buffer_views;
        let view =
            views.get(index).ok_or_else(|| format!("there is no buffer view {index}; there are {}", views.len()))?;
        let buffer = self.buffers.get(view.buffer);
        let buffer =
            buffer.ok_or_else(|| format!("buffer view {index} lies in buffer {}, which is not there", view.buffer))?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes = end.and_then(|end| buffer.get(usize::try_from(view.byte_offset).ok()?..usize::try_from(end).ok()?));
        let bytes = bytes.ok_or_else(|| {
            let (from, length) = (view.byte_offset, view.byte_length);
            format!("buffer view {index} takes {length} bytes from {from} on, past its buffer's {}", buffer.len())
        })?;
        match view.byte_stride {
            Some(stride) if !(4..=252).contains(&stride) || stride % 4 != 0 => {
                Err(format!("buffer view {index} has the stride {stride}; it has to be a multiple of 4 from 4 to 252"))
            }
            stride => Ok((bytes, stride.map(|s| s as usize))),
        }
    }

    /// Counts bytes that accessors without data stand for, up to `most`.
    fn spend_zeros(&self, bytes: u64, most: u64) -> Placeless<()> {
        self.zeros.set(self.zeros.get().saturating_add(bytes));
        if self.zeros.get() > most {
            return Err(format!("accessors without data stand for more than {most} bytes"));
        }
        Ok(())
    }

    /// Counts bytes that a mesh is about to take.
    fn spend(&self, pointer: &str, bytes: u64) -> Result<()> {
        self.taken.set(self.taken.get().saturating_add(bytes));
        if self.taken.get() > self.most {
            let message = format!("the meshes share so much data that they take more than {} bytes", self.most);
            return Err(self.error(pointer, message));
        }
        Ok(())
    }
}
