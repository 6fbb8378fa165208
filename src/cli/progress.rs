//! What is being done and how far it is, on stderr, while a file is loaded, a tree is built and a picture is rendered.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar over so many pixels, bytes or whatever `what` counts; invisible where `quiet` or where stderr is not a
/// terminal.
pub(super) fn bar(count: u64, what: &str, quiet: bool) -> ProgressBar {
    show(Some(count), "{msg} [{bar:40}] {percent:>3} %, {elapsed} of {duration}", what, quiet)
}

/// The time that something takes whose end is not known, in the place of a bar: builds by Embree, and by accelerators
/// that do not tell.
pub(super) fn spinner(what: &str, quiet: bool) -> ProgressBar {
    show(None, "{msg} {spinner} {elapsed}", what, quiet)
}

fn show(count: Option<u64>, template: &str, what: &str, quiet: bool) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::with_draw_target(count, ProgressDrawTarget::stderr());
    bar.set_style(if count.is_some() { style.progress_chars("=> ") } else { style });
    bar.set_message(what.to_owned());
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
