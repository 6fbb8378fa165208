//! `twincast man`: the manual.

use std::path::PathBuf;

use clap::{Args, CommandFactory};

use super::{Cli, say};
use crate::error::{Error, Result};

/// Print the manual page, or write one for each command
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  twincast man --out /usr/local/share/man/man1")]
pub(super) struct ManArgs {
    /// Write twincast.1 and a page for each command into this folder, which must exist
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(super) fn run(args: &ManArgs) -> Result<()> {
    if let Some(folder) = &args.out {
        clap_mangen::generate_to(Cli::command(), folder)
            .map_err(|error| Error::output(folder, format!("manual pages could not be written: {error}")))?;
        return say(format_args!("wrote {} and a page for each command", folder.join("twincast.1").display()));
    }
    let mut page = Vec::new();
    clap_mangen::Man::new(Cli::command())
        .render(&mut page)
        .map_err(|error| Error::output("<stdout>", error.to_string()))?;
    say(String::from_utf8_lossy(&page).trim_end())
}
