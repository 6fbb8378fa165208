//! Lists of rays that are on their way.

use super::RAYS;

/// Numbers of travellers.
#[derive(Clone, Copy)]
pub(super) struct List {
    slots: [u8; RAYS],
    len: usize,
}

impl List {
    pub const EMPTY: Self = Self { slots: [0; RAYS], len: 0 };

    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    #[inline(always)]
    pub fn push(&mut self, slot: u8) {
        self.slots[self.len % RAYS] = slot;
        self.len += 1;
    }

    #[inline(always)]
    pub fn iter(&self) -> impl Iterator<Item = u8> {
        self.slots[..self.len.min(RAYS)].iter().copied()
    }
}
