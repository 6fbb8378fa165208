//! `twincast info`: what a scene holds, and what about it looks like a mistake.

use clap::Args;

use super::common::SceneArgs;
use super::{say_report, warn};
use crate::error::Result;
use crate::lab::inspect::Inspection;

/// Say what a scene holds, and what about it looks like a mistake
///
/// Counts, bounds, materials, textures, lights, cameras and memory; and for each mesh the triangles without an area,
/// with NaN or infinite corners, or stored twice, the open and the non-manifold edges, and those across which the
/// winding flips.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  twincast info bunny.glb
  twincast info scan.ply --json")]
pub(super) struct InfoArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// Print one JSON document, and nothing else
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &InfoArgs) -> Result<()> {
    let (scene, warnings) = args.scene.load(false)?;
    warn(&warnings);
    let inspection = Inspection::new(&scene);
    say_report(args.json, &inspection)
}
