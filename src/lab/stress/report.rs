//! What came of the matrix, as a table and as a document.

use std::fmt;

use serde::Serialize;

use super::verdict::{Fault, Gate, Verdict};
use crate::error::{Error, Result};

/// The matrix. Serialises as the document of `stress --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// About how many rays a case.
    pub rays: usize,
    /// What chose them.
    pub seed: u64,
    /// One for each case.
    pub rows: Vec<Row>,
}

/// A case.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Its name.
    pub name: String,
    /// What is in it.
    pub about: String,
    /// Who found it.
    pub source: String,
    /// What those that are not exact are held to.
    pub gate: Gate,
    /// The largest relative error of t that passes, where that is what the case is about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_relative: Option<f64>,
    /// Rays that were asked.
    pub rays: u64,
    /// Rays that hit something, by the oracle.
    pub hits: u64,
    /// Rays that merely touch what they hit.
    pub touching: u64,
    /// What the oracle took for all of them, on all threads.
    pub oracle_seconds: f64,
    /// One for each column that something in the case is about.
    pub cells: Vec<Cell>,
}

/// A column in a case: the worst of its forms.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// The column's name.
    pub column: &'static str,
    /// Whether it must not fail.
    #[serde(skip)]
    pub is_exact: bool,
    /// `.` where no form fails the gate, `x` where all do, `-` where some do.
    pub mark: char,
    /// The mark that is on record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<char>,
    /// How many forms the column has: presets, widths, accelerators.
    pub forms: usize,
    /// Of the worst form.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// Some of the rays on which that form fails.
    pub replay: Vec<Replay>,
}

/// A ray that fails, to be looked at again with `twincast trace SCENE --ray RAY`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Replay {
    /// The form of the column; empty for an only one.
    pub form: String,
    /// What is wrong.
    pub fault: Fault,
    /// The case and its world.
    pub scene: String,
    /// To the bit.
    pub ray: String,
}

impl Row {
    /// Before anything was asked.
    pub(super) fn new(name: &str, about: &str, source: &str, gate: Gate, t_relative: Option<f64>) -> Self {
        let [name, about, source] = [name, about, source].map(str::to_owned);
        Self {
            name,
            about,
            source,
            gate,
            t_relative,
            rays: 0,
            hits: 0,
            touching: 0,
            oracle_seconds: 0.0,
            cells: Vec::new(),
        }
    }
}

impl Cell {
    /// What is not as it must be, or not as it is on record.
    fn breach(&self) -> Option<String> {
        let Self { column, verdict, .. } = self;
        if self.is_exact && self.mark != '.' {
            let example = self.replay.first().map_or(String::new(), |replay| {
                format!(
                    "; the first: twincast trace {} --ray {} ({}, {})",
                    replay.scene,
                    replay.ray,
                    replay.fault.name(),
                    replay.form
                )
            });
            let error = verdict.t_relative_max;
            return Some(format!(
                "{column} fails on {} of {} rays (t is off by {error:.1e}){example}",
                verdict.failing, verdict.rays
            ));
        }
        match self.expected {
            Some(expected) if expected != self.mark => Some(format!(
                "{column} is {:?} where {expected:?} is on record ({} of {} rays fail)",
                self.mark, verdict.failing, verdict.rays
            )),
            _ => None,
        }
    }
}

impl Report {
    /// # Errors
    /// [`Error::Check`] where something exact fails, and where reality is not what is on record, for better or worse.
    pub fn check(&self) -> Result<()> {
        let breaches: Vec<String> = self
            .rows
            .iter()
            .flat_map(|row| row.cells.iter().filter_map(|cell| Some(format!("{}: {}", row.name, cell.breach()?))))
            .collect();
        if breaches.is_empty() { Ok(()) } else { Err(Error::Check(breaches.join("\n       "))) }
    }

    /// The columns that are in any row, in order.
    pub(super) fn columns(&self) -> Vec<&'static str> {
        let mut names: Vec<&'static str> = Vec::new();
        let all = super::columns();
        for column in all.iter().map(|column| column.name()) {
            if self.rows.iter().any(|row| row.cells.iter().any(|cell| cell.column == column)) {
                names.push(column);
            }
        }
        names
    }
}

/// A count in at most five characters.
pub(super) fn short(count: u64) -> String {
    match count {
        0..10_000 => count.to_string(),
        10_000..1_000_000 => format!("{}k", count / 1000),
        _ => format!("{:.1}M", count as f64 / 1e6),
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let columns = self.columns();
        writeln!(f, "rays that fail the gate, of the worst form of each column; . is none, t is an error of t\n")?;
        for (i, name) in columns.iter().enumerate() {
            writeln!(f, "{:32}{}{name}", "", "|     ".repeat(i))?;
        }
        for row in &self.rows {
            write!(f, "{:<17}{:<6}{:>7}  ", row.name, row.gate.name(), short(row.rays))?;
            for name in &columns {
                let text = match row.cells.iter().find(|cell| cell.column == *name) {
                    None => String::new(),
                    Some(cell) if cell.mark == '.' => ".".to_owned(),
                    Some(cell) if cell.verdict.failing == 0 => "t".to_owned(),
                    Some(cell) => short(cell.verdict.failing),
                };
                write!(f, "{text:<6}")?;
            }
            writeln!(f)?;
        }
        let rays: u64 = self.rows.iter().map(|row| row.rays).sum();
        let seconds: f64 = self.rows.iter().map(|row| row.oracle_seconds).sum();
        let pace = rays as f64 / seconds.max(1e-9) * 60e-6;
        writeln!(f, "\nthe oracle answered {rays} rays, {pace:.1} million a minute")
    }
}
