//! Points in panels side by side: cost to the right, error upwards, so that the best are at the bottom left.

use super::axis::Axis;
use super::labels;
use crate::lab::bench::Spread;
use crate::lab::drawing::{Anchor, Drawing, Font};

const WIDTH: f64 = 960.0;
const MARGIN: f64 = 24.0;
/// Left of a plot, for its numbers.
const NUMBERS: f64 = 62.0;
const GAP: f64 = 26.0;
const HEIGHT: f64 = 300.0;
/// Between the rows of panels: their titles above, their axes below.
const ABOVE: f64 = 28.0;
const BELOW: f64 = 50.0;

pub(super) const INK: &str = "#222222";
pub(super) const GREY: &str = "#666666";
const GRID: &str = "#dddddd";
const FRONT: &str = "#999999";
pub(super) const TITLE: Font = Font { size: 18.0, bold: true, color: INK };
pub(super) const PANEL: Font = Font { size: 13.0, bold: true, color: INK };
pub(super) const BODY: Font = Font { size: 11.5, bold: false, color: INK };
pub(super) const NOTE: Font = Font { size: 11.0, bold: false, color: GREY };

/// Colours that can be told apart, also by most who see fewer (after Okabe and Ito 2008, *Color universal design*).
pub(super) const COLORS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c564b"];

/// One thing that was measured.
#[derive(Clone, Debug)]
pub(super) struct Point {
    /// Which entry of the legend.
    pub group: usize,
    /// What tells it from others of its group; may be empty.
    pub label: String,
    pub x: Spread,
    pub y: Spread,
}

/// A plot.
pub(super) struct Panel {
    pub title: String,
    pub points: Vec<Point>,
}

/// A whole chart.
pub(super) struct Scatter<'a> {
    pub title: &'a str,
    pub legend: &'a [&'a str],
    pub x: &'a str,
    pub y: &'a str,
    /// Whether a larger x is better: a rate, not a time.
    pub more_is_better: bool,
    /// Whether the points of a group are joined, in order.
    pub joined: bool,
    /// How many panels stand in a row.
    pub columns: usize,
    pub panels: Vec<Panel>,
}

impl Scatter<'_> {
    /// The drawing, and its size.
    pub fn draw(&self) -> (Drawing, (f64, f64)) {
        let mut drawing = Drawing::new();
        drawing.text((MARGIN, MARGIN + 12.0), Anchor::Start, TITLE, self.title);
        let mut y = MARGIN + 36.0;
        y = self.draw_legend(&mut drawing, y);
        // Panels share their axes, so that they can be compared.
        let all = || self.panels.iter().flat_map(|panel| &panel.points);
        let ends = |spread: Spread| [spread.min, spread.median, spread.max];
        // The upper end of an interval from zero needs no room of its own.
        let axes = (Axis::over(all().flat_map(|p| ends(p.x))), Axis::over(all().flat_map(|p| ends(p.y))));
        let columns = self.columns.max(1) as f64;
        let width = (WIDTH - 2.0 * MARGIN - NUMBERS - GAP * (columns - 1.0)) / columns;
        for row in self.panels.chunks(self.columns.max(1)) {
            y += ABOVE;
            let upwards = (MARGIN + 10.0, y + HEIGHT / 2.0);
            drawing.text_upwards(upwards, Anchor::Middle, BODY, self.y);
            for (panel, i) in row.iter().zip(0u32..) {
                let x = MARGIN + NUMBERS + f64::from(i) * (width + GAP);
                let plot = Plot { x, y, width, axes, is_first: i == 0 };
                self.draw_panel(&mut drawing, &plot, panel);
            }
            y += HEIGHT + BELOW;
        }
        (drawing, (WIDTH, (y + MARGIN / 2.0).ceil()))
    }

    fn draw_legend(&self, drawing: &mut Drawing, mut y: f64) -> f64 {
        let mut x = MARGIN;
        for (group, name) in self.legend.iter().enumerate() {
            let length = 34.0 + 6.6 * name.len() as f64;
            if x + length > WIDTH - MARGIN {
                (x, y) = (MARGIN, y + 18.0);
            }
            mark(drawing, (x + 5.0, y - 4.0), group);
            drawing.text((x + 15.0, y), Anchor::Start, BODY, name);
            x += length;
        }
        y += 18.0;
        drawing.stroke((MARGIN, y - 4.0), (MARGIN + 20.0, y - 4.0), FRONT, 2.0);
        let front = "Pareto front: nothing shown is better in both. Bars: see the caption.";
        drawing.text((MARGIN + 28.0, y), Anchor::Start, NOTE, front);
        y
    }

    fn draw_panel(&self, drawing: &mut Drawing, plot: &Plot, panel: &Panel) {
        drawing.text((plot.x, plot.y - 8.0), Anchor::Start, PANEL, &panel.title);
        plot.draw_axes(drawing, self.x);
        let front = front(&panel.points, self.more_is_better);
        for ends in front.windows(2) {
            let place = |point: &Point| (plot.across(point.x.median), plot.down(point.y.median));
            drawing.stroke(place(ends[0]), place(ends[1]), FRONT, 2.0);
        }
        if self.joined {
            for ends in panel.points.windows(2).filter(|ends| ends[0].group == ends[1].group) {
                let place = |point: &Point| (plot.across(point.x.median), plot.down(point.y.median));
                drawing.line(place(&ends[0]), place(&ends[1]), color(ends[0].group));
            }
        }
        for point in &panel.points {
            let (x, y) = (plot.across(point.x.median), plot.down(point.y.median));
            let color = color(point.group);
            drawing.line((plot.across(point.x.min), y), (plot.across(point.x.max), y), color);
            drawing.line((x, plot.down(point.y.min)), (x, plot.down(point.y.max)), color);
        }
        let at = |point: &Point| (plot.across(point.x.median), plot.down(point.y.median));
        let labels: Vec<_> = panel.points.iter().map(|point| (at(point), point.label.as_str())).collect();
        let placed = labels::place(&labels, [plot.x, plot.y, plot.x + plot.width, plot.y + HEIGHT]);
        for [from, to] in placed.iter().filter_map(|label| label.lead) {
            drawing.line(from, to, GREY);
        }
        for point in &panel.points {
            mark(drawing, at(point), point.group);
        }
        for label in placed {
            let point = &panel.points[label.index];
            drawing.text(label.at, Anchor::Start, Font { color: color(point.group), ..NOTE }, &point.label);
        }
    }
}

/// Of more groups than there are colours, the second of a colour is hollow.
fn mark(drawing: &mut Drawing, at: (f64, f64), group: usize) {
    let is_hollow = group / COLORS.len() % 2 == 1;
    if is_hollow { drawing.ring(at, 4.0, color(group)) } else { drawing.dot(at, 5.0, color(group)) }
}

fn color(group: usize) -> &'static str {
    COLORS[group % COLORS.len()]
}

/// Where a panel is drawn.
struct Plot {
    x: f64,
    y: f64,
    width: f64,
    axes: (Axis, Axis),
    /// Whether it is the first of its row, which has the numbers.
    is_first: bool,
}

impl Plot {
    fn across(&self, value: f64) -> f64 {
        self.x + self.axes.0.at(value) * self.width
    }

    fn down(&self, value: f64) -> f64 {
        self.y + (1.0 - self.axes.1.at(value)) * HEIGHT
    }

    fn draw_axes(&self, drawing: &mut Drawing, x_label: &str) {
        let (right, bottom) = (self.x + self.width, self.y + HEIGHT);
        for tick in self.axes.0.ticks() {
            let x = self.x + tick.at * self.width;
            drawing.line((x, self.y), (x, bottom), GRID);
            drawing.text((x, bottom + 15.0), Anchor::Middle, NOTE, &tick.label);
        }
        for tick in self.axes.1.ticks() {
            let y = self.y + (1.0 - tick.at) * HEIGHT;
            drawing.line((self.x, y), (right, y), GRID);
            if self.is_first {
                drawing.text((self.x - 6.0, y + 4.0), Anchor::End, NOTE, &tick.label);
            }
        }
        // The axis is broken before the bin of zero.
        let (x_gap, y_gap) = (self.axes.0.gap(), self.axes.1.gap());
        let below = |from: f64, to: f64| ((self.x + from * self.width, bottom), (self.x + to * self.width, bottom));
        let left =
            |from: f64, to: f64| ((self.x, self.y + (1.0 - from) * HEIGHT), (self.x, self.y + (1.0 - to) * HEIGHT));
        let parts = |gap: Option<(f64, f64)>| match gap {
            None => vec![(0.0, 1.0)],
            Some((end, begin)) => vec![(0.0, end), (begin, 1.0)],
        };
        for (from, to) in parts(x_gap) {
            let (a, b) = below(from, to);
            drawing.line(a, b, INK);
        }
        for (from, to) in parts(y_gap) {
            let (a, b) = left(from, to);
            drawing.line(a, b, INK);
        }
        drawing.text((self.x + self.width / 2.0, bottom + 34.0), Anchor::Middle, BODY, x_label);
    }
}

/// The points that no other is better than in one number and not worse in the other, by rising x.
pub(super) fn front(points: &[Point], more_is_better: bool) -> Vec<&Point> {
    let cost = |point: &Point| if more_is_better { -point.x.median } else { point.x.median };
    let beats = |a: &Point, b: &Point| {
        let (x, y) = ((cost(a), cost(b)), (a.y.median, b.y.median));
        x.0 <= x.1 && y.0 <= y.1 && (x.0 < x.1 || y.0 < y.1)
    };
    let mut best: Vec<&Point> = points.iter().filter(|point| !points.iter().any(|other| beats(other, point))).collect();
    best.sort_by(|a, b| a.x.median.total_cmp(&b.x.median));
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(group: usize, x: f64, y: f64) -> Point {
        let exactly = |x| Spread { min: 0.9 * x, median: x, max: 1.1 * x };
        Point { group, label: format!("{group}"), x: exactly(x), y: exactly(y) }
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let points = [(1.0, 9.0), (2.0, 3.0), (3.0, 4.0), (4.0, 0.0), (5.0, 0.0), (2.5, 2.0)];
        let points: Vec<Point> = (0..).zip(points).map(|(i, (x, y))| point(i, x, y)).collect();
        let groups = |more| front(&points, more).iter().map(|point| point.group).collect::<Vec<_>>();
        assert_eq!(groups(false), [0, 1, 5, 3]);
        assert_eq!(groups(true), [4]);
        assert!(front(&[], true).is_empty());
    }

    #[test]
    fn all_that_is_drawn_is_inside_and_every_point_is_there() {
        let panel = |i: usize| Panel {
            title: format!("panel {i} & more"),
            points: vec![point(0, 1e-3, 0.0), point(1, 5.0, 100.0), point(1, 0.2, 1e6)],
        };
        let scatter = Scatter {
            title: "Title",
            legend: &["one", "two"],
            x: "seconds",
            y: "errors",
            more_is_better: false,
            joined: true,
            columns: 2,
            panels: (0..3).map(panel).collect(),
        };
        let (drawing, (width, height)) = scatter.draw();
        let svg = drawing.svg(width, height);
        let values = |name: &str| -> Vec<f64> {
            let pattern = format!(" {name}=\"");
            let after = svg.match_indices(&pattern).map(|(i, _)| &svg[i + pattern.len()..]);
            after.filter_map(|rest| rest.split('"').next()?.parse().ok()).collect()
        };
        for (names, most) in [(["x", "x1", "x2", "cx"], width), (["y", "y1", "y2", "cy"], height)] {
            let all: Vec<f64> = names.iter().flat_map(|name| values(name)).collect();
            assert!(all.len() > 50 && all.iter().all(|x| (0.0..=most).contains(x)), "{names:?} {all:?}");
        }
        // Nine points, and two in the legend.
        assert_eq!(svg.matches("<circle").count(), 11);
        assert!(svg.contains("panel 2 &amp; more") && svg.contains(">none<"));
    }
}
