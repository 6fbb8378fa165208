//! Files as slices of bytes, mapped into memory.
//!
//! A mapped file costs no copy and no allocation however large it is, which is what a 10 GB scan needs, and loaders say
//! which part they are done with, so that it does not stand in memory beside the mesh that was made of it. Reading into
//! a buffer would be safe code, and costs thrice the time where the file is in the system's cache (measured: 0.045 s
//! against 0.016 s for 380 MB in windows).
#![allow(unsafe_code)] // Mapping is unsafe because another process may change the file; see `open`.

use std::fs::{self, File};
use std::io::{Error, ErrorKind, Result};
use std::ops::Deref;
use std::path::Path;

use memmap2::{Mmap, UncheckedAdvice};

/// What is told how many bytes have been read, from any thread.
type OnBytes<'a> = &'a (dyn Fn(u64) + Sync);

/// The bytes of a file.
pub struct Mapped<'a> {
    map: Option<Mmap>,
    on_bytes: Option<OnBytes<'a>>,
}

impl<'a> Mapped<'a> {
    /// Maps a whole file. An empty file gives an empty slice.
    ///
    /// # Errors
    /// Whatever the system says; [`ErrorKind::IsADirectory`] for a directory, [`ErrorKind::InvalidInput`] for a pipe, a
    /// device or anything else that has no length.
    pub fn open(path: &Path) -> Result<Self> {
        // Before it is opened: opening a pipe would wait for a writer.
        let kind = fs::metadata(path)?;
        if kind.is_dir() {
            return Err(Error::new(ErrorKind::IsADirectory, "is a directory, where a file is needed"));
        }
        if !kind.is_file() {
            return Err(Error::new(ErrorKind::InvalidInput, "is a device or a pipe, where a regular file is needed"));
        }
        if kind.len() == 0 {
            return Ok(Self { map: None, on_bytes: None });
        }
        let file = File::open(path)?;
        // SAFETY: the mapping is private and read-only, and `Mmap` keeps it alive as long as the slice. That nobody
        // shortens or rewrites the file meanwhile is left to whoever runs the program, as with every program that maps
        // its input: shortening ends it with SIGBUS, and rewriting can give other numbers, which the loaders' checks
        // (made on values they have copied out, or through bounds-checked indexing) keep from doing harm; a tree that
        // is used where it lies is only indexed with bounds checked, too.
        let map = unsafe { Mmap::map(&file)? };
        Ok(Self { map: Some(map), on_bytes: None })
    }

    /// The same file, which tells of the bytes that are read.
    pub fn watched(self, on_bytes: Option<OnBytes<'a>>) -> Self {
        Self { on_bytes, ..self }
    }

    /// Says that `part` has been read: its pages need not stay in memory. Reading it again is slower, and right.
    /// A part of something else is only counted.
    pub fn done(&self, part: &[u8]) {
        if let Some(on_bytes) = self.on_bytes {
            on_bytes(part.len() as u64);
        }
        const PAGE: usize = 4096;
        let begin = part.as_ptr().addr();
        // From the page that the part begins in, which is shared with what was read before at most, to the last that
        // it fills.
        let offset = begin.checked_sub(self.as_ptr().addr()).map(|offset| offset / PAGE * PAGE);
        let end = begin.checked_add(part.len()).and_then(|end| end.checked_sub(self.as_ptr().addr()));
        if let (Some(map), Some(offset), Some(end)) = (&self.map, offset, end)
            && end <= map.len()
            && let end = end / PAGE * PAGE
            && end > offset
        {
            // SAFETY: the range lies within the mapping, which is of a file, private and never written: pages that are
            // dropped come back with the file's contents when they are touched. A refusal changes nothing.
            let _ = unsafe { map.unchecked_advise_range(UncheckedAdvice::DontNeed, offset, end - offset) };
        }
    }
}

impl Deref for Mapped<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.map.as_deref().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn what_was_let_go_reads_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let bytes: Vec<u8> = (0..100_000u32).map(|i| (i * 7 % 251) as u8).collect();
        fs::write(folder.path().join("a"), &bytes).unwrap();
        let read = AtomicU64::new(0);
        let on_bytes = |n| {
            read.fetch_add(n, Ordering::Relaxed);
        };
        let file = Mapped::open(&folder.path().join("a")).unwrap().watched(Some(&on_bytes));
        for part in [0..100_000, 1..5000, 5000..5001, 4096..8192, 70_000..100_000, 9..9] {
            file.done(&file[part]);
            assert_eq!(file[..], bytes);
        }
        // Memory of something else is left alone.
        let other = vec![1u8; 100_000];
        file.done(&other);
        assert!(other.iter().all(|&b| b == 1));
        assert_eq!(read.into_inner(), 100_000 + 4999 + 1 + 4096 + 30_000 + 100_000);
    }
}
