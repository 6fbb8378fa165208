//! What a ray cannot hit: boxes ([`slab`]) and triangles ([`woop`], [`planes`], [`filter`]) are left out in f32, by
//! bounds on all that rounding may do. Rays are made ready for it one at a time, or eight ([`ready`]), and may be a
//! little off the ones that are meant: [`Blur`].

pub(super) mod filter;
pub(super) mod planes;
pub(super) mod ready;
pub(super) mod slab;
pub(super) mod woop;

/// How far a ray may be from the one that is meant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::trace) struct Blur {
    /// In each component of the origin.
    pub origin: f32,
    /// In each component of the direction, relative to the largest of them; at most [`Blur::MAX`].
    pub direction: f32,
}

impl Blur {
    /// The ray is the one that is meant.
    pub const NONE: Self = Self { origin: 0.0, direction: 0.0 };

    /// Of a direction; a larger one is treated as unknown.
    pub(super) const MAX: f32 = 1.0 / 1024.0;

    /// The ray may be anywhere: it meets all boxes, and no triangle is rejected or hit without doubt.
    pub(super) const UNKNOWN: Self = Self { origin: f32::INFINITY, direction: 0.0 };
}
