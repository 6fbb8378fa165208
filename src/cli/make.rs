//! `twincast make`: scenes by rule, written to a file.

use std::path::PathBuf;

use clap::Args;

use super::named::one_of;
use super::report::{counted, grouped};
use super::{interrupt, say};
use crate::error::{Error, Result};
use crate::io;
use crate::output::check_writable;
use crate::scene::{RECIPES, Recipe};

/// Make a scene by rule, at any size
#[derive(Debug, Args)]
#[command(
    override_usage = "twincast make [OPTIONS] --output <FILE> <NAME>\n       twincast make --list",
    after_help = "\
Examples:
  twincast make --list
  twincast make sphereflake --size 5 -o flake.nff
  twincast make lattice --size 10 -o teapots.toml
  twincast make terrain --size 4096 -o terrain.ply"
)]
pub(super) struct MakeArgs {
    /// What to make
    #[arg(value_name = "NAME", value_parser = one_of(RECIPES, |recipe| recipe.name, |recipe| recipe.about), required_unless_present = "list")]
    recipe: Option<Recipe>,

    /// How much of it; --list says what it counts
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    size: Option<u32>,

    /// File to write; the suffix decides the format: .nff, .ply (triangles alone) or .toml
    #[arg(short, long, value_name = "FILE", required_unless_present = "list")]
    output: Option<PathBuf>,

    /// Name everything that can be made
    #[arg(long, conflicts_with_all = ["recipe", "size", "output"])]
    list: bool,

    /// Say nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

pub(super) fn run(args: &MakeArgs) -> Result<()> {
    let (Some(recipe), Some(output)) = (&args.recipe, &args.output) else {
        return say(list());
    };
    let name = recipe.name;
    let size = args.size.unwrap_or(recipe.usual);
    if size > recipe.largest {
        let message = format!("--size {size}: {name} goes to {} ({})", recipe.largest, recipe.size);
        return Err(Error::Usage(message));
    }
    let cancel = interrupt::install()?;
    check_writable(output)?;
    let scene = interrupt::while_nothing_is_written(|| recipe.make(size));
    io::save_until(&scene, output, cancel)?;
    if args.quiet {
        return Ok(());
    }
    let count = scene.primitive_count();
    say(format_args!(
        "{name} of size {size}: {} in {}\nwrote {}",
        counted(count, "primitive", "primitives"),
        counted(scene.instances.len() as u64, "instance", "instances"),
        output.display()
    ))
}

fn list() -> String {
    let line = |Recipe { name, about, size, usual, largest, .. }: &Recipe| {
        format!(
            "{name:<12} {about}\n{:<12} --size: {size}; {usual} unless given, at most {}",
            "",
            grouped((*largest).into())
        )
    };
    RECIPES.iter().map(line).collect::<Vec<_>>().join("\n")
}
