//! Numbers as colours: a panel of cells for each method.

use super::scatter::{BODY, INK, NOTE, PANEL, TITLE};
use crate::lab::drawing::{Anchor, Drawing};

const WIDTH: f64 = 960.0;
const MARGIN: f64 = 24.0;
const NUMBERS: f64 = 50.0;
const GAP: f64 = 24.0;
const CELL: f64 = 22.0;
const ABOVE: f64 = 28.0;
const BELOW: f64 = 48.0;

/// White for nothing, then from pale to dark with each power of ten (after Brewer's OrRd, 2003).
const STEPS: [(f64, &str, &str); 6] = [
    (0.0, "#ffffff", "none"),
    (0.001, "#fef0d9", "to 0.1 %"),
    (0.01, "#fdcc8a", "to 1 %"),
    (0.1, "#fc8d59", "to 10 %"),
    (0.5, "#d7301f", "to 50 %"),
    (1.0, "#7f0000", "more"),
];

/// Cells of one method: rows from the top, each from left to right, shares from 0 to 1.
pub(super) struct Map {
    pub title: String,
    pub rows: Vec<Vec<f64>>,
}

/// What the maps have in common.
pub(super) struct Heat<'a> {
    pub title: &'a str,
    /// Below each column, and what they are.
    pub columns: (Vec<String>, &'a str),
    /// Beside each row, and what they are.
    pub rows: (Vec<String>, &'a str),
    pub maps: Vec<Map>,
}

impl Heat<'_> {
    /// The drawing, and its size.
    pub fn draw(&self) -> (Drawing, (f64, f64)) {
        let mut drawing = Drawing::new();
        drawing.text((MARGIN, MARGIN + 12.0), Anchor::Start, TITLE, self.title);
        let mut y = MARGIN + 36.0;
        let mut x = MARGIN;
        for (_, color, meaning) in STEPS {
            outlined(&mut drawing, (x, y - 11.0), 13.0, color);
            drawing.text((x + 19.0, y), Anchor::Start, BODY, meaning);
            x += 46.0 + 6.4 * meaning.len() as f64;
        }
        let across = self.columns.0.len() as f64 * CELL;
        let down = self.rows.0.len() as f64 * CELL;
        let in_a_row = ((WIDTH - 2.0 * MARGIN + GAP) / (NUMBERS + across + GAP)).floor().max(1.0) as usize;
        for maps in self.maps.chunks(in_a_row) {
            y += ABOVE;
            for (map, i) in maps.iter().zip(0u32..) {
                let x = MARGIN + NUMBERS + f64::from(i) * (NUMBERS + across + GAP);
                self.draw_map(&mut drawing, (x, y), map);
            }
            drawing.text_upwards((MARGIN + 10.0, y + down / 2.0), Anchor::Middle, BODY, self.rows.1);
            y += down + BELOW;
        }
        (drawing, (WIDTH, (y + MARGIN / 2.0).ceil()))
    }

    fn draw_map(&self, drawing: &mut Drawing, (x, y): (f64, f64), map: &Map) {
        drawing.text((x, y - 8.0), Anchor::Start, PANEL, &map.title);
        for ((row, name), i) in map.rows.iter().zip(&self.rows.0).zip(0u32..) {
            let top = y + f64::from(i) * CELL;
            drawing.text((x - 5.0, top + CELL / 2.0 + 4.0), Anchor::End, NOTE, name);
            for (&share, j) in row.iter().zip(0u32..) {
                outlined(drawing, (x + f64::from(j) * CELL, top), CELL - 1.0, color(share));
            }
        }
        let bottom = y + map.rows.len() as f64 * CELL;
        for (name, j) in self.columns.0.iter().zip(0u32..) {
            drawing.text((x + (f64::from(j) + 0.5) * CELL, bottom + 13.0), Anchor::Middle, NOTE, name);
        }
        let middle = x + self.columns.0.len() as f64 * CELL / 2.0;
        drawing.text((middle, bottom + 30.0), Anchor::Middle, BODY, self.columns.1);
    }
}

/// A square that is seen on white as well.
fn outlined(drawing: &mut Drawing, (x, y): (f64, f64), side: f64, color: &str) {
    drawing.rectangle((x, y), (side, side), if color == STEPS[0].1 { "#cccccc" } else { INK });
    drawing.rectangle((x + 0.5, y + 0.5), (side - 1.0, side - 1.0), color);
}

fn color(share: f64) -> &'static str {
    STEPS.iter().find(|(most, ..)| share <= *most).unwrap_or(&STEPS[5]).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_white_and_anything_is_not() {
        let colors = [0.0, 1e-9, 0.001, 0.0011, 0.05, 0.3, 0.9, 1.0].map(color);
        let expected = ["#ffffff", "#fef0d9", "#fef0d9", "#fdcc8a", "#fc8d59", "#d7301f", "#7f0000", "#7f0000"];
        assert_eq!(colors, expected);
        let heat = Heat {
            title: "Title",
            columns: (vec!["1".into(), "2".into()], "x"),
            rows: (vec!["a".into(), "b".into(), "c".into()], "y"),
            maps: vec![Map { title: "m".into(), rows: vec![vec![0.0, 1.0]; 3] }],
        };
        let (drawing, (width, height)) = heat.draw();
        let svg = drawing.svg(width, height);
        // A cell is its rim and its inside; three of the darkest, and one in the legend.
        assert_eq!(svg.matches("fill=\"#7f0000\"").count(), 4);
        assert_eq!(svg.matches("<rect").count(), 1 + 2 * (6 + 6));
    }
}
