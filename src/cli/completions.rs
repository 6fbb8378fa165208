//! `twincast completions`: the command line, known to a shell.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Cli, say};
use crate::error::Result;

/// Print a completion script for a shell
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  twincast completions bash > ~/.local/share/bash-completion/completions/twincast")]
pub(super) struct CompletionsArgs {
    /// Which shell
    shell: Shell,
}

pub(super) fn run(args: &CompletionsArgs) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "twincast", &mut script);
    say(String::from_utf8_lossy(&script).trim_end())
}
