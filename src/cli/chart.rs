//! `twincast chart`: speed against accuracy, measured and drawn.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::TypedValueParser;

use super::named::one_of;
use super::threads::{parse_threads, pool};
use super::{interrupt, outputs, progress, say};
use crate::error::{Error, Result};
use crate::image::{self, Metadata, WriteOptions};
use crate::lab::chart::{Chart, Figure, Setup, page};

/// Chart speed against accuracy: methods, engines, samplers, filters
///
/// Writes each chart as SVG and PNG with its numbers as CSV, and a page (index.html) that shows them all with how they
/// were made.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  twincast chart --quick -o charts
  twincast chart -o charts --charts triangles,scales")]
pub(super) struct ChartArgs {
    /// Folder for the charts; made if it is missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,

    /// Fewer rays, samples and turns: a minute or two
    #[arg(long)]
    quick: bool,

    /// Which charts
    #[arg(
        long,
        value_name = "NAME,...",
        value_parser = charts(),
        value_delimiter = ',',
        default_value = "triangles,engines,scales,samplers"
    )]
    charts: Vec<Chart>,

    /// Threads of what is not timed by itself; 0 is one for each core
    #[arg(short, long, value_name = "N", default_value_t = 1, value_parser = parse_threads)]
    threads: usize,

    /// Say nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

fn charts() -> impl TypedValueParser<Value = Chart> {
    one_of(Chart::ALL, Chart::name, |chart| match chart {
        Chart::Triangles => "Ways to meet a triangle: time against leaks",
        Chart::Engines => "Native and Embree in every mode: rays a second against wrong hits",
        Chart::Scales => "Where ways to meet a triangle fail, by size and distance",
        Chart::Samplers => "Samplers, filters and adaptive sampling: time against error",
    })
}

pub(super) fn run(args: &ChartArgs) -> Result<()> {
    let cancel = interrupt::install()?;
    let folder = &args.output;
    std::fs::create_dir_all(folder)
        .map_err(|error| Error::output(folder, format!("the folder cannot be made ({error}); name another")))?;
    let charts = Chart::ALL.into_iter().filter(|chart| args.charts.contains(chart));
    let charts: Vec<Chart> = charts.collect();
    let files = |chart: &Chart| [".svg", ".png", ".csv"].map(|suffix| folder.join(format!("{}{suffix}", chart.name())));
    let outputs: Vec<PathBuf> = charts.iter().flat_map(files).chain([folder.join("index.html")]).collect();
    outputs::check(&[], &outputs, [])?;
    let pool = pool(args.threads)?;
    let bar = progress::spinner("measuring", args.quiet);
    let on_step = |what: &str| bar.set_message(what.to_owned());
    let figures = pool.install(|| {
        let setup = Setup { quick: args.quick, cancel: Some(cancel), on_step: Some(&on_step) };
        let figures = charts.iter().map(|chart| {
            let figure = interrupt::while_nothing_is_written(|| chart.make(&setup))?;
            write(folder, &figure)?;
            Ok(figure)
        });
        figures.collect::<Result<Vec<_>>>()
    });
    bar.finish_and_clear();
    outputs::write_text(&folder.join("index.html"), &page(&figures?))?;
    if args.quiet {
        return Ok(());
    }
    outputs.iter().try_for_each(|path| say(format_args!("{:<8}  {}", "wrote", path.display())))
}

fn write(folder: &Path, figure: &Figure) -> Result<()> {
    let file = |suffix: &str| folder.join(format!("{}{suffix}", figure.name));
    outputs::write_text(&file(".svg"), &figure.svg())?;
    outputs::write_text(&file(".csv"), &figure.csv)?;
    image::write(&file(".png"), &figure.picture(), &Metadata::default(), &WriteOptions::default())
}
