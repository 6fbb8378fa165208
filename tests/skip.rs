//! Tests that cannot be run everywhere.

use std::fmt::Display;
use std::io::{Write, stderr};

/// Says why the test that calls it is not run. Straight to stderr, since what is printed in a test that passes is shown to
/// nobody.
pub(crate) fn skip(why: impl Display) {
    // Nobody is left to be told that stderr is closed.
    let _ = writeln!(stderr(), "skipped: {why}");
}
