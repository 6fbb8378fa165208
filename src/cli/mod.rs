//! The command line: a file for each subcommand, for each group of flags that several of them take, and for what they
//! need to do their work.
//!
//! Arguments go in, the library does the work, an exit code comes out. Completions and the manual are made from the
//! same definition, [`Cli`]. The module is public for the binary and the tests; it is no part of the library's promise.

mod accel;
mod aov;
mod bench;
mod build;
mod cache;
mod camera;
mod chart;
mod checkpoint;
mod common;
mod compare;
mod completions;
mod denoise;
mod display;
mod engine;
mod explain;
mod frames;
mod info;
mod interrupt;
mod leave;
mod light;
mod make;
mod man;
mod named;
mod outputs;
mod picture;
mod plan;
mod progress;
mod render;
mod report;
mod request;
mod response;
mod scaling;
#[cfg(unix)]
mod signals;
mod stress;
mod summary;
mod threads;
mod trace;
mod trial;

use std::ffi::OsString;
use std::fmt::Display;
use std::io::{ErrorKind, Write};

use clap::{Arg, CommandFactory, FromArgMatches, Parser, Subcommand};
use serde::Serialize;

use crate::error::{Error, Result, Warning};

/// A ray caster with two engines that check each other: Intel Embree and a native BVH.
#[derive(Debug, Parser)]
#[command(name = "twincast", version, long_version = LONG_VERSION, after_help = EXIT_CODES, max_term_width = 110)]
#[command(subcommand_required = true, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
enum Command {
    Render(Box<render::RenderArgs>),
    Compare(Box<compare::CompareArgs>),
    Bench(bench::BenchArgs),
    Chart(chart::ChartArgs),
    Plan(Box<plan::PlanCommand>),
    Info(info::InfoArgs),
    Stress(stress::StressArgs),
    Trace(Box<trace::TraceArgs>),
    Make(make::MakeArgs),
    Completions(completions::CompletionsArgs),
    Man(man::ManArgs),
}

impl Command {
    fn run(&self) -> Result<()> {
        match self {
            Self::Render(args) => render::run(args),
            Self::Compare(args) => compare::run(args),
            Self::Bench(args) => bench::run(args),
            Self::Chart(args) => chart::run(args),
            Self::Plan(args) => plan::run(args),
            Self::Info(args) => info::run(args),
            Self::Stress(args) => stress::run(args),
            Self::Trace(args) => trace::run(args),
            Self::Make(args) => make::run(args),
            Self::Completions(args) => completions::run(args),
            Self::Man(args) => man::run(args),
        }
    }
}

const LONG_VERSION: &str = match (cfg!(feature = "embree"), cfg!(feature = "oiio")) {
    (true, true) => concat!(env!("CARGO_PKG_VERSION"), "\nengines: native, embree\nimage files: OpenImageIO"),
    (true, false) => concat!(env!("CARGO_PKG_VERSION"), "\nengines: native, embree\nimage files: EXR, PNG, JPEG"),
    (false, true) => concat!(env!("CARGO_PKG_VERSION"), "\nengines: native\nimage files: OpenImageIO"),
    (false, false) => concat!(env!("CARGO_PKG_VERSION"), "\nengines: native\nimage files: EXR, PNG, JPEG"),
};

const EXIT_CODES: &str = "\
Exit codes:
  0    done
  1    the check it ran did not hold
  2    bad usage
  3    bad scene or input file, too little memory, or an engine that failed
  4    output could not be written
  5    a backend or feature that this build or this machine does not have
  130  interrupted";

/// Runs the program on the process's own arguments, and ends the process with its exit code.
pub fn main() -> ! {
    #[cfg(unix)]
    signals::tell_of_missing_pages();
    leave::leave(main_with(std::env::args_os()))
}

/// Runs the program on these arguments, of which the first is its name, and returns its exit code.
pub fn main_with(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    // So that a number that is too small is told to be that, and not an unknown flag.
    let takes_value = |arg: &Arg| !arg.is_positional() && arg.get_action().takes_values();
    let numbers = |arg: Arg| if takes_value(&arg) { arg.allow_negative_numbers(true) } else { arg };
    let parser = Cli::command().mut_subcommands(|command| command.mut_args(numbers));
    let parsed = parser.try_get_matches_from(arguments).and_then(|matches| Cli::from_arg_matches(&matches));
    let outcome = match parsed {
        Ok(cli) => cli.command.run(),
        Err(error) => {
            let printed = error.print().and_then(|()| std::io::stdout().flush());
            return match printed {
                // What was asked for, help or a version, and could not be told. Where stderr is closed, nobody is left
                // to be told of that.
                Err(failed) if !error.use_stderr() && failed.kind() != ErrorKind::BrokenPipe => {
                    let failed = Error::output("<stdout>", failed.to_string());
                    complain("error", &failed);
                    failed.exit_code()
                }
                _ => error.exit_code() as u8,
            };
        }
    };
    match outcome {
        Ok(()) => 0,
        Err(error) => {
            complain("error", &error);
            error.exit_code()
        }
    }
}

/// Prints on stdout. A reader that has gone away is no error.
fn say(text: impl Display) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(format!("{text}\n").as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Error::output("<stdout>", error.to_string())),
        _ => Ok(()),
    }
}

/// Prints one JSON document on stdout, in one line.
fn say_json(document: &impl Serialize) -> Result<()> {
    say(serde_json::to_string(document).map_err(|error| Error::output("<stdout>", error.to_string()))?)
}

/// Prints a report on stdout, as JSON or for people.
fn say_report(json: bool, report: &(impl Serialize + Display)) -> Result<()> {
    if json { say_json(report) } else { say(report.to_string().trim_end()) }
}

/// Prints warnings on stderr.
fn warn(warnings: &[Warning]) {
    for warning in warnings {
        complain("warning", warning);
    }
}

fn complain(kind: &str, message: &dyn Display) {
    // Nobody is left to be told that stderr is closed.
    let _ = writeln!(std::io::stderr(), "{kind}: {message}");
}
