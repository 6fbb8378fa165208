//! What the numbers of a sample are for; each use has numbers of its own.

/// What a pair of numbers is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) struct Dimension(u32);

/// What a path chooses where it meets a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) enum Choice {
    /// Which light is asked, and which lobe is followed.
    Which,
    /// The point on the light.
    Light,
    /// The direction to go on in.
    Direction,
    /// Whether it ends.
    End,
    /// What its ray passes through.
    Alpha,
}

impl Choice {
    /// By their numbers.
    pub(super) const ALL: [Self; 5] = [Self::Which, Self::Light, Self::Direction, Self::End, Self::Alpha];
}

impl Dimension {
    /// The point on the pixel.
    pub(in crate::render) const FILM: Self = Self(0);
    /// The point on the lens.
    pub(in crate::render) const LENS: Self = Self(1);
    /// The time while the shutter is open.
    pub(in crate::render) const TIME: Self = Self(u32::MAX >> 1);

    /// The point on a light, as asked by the ray of a pixel's tree of rays that has the number `branch`.
    pub(in crate::render) const fn light(light: u32, branch: u32) -> Self {
        Self(branch.wrapping_mul(0x9e37_79b9).wrapping_add(2).wrapping_add(light))
    }

    /// How a glossy surface spreads the ray that has the number `branch`.
    pub(in crate::render) const fn gloss(branch: u32) -> Self {
        Self(branch.wrapping_mul(0x85eb_ca6b).wrapping_add(0x4000_0000))
    }

    /// What the ray that has the number `branch` passes through.
    pub(in crate::render) const fn alpha(branch: u32) -> Self {
        Self(branch.wrapping_mul(0xc2b2_ae35).wrapping_add(0x2000_0000))
    }

    /// One of the choices where a path was scattered `depth` times.
    pub(in crate::render) const fn bounce(depth: u32, choice: Choice) -> Self {
        // Below 2^31, for streams are twice the number.
        Self(0x6000_0000 + depth * 8 + choice as u32)
    }

    /// The first of its two streams of numbers: one for all samples of a pixel, one for each.
    #[inline]
    pub(super) const fn stream(self) -> u32 {
        self.0.wrapping_mul(2)
    }
}
