//! How well the tree is worth building, and whether there is the memory for it: flags, and what the plan makes of them.

use std::path::Path;

use clap::Args;
use clap::builder::TypedValueParser;

use super::common::parse_bytes;
use super::engine::BackendArg;
use super::named::{AUTO, OrAuto, one_of_or_auto};
use crate::error::{Error, Result};
use crate::image;
use crate::io;
use crate::memory::process;
use crate::plan::{BuildChoice, BuildRequest, EMBREE_BYTES, NotEnoughMemory, Rays};
use crate::render::Aov;
use crate::trace::bvh::Preset;

/// Bytes that a picture takes for each pixel: four floats, once more while it is written.
const BYTES_A_PIXEL: u64 = 32;

/// The same for each further channel: its sum, and what is written of it. Measured.
const BYTES_A_CHANNEL: u64 = 10;

#[derive(Clone, Debug, Args)]
pub(super) struct BuildArgs {
    /// How well the native tree is built; never changes a picture
    #[arg(long, value_name = "PRESET", value_parser = presets(), default_value = AUTO)]
    build: OrAuto<Preset>,

    /// Most memory to hold, as in 1.6G or 500M (powers of 1024); what would not fit is refused before it is built, PLY
    /// and binary STL before they are read
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    max_memory: Option<u64>,
}

fn presets() -> impl TypedValueParser<Value = OrAuto<Preset>> {
    one_of_or_auto(Preset::ALL, Preset::name, |preset| match preset {
        None => "As the number of rays and --max-memory suggest; -v tells",
        Some(Preset::Fast) => "Soon ready, slower to trace",
        Some(Preset::Default) => "In between",
        Some(Preset::High) => "Slow to build, fastest to trace",
        Some(Preset::Compact) => "A fifth of the memory, slower to trace",
        Some(Preset::FastCompact) => "Soonest ready, in as little memory, slowest to trace",
    })
}

impl BuildArgs {
    /// Whether anything is asked of the native BVH.
    pub(super) fn is_given(&self) -> bool {
        self.max_memory.is_some() || self.build.0.is_some()
    }

    /// An error where nothing is built of what is asked for.
    pub(super) fn check(&self, backend: BackendArg) -> Result<()> {
        if backend == BackendArg::Embree && self.build.0.is_some() {
            let problem = "--build is about native trees, of which --backend embree builds none; leave one of them out";
            return Err(Error::Usage(problem.to_owned()));
        }
        Ok(())
    }

    /// Whether what a file promises may fit at all, before it is read.
    ///
    /// # Errors
    /// [`Error::Backend`] where it cannot.
    pub(super) fn check_file(&self, backend: BackendArg, scene: &Path) -> Result<()> {
        let Some(promised) = self.max_memory.and_then(|_| io::promised(scene)) else { return Ok(()) };
        self.decide(backend, promised.triangles, Rays::default(), promised.bytes).map(drop)
    }

    /// How to build the native tree over so many triangles, for so many rays, beside a picture of so many pixels with
    /// these channels; none where only Embree renders.
    ///
    /// # Errors
    /// [`Error::Backend`] where there is not the memory for it.
    pub(super) fn choose(
        &self,
        backend: BackendArg,
        triangles: u64,
        rays: &Rays,
        pixels: u64,
        aovs: &[Aov],
    ) -> Result<Option<BuildChoice>> {
        let channels = aovs.iter().map(|aov| aov.channels() as u64).sum::<u64>();
        let picture = pixels.saturating_mul(BYTES_A_PIXEL + channels * BYTES_A_CHANNEL);
        self.decide(backend, triangles, *rays, picture)
    }

    /// The same, with so many bytes still to come beside the tree.
    fn decide(&self, backend: BackendArg, triangles: u64, rays: Rays, to_come: u64) -> Result<Option<BuildChoice>> {
        if self.max_memory.is_some() {
            // A render holds OpenImageIO's libraries sooner or later, and may be loading them just now. Where that
            // fails, whoever wants a picture says so.
            let _ = image::prepare();
        }
        let embree = if backend == BackendArg::Native { 0 } else { triangles.saturating_mul(EMBREE_BYTES) };
        let request = BuildRequest {
            triangles,
            rays,
            held: process::held().unwrap_or(0).saturating_add(to_come).saturating_add(embree),
            max_memory: self.max_memory,
            wanted: self.build.0,
        };
        let refuse = |backend, problem: NotEnoughMemory| {
            let message = format!("{problem}; {}", advice(&problem));
            Error::Backend { backend, message }
        };
        if backend == BackendArg::Embree {
            return request.fits().map(|()| None).map_err(|problem| refuse("embree", problem));
        }
        request.choose().map(Some).map_err(|problem| refuse("native", problem))
    }
}

/// Which flags would do.
fn advice(problem: &NotEnoughMemory) -> String {
    let instead = match problem.preset {
        Some(Preset::FastCompact) => "a smaller mesh or picture",
        Some(_) => "--build auto, which may choose a smaller one",
        None => "use --backend native, which may need less",
    };
    format!("give at least --max-memory {}M, or {instead}", problem.enough().div_ceil(1 << 20))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_advised_would_do() {
        let problem = |preset| NotEnoughMemory { preset, needed: (500 << 20) + 38_000_000, limit: 500 << 20 };
        // A thirty-second more than is needed.
        let of_least = advice(&problem(Some(Preset::FastCompact)));
        assert!(of_least.contains("--max-memory 553M, or a smaller mesh"), "{of_least}");
        // No other build would do.
        assert!(!of_least.contains("--build auto"), "{of_least}");
        assert!(advice(&problem(Some(Preset::High))).contains("--build auto"));
        assert!(advice(&problem(None)).contains("--backend native"));
    }
}
