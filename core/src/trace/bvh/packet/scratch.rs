//! What a thread needs while it traces packets.
//!
//! It lies in the thread's own memory, always ready: to lend a box and take it back would be some thirty instructions
//! more, to clear as much some hundred.

use std::cell::RefCell;

use super::{MAX, PacketHits, RAYS};
use crate::trace::bvh::hits::found::Found;

/// Room for what rays have hit of which there was doubt, and for the hits of packets.
pub(super) struct Scratch {
    pub found: [Found; MAX * RAYS],
    pub hits: [PacketHits; MAX],
}

impl Scratch {
    const NEW: Self = Self { found: [Found::NONE; MAX * RAYS], hits: [PacketHits::NONE; MAX] };
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = const { RefCell::new(Scratch::NEW) };
}

/// Lends it to `work`, which calls nobody who might ask for it again.
#[inline(always)]
pub(super) fn with_scratch<R>(work: impl FnOnce(&mut Scratch) -> R) -> R {
    SCRATCH.with_borrow_mut(work)
}
