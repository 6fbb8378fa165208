//! Large arrays: written once, by all threads, in huge pages where the system has them.
//!
//! A tree of a few million triangles is built in the time that the system takes to hand out its memory in pages of
//! 4 KiB: see docs/PERFORMANCE.md. Collecting into one vector for each chunk and joining these, the safe alternative,
//! writes everything twice and holds both copies for a while.
#![allow(unsafe_code)] // A vector's length is set after it was filled in place.

use std::mem::MaybeUninit;

use rayon::prelude::*;

use crate::memory;

/// Room for some values of an array, filled from the front.
pub(crate) struct Room<'a, T> {
    slots: &'a mut [MaybeUninit<T>],
    len: usize,
    /// Index of its first value in the array.
    pub first: usize,
}

impl<T> Room<'_, T> {
    /// # Panics
    /// Where more is pushed than was announced.
    #[inline]
    pub fn push(&mut self, value: T) {
        self.slots[self.len].write(value);
        self.len += 1;
    }

    /// Values written so far.
    pub fn len(&self) -> usize {
        self.len
    }
}

/// Values that one thread goes through by itself: to wake another one takes as long.
pub(crate) const fn few<T>() -> usize {
    const BYTES: usize = 1 << 17;
    BYTES / size_of::<T>()
}

/// An array of which each chunk, given with how many values it makes, writes its own part; in order, on all threads,
/// unless it is short.
///
/// # Panics
/// Where a chunk writes another number of values than it was given with.
pub(crate) fn fill<T: Send, C: Send>(chunks: Vec<(usize, C)>, write: impl Fn(C, &mut Room<'_, T>) + Sync) -> Vec<T> {
    let len = chunks.iter().map(|(len, _)| len).sum();
    let mut array = memory::with_capacity(len);
    let mut rest = &mut array.spare_capacity_mut()[..len];
    let mut jobs = Vec::with_capacity(chunks.len());
    let mut first = 0;
    for (len, chunk) in chunks {
        let (slots, others) = rest.split_at_mut(len);
        rest = others;
        jobs.push((chunk, Room { slots, len: 0, first }));
        first += len;
    }
    let work = |(chunk, mut room): (C, Room<'_, T>)| {
        write(chunk, &mut room);
        assert_eq!(room.len, room.slots.len(), "a chunk fills its part");
    };
    if len <= few::<T>() {
        jobs.into_iter().for_each(work)
    } else {
        jobs.into_par_iter().for_each(work)
    }
    // SAFETY: the rooms are the first `len` slots of the capacity, each of which has been filled: the assertion above
    // holds for all of them, or its panic has left this function.
    unsafe { array.set_len(len) };
    array
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Enough for huge pages.
    const MANY: usize = 4 << 20;

    #[test]
    fn chunks_stand_in_order() {
        for count in [3, 600] {
            let chunks: Vec<(usize, usize)> = (0..count).map(|i| (i * 31 % 97, i)).collect();
            let expected: Vec<usize> =
                chunks.iter().flat_map(|&(len, i)| (0..len).map(move |k| 1000 * i + k)).collect();
            assert_eq!(expected.len() > few::<usize>(), count > 3, "by one thread, and by all");
            let array = fill(chunks.clone(), |i, room| {
                for k in 0..chunks[i].0 {
                    assert_eq!(room.len(), k);
                    room.push(1000 * i + k);
                }
            });
            assert_eq!(array, expected);
        }
        let large: Vec<u64> = fill(vec![(0, 0), (MANY, 1)], |i, room| {
            for k in 0..MANY * i {
                room.push(k as u64);
            }
        });
        assert!(large.iter().copied().eq(0..MANY as u64));
    }

    #[test]
    #[should_panic = "a chunk fills its part"]
    fn a_chunk_that_writes_too_little_is_refused() {
        fill(vec![(2, ())], |(), room| room.push(String::new()));
    }
}
