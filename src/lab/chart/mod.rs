//! Speed against accuracy, drawn: what a method costs beside how often it is wrong.
//!
//! | file | idea |
//! | --- | --- |
//! | `triangles` | ways to meet a triangle: time against leaks |
//! | `engines` | native and Embree in every mode: rays a second against wrong hits |
//! | `scales` | where ways to meet a triangle fail, by size and distance |
//! | `samplers` | samplers, filters and adaptive sampling: time against error |
//! | `rate` | how often something happens, and how well that is known |
//! | `scatter`, `axis`, `labels` | points with error bars and the Pareto front |
//! | `heat` | numbers as colours |
//! | `page` | all charts as one page |
//!
//! Times are medians of runs in turn, from the smallest to the largest; what is right is told by the
//! [oracle](super::oracle), by exact arithmetic or by a reference of many more samples. Times move with the machine, so
//! that only what stands in one chart can be compared; counts of errors are the same on every machine.

mod axis;
mod engines;
mod heat;
mod labels;
mod page;
mod rate;
mod samplers;
mod scales;
mod scatter;
mod triangles;

use std::sync::atomic::AtomicBool;

pub use page::page;

use super::bench::processor;
use super::drawing::Drawing;
use crate::error::Result;
use crate::image::Image;
use crate::render::Control;

/// Pixels of a picture for each unit of a drawing.
const SCALE: f64 = 2.0;

/// How charts are made.
#[derive(Clone, Copy, Default)]
pub struct Setup<'a> {
    /// Whether fewer rays, samples and turns will do.
    pub quick: bool,
    /// Set to stop.
    pub cancel: Option<&'a AtomicBool>,
    /// Called with what is measured next.
    pub on_step: Option<&'a dyn Fn(&str)>,
}

/// A chart, and the numbers that it shows.
#[derive(Clone, Debug)]
pub struct Figure {
    /// For files.
    pub name: &'static str,
    /// What it shows, in a line.
    pub title: String,
    /// How it was made, and how to read it.
    pub caption: String,
    /// The numbers, one line a point, the first line naming the columns.
    pub csv: String,
    drawing: Drawing,
    size: (f64, f64),
}

impl Figure {
    /// As SVG.
    pub fn svg(&self) -> String {
        self.drawing.svg(self.size.0, self.size.1)
    }

    /// As pixels, two to a unit.
    pub fn picture(&self) -> Image {
        self.drawing.pixels(self.size.0, self.size.1, SCALE)
    }
}

/// A chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chart {
    /// Ways to meet a triangle: time against leaks.
    Triangles,
    /// Native and Embree in every mode: rays a second against wrong hits.
    Engines,
    /// Where ways to meet a triangle fail, by size and distance.
    Scales,
    /// Samplers, filters and adaptive sampling: time against error.
    Samplers,
}

impl Chart {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Triangles, Self::Engines, Self::Scales, Self::Samplers];

    /// As flags and files have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Engines => "engines",
            Self::Scales => "scales",
            Self::Samplers => "samplers",
        }
    }

    /// Measures and draws.
    ///
    /// # Errors
    /// [`Error::Interrupted`](crate::Error::Interrupted) once it is to stop, and those of engines and renders.
    pub fn make(self, setup: &Setup<'_>) -> Result<Figure> {
        match self {
            Self::Triangles => triangles::figure(setup),
            Self::Engines => engines::figure(setup),
            Self::Scales => scales::figure(setup),
            Self::Samplers => samplers::figure(setup),
        }
    }
}

impl Setup<'_> {
    /// One of two numbers.
    const fn pick<T: Copy>(&self, quick: T, thorough: T) -> T {
        if self.quick { quick } else { thorough }
    }

    fn control(&self) -> Control<'_> {
        Control::stopping(self.cancel)
    }

    /// Says what comes next.
    fn step(&self, what: &str) -> Result<()> {
        self.control().check()?;
        if let Some(on_step) = self.on_step {
            on_step(what);
        }
        Ok(())
    }

    /// What figures were made by, for captions.
    fn made_by(&self) -> String {
        let build = if cfg!(debug_assertions) { "a debug build, whose times mean nothing" } else { "a release build" };
        let quick = if self.quick { ", --quick" } else { "" };
        format!("Twincast {}, {build}, on {}{quick}.", env!("CARGO_PKG_VERSION"), processor())
    }
}

/// A table as text: fields that hold a comma, a quote or a line's end stand in quotes.
fn csv<const N: usize>(columns: [&str; N], rows: impl IntoIterator<Item = [String; N]>) -> String {
    let field = |field: &str| {
        if field.contains([',', '"', '\n', '\r']) {
            format!("\"{}\"", field.replace('"', "\"\""))
        } else {
            field.to_owned()
        }
    };
    let line = |fields: [&str; N]| fields.map(field).join(",") + "\n";
    rows.into_iter().fold(line(columns), |text, row| text + &line(row.each_ref().map(String::as_str)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_quote_what_would_part_them() {
        let rows = [["a,b".to_owned(), "say \"x\"".to_owned()], ["1".to_owned(), String::new()]];
        assert_eq!(csv(["one", "two"], rows), "one,two\n\"a,b\",\"say \"\"x\"\"\"\n1,\n");
    }
}
