//! What a thread needs while it traces rays that do not travel in flights or bundles: for callers who have one, or a packet.
//!
//! It lies in the thread's own memory, always ready: such a call takes as long as some hundred instructions, of which lending a box and
//! taking it back are some thirty.

use std::cell::RefCell;

use super::found::Found;
use super::packet::{self, PacketHits};
use super::walk::Stack;

/// Room for a walk, for what rays have hit of which there was doubt, that of a single ray being the first, and for the hits of packets.
pub(super) struct Scratch {
    pub stack: Stack,
    pub found: [Found; packet::MOST * packet::RAYS],
    pub hits: [PacketHits; packet::MOST],
}

impl Scratch {
    const NEW: Self = Self {
        stack: Stack::new(),
        found: [Found::NONE; packet::MOST * packet::RAYS],
        hits: [PacketHits::NONE; packet::MOST],
    };
}

thread_local! {
    static SCRATCH: RefCell<Scratch> =
        const { RefCell::new(Scratch::NEW) };
}

/// Lends it to `work`, which calls nobody who might ask for it again.
#[inline(always)]
pub(super) fn with_scratch<R>(work: impl FnOnce(&mut Scratch) -> R) -> R {
    SCRATCH.with_borrow_mut(work)
}
