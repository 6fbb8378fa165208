//! Some of what is in flight, be it rays or points.

/// How many travel together, at most.
pub(in crate::trace::bvh) const IN_FLIGHT: usize = u32::BITS as usize;

/// A bit for each ray or point that belongs to it. Gone through, it gives their numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::trace::bvh) struct Set(u32);

impl Set {
    pub const EMPTY: Self = Self(0);

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

    /// How many they are.
    #[inline(always)]
    pub fn len(self) -> u32 {
        self.0.count_ones()
    }

    /// Parts with the first eight, or all if they are fewer.
    #[inline(always)]
    pub fn take_eight(&mut self) -> Self {
        let mut rest = *self;
        for _ in 0..8 {
            rest.next();
        }
        let first = Self(self.0 & !rest.0);
        *self = rest;
        first
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
        let first = self.0.trailing_zeros() as usize % IN_FLIGHT;
        self.0 &= self.0 - 1;
        Some(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_at_a_time_are_all_in_their_order() {
        for bits in [0, 1, 0x8000_0000, 0xff, 0x1_ff00, 0x5555_5555, 0xffff_fff0, u32::MAX] {
            let all = Set(bits);
            let (mut rest, mut taken) = (all, Vec::new());
            while !rest.is_empty() {
                let eight = rest.take_eight();
                assert!(eight.len() == 8 || rest.is_empty() && !eight.is_empty(), "{eight:?} of {all:?}");
                taken.extend(eight);
            }
            assert_eq!(taken, all.collect::<Vec<_>>());
        }
    }
}
