//! An array that the program has filled, or that lies in a mapped file.
//!
//! Where it begins and ends is looked up once, when it is made, so that to index one costs what indexing a vector does.
//! An enum that is matched at each access, the safe alternative, would put a branch into the innermost loop of every
//! ray.
#![allow(unsafe_code)] // The slice is borrowed from its owner, which lies beside it.

use std::fmt;
use std::ops::{Deref, Range};
use std::sync::Arc;

use bytemuck::AnyBitPattern;

use super::Mapped;

/// An array, and what holds it.
pub(crate) struct Array<T> {
    first: *const T,
    len: usize,
    owner: Owner<T>,
}

enum Owner<T> {
    Memory(Vec<T>),
    File(#[expect(dead_code, reason = "held, so that the mapping lives as long")] Arc<Mapped<'static>>),
}

impl<T> Array<T> {
    /// The values that these bytes of a file are; none where the file ends before, where a value would be cut, or where
    /// they do not lie as the type asks for.
    pub(crate) fn mapped(file: &Arc<Mapped<'static>>, bytes: Range<usize>) -> Option<Self>
    where
        T: AnyBitPattern,
    {
        let values: &[T] = bytemuck::try_cast_slice(file.get(bytes)?).ok()?;
        Some(Self { first: values.as_ptr(), len: values.len(), owner: Owner::File(Arc::clone(file)) })
    }

    /// As a vector: copied out of a file.
    pub(crate) fn into_vec(self) -> Vec<T>
    where
        T: Clone,
    {
        match self.owner {
            Owner::Memory(values) => values,
            Owner::File(_) => self.to_vec(),
        }
    }

    /// To be changed, after it is copied out of a file.
    pub(crate) fn make_mut(&mut self) -> &mut [T]
    where
        T: Clone,
    {
        if let Owner::File(_) = self.owner {
            *self = self.to_vec().into();
        }
        match &mut self.owner {
            Owner::Memory(values) => values,
            Owner::File(_) => unreachable!("it was copied"),
        }
    }
}

impl<T> From<Vec<T>> for Array<T> {
    fn from(values: Vec<T>) -> Self {
        Self { first: values.as_ptr(), len: values.len(), owner: Owner::Memory(values) }
    }
}

impl<T> Deref for Array<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: `first` and `len` are those of a slice of the owner: of a vector's values, whose place does not
        // change while the vector is neither grown nor shrunk, which nothing here does; or of a mapping, which stays
        // where it is until it is dropped, and of bytes that were found to be values of T. The owner lives as long as
        // this borrow, and `make_mut` borrows it exclusively.
        unsafe { std::slice::from_raw_parts(self.first, self.len) }
    }
}

// SAFETY: the pointer is to what the owner holds, and a vector, as a mapping, may go to another thread where its values
// may.
unsafe impl<T: Send + Sync> Send for Array<T> {}
// SAFETY: through a shared array values are only read.
unsafe impl<T: Send + Sync> Sync for Array<T> {}

impl<T: fmt::Debug> fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self[..].fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_those_of_the_vector_or_of_the_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("numbers");
        let numbers: Vec<u32> = (0..1000).collect();
        std::fs::write(&path, bytemuck::cast_slice(&numbers)).expect("written");
        let file = Arc::new(Mapped::open(&path).expect("a file"));
        let mut mapped = Array::<u32>::mapped(&file, 40..4000).expect("it fits");
        let mut owned = Array::from(numbers[10..].to_vec());
        drop(file);
        assert_eq!((&mapped[..], &owned[..]), (&numbers[10..], &numbers[10..]));
        // Moved about, and changed.
        for array in [&mut mapped, &mut owned] {
            array.make_mut()[0] = 7;
            let moved = Box::new(std::mem::replace(array, Vec::new().into()));
            assert_eq!((moved[0], &moved[1..]), (7, &numbers[11..]));
            assert_eq!(moved.into_vec().len(), 990);
            assert!(array.is_empty());
        }
        assert_eq!(std::fs::read(&path).expect("a file")[40], 10, "the file is as it was");
    }

    #[test]
    fn what_does_not_fit_is_none() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("zeros");
        std::fs::write(&path, [0; 64]).expect("written");
        let file = Arc::new(Mapped::open(&path).expect("a file"));
        let reversed = Range { start: 8, end: 4 };
        for bytes in [0..68, 64..68, 2..6, 0..6, reversed, usize::MAX - 3..usize::MAX] {
            assert!(Array::<u32>::mapped(&file, bytes.clone()).is_none(), "{bytes:?}");
        }
        assert!(Array::<u32>::mapped(&file, 64..64).expect("nothing fits").is_empty());
    }
}
