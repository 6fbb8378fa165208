//! How well the tree is worth building: seconds spent on triangles against seconds won on rays, within the memory there
//! is.
//!
//! The model is linear: a preset costs so much for every triangle and every ray, and the cheapest whose memory fits is
//! taken. Finer models (depth, occlusion) would need what only the finished tree tells, and move the limits
//! by less than machines differ.

use std::fmt;

use super::Rays;
use crate::trace::bvh::Preset;

/// Bytes that Embree holds for a triangle at most, while it builds and beside the mesh; measured on 20 million.
pub const EMBREE_BYTES: u64 = 120;

/// What decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildRequest {
    /// Triangles as stored: those of an instanced mesh count once.
    pub triangles: u64,
    /// Rays that will be traced, at most.
    pub rays: Rays,
    /// Bytes that the process holds before it builds, the meshes among them, and those it will need for the picture.
    pub held: u64,
    /// Bytes that it may hold at any time; none for no limit.
    pub max_memory: Option<u64>,
    /// The preset that was asked for; none to choose one.
    pub wanted: Option<Preset>,
}

/// What was decided.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BuildChoice {
    /// How to build.
    pub preset: Preset,
    /// An estimate of the most bytes the process will hold.
    pub memory: u64,
    /// Why, as half a sentence.
    pub why: String,
}

/// No preset fits, or not the one that was asked for, or what was not chosen at all does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotEnoughMemory {
    /// The preset that needs least, or was asked for; none where nothing was to be chosen.
    pub preset: Option<Preset>,
    /// Bytes it would need.
    pub needed: u64,
    /// Bytes there may be.
    pub limit: u64,
}

/// What a preset costs.
struct Cost {
    /// Nanoseconds to build a triangle, one thread.
    build: f64,
    /// Nanoseconds to trace a ray from the camera or to a light, one thread.
    ray: f64,
    /// The same of a mirrored, refracted or scattered one, which shares its way with no other.
    sent_on: f64,
    /// Bytes a triangle of the finished tree.
    tree: u64,
    /// Bytes a triangle beside the tree while it is built.
    building: u64,
}

/// Measured on terrains of 2 and 20 million triangles, scans and `architecture`; of bytes, what no mesh tried exceeds.
/// The time to build includes the system's for handing out the memory, which is why compact trees are soon ready. The
/// differences decide: of rays from the camera and to lights `FastCompact` pays below two thirds of one a triangle,
/// `Fast` below nine, `High` above 310; of others below a twentieth, below two, above 31. `Compact` is for rays that
/// would pay for `Default` where there is not the memory.
const fn cost(preset: Preset) -> Cost {
    match preset {
        Preset::Fast => Cost { build: 105.0, ray: 95.0, sent_on: 340.0, tree: 66, building: 33 },
        Preset::Default => Cost { build: 290.0, ray: 75.0, sent_on: 250.0, tree: 58, building: 40 },
        // Where triangles are long and thin a triangle takes 2000 and a ray that is sent on 200; elsewhere little is
        // lost, and little won.
        Preset::High => Cost { build: 600.0, ray: 74.0, sent_on: 240.0, tree: 84, building: 84 },
        Preset::Compact => Cost { build: 210.0, ray: 115.0, sent_on: 650.0, tree: 16, building: 40 },
        Preset::FastCompact => Cost { build: 75.0, ray: 140.0, sent_on: 900.0, tree: 18, building: 20 },
    }
}

impl BuildRequest {
    /// Bytes that the process will hold at most.
    fn memory(&self, preset: Preset) -> u64 {
        let Cost { tree, building, .. } = cost(preset);
        self.held.saturating_add(self.triangles.saturating_mul(tree + building))
    }

    fn nanoseconds(&self, preset: Preset) -> f64 {
        let Cost { build, ray, sent_on, .. } = cost(preset);
        let Rays { camera, sent_on: others, shadow } = self.rays;
        build * self.triangles as f64 + ray * (camera as f64 + shadow as f64) + sent_on * others as f64
    }

    /// Whether what is held anyway fits.
    ///
    /// # Errors
    /// [`NotEnoughMemory`] where it does not.
    pub fn fits(&self) -> Result<(), NotEnoughMemory> {
        let (needed, limit) = (self.held, self.max_memory.unwrap_or(u64::MAX));
        if needed <= limit { Ok(()) } else { Err(NotEnoughMemory { preset: None, needed, limit }) }
    }

    /// Chooses a preset.
    ///
    /// # Errors
    /// [`NotEnoughMemory`] where none fits within `max_memory`, or not the one that is wanted.
    pub fn choose(&self) -> Result<BuildChoice, NotEnoughMemory> {
        let limit = self.max_memory.unwrap_or(u64::MAX);
        let allowed = |preset: &Preset| self.wanted.is_none_or(|wanted| wanted == *preset);
        let cheaper = |a: &Preset, b: &Preset| self.nanoseconds(*a).total_cmp(&self.nanoseconds(*b));
        let candidates = || Preset::ALL.into_iter().filter(allowed);
        let Some(preset) = candidates().filter(|preset| self.memory(*preset) <= limit).min_by(cheaper) else {
            let by_memory = |preset: &Preset| (self.memory(*preset), *preset != Preset::FastCompact);
            let least = candidates().min_by_key(by_memory).unwrap_or(Preset::FastCompact);
            return Err(NotEnoughMemory { preset: Some(least), needed: self.memory(least), limit });
        };
        let unlimited = candidates().min_by(cheaper).unwrap_or(preset);
        let why = if self.wanted.is_some() {
            "asked for".to_owned()
        } else if preset != unlimited {
            format!("{} would take more memory than there may be", unlimited.name())
        } else {
            let rays = self.rays.total() as f64 / self.triangles as f64;
            let judged = match preset {
                Preset::Fast | Preset::Compact | Preset::FastCompact => "too few to pay for a better tree",
                Preset::Default => "enough for a good tree, too few for the best",
                Preset::High => "enough to pay for the best tree",
            };
            if self.triangles > 0 {
                format!("{rays:.1} rays a triangle are {judged}")
            } else {
                "there are no triangles to build over".to_owned()
            }
        };
        Ok(BuildChoice { preset, memory: self.memory(preset), why })
    }
}

impl fmt::Display for NotEnoughMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { preset, needed, limit } = self;
        let needed = needed.div_ceil(1 << 20);
        let limit = if *limit < 1 << 20 { format!("{} KiB", limit >> 10) } else { format!("{} MiB", limit >> 20) };
        match preset {
            Some(preset) => write!(f, "its {} build", preset.name())?,
            None => write!(f, "its build")?,
        }
        write!(f, " needs about {needed} MiB of memory in all, above the limit of {limit}")
    }
}

impl NotEnoughMemory {
    /// A limit that will do, bytes. What is held moves a little from run to run; what is asked for should be enough in
    /// the next one.
    pub const fn enough(&self) -> u64 {
        self.needed + self.needed / 32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MESH: BuildRequest = BuildRequest {
        triangles: 1_000_000,
        rays: Rays { camera: 0, sent_on: 0, shadow: 0 },
        held: 500 << 20,
        max_memory: None,
        wanted: None,
    };

    fn preset(rays: Rays, max_memory: Option<u64>) -> Option<Preset> {
        BuildRequest { rays, max_memory, ..MESH }.choose().ok().map(|choice| choice.preset)
    }

    #[test]
    fn rays_pay_for_triangles() {
        use Preset::{Default, Fast, FastCompact, High};
        // The limits follow from the costs: (105 - 75) / (140 - 95), (290 - 105) / (95 - 75) and (600 - 290) / (75 -
        // 74).
        let of_camera =
            [(0.0, FastCompact), (0.6, FastCompact), (0.7, Fast), (9.0, Fast), (9.5, Default), (309.0, Default)];
        for (rays, expected) in of_camera.into_iter().chain([(311.0, High), (10_000.0, High)]) {
            let half = (rays * 500_000.0) as u64;
            assert_eq!(preset(Rays { camera: half, shadow: half, sent_on: 0 }, None), Some(expected), "{rays}");
        }
        // (105 - 75) / (900 - 340), (290 - 105) / (340 - 250) and (600 - 290) / (250 - 240).
        let others = [(0.05, FastCompact), (0.06, Fast), (2.0, Fast), (2.1, Default), (30.9, Default), (31.1, High)];
        for (rays, expected) in others {
            let sent_on = (rays * 1e6) as u64;
            assert_eq!(preset(Rays { sent_on, ..Rays::default() }, None), Some(expected), "{rays} sent_on");
        }
        assert!(BuildRequest { triangles: 0, ..MESH }.choose().is_ok());
        assert!(BuildRequest { triangles: u64::MAX, ..MESH }.choose().is_ok());
    }

    #[test]
    fn memory_comes_first() {
        use Preset::{Compact, Default, FastCompact, High};
        let held = MESH.held;
        let many = Rays { camera: 1_000_000_000, ..Rays::default() };
        let at = |bytes: u64| preset(many, Some(held + bytes * MESH.triangles));
        let expected = [
            (168, High),
            (167, Default),
            (98, Default),
            (97, Compact),
            (56, Compact),
            (55, FastCompact),
            (38, FastCompact),
        ];
        assert_eq!(expected.map(|(bytes, _)| at(bytes)), expected.map(|(_, preset)| Some(preset)));
        assert_eq!(at(37), None);
        let error = BuildRequest { max_memory: Some(held), ..MESH }.choose().unwrap_err();
        assert_eq!(error, NotEnoughMemory { preset: Some(FastCompact), needed: held + 38_000_000, limit: held });
        let (text, enough) = (error.to_string(), error.enough());
        let error = BuildRequest { max_memory: Some(held - 1), ..MESH }.fits().unwrap_err();
        assert_eq!((error.needed, MESH.fits()), (held, Ok(())));
        // What it says is needed is enough.
        assert!(text.contains("about 537 MiB") && text.contains("limit of 500 MiB"), "{text}");
        assert!(preset(many, Some(537 << 20)).is_some() && preset(many, Some(536 << 20)).is_none());
        // A thirty-second more.
        assert_eq!(enough.div_ceil(1 << 20), 553);
        // Where there is nothing to build, no other build would do.
        let none = BuildRequest { triangles: 0, max_memory: Some(1000 << 10), ..MESH }.choose().unwrap_err();
        assert_eq!(none.preset, Some(FastCompact));
        assert!(none.to_string().contains("limit of 1000 KiB"), "{none}");
    }

    #[test]
    fn a_wish_is_kept_or_refused() {
        for wanted in Preset::ALL {
            let request =
                BuildRequest { wanted: Some(wanted), rays: Rays { camera: 1 << 30, ..Rays::default() }, ..MESH };
            let choice = request.choose().unwrap();
            assert_eq!((choice.preset, choice.why.as_str()), (wanted, "asked for"));
            let error = BuildRequest { max_memory: Some(choice.memory - 1), ..request }.choose().unwrap_err();
            assert_eq!((error.preset, error.needed), (Some(wanted), choice.memory));
        }
    }
}
