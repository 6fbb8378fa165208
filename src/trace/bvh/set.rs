//! Some of the travellers of a flight, be they rays or points.

/// How many travel together, at most.
pub(super) const TRAVELLERS: usize = u32::BITS as usize;

/// A bit for each traveller that belongs to it. Gone through, it gives their numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Set(u32);

impl Set {
    pub const NOBODY: Self = Self(0);

    #[inline(always)]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    #[inline(always)]
    pub fn insert(&mut self, k: usize) {
        self.0 |= 1 << k;
    }

    #[inline(always)]
    pub fn remove(&mut self, k: usize) {
        self.0 &= !(1 << k);
    }

    /// Those of them whose bit is set.
    #[inline(always)]
    pub fn of(self, bits: u32) -> Self {
        Self(self.0 & bits)
    }
}

impl Iterator for Set {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let first = self.0.trailing_zeros() as usize % TRAVELLERS;
        self.0 &= self.0 - 1;
        Some(first)
    }
}
