//! A parsed file with its buffers, and what lies in them.

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::uri::{self, Target};
use super::{meshopt, schema};
use crate::error::{Error, Result, Warning, system_message};
use crate::io::Placeless;
use crate::memory::Mapped;

/// A parsed file with its buffers.
pub(super) struct Document<'a> {
    pub(super) path: &'a Path,
    pub(super) root: schema::Root,
    buffers: Vec<Bytes<'a>>,
    /// The contents of buffer views that are compressed, once they were asked for.
    decoded: Vec<OnceCell<Vec<u8>>>,
    /// Accessors without data that were asked for, and the bytes that they stand for.
    zeros: RefCell<HashSet<usize>>,
    zero_bytes: Cell<u64>,
    /// Bytes that meshes have taken so far, and the most they may.
    taken: Cell<u64>,
    most: u64,
}

/// The bytes of a buffer.
enum Bytes<'a> {
    /// None, in place of what is compressed elsewhere.
    Fallback,
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
            Self::Memory(_) | Self::Fallback => None,
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
            Self::Fallback => &[],
        }
    }
}

impl<'a> Document<'a> {
    /// Opens the buffers of a parsed file, of which `binary` is the chunk of a GLB.
    pub(super) fn open(
        path: &'a Path,
        root: schema::Root,
        file: &'a Mapped<'a>,
        binary: Option<&'a [u8]>,
    ) -> Result<Self> {
        let decoded = root.buffer_views.iter().map(|_| OnceCell::new()).collect();
        let mut document = Self {
            path,
            root,
            buffers: Vec::new(),
            decoded,
            zeros: RefCell::default(),
            zero_bytes: Cell::new(0),
            taken: Cell::new(0),
            // Decoding makes data a few times larger, sharing between primitives a few times more; a file far beyond
            // that is made to exhaust memory.
            most: (1 << 28) + 64 * file.len() as u64,
        };
        for index in 0..document.root.buffers.len() {
            let buffer = document.open_buffer(index, binary.map(|bytes| (file, bytes)))?;
            document.most += 64 * buffer.len() as u64;
            document.buffers.push(buffer);
        }
        Ok(document)
    }

    /// The files that it names, used or not, as far as they are there.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let schema::Root { buffers, images, .. } = &self.root;
        let uris = buffers.iter().filter_map(|buffer| buffer.uri.as_ref());
        let uris = uris.chain(images.iter().filter_map(|image| image.uri.as_ref()));
        let file = |uri: &String| match uri::resolve(self.path, uri) {
            Ok(Target::File(file)) if file.is_file() => Some(file),
            _ => None,
        };
        uris.filter(|uri| !uri.starts_with("data:")).filter_map(file).collect()
    }

    pub(super) fn error(&self, pointer: impl Into<String>, message: impl Into<String>) -> Error {
        Error::input(self.path, pointer, message)
    }

    pub(super) fn warning(&self, pointer: impl Into<String>, message: impl Into<String>) -> Warning {
        Warning::new(self.path, pointer, message)
    }

    /// An error unless `index` is below `count`.
    pub(super) fn check_index(&self, pointer: &str, index: usize, count: usize, what: &str) -> Result<()> {
        if index < count {
            return Ok(());
        }
        Err(self.error(pointer, format!("there is no {what} {index}; there are {count}")))
    }

    fn open_buffer(&self, index: usize, binary: Option<(&'a Mapped<'a>, &'a [u8])>) -> Result<Bytes<'a>> {
        let buffer = &self.root.buffers[index];
        let pointer = format!("/buffers/{index}/uri");
        if self.is_fallback(index) {
            return Ok(Bytes::Fallback);
        }
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

    /// Whether a buffer stands in for readers that cannot decompress: it says so, or it has no bytes and all that lies
    /// in it is compressed.
    fn is_fallback(&self, index: usize) -> bool {
        let buffer = &self.root.buffers[index];
        let mut views = self.root.buffer_views.iter().filter(|view| view.buffer == index).peekable();
        let is_empty = buffer.uri.is_none() && index > 0 && views.peek().is_some();
        meshopt::is_fallback(&buffer.extensions)
            // Where it does not say how, that is what is wrong.
            || is_empty && views.all(|view| !matches!(meshopt::compressed(&view.extensions), Ok(None)))
    }

    /// The file that a buffer view is mapped from.
    pub(super) fn view_file(&self, index: usize) -> Option<&Mapped<'_>> {
        let view = self.root.buffer_views.get(index)?;
        let is_compressed = self.decoded.get(index).is_some_and(|decoded| decoded.get().is_some());
        self.buffers.get(view.buffer).filter(|_| !is_compressed).and_then(Bytes::file)
    }

    /// The bytes of a buffer view, decompressed, and its stride.
    pub(super) fn view(&self, index: usize) -> Placeless<(&[u8], Option<usize>)> {
        let views = &self.root.buffer_views;
        let view =
            views.get(index).ok_or_else(|| format!("there is no buffer view {index}; there are {}", views.len()))?;
        let stride = match view.byte_stride {
            Some(stride) if !(4..=252).contains(&stride) || stride % 4 != 0 => {
                let rule = "it has to be a multiple of 4 from 4 to 252";
                return Err(format!("buffer view {index} has the stride {stride}; {rule}"));
            }
            stride => stride.map(|s| s as usize),
        };
        let bytes = match meshopt::compressed(&view.extensions)? {
            None => self.range(index, view.buffer, view.byte_offset, view.byte_length)?,
            Some(compressed) => self.decoded(index, &compressed, view.byte_length)?,
        };
        Ok((bytes, stride))
    }

    /// The contents of a compressed buffer view, which are decoded the first time.
    fn decoded(&self, index: usize, compressed: &meshopt::Compressed, length: u64) -> Placeless<&[u8]> {
        let cell = self.decoded.get(index).ok_or("a buffer view that is not there")?;
        if let Some(bytes) = cell.get() {
            return Ok(bytes);
        }
        let source = self.range(index, compressed.buffer, compressed.byte_offset, compressed.byte_length)?;
        self.take(compressed.size(length)?)?;
        let bytes = compressed.decode(source).map_err(|message| format!("buffer view {index}: {message}"))?;
        Ok(cell.get_or_init(|| bytes))
    }

    /// A part of a buffer, for the buffer view `index`.
    fn range(&self, index: usize, buffer: usize, from: u64, length: u64) -> Placeless<&[u8]> {
        let found = self.buffers.get(buffer);
        let found = found.ok_or_else(|| format!("buffer view {index} lies in buffer {buffer}, which is not there"))?;
        let end = from.checked_add(length);
        let bytes = end.and_then(|end| found.get(usize::try_from(from).ok()?..usize::try_from(end).ok()?));
        bytes.ok_or_else(|| {
            format!("buffer view {index} takes {length} bytes from {from} on, past its buffer's {}", found.len())
        })
    }

    /// Counts bytes that an accessor without data stands for, up to `most` of all of them: once, for whoever makes
    /// memory of them counts that besides.
    pub(super) fn spend_zeros(&self, accessor: usize, bytes: u64, most: u64) -> Placeless<()> {
        if self.zeros.borrow_mut().insert(accessor) {
            self.zero_bytes.set(self.zero_bytes.get().saturating_add(bytes));
        }
        if self.zero_bytes.get() > most {
            return Err(format!("accessors without data stand for more than {most} bytes"));
        }
        Ok(())
    }

    /// How many bytes may still be taken.
    pub(super) fn left(&self) -> u64 {
        self.most.saturating_sub(self.taken.get())
    }

    /// Counts bytes that something at `pointer` is about to take.
    pub(super) fn spend(&self, pointer: &str, bytes: u64) -> Result<()> {
        self.take(bytes).map_err(|message| self.error(pointer, message))
    }

    fn take(&self, bytes: u64) -> Placeless<()> {
        self.taken.set(self.taken.get().saturating_add(bytes));
        if self.taken.get() > self.most {
            return Err(format!("the meshes share so much data that they take more than {} bytes", self.most));
        }
        Ok(())
    }
}
