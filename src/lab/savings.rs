//! What a plan saves: the picture with no more than the scene needs, against the same with one thing after another put back.
//!
//! The two renders of a pair take turns, so that whatever else the machine does touches both; a saving is the median of those of each
//! turn. The pictures are compared as well: what is left out must not be seen.

use std::fmt;
use std::time::Instant;

use serde::Serialize;

use super::bench::Spread;
use crate::error::Result;
use crate::plan::{self, Complete, Reduction};
use crate::render::{Control, Renderer, Settings};
use crate::scene::{Camera, Scene};
use crate::trace::bvh::Bvh;

/// What is measured.
pub struct Setup<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Where it is seen from.
    pub camera: &'a Camera,
    /// What picture.
    pub settings: &'a Settings,
    /// How often each is rendered.
    pub repeat: usize,
    /// How it is watched.
    pub control: Control<'a>,
}

/// What one reduction saves. Serialises as a part of the document of `plan --measure --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Saving {
    /// The reduction, or `all` of them.
    pub name: &'static str,
    /// Seconds of a render with no more than the scene needs.
    pub needed_seconds: Spread,
    /// Seconds of a render with this put back.
    pub complete_seconds: Spread,
    /// The share of time that is saved, the median of all turns.
    pub saved: f64,
    /// Bytes of the tree that are saved, as a share.
    pub memory_saved: f64,
    /// Whether both pictures are the same to the bit.
    pub identical: bool,
    /// The largest difference of any channel.
    pub largest_difference: f64,
}

/// A way to render.
struct Way {
    complete: Complete,
    world: crate::trace::World,
}

impl Setup<'_> {
    /// Measures each of `reductions`, and then all of them at once.
    ///
    /// # Errors
    /// Those of rendering.
    pub fn run(&self, reductions: &[Reduction]) -> Result<Vec<Saving>> {
        let needed = self.settings.complete;
        let mut rows = Vec::new();
        for &reduction in reductions {
            rows.push(self.measure(reduction.name(), needed.with(reduction))?);
        }
        rows.push(self.measure("all", Complete::ALL)?);
        Ok(rows)
    }

    fn measure(&self, name: &'static str, complete: Complete) -> Result<Saving> {
        let way = |complete| Ok(Way { complete, world: plan::world(self.scene, complete)? });
        let ways = [way(self.settings.complete)?, way(complete)?];
        let trees = [Bvh::build(&ways[0].world), Bvh::build(&ways[1].world)];
        let renderer = |way: usize| {
            let Way { complete, world } = &ways[way];
            let settings = Settings { complete: *complete, ..self.settings.clone() };
            Renderer::new(self.scene, world, self.camera.clone(), settings)
        };
        let renderers = [renderer(0)?, renderer(1)?];
        let mut seconds = [Vec::new(), Vec::new()];
        let mut difference = None;
        // The first turn warms caches and allocator, and is not counted.
        for turn in 0..=self.repeat {
            let mut pictures = Vec::new();
            for way in if turn % 2 == 0 { [0, 1] } else { [1, 0] } {
                let start = Instant::now();
                let picture = renderers[way].render(&trees[way], self.control)?;
                if turn > 0 {
                    seconds[way].push(start.elapsed().as_secs_f64());
                }
                pictures.push(picture);
            }
            difference = Some(pictures[0].difference(&pictures[1])?);
        }
        let [needed, complete] = seconds;
        let shares: Vec<f64> = needed.iter().zip(&complete).map(|(needed, complete)| 1.0 - needed / complete).collect();
        let bytes = trees.map(|tree| tree.bytes() as f64);
        let largest_difference = difference.map_or(0.0, |difference| difference.max_abs);
        Ok(Saving {
            name,
            needed_seconds: Spread::of(&needed),
            complete_seconds: Spread::of(&complete),
            saved: Spread::of(&shares).median,
            memory_saved: 1.0 - bytes[0] / bytes[1].max(1.0),
            identical: largest_difference == 0.0,
            largest_difference,
        })
    }
}

/// The rows as a table.
pub struct Table<'a>(pub &'a [Saving]);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<11} {:>9} {:>9} {:>8} {:>8}  picture", "left out", "needed s", "full s", "time", "memory")?;
        for row in self.0 {
            let Saving { name, needed_seconds, complete_seconds, saved, memory_saved, .. } = row;
            let (needed, complete) = (needed_seconds.median, complete_seconds.median);
            let (time, memory) = (100.0 * saved, 100.0 * memory_saved);
            write!(f, "{name:<11} {needed:>9.4} {complete:>9.4} {time:>6.1} % {memory:>6.1} %  ")?;
            if row.identical {
                writeln!(f, "the same")?;
            } else {
                writeln!(f, "differs by up to {:.1e}", row.largest_difference)?;
            }
        }
        Ok(())
    }
}
