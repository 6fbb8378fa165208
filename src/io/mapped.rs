//! Files as slices of bytes, mapped into memory.
//!
//! A mapped file costs no copy and no allocation however large it is, which is what a 10 GB scan needs. Reading into a
//! buffer would be safe code, and would double the memory of every load.
#![allow(unsafe_code)] // Mapping is unsafe because another process may change the file; see `open`.

use std::fs::{self, File};
use std::io::{Error, ErrorKind, Result};
use std::ops::Deref;
use std::path::Path;

use memmap2::Mmap;

/// The bytes of a file.
#[derive(Debug)]
pub(crate) struct Mapped(Option<Mmap>);

impl Mapped {
    /// Maps a whole file. An empty file gives an empty slice.
    ///
    /// # Errors
    /// Whatever the system says; [`ErrorKind::IsADirectory`] for a directory, [`ErrorKind::InvalidInput`] for a pipe, a
    /// device or anything else that has no length.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        // Before it is opened: opening a pipe would wait for a writer.
        let kind = fs::metadata(path)?;
        if kind.is_dir() {
            return Err(Error::new(ErrorKind::IsADirectory, "is a directory, where a file is needed"));
        }
        if !kind.is_file() {
            return Err(Error::new(ErrorKind::InvalidInput, "is a device or a pipe, where a regular file is needed"));
        }
        if kind.len() == 0 {
            return Ok(Self(None));
        }
        let file = File::open(path)?;
        // SAFETY: the mapping is private and read-only, and `Mmap` keeps it alive as long as the slice. That nobody
        // shortens or rewrites the file meanwhile is left to whoever runs the program, as with every program that maps
        // its input: shortening ends it with SIGBUS, and rewriting can give other numbers, which the loaders' checks
        // (made on values they have copied out, or through bounds-checked indexing) keep from doing harm.
        let map = unsafe { Mmap::map(&file)? };
        Ok(Self(Some(map)))
    }
}

impl Deref for Mapped {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.0.as_deref().unwrap_or_default()
    }
}
