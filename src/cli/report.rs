//! What a render took: for people, and as JSON.

use std::fmt::{self, Write};

use serde::Serialize;

use super::cache::CacheStats;
use super::denoise::DenoiseStats;
use super::engine::{Outcome, Pass};
use super::request::RenderRequest;
use crate::trace::World;

/// What `--stats` writes. Times are seconds, sizes bytes.
#[derive(Debug, Serialize)]
pub(super) struct Stats {
    pub(super) scene: String,
    pub(super) triangles: u64,
    pub(super) size: [u32; 2],
    pub(super) spp: u32,
    /// Samples a pixel on average; fewer or more than `spp` with a noise threshold.
    pub(super) mean_spp: f64,
    pub(super) threads: usize,
    pub(super) packet: usize,
    pub(super) load_seconds: f64,
    /// Recentring and baking the scene, and planning.
    pub(super) prepare_seconds: f64,
    pub(super) write_seconds: f64,
    /// The most memory the process has held.
    pub(super) peak_memory: Option<u64>,
    /// Of the first engine's picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) denoise: Option<DenoiseStats>,
    pub(super) engines: Vec<EngineStats>,
}

impl Stats {
    /// Of a render that is done; what is not known of it here is 0, or none.
    pub(super) fn new(scene: &str, world: &World, request: &RenderRequest, outcome: &Outcome) -> Self {
        let settings = &request.settings;
        let stored = world.stored_triangles();
        Self {
            scene: scene.to_owned(),
            triangles: world.placed_triangles(),
            size: request.size(),
            spp: settings.spp,
            mean_spp: outcome.passes[0].picture.samples as f64 / request.pixels() as f64,
            threads: rayon::current_num_threads(),
            packet: settings.batch.width.rays(),
            load_seconds: request.load_seconds,
            prepare_seconds: 0.0,
            write_seconds: 0.0,
            peak_memory: None,
            denoise: None,
            engines: outcome.passes.iter().map(|pass| EngineStats::new(pass, stored)).collect(),
        }
    }
}

/// One engine's share.
#[derive(Debug, Serialize)]
pub(super) struct EngineStats {
    pub(super) backend: String,
    pub(super) build_seconds: f64,
    pub(super) render_seconds: f64,
    pub(super) rays: Rays,
    pub(super) rays_per_second: f64,
    pub(super) bytes: usize,
    /// Of the triangles as stored: those of an instanced mesh count once.
    pub(super) bytes_per_triangle: Option<f64>,
    /// What became of the native tree's file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) cache: Option<CacheStats>,
    /// What there is to say about how it was built.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) notes: Vec<String>,
}

/// Rays by kind.
#[derive(Debug, Serialize)]
pub(super) struct Rays {
    pub(super) camera: u64,
    /// Mirrored and refracted.
    pub(super) sent_on: u64,
    pub(super) shadow: u64,
    /// Decisions about hits that f64 could not take, so that exact arithmetic did.
    pub(super) exact: u64,
}

impl EngineStats {
    /// `stored` triangles were built.
    pub(super) fn new(pass: &Pass, stored: u64) -> Self {
        let camera = pass.picture.camera_rays;
        let sent_on = pass.closest_rays.saturating_sub(camera);
        let rays = Rays { camera, sent_on, shadow: pass.shadow_rays, exact: pass.exact };
        Self {
            backend: pass.engine.clone(),
            build_seconds: pass.build_seconds,
            render_seconds: pass.render_seconds,
            rays_per_second: (pass.closest_rays + pass.shadow_rays) as f64 / pass.render_seconds.max(1e-9),
            rays,
            bytes: pass.bytes,
            bytes_per_triangle: (stored > 0).then(|| pass.bytes as f64 / stored as f64),
            cache: pass.cache.as_ref().map(CacheStats::new),
            notes: pass.notes.clone(),
        }
    }
}

/// Aligned lines of a name and what there is to say.
#[derive(Debug, Default)]
pub(super) struct Summary(String);

impl Summary {
    /// Adds a line.
    pub(super) fn line(&mut self, name: &str, text: impl fmt::Display) {
        let newline = if self.0.is_empty() { "" } else { "\n" };
        write!(self.0, "{newline}{name:<8}  {text}").expect("a String takes everything");
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// 1234567 as 1,234,567.
pub(super) fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A number of things, with the noun in its right form.
pub(super) fn counted(n: u64, singular: &str, plural: &str) -> String {
    format!("{} {}", grouped(n), if n == 1 { singular } else { plural })
}

/// Seconds in a unit that suits them.
pub(super) fn time(seconds: f64) -> String {
    match seconds {
        s if s < 0.1 => format!("{:.1} ms", s * 1e3),
        s if s < 100.0 => format!("{s:.2} s"),
        s => format!("{:.0} min {:02.0} s", (s / 60.0).floor(), s % 60.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!([0, 999, 1000, 1234567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
        assert_eq!(counted(1, "mesh", "meshes"), "1 mesh");
        assert_eq!([0.0123, 5.678, 125.0].map(time), ["12.3 ms", "5.68 s", "2 min 05 s"]);
    }

    #[test]
    fn summaries_are_aligned() {
        let mut summary = Summary::default();
        summary.line("scene", "x");
        summary.line("picture", "y");
        assert_eq!(summary.to_string(), "scene     x\npicture   y");
    }
}
