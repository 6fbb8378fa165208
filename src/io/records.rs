//! Records of one size, read in parallel from where they lie in the file.
//!
//! Each task reads a stretch of some thousand records into its place in the result and lets the file's pages go, so
//! that the result is the same for any number of threads and the file takes no memory beside it.

use std::sync::atomic::{AtomicUsize, Ordering};

use bytemuck::Zeroable;
use rayon::prelude::*;

use crate::memory;
use crate::memory::Mapped;

/// Records a task: about a megabyte.
const TASK: usize = 1 << 16;

/// Records that begin `stride` bytes apart.
#[derive(Clone, Copy)]
pub(super) struct Records<'a> {
    /// The file that the bytes are of, which is told what has been read; none where they are of none.
    pub(super) file: Option<&'a Mapped<'a>>,
    /// From the first byte that is wanted of the first record on.
    pub(super) bytes: &'a [u8],
    /// How many there are: of the last, as many bytes must be there as are wanted.
    pub(super) count: usize,
    pub(super) stride: usize,
}

impl Records<'_> {
    /// Reads N bytes of every record.
    pub(super) fn read<const N: usize, T: Zeroable + Send>(&self, read: impl Fn(&[u8; N]) -> T + Sync) -> Vec<T> {
        self.collect(|rest| rest.first_chunk().map(&read))
    }

    /// Reads every record as a whole, which all must be there.
    pub(super) fn read_slices<T: Zeroable + Send>(&self, read: impl Fn(&[u8]) -> T + Sync) -> Vec<T> {
        self.collect(|rest| rest.get(..self.stride).map(&read))
    }

    /// Reads N bytes of every record up to the first that cannot be read.
    pub(super) fn read_while<const N: usize, T: Zeroable + Send>(
        &self,
        read: impl Fn(&[u8; N]) -> Option<T> + Sync,
    ) -> Vec<T> {
        self.collect(|rest| rest.first_chunk().and_then(&read))
    }

    /// `read` is given the bytes from a record on.
    fn collect<T: Zeroable + Send>(&self, read: impl Fn(&[u8]) -> Option<T> + Sync) -> Vec<T> {
        let mut items: Vec<T> = memory::zeroed(self.count);
        let first_bad = AtomicUsize::new(self.count);
        items.par_chunks_mut(TASK).enumerate().for_each(|(task, items)| {
            let first = task * TASK;
            // What follows a bad record is not wanted.
            if first > first_bad.load(Ordering::Relaxed) {
                return;
            }
            let bytes = &self.bytes[first * self.stride..];
            for (k, item) in items.iter_mut().enumerate() {
                match bytes.get(k * self.stride..).and_then(&read) {
                    Some(value) => *item = value,
                    None => {
                        first_bad.fetch_min(first + k, Ordering::Relaxed);
                        return;
                    }
                }
            }
            if let Some(file) = self.file {
                file.done(&bytes[..(items.len() * self.stride).min(bytes.len())]);
            }
        });
        items.truncate(first_bad.into_inner());
        items
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_up_to_the_first_bad_record() {
        let count = 3 * TASK + 17;
        // A word and two bytes of something else; the last record is cut short.
        let mut bytes: Vec<u8> = (0..count as u32).flat_map(|i| [&i.to_le_bytes()[..], &[9, 9]].concat()).collect();
        bytes.truncate(bytes.len() - 2);
        let records = Records { file: None, bytes: &bytes, count, stride: 6 };
        let all = records.read(|word| u32::from_le_bytes(*word));
        assert!(all.len() == count && all.iter().enumerate().all(|(i, &word)| word == i as u32));
        for bad in [0, 1, TASK as u32 - 1, TASK as u32, 2 * TASK as u32 + 5, count as u32 - 1] {
            let good = |word: &[u8; 4]| Some(u32::from_le_bytes(*word)).filter(|&i| i < bad || i == bad + 2);
            assert_eq!(records.read_while(good), all[..bad as usize]);
        }
    }
}
