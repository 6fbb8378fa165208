//! The program, run as a user runs it.

use std::process::{Command, Output};

/// Runs it to its end.
pub fn twincast(args: &[&str]) -> Output {
    command().args(args).output().expect("the program runs")
}

/// It, for whoever has more to say than arguments.
pub fn command() -> Command {
    Command::new(env!("CARGO_BIN_EXE_twincast"))
}

/// What it said.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}
