//! What a ray cannot hit: boxes ([`slab`]) and triangles ([`woop`], [`planes`], [`filter`]) are left out in f32, by bounds on all that
//! rounding may do. Rays are made ready for it one at a time, or eight ([`ready`]).

pub(super) mod filter;
pub(super) mod planes;
pub(super) mod ready;
pub(super) mod slab;
pub(super) mod woop;
