//! How much work goes into a tree, and how much memory.

use crate::trace::bvh::simd::isa::Isa;

/// What a tree is built for. Hits do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// Built soon, for few rays: along a curve.
    Fast,
    /// Built by the surface area heuristic.
    #[default]
    Default,
    /// Built slowest, for many rays: large triangles are referenced from several leaves.
    High,
    /// The default tree in least memory: leaves hold numbers of triangles, whose corners are fetched from the mesh.
    Compact,
    /// The fast tree in least memory, which is built sooner still.
    FastCompact,
}

impl Preset {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Fast, Self::Default, Self::High, Self::Compact, Self::FastCompact];

    /// In lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Default => "default",
            Self::High => "high",
            Self::Compact => "compact",
            Self::FastCompact => "fast-compact",
        }
    }

    /// Whether leaves hold numbers of triangles, and not their corners.
    pub(in crate::trace::bvh) const fn is_compact(self) -> bool {
        matches!(self, Self::Compact | Self::FastCompact)
    }
}

/// How a tracer is built.
#[derive(Clone, Copy)]
pub struct Options<'a> {
    /// What for.
    pub preset: Preset,
    /// What with; must be available. Neither the tree nor hits depend on it.
    pub isa: Isa,
    /// Called from any thread with numbers of primitives that have found their place. They add up to all that can be
    /// hit, stored ones and placed objects; in the high preset to all references, up to 1.3 times as many.
    pub progress: Option<&'a (dyn Fn(u64) + Sync)>,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self { preset: Preset::default(), isa: Isa::detect(), progress: None }
    }
}

impl From<Preset> for Options<'_> {
    fn from(preset: Preset) -> Self {
        Self { preset, ..Self::default() }
    }
}

impl Options<'_> {
    pub(in crate::trace::bvh) fn report(&self, primitives: usize) {
        if let Some(progress) = self.progress {
            progress(primitives as u64);
        }
    }
}
