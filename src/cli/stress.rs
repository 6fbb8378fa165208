//! `twincast stress`: the cases on which ray casters fail, every method on each of them.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use clap::builder::TypedValueParser;
use serde::Serialize;

use super::engine::BackendArg;
use super::named::one_of;
use super::{interrupt, outputs, progress, say, say_json, say_report};
use crate::error::{Error, Result};
use crate::lab::stress::{Case, Column, Found, Report, Search, Setup, catalogue, columns, file, heat_map};
use crate::output::AtomicWrites;
use crate::render::Control;

/// What goes into the folder of a matrix.
const MATRIX: [&str; 3] = ["matrix.json", "matrix.svg", "failing.txt"];

/// Run every method on the cases on which ray casters are known to fail
///
/// Exact arithmetic answers every ray, and the native tracer in all its forms, the classic accelerators, the textbooks'
/// methods and Embree are held against that. What is known to fail is on record. Exit code 1 if anything exact fails,
/// or if something does not fail as it is on record (with the usual number of rays and seed).
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  twincast stress
  twincast stress --case edge-leak --method native --rays 1000000
  twincast stress -o stress --json
  twincast stress --search 60 --method woop -o found
  twincast stress --case found/found-0.json
  twincast trace case:edge-leak/6 --ray 0x1p-2,0,0,1,0,0 --oracle")]
pub(super) struct StressArgs {
    /// A case by its name, or a case file (.json); may be given again (default: all)
    #[arg(long = "case", value_name = "NAME|FILE")]
    cases: Vec<String>,

    /// Methods of this engine alone (default: of all in this build)
    #[arg(long, value_enum)]
    backend: Option<BackendArg>,

    /// A column of the table; may be given again (default: all)
    #[arg(long = "method", value_name = "NAME", value_parser = methods())]
    methods: Vec<Column>,

    /// About how many rays a case
    #[arg(long, value_name = "N", default_value_t = Setup::RAYS as u64, value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    rays: u64,

    /// Chooses the rays
    #[arg(long, value_name = "N", default_value_t = Setup::SEED)]
    seed: u64,

    /// Share the rays out among the forms of a method (builds, instruction sets, packets), instead of asking each form
    /// all of them
    #[arg(long)]
    in_turns: bool,

    /// Look for new cases for so long: change rays and triangles towards where f32 fails, and ask the methods there
    /// (default: native)
    #[arg(long, value_name = "SECONDS", conflicts_with_all = ["cases", "rays", "in_turns"], value_parser = clap::value_parser!(u64).range(1..))]
    search: Option<u64>,

    /// Print one JSON document, and nothing else
    #[arg(long)]
    json: bool,

    /// Folder for the matrix (JSON and a heat map), for the rays that fail, and for the cases that a search finds
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,

    /// Name every case, and where it is from
    #[arg(long, conflicts_with_all = ["cases", "backend", "methods", "rays", "in_turns", "search", "json", "output"])]
    list: bool,
}

fn methods() -> impl TypedValueParser<Value = Column> {
    one_of(columns(), Column::name, |column| match column {
        Column::Native => "The native tracer, in every form",
        Column::Accel(_) => "An accelerator, with the exact methods",
        Column::Triangle(method) => method.source(),
        Column::Sphere(method) => method.source(),
        #[cfg(feature = "embree")]
        Column::Embree(_) => "Embree, in packets of every width",
    })
}

pub(super) fn run(args: &StressArgs) -> Result<()> {
    if args.list {
        return say(list().trim_end());
    }
    if let Some(backend) = args.backend {
        backend.check_available()?;
    }
    let cancel = interrupt::install()?;
    let columns = args.columns()?;
    if let Some(folder) = &args.output {
        fs::create_dir_all(folder).map_err(|error| Error::output(folder, error.to_string()))?;
        let files = args.search.map_or(MATRIX.to_vec(), |_| vec!["found-0.json"]);
        let files: Vec<PathBuf> = files.into_iter().map(|name| folder.join(name)).collect();
        let cases: Vec<PathBuf> =
            args.cases.iter().map(PathBuf::from).filter(|path| file::is_case_file(path)).collect();
        outputs::check(&[], &files, &cases)?;
    }
    let control = Control::stopping(Some(cancel));
    match args.search {
        Some(seconds) => search(args, columns, Duration::from_secs(seconds), control),
        None => matrix(args, columns, control),
    }
}

impl StressArgs {
    fn columns(&self) -> Result<Vec<Column>> {
        let mut chosen = match &self.methods[..] {
            [] if self.search.is_some() => vec![Column::Native],
            [] => columns(),
            methods => methods.to_vec(),
        };
        match self.backend {
            None | Some(BackendArg::Both) => {}
            Some(BackendArg::Native) => chosen.retain(|column| column.is_native()),
            Some(BackendArg::Embree) => chosen.retain(|column| !column.is_native()),
        }
        if chosen.is_empty() {
            return Err(Error::Usage("no method is left: --method names none of --backend".to_owned()));
        }
        Ok(chosen)
    }

    fn setup(&self, columns: Vec<Column>) -> Result<Setup> {
        let mut setup = Setup {
            cases: Vec::new(),
            own: Vec::new(),
            columns,
            rays: self.rays as usize,
            seed: self.seed,
            in_turns: self.in_turns,
        };
        for name in &self.cases {
            if file::is_case_file(Path::new(name)) {
                setup.own.push(file::read(Path::new(name))?);
                continue;
            }
            let case = catalogue().find(|case| case.name == name).ok_or_else(|| {
                let names = catalogue().map(|case| case.name).collect::<Vec<_>>().join(", ");
                Error::Usage(format!("no case {name:?}; there are {names}, and case files that end in .json"))
            })?;
            setup.cases.push(case);
        }
        if self.cases.is_empty() {
            setup.cases = catalogue().collect();
        }
        Ok(setup)
    }
}

fn matrix(args: &StressArgs, columns: Vec<Column>, control: Control<'_>) -> Result<()> {
    let setup = args.setup(columns)?;
    let bar = progress::bar(setup.cases.len() as u64, "stressing", args.json);
    let on_tile = |done| bar.inc(done);
    let report = setup.run(Control { on_tile: Some(&on_tile), ..control });
    bar.finish_and_clear();
    let report = report?;
    say_report(args.json, &report)?;
    if let Some(folder) = &args.output {
        let mut files = AtomicWrites::default();
        let [document, map, commands] = MATRIX.map(|name| folder.join(name));
        outputs::write_json(&mut files, &document, &report);
        outputs::write_beside(&mut files, &map, &heat_map(&report));
        outputs::write_beside(&mut files, &commands, &failing(&report));
        outputs::commit(files)?;
    }
    report.check()
}

/// Every ray that was kept, as the command that shows it again.
fn failing(report: &Report) -> String {
    let mut text = String::new();
    for row in &report.rows {
        for cell in &row.cells {
            for replay in &cell.replay {
                // A String takes everything.
                _ = writeln!(
                    text,
                    "# {} {}: {}\ntwincast trace {} --ray {} --oracle",
                    cell.column,
                    replay.form,
                    replay.fault.name(),
                    replay.scene,
                    replay.ray
                );
            }
        }
    }
    text
}

/// What a search found. Serialises as the document of `stress --search --json`.
#[derive(Serialize)]
struct Findings {
    seed: u64,
    rays: u64,
    found: Vec<Finding>,
}

#[derive(Serialize)]
struct Finding {
    who: String,
    fault: crate::lab::stress::Fault,
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<PathBuf>,
}

fn search(args: &StressArgs, columns: Vec<Column>, time: Duration, control: Control<'_>) -> Result<()> {
    // What a native tracer must not do at all, others may be found to do a few times.
    const ENOUGH: usize = 10;
    let search = Search { columns, time: Some(time), most: u64::MAX, enough: ENOUGH, seed: args.seed };
    let (rays, found) = search.run(control)?;
    let wrong = found.iter().filter(|found| found.column.is_exact()).count();
    let mut findings = Findings { seed: args.seed, rays, found: Vec::new() };
    let mut files = AtomicWrites::default();
    for (i, Found { who, fault, text, .. }) in found.into_iter().enumerate() {
        let file = args.output.as_ref().map(|folder| folder.join(format!("found-{i}.json")));
        if let Some(path) = &file {
            outputs::write_beside(&mut files, path, &text);
        }
        findings.found.push(Finding { who, fault, file });
    }
    // What was found is told all the same where it cannot be written.
    let written = outputs::commit(files);
    if args.json {
        say_json(&findings)?;
    } else {
        let mut text = format!("{rays} rays, seed {}: {} found", args.seed, findings.found.len());
        for Finding { who, fault, file } in &findings.found {
            let place = file.as_ref().map_or(String::new(), |path| format!(", {}", path.display()));
            _ = write!(text, "\n  {who}: {fault:?}{place}");
        }
        say(text)?;
    }
    written?;
    match wrong {
        0 => interrupt::check(),
        _ => Err(Error::Check(format!("{wrong} of what was found must not be: a native tracer is wrong"))),
    }
}

fn list() -> String {
    let line = |Case { name, about, source, .. }: Case| format!("{name:<17} {about}\n{:<17} {source}\n", "");
    catalogue().map(line).collect()
}
