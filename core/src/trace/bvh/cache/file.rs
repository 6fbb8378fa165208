//! The file: a header, a table, and arrays, each with its digest.
//!
//! ```text
//! header        72 bytes: see `Header`
//! table         of each array its length in bytes and its digest
//! arrays        in order, each at the next multiple of 64, zeros between
//! ```
//!
//! Where an array lies follows from the lengths before it, so nothing can overlap or point out of the file. Numbers are
//! as the processor has them, so that arrays are used where they lie; a file of another byte order is refused.

use std::fs::File;
use std::io::Write;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use bytemuck::{AnyBitPattern, Pod, Zeroable};

use super::digest::{self, Digest};
use crate::error::{Error, Result};
use crate::memory::{Array, Mapped};
use crate::output;
use crate::trace::bvh::block::Block;
use crate::trace::bvh::node::Node;

/// Not text, not cut at its seventh bit, line ends as they were: damage that is done in transfers shows here.
const MAGIC: [u8; 8] = *b"\x89BVH\r\n\x1a\n";

/// To be raised whenever what is stored changes, or what it means, or how trees are built.
const VERSION: u32 = 4;

const BYTE_ORDER: u32 = 0x0102_0304;

/// Where arrays begin: a cache line, as nodes ask for.
const ALIGNMENT: usize = 64;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Header {
    magic: [u8; 8],
    version: u32,
    byte_order: u32,
    /// Bytes of a node and of a block.
    sizes: [u32; 2],
    /// How many arrays there are.
    arrays: u64,
    /// Bytes of the file.
    length: u64,
    /// What the trees are of.
    key: Digest,
    /// Of the header without this, and of the table.
    digest: Digest,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Entry {
    bytes: u64,
    digest: Digest,
}

impl Header {
    fn new(key: &Digest, arrays: usize, length: usize) -> Self {
        Self {
            magic: MAGIC,
            version: VERSION,
            byte_order: BYTE_ORDER,
            sizes: [size_of::<Node>() as u32, size_of::<Block>() as u32],
            arrays: arrays as u64,
            length: length as u64,
            key: *key,
            digest: [0; 16],
        }
    }

    fn digest(&self, table: &[u8]) -> Digest {
        let bare = Self { digest: [0; 16], ..*self };
        digest::of_few(&[bytemuck::bytes_of(&bare), table].concat())
    }
}

/// Where arrays of these lengths lie, behind a table of them, and the length of the file; none where that is more than
/// can be.
fn places(lengths: impl ExactSizeIterator<Item = u64>) -> Option<(Vec<Range<usize>>, usize)> {
    let mut end = size_of::<Header>().checked_add(lengths.len().checked_mul(size_of::<Entry>())?)?;
    let mut places = Vec::with_capacity(lengths.len());
    for length in lengths {
        let first = end.checked_next_multiple_of(ALIGNMENT)?;
        end = first.checked_add(usize::try_from(length).ok()?)?;
        places.push(first..end);
    }
    Some((places, end))
}

/// Writes a file whole or not at all, and says how long it is.
///
/// # Errors
/// [`Error::Output`].
pub(super) fn write(path: &Path, key: &Digest, arrays: &[&[u8]]) -> Result<u64> {
    let failed = |error: std::io::Error| Error::output(path, error.to_string());
    let lengths = arrays.iter().map(|bytes| bytes.len() as u64);
    let (places, length) = places(lengths).ok_or_else(|| Error::output(path, "the tree is too large for a file"))?;
    let entry = |bytes: &&[u8]| Entry { bytes: bytes.len() as u64, digest: digest::of(bytes) };
    let table: Vec<Entry> = arrays.iter().map(entry).collect();
    let table: &[u8] = bytemuck::cast_slice(&table);
    let header = Header::new(key, arrays.len(), length);
    let header = Header { digest: header.digest(table), ..header };
    output::write_passing(path, |part| {
        // A pipe in the file's place would have to be written to directly, and wait for a reader.
        if part == path {
            return Err(Error::output(path, "is a device or a pipe; remove it"));
        }
        let mut file = File::create(part).map_err(failed)?;
        let mut written = size_of::<Header>() + table.len();
        file.write_all(&[bytemuck::bytes_of(&header), table].concat()).map_err(failed)?;
        for (place, bytes) in places.iter().zip(arrays) {
            file.write_all(&[0; ALIGNMENT][..place.start - written]).map_err(failed)?;
            file.write_all(bytes).map_err(failed)?;
            written = place.end;
        }
        Ok(())
    })?;
    Ok(length as u64)
}

/// A file that is whole.
pub(super) struct Arrays {
    file: Arc<Mapped<'static>>,
    places: Vec<Range<usize>>,
}

impl Arrays {
    /// Checks that a file is of this format and `key`, has `arrays` arrays, and is as it was written; none where there
    /// is no file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(super) fn open(path: &Path, key: &Digest, arrays: usize) -> std::result::Result<Option<Self>, String> {
        let file = match Mapped::open(path) {
            Ok(file) => file,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(format!("cannot be read: {error}")),
        };
        let header = file.get(..size_of::<Header>()).ok_or("is too short for a header")?;
        let header: Header = bytemuck::pod_read_unaligned(header);
        let expected = Header::new(key, arrays, file.len());
        if header.magic != MAGIC {
            return Err("is no file of this program".to_owned());
        }
        if header.byte_order != BYTE_ORDER {
            return Err("is of another byte order".to_owned());
        }
        if (header.version, header.sizes) != (VERSION, expected.sizes) {
            return Err(format!("is of version {}, or layout, other than this program's {VERSION}", header.version));
        }
        if header.key != *key {
            return Err("belongs to other triangles or another preset".to_owned());
        }
        if header.length != expected.length {
            return Err(format!("has {} bytes, where it says {}", file.len(), header.length));
        }
        if header.arrays != expected.arrays {
            return Err(format!("has {} arrays, where {arrays} are needed", header.arrays));
        }
        let table = size_of::<Header>()..size_of::<Header>() + arrays * size_of::<Entry>();
        let table = file.get(table).ok_or("is too short for its table")?;
        if header.digest != header.digest(table) {
            return Err("has a damaged header".to_owned());
        }
        let entries: Vec<Entry> = table.chunks_exact(size_of::<Entry>()).map(bytemuck::pod_read_unaligned).collect();
        let (places, length) = places(entries.iter().map(|entry| entry.bytes)).ok_or("has impossible lengths")?;
        if length != file.len() {
            return Err(format!("has {} bytes, where its arrays need {length}", file.len()));
        }
        let mut end = size_of::<Header>() + table.len();
        for (place, entry) in places.iter().zip(&entries) {
            if file[end..place.start].iter().any(|&byte| byte != 0) {
                return Err(format!("is damaged before byte {}", place.start));
            }
            if digest::of(&file[place.clone()]) != entry.digest {
                return Err(format!("is damaged between bytes {} and {}", place.start, place.end));
            }
            end = place.end;
        }
        Ok(Some(Self { file: Arc::new(file), places }))
    }

    /// Bytes of the file.
    pub(super) fn len(&self) -> u64 {
        self.file.len() as u64
    }

    /// An array, where it lies.
    ///
    /// # Errors
    /// Where it is not one of T.
    pub(super) fn get<T: AnyBitPattern>(&self, index: usize) -> std::result::Result<Array<T>, String> {
        let place = self.places.get(index).cloned();
        let array = place.and_then(|place| Array::mapped(&self.file, place));
        array.ok_or_else(|| format!("has no array {index} of this kind"))
    }
}
