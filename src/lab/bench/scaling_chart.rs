//! The scaling report as a picture: time against number, both on logarithmic axes, on which a power is a line and its
//! exponent the slope.

use super::scaling::{Family, Point, ScalingReport, Swept};
use crate::lab::drawing::{Anchor, Drawing, Font};

const WIDTH: f64 = 960.0;
const MARGIN: f64 = 28.0;
/// A plot with its axes, and what its numbers take on the left and below.
const PANEL: (f64, f64) = ((WIDTH - 3.0 * MARGIN) / 2.0, 300.0);
const NUMBERS: (f64, f64) = (52.0, 34.0);
const HEADING: f64 = 24.0;

const INK: &str = "#222222";
const GREY: &str = "#666666";
const LINES: &str = "#dddddd";
const TITLE: Font = Font { size: 19.0, bold: true, color: INK };
const HEAD: Font = Font { size: 13.0, bold: true, color: INK };
const BODY: Font = Font { size: 11.5, bold: false, color: INK };
const NOTE: Font = Font { size: 11.5, bold: false, color: GREY };

/// The accelerators and their colours: those that can be told apart by people who see few (after Okabe, Ito 2008).
const COLORS: [(&str, &str); 9] = [
    ("bvh", "#0072b2"),
    ("brute", "#222222"),
    ("groups", "#999999"),
    ("binary-bvh", "#56b4e9"),
    ("grid", "#d55e00"),
    ("octree", "#009e73"),
    ("kd-tree", "#cc79a7"),
    ("bsp", "#b8a000"),
    ("embree", "#7a3fa0"),
];

fn color(accel: &str) -> &'static str {
    COLORS.iter().find(|(name, _)| *name == accel).map_or(GREY, |(_, color)| color)
}

/// What a point is drawn by.
type Value = fn(&Point) -> f64;

/// The left and the right plot of a row.
const VALUES: [(&str, Value); 2] =
    [("microseconds a ray", |p| p.microseconds_a_ray), ("milliseconds to build", |p| p.build_seconds * 1e3)];

/// One line of a plot.
struct Series {
    color: &'static str,
    points: Vec<(f64, f64)>,
}

/// A chart of the report, an SVG document; `notes` say what was measured on what.
pub fn scaling_chart(report: &ScalingReport, notes: &[String]) -> String {
    let mut svg = Drawing::new();
    let mut y = MARGIN + 12.0;
    svg.text((MARGIN, y), Anchor::Start, TITLE, "Time against the number of triangles");
    for note in notes {
        y += 18.0;
        svg.text((MARGIN, y), Anchor::Start, NOTE, note);
    }
    y += 22.0;
    legend(&mut svg, y, report);
    y += 12.0;
    let places = [MARGIN, 2.0 * MARGIN + PANEL.0];
    for family in Family::ALL {
        for ((what, value), x) in VALUES.into_iter().zip(places) {
            let title = format!("{}: {what}", family.name());
            plot(&mut svg, (x, y), &title, "triangles", &series(report, family, value));
        }
        y += PANEL.1 + MARGIN;
    }
    if let Some(first) = report.grids.first() {
        let given = |value: Value| {
            let of = |swept: &Swept| Some((f64::from(swept.cells?), value(&swept.point)));
            report.grids.iter().filter_map(of).collect::<Vec<_>>()
        };
        let own = report.grids.iter().find(|swept| swept.cells.is_none()).map(|swept| &swept.point);
        let name = format!("grids of {} scattered triangles", first.point.primitives);
        for ((what, value), x) in VALUES.into_iter().zip(places) {
            let mut lines = vec![Series { color: color("grid"), points: given(value) }];
            if let Some(own) = own {
                // The grid's own choice, as a level to compare with.
                let ends = lines[0].points.iter().map(|&(cells, _)| (cells, value(own)));
                let level = Series { color: GREY, points: ends.collect() };
                lines.push(level);
            }
            plot(
                &mut svg,
                (x, y),
                &format!("{name}: {what}"),
                "cells along a side; grey: the grid's own choice",
                &lines,
            );
        }
        y += PANEL.1 + MARGIN;
    }
    for stopped in &report.stopped {
        svg.text((MARGIN, y), Anchor::Start, NOTE, stopped);
        y += 16.0;
    }
    svg.svg(WIDTH, (y + MARGIN).ceil())
}

/// The accelerators that were measured, in the order of [`COLORS`].
fn measured(report: &ScalingReport) -> impl Iterator<Item = (&'static str, &'static str)> {
    COLORS.into_iter().filter(|(name, _)| report.points.iter().any(|point| point.accel == *name))
}

fn legend(svg: &mut Drawing, y: f64, report: &ScalingReport) {
    let mut x = MARGIN;
    for (name, color) in measured(report) {
        svg.rectangle((x, y - 6.0), (18.0, 3.0), color);
        svg.text((x + 23.0, y), Anchor::Start, BODY, name);
        x += 42.0 + 6.2 * name.len() as f64;
    }
}

fn series(report: &ScalingReport, family: Family, value: Value) -> Vec<Series> {
    let of = |(name, color): (&'static str, &'static str)| {
        let points = report.points.iter().filter(|point| point.family == family && point.accel == name);
        Series { color, points: points.map(|point| (point.primitives as f64, value(point))).collect() }
    };
    measured(report).map(of).collect()
}

/// Decades that hold all of the numbers, from one power of ten to another.
fn decades(numbers: impl Iterator<Item = f64>) -> (i32, i32) {
    let logs = numbers.filter(|x| *x > 0.0 && x.is_finite()).map(f64::log10);
    let (low, high) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    if low > high { (0, 1) } else { (low.floor() as i32, (high.ceil() as i32).max(low.floor() as i32 + 1)) }
}

fn plot(svg: &mut Drawing, (x, y): (f64, f64), title: &str, across: &str, series: &[Series]) {
    svg.text((x, y + HEADING - 8.0), Anchor::Start, HEAD, title);
    let points = || series.iter().flat_map(|series| series.points.iter().copied());
    let (left, top) = (x + NUMBERS.0, y + HEADING);
    let (right, bottom) = (x + PANEL.0, y + PANEL.1 - NUMBERS.1);
    let columns = decades(points().map(|p| p.0));
    let rows = decades(points().map(|p| p.1));
    let share = |value: f64, (low, high): (i32, i32)| (value.log10() - f64::from(low)) / f64::from(high - low);
    let at = |(a, b): (f64, f64)| (left + share(a, columns) * (right - left), bottom - share(b, rows) * (bottom - top));
    for power in columns.0..=columns.1 {
        let (place, _) = at((10f64.powi(power), 1.0));
        svg.line((place, top), (place, bottom), LINES);
        svg.text((place, bottom + 14.0), Anchor::Middle, NOTE, &power_of_ten(power));
    }
    for power in rows.0..=rows.1 {
        let (_, place) = at((1.0, 10f64.powi(power)));
        svg.line((left, place), (right, place), LINES);
        svg.text((left - 6.0, place + 4.0), Anchor::End, NOTE, &power_of_ten(power));
    }
    svg.text((left.midpoint(right), bottom + 29.0), Anchor::Middle, NOTE, across);
    for Series { color, points } in series {
        let drawn: Vec<(f64, f64)> = points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0).map(|&p| at(p)).collect();
        drawn.windows(2).for_each(|pair| svg.line(pair[0], pair[1], color));
        drawn.iter().for_each(|&place| svg.ring(place, 2.5, color));
    }
}

/// As people write it: 0.001 to 1000, then 10k and 1M.
fn power_of_ten(power: i32) -> String {
    match power {
        ..0 => format!("{:.*}", power.unsigned_abs() as usize, 10f64.powi(power)),
        0..4 => format!("{}", 10f64.powi(power)),
        4..6 => format!("{}k", 10f64.powi(power - 3)),
        _ => format!("{}M", 10f64.powi(power - 6)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A power is a line: of three points with time n^2 the middle one is in the middle.
    #[test]
    fn powers_are_lines_and_numbers_are_read_off_the_axes() {
        let point = |primitives: u64, seconds: f64| Point {
            family: Family::Scattered,
            accel: "brute",
            primitives,
            build_seconds: seconds,
            microseconds_a_ray: (primitives * primitives) as f64,
            bytes_a_primitive: 1.0,
            bytes_a_primitive_building: None,
            notes: Vec::new(),
        };
        let points = vec![point(10, 1.0), point(100, 1.0), point(1000, 1.0)];
        let stopped = vec!["a < b".to_owned()];
        let svg = scaling_chart(&ScalingReport { points, stopped, grids: Vec::new() }, &["note".to_owned()]);
        let rings: Vec<(f64, f64)> = svg
            .lines()
            .filter(|line| line.starts_with("<circle"))
            .map(|line| {
                let number = |name: &str| {
                    let rest = line.split_once(&format!("{name}=\"")).expect("an attribute").1;
                    rest.split_once('"').expect("its end").0.parse::<f64>().expect("a number")
                };
                (number("cx"), number("cy"))
            })
            .collect();
        let [a, b, c] = rings[..3] else { panic!("{rings:?}") };
        assert!((a.0 + c.0 - 2.0 * b.0).abs() < 0.3 && (a.1 + c.1 - 2.0 * b.1).abs() < 0.3, "{rings:?}");
        assert!(a.0 < b.0 && a.1 > b.1, "larger is to the right and above: {rings:?}");
        // The same time for all: a level line.
        assert!(rings[3].1 == rings[4].1 && rings[4].1 == rings[5].1, "{rings:?}");
        for text in [">1000<", ">1M<", ">brute<", "a &lt; b"] {
            assert!(svg.contains(text), "{text}\n{svg}");
        }
    }

    #[test]
    fn decades_hold_their_numbers() {
        assert_eq!(decades([0.02, 5.0].into_iter()), (-2, 1));
        assert_eq!(decades([10.0].into_iter()), (1, 2));
        assert_eq!(decades([0.0, f64::NAN].into_iter()), (0, 1));
        assert_eq!([-3, 0, 3, 4, 5, 6, 7].map(power_of_ten), ["0.001", "1", "1000", "10k", "100k", "1M", "10M"]);
    }
}
