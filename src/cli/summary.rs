//! What a render says of itself when it is done.

use super::report::{Rays, Stats, Summary, counted, grouped, time};
use crate::memory::in_words;
use crate::plan::BuildChoice;
use crate::render::Renderer;
use crate::scene::Scene;

/// A render that is done.
pub(super) struct Rendered<'a> {
    pub(super) scene: &'a Scene,
    pub(super) renderer: &'a Renderer<'a>,
    /// Where the camera is from, in words.
    pub(super) camera: &'a str,
    pub(super) build: Option<&'a BuildChoice>,
    pub(super) stats: &'a Stats,
}

impl Rendered<'_> {
    pub(super) fn summary(&self, verbose: bool) -> Summary {
        let mut summary = Summary::default();
        let triangles = self.stats.triangles;
        let shapes = self.scene.primitive_count().saturating_sub(triangles);
        let mut parts = Vec::new();
        if triangles > 0 || shapes == 0 {
            parts.push(counted(triangles, "triangle", "triangles"));
        }
        if shapes > 0 {
            parts.push(counted(shapes, "other shape", "other shapes"));
        }
        parts.push(counted(self.scene.materials.len() as u64, "material", "materials"));
        parts.push(counted(self.scene.lights.len() as u64, "light", "lights"));
        summary.line("scene", format_args!("{}: {}", self.stats.scene, parts.join(", ")));
        if verbose {
            summary.line("plan", self.renderer.plan());
            if let Some(build) = self.build {
                summary.line("build", format_args!("{}: {}", build.preset.name(), build.why));
            }
        }
        summary.line("camera", self.camera);
        if self.renderer.plan().idle_emitters {
            summary.line("note", "what glows lights nothing else here; with --integrator path it does");
        }
        let [width, height] = self.stats.size;
        let samples = match self.stats.mean_spp {
            mean if mean == f64::from(self.stats.spp) => counted(u64::from(self.stats.spp), "sample", "samples"),
            mean => format!("on average {mean:.1} samples"),
        };
        let threads = counted(self.stats.threads as u64, "thread", "threads");
        summary.line("picture", format_args!("{width}x{height}, {samples} a pixel, {threads}"));
        if verbose {
            summary.line(
                "load",
                format_args!("{}, prepare {}", time(self.stats.load_seconds), time(self.stats.prepare_seconds)),
            );
        }
        for engine in &self.stats.engines {
            let (build, render) = (time(engine.build_seconds), time(engine.render_seconds));
            summary.line("backend", format_args!("{}: build {build}, render {render}", engine.backend));
            for note in &engine.notes {
                summary.line("built", note);
            }
            if verbose {
                if let Some(cache) = &engine.cache {
                    summary.line("cache", cache);
                }
                let Rays { camera, sent_on, shadow, exact } = &engine.rays;
                let speed = engine.rays_per_second / 1e6;
                let (camera, shadow) = (grouped(*camera), grouped(*shadow));
                let sent_on = if *sent_on > 0 { format!(" + {} sent on", grouped(*sent_on)) } else { String::new() };
                summary.line(
                    "rays",
                    format_args!("{camera} camera{sent_on} + {shadow} shadow, {speed:.2} million a second"),
                );
                summary.line(
                    "exact",
                    counted(*exact, "decision that f64 could not take", "decisions that f64 could not take"),
                );
                let each = engine.bytes_per_triangle.map(|b| format!(", {b:.0} B a triangle")).unwrap_or_default();
                summary.line("memory", format_args!("{}{each}", in_words(engine.bytes as u64)));
            }
        }
        if let Some(denoise) = &self.stats.denoise {
            summary.line("denoised", format_args!("{}: {}", denoise.library, time(denoise.seconds)));
        }
        if let (true, Some(peak)) = (verbose, self.stats.peak_memory) {
            summary.line("peak", format_args!("{} of memory for everything", in_words(peak)));
        }
        summary
    }
}
