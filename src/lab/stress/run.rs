//! The matrix: every column on every case.

use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;

use super::expected::expected;
use super::report::{Cell, Replay, Report, Row};
use super::verdict::{Fault, Gate, Tally, Verdict};
use super::{Case, Column, Probe};
use crate::error::Result;
use crate::lab::hex;
use crate::lab::tree::{Exact, Oracle};
use crate::ray::{Hit, Ray};
use crate::render::Control;
use crate::trace::{Batch, Tracer};

/// Rays that are asked together.
const CHUNK: usize = 1024;
/// Rays that are kept of those that fail, for each form of a column.
const KEPT: usize = 3;

/// What is run.
pub struct Setup {
    /// Which cases.
    pub cases: Vec<Case>,
    /// Cases of the caller's own, by name; nothing is expected of them.
    pub own: Vec<(String, Probe)>,
    /// Which columns.
    pub columns: Vec<Column>,
    /// About how many rays a case.
    pub rays: usize,
    /// Chooses the rays.
    pub seed: u64,
    /// Whether the forms of a column share the rays out among them, for very many rays; otherwise each answers all of
    /// them.
    pub in_turns: bool,
}

/// What one form of a column made of a case.
#[derive(Default)]
struct Form {
    tally: Tally,
    replay: Vec<Replay>,
}

impl Setup {
    /// Rays a case where none are asked for: what is expected to fail is recorded for these.
    pub const RAYS: usize = 1500;
    /// The seed that goes with it.
    pub const SEED: u64 = 0;

    /// Runs it all; `control.on_tile` hears of every case.
    ///
    /// # Errors
    /// [`Error::Interrupted`](crate::Error::Interrupted), and those of Embree.
    pub fn run(&self, control: Control<'_>) -> Result<Report> {
        let mut rows = Vec::new();
        let is_recorded = self.rays == Self::RAYS && self.seed == Self::SEED && !self.in_turns;
        for case in &self.cases {
            let row = Row::new(case.name, case.about, case.source, case.gate, case.t_relative);
            let expected = |column: Column| if is_recorded { expected(case.name, column) } else { None };
            rows.push(self.row(row, &case.probes(self.rays, self.seed), expected, &control)?);
            if let Some(on_tile) = control.on_tile {
                on_tile(1);
            }
        }
        for (name, probe) in &self.own {
            let row = Row::new(name, "from a file", "", Gate::Hits, None);
            rows.push(self.row(row, std::slice::from_ref(probe), |_| None, &control)?);
        }
        Ok(Report { rays: self.rays, seed: self.seed, rows })
    }

    fn row(
        &self,
        mut row: Row,
        probes: &[Probe],
        expected: impl Fn(Column) -> Option<char>,
        control: &Control<'_>,
    ) -> Result<Row> {
        let mut forms: Vec<BTreeMap<String, Form>> = self.columns.iter().map(|_| BTreeMap::new()).collect();
        for probe in probes {
            let start = Instant::now();
            let oracle = Oracle::new(&probe.world, 0.0);
            let exact: Vec<Exact> = probe.rays.par_iter().map(|ray| oracle.closest(ray)).collect();
            row.oracle_seconds += start.elapsed().as_secs_f64();
            row.rays += exact.len() as u64;
            row.hits += exact.iter().filter(|exact| !exact.nearest.is_empty()).count() as u64;
            row.touching += exact.iter().filter(|exact| exact.touches).count() as u64;
            let scene = match probe.label.as_str() {
                "" => format!("case:{}", row.name),
                label => format!("case:{}/{label}", row.name),
            };
            for (column, forms) in self.columns.iter().zip(&mut forms) {
                control.check()?;
                if !column.applies(&probe.world) {
                    continue;
                }
                let gate = column.gate(row.gate);
                let shares = if self.in_turns { column.forms() } else { 1 };
                let mut turn = 0;
                column.each(&probe.world, &mut |name, tracer, batch| {
                    let share = share(exact.len(), turn % shares, shares);
                    turn += 1;
                    let (rays, exact) = (&probe.rays[share.clone()], &exact[share]);
                    let (found, occluded) = answers(tracer, rays, batch);
                    let form = forms.entry(name.to_owned()).or_default();
                    let failing = form.tally.add(gate, rays, exact, &found, &occluded);
                    let room = KEPT.saturating_sub(form.replay.len());
                    let replay = |(i, fault): (usize, Fault)| Replay {
                        form: name.to_owned(),
                        fault,
                        scene: scene.clone(),
                        ray: hex::ray_to_hex(&rays[i]),
                    };
                    form.replay.extend(failing.into_iter().take(room).map(replay));
                    Ok(())
                })?;
            }
        }
        for (&column, forms) in self.columns.iter().zip(forms) {
            row.cells.extend(cell(column, forms, row.t_relative, &expected));
        }
        Ok(row)
    }
}

/// Which of so many rays are those of a turn.
fn share(rays: usize, turn: usize, turns: usize) -> Range<usize> {
    rays * turn / turns..rays * (turn + 1) / turns
}

/// Nearest hits, and whether there is any, of all rays.
pub(super) fn answers(tracer: &dyn Tracer, rays: &[Ray], batch: Batch) -> (Vec<Option<Hit>>, Vec<bool>) {
    let (mut found, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
    let chunks = rays.par_chunks(CHUNK).zip(found.par_chunks_mut(CHUNK)).zip(occluded.par_chunks_mut(CHUNK));
    chunks.for_each(|((rays, found), occluded)| {
        tracer.closest_batch(rays, found, batch);
        tracer.occluded_batch(rays, occluded, batch);
    });
    (found, occluded)
}

/// None for a column that nothing in the case is about.
fn cell(
    column: Column,
    forms: BTreeMap<String, Form>,
    t_relative: Option<f64>,
    expected: &impl Fn(Column) -> Option<char>,
) -> Option<Cell> {
    if forms.is_empty() {
        return None;
    }
    let count = forms.len();
    let mut failing = 0;
    let mut worst: Option<(bool, Verdict, Form)> = None;
    for form in forms.into_values() {
        let verdict = form.tally.verdict();
        let fails = verdict.failing > 0 || t_relative.is_some_and(|bound| verdict.t_relative_max > bound);
        failing += usize::from(fails);
        let is_worse = worst.as_ref().is_none_or(|(also, other, _)| {
            (fails, verdict.failing, verdict.t_relative_max) > (*also, other.failing, other.t_relative_max)
        });
        if is_worse {
            worst = Some((fails, verdict, form));
        }
    }
    let (_, verdict, form) = worst?;
    let mark = match failing {
        0 => '.',
        all if all == count => 'x',
        _ => '-',
    };
    let expected = expected(column);
    Some(Cell {
        column: column.name(),
        is_exact: column.is_exact(),
        mark,
        expected,
        forms: count,
        verdict,
        replay: form.replay,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::stress::{catalogue, columns};

    #[test]
    fn turns_leave_no_ray_out_and_none_twice() {
        for (rays, turns) in [(0, 3), (2, 3), (7, 3), (1000, 7), (61, 60)] {
            let all: Vec<usize> = (0..turns).flat_map(|turn| share(rays, turn, turns)).collect();
            assert_eq!(all, (0..rays).collect::<Vec<_>>());
        }
    }

    #[test]
    fn forms_are_as_many_as_are_asked() {
        let case = catalogue().find(|case| case.name == "soups").expect("it is in the catalogue");
        let probe = &case.probes(1, 0)[0];
        for column in columns() {
            let mut asked = 0;
            let mut count = |_: &str, _: &dyn Tracer, _| {
                asked += 1;
                Ok(())
            };
            column.each(&probe.world, &mut count).expect("it can be built");
            assert_eq!(asked, column.forms(), "{}", column.name());
        }
    }
}
