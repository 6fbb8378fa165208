//! What a plan leaves out of the complete model, each of which can be put back.
//!
//! A picture must not depend on what was left out: `--plan full` renders the complete model, and tests hold both
//! against each other, to the bit. Leaving out without a way back would be simpler, and every reduction would have to
//! be believed.

/// Something that a plan leaves out where a scene does not need it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reduction {
    /// Instances: what stands in one place alone is traced in world coordinates, without a transform.
    Levels,
    /// Lights that are black or cannot reach anything, and all of them where nothing reflects.
    Lights,
    /// Normals, texture coordinates, vertex colours and normal maps that nothing reads.
    Surfaces,
    /// The time of each ray.
    Motion,
    /// Rays that are sent on where nothing mirrors or refracts.
    Recursion,
    /// Rays through surfaces that are not all there.
    Alpha,
    /// Mirrored and refracted rays that matter less than half a step of 8 bits.
    Faint,
}

impl Reduction {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Levels, Self::Lights, Self::Surfaces, Self::Motion, Self::Recursion, Self::Alpha, Self::Faint];

    /// As flags and reports have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Levels => "levels",
            Self::Lights => "lights",
            Self::Surfaces => "surfaces",
            Self::Motion => "motion",
            Self::Recursion => "recursion",
            Self::Alpha => "alpha",
            Self::Faint => "faint",
        }
    }

    /// What is not done.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Levels => "transforms of what stands in one place alone",
            Self::Lights => "lights that are black or cannot reach anything",
            Self::Surfaces => "normals, texture coordinates and colours that nothing reads",
            Self::Motion => "the time of each ray",
            Self::Recursion => "rays sent on where nothing mirrors or refracts",
            Self::Alpha => "rays through surfaces that are not all there",
            Self::Faint => "mirrored and refracted rays too faint to be seen",
        }
    }
}

/// What is modelled completely, whether the scene needs it or not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Complete(u16);

impl Complete {
    /// No more than the scene needs.
    pub const NOTHING: Self = Self(0);
    /// The complete model.
    pub const ALL: Self = Self((1 << Reduction::ALL.len()) - 1);

    /// This too.
    #[must_use]
    pub const fn with(self, reduction: Reduction) -> Self {
        Self(self.0 | 1 << reduction as u16)
    }

    /// What is in either.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether it is modelled completely.
    pub const fn has(self, reduction: Reduction) -> bool {
        self.0 >> reduction as u16 & 1 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_hold_what_was_put_in() {
        let all = Reduction::ALL.into_iter().fold(Complete::NOTHING, Complete::with);
        assert_eq!(all, Complete::ALL);
        for (i, reduction) in Reduction::ALL.into_iter().enumerate() {
            assert_eq!(reduction as usize, i);
            let one = Complete::NOTHING.with(reduction);
            assert!(Reduction::ALL.into_iter().all(|other| one.has(other) == (other == reduction)));
        }
    }
}
