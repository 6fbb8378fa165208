//! The matrix as a picture: the redder, the more rays fail.

use super::report::{Report, short};
use crate::lab::drawing::{Anchor, Drawing, Font};

const CELL: (f64, f64) = (58.0, 20.0);
const LEFT: f64 = 150.0;
const TOP: f64 = 150.0;

/// White for none, then from pale to dark red by the order of magnitude of failing rays a million.
const COLORS: [&str; 6] = ["#fee8d8", "#fdcaa8", "#fc9272", "#fb6a4a", "#de2d26", "#a50f15"];
const NONE: &str = "#e5f5e0";

/// As SVG.
pub fn heat_map(report: &Report) -> String {
    let columns = report.columns();
    let font = |size, bold| Font { size, bold, color: "#222222" };
    let mut drawing = Drawing::new();
    let title = format!("Rays that fail, of about {} a case, seed {}", report.rays, report.seed);
    drawing.text((10.0, 22.0), Anchor::Start, font(15.0, true), &title);
    drawing.text(
        (10.0, 40.0),
        Anchor::Start,
        font(11.0, false),
        "the worst form of each column; green: none; t: only the error of t",
    );
    for (i, name) in columns.iter().enumerate() {
        // Names are longer than cells are wide: on three lines in turn.
        let at = (LEFT + (i as f64 + 0.5) * CELL.0, TOP - 10.0 - (i % 4) as f64 * 16.0);
        drawing.text(at, Anchor::Middle, font(11.0, false), name);
    }
    for (j, row) in report.rows.iter().enumerate() {
        let y = TOP + j as f64 * CELL.1;
        drawing.text((LEFT - 8.0, y + 14.0), Anchor::End, font(11.0, false), &row.name);
        for (i, name) in columns.iter().enumerate() {
            let Some(cell) = row.cells.iter().find(|cell| cell.column == *name) else { continue };
            let x = LEFT + i as f64 * CELL.0;
            let failing = cell.verdict.failing;
            let (color, text) = match (cell.mark, failing) {
                ('.', _) => (NONE, String::new()),
                (_, 0) => (COLORS[0], "t".to_owned()),
                _ => {
                    let per_million = failing as f64 * 1e6 / cell.verdict.rays.max(1) as f64;
                    let order = per_million.max(1.0).log10() as usize;
                    (COLORS[order.min(COLORS.len() - 1)], short(failing))
                }
            };
            drawing.rectangle((x, y), (CELL.0 - 1.0, CELL.1 - 1.0), color);
            drawing.text((x + CELL.0 / 2.0, y + 14.0), Anchor::Middle, font(10.0, false), &text);
        }
    }
    drawing.svg(LEFT + columns.len() as f64 * CELL.0 + 40.0, TOP + report.rows.len() as f64 * CELL.1 + 20.0)
}
