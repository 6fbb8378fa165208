//! The rates as a picture: small multiples, one for each scene and kind of ray, of one bar for each engine and mode.
//!
//! A bar is the median at the best width, from zero; the line across its end goes from the smallest to the largest
//! rate, rings are the medians of other widths. Every kind of ray has a scale of its own, since diffuse rays are ten
//! times slower than camera rays: on a common one, the alternative, they could not be told apart. SVG is written as it
//! is; a library that draws charts would weigh more than the program.

use std::ffi::OsStr;
use std::path::Path;

use super::rays::Kind;
use super::report::{Ratio, Report, TraversalRow};
use crate::lab::drawing::{Anchor, Drawing, Font};

const WIDTH: f64 = 900.0;
const MARGIN: f64 = 28.0;
/// Between the two panels in a row.
const GAP: f64 = 32.0;
const PANEL: f64 = (WIDTH - 2.0 * MARGIN - GAP) / 2.0;
/// Of a panel: engine and mode on the left, the rate on the right, bars between.
const NAMES: f64 = 102.0;
const RATES: f64 = 68.0;
const PLOT: f64 = PANEL - NAMES - RATES;
/// Letters that fit on the left.
const MAX_LETTERS: usize = 17;
/// Height of a bar's row, and of the bar.
const ROW: f64 = 17.0;
const BAR: f64 = 9.0;
/// Above and below the rows of a panel: heading, numbers of the axis.
const HEADING: f64 = 26.0;
const AXIS: f64 = 24.0;

const INK: &str = "#222222";
const GREY: &str = "#666666";
const GRID: &str = "#dddddd";
const TITLE: Font = Font { size: 19.0, bold: true, color: INK };
const SCENE: Font = Font { size: 15.0, bold: true, color: INK };
const KIND: Font = Font { size: 13.0, bold: true, color: INK };
const BODY: Font = Font { size: 11.5, bold: false, color: INK };
const NOTE: Font = Font { size: 11.5, bold: false, color: GREY };

/// What the bars of an engine look like, and what that means.
const LEGEND: [(&str, &str); 4] = [
    ("#1f5fa8", "native, default"),
    ("#8db6de", "native, other modes"),
    ("#c8541a", "Embree robust"),
    ("#eab08c", "Embree, not watertight"),
];

fn color(row: &TraversalRow) -> &'static str {
    let which = match (row.backend, row.mode) {
        ("native", "default") => 0,
        ("native", _) => 1,
        (_, "robust") => 2,
        _ => 3,
    };
    LEGEND[which].0
}

/// A chart of these reports, an SVG document 900 units wide; `notes` are lines that say what was measured on what.
pub fn chart(reports: &[Report], notes: &[String]) -> String {
    let mut svg = Drawing::new();
    let mut y = MARGIN + 12.0;
    svg.text((MARGIN, y), Anchor::Start, TITLE, "Millions of rays a second, native and Embree");
    y += 6.0;
    for note in notes {
        y += 16.0;
        svg.text((MARGIN, y), Anchor::Start, NOTE, &shortened(note, 140));
    }
    y += 22.0;
    legend(&mut svg, y);
    y += 17.0;
    for report in reports {
        y += 36.0;
        let Report { triangles, threads, .. } = report;
        let threads = format!("{threads} {}", if *threads == 1 { "thread" } else { "threads" });
        let heading =
            format!("{}: {} triangles, {threads}", shortened(file_name(&report.scene), 60), grouped(*triangles));
        svg.text((MARGIN, y), Anchor::Start, SCENE, &heading);
        y += 8.0;
        for pair in report.ratios.chunks(2) {
            let heights = pair
                .iter()
                .zip([MARGIN, MARGIN + PANEL + GAP])
                .map(|(ratio, x)| panel(&mut svg, (x, y), report, ratio));
            y += heights.fold(0.0, f64::max);
        }
    }
    svg.svg(WIDTH, (y + MARGIN).ceil())
}

fn legend(svg: &mut Drawing, y: f64) {
    let mut x = MARGIN;
    for (color, meaning) in LEGEND {
        svg.rectangle((x, y - BAR), (16.0, BAR), color);
        svg.text((x + 21.0, y), Anchor::Start, BODY, meaning);
        x += 38.0 + 6.0 * meaning.len() as f64;
    }
    let middle = y - BAR / 2.0;
    whiskers(svg, (x, x + 16.0), middle);
    svg.text((x + 21.0, y), Anchor::Start, BODY, "min to max");
    svg.ring((x + 98.0, middle), 2.5, GREY);
    svg.text((x + 106.0, y), Anchor::Start, BODY, "other widths");
    svg.text(
        (MARGIN, y + 17.0),
        Anchor::Start,
        NOTE,
        "Bars: median at the best width, which stands in brackets: rays that are traced together.",
    );
}

/// One kind of ray of one scene; its height.
fn panel(svg: &mut Drawing, (x, y): (f64, f64), report: &Report, ratio: &Ratio) -> f64 {
    let kind = ratio.kind;
    let (above, y) = (y, y + HEADING);
    svg.text((x, y - 6.0), Anchor::Start, KIND, title(kind));
    svg.text((x + PANEL, y - 6.0), Anchor::End, BODY, &ratios(ratio));
    let rows: Vec<&TraversalRow> = report.traversal.iter().filter(|row| row.kind == kind).collect();
    // Rows of one engine and mode follow each other, a width each.
    let modes: Vec<&[&TraversalRow]> = rows.chunk_by(|a, b| (a.backend, a.mode) == (b.backend, b.mode)).collect();
    let most = rows.iter().map(|row| row.mrays_per_s.max).fold(0.0, f64::max);
    let (step, ticks) = scale(most);
    let at = |rate: f64| x + NAMES + rate / (step * f64::from(ticks)) * PLOT;
    let bottom = y + modes.len() as f64 * ROW + 4.0;
    for tick in 0..=ticks {
        let place = at(step * f64::from(tick));
        svg.line((place, y), (place, bottom), GRID);
        let label = number(step * f64::from(tick));
        let label = if label.contains('.') { label.trim_end_matches('0').trim_end_matches('.') } else { &label };
        svg.text((place, bottom + 14.0), Anchor::Middle, NOTE, label);
    }
    svg.text((x + PANEL, bottom + 14.0), Anchor::End, NOTE, "Mray/s");
    for (mode, i) in modes.iter().zip(0u32..) {
        let middle = y + (f64::from(i) + 0.5) * ROW + 2.0;
        bar(svg, x, middle, mode, at);
    }
    svg.line((x + NAMES, y), (x + NAMES, bottom), INK);
    bottom + AXIS - above
}

/// One engine in one mode: its rows, a width each.
fn bar(svg: &mut Drawing, x: f64, middle: f64, rows: &[&TraversalRow], at: impl Fn(f64) -> f64) {
    let Some(best) = rows.iter().max_by(|a, b| a.mrays_per_s.median.total_cmp(&b.mrays_per_s.median)) else { return };
    let baseline = middle + 4.0;
    // Where there is no room for both, colours tell the engines apart.
    let name = format!("{} {}", best.backend, best.mode);
    let name = if name.len() > MAX_LETTERS { best.mode } else { &name };
    svg.text((x + NAMES - 7.0, baseline), Anchor::End, BODY, &shortened(name, MAX_LETTERS));
    let rate = best.mrays_per_s;
    let length = at(rate.median) - at(0.0);
    svg.rectangle((at(0.0), middle - BAR / 2.0), (length, BAR), color(best));
    for other in rows.iter().filter(|row| row.width != best.width) {
        svg.ring((at(other.mrays_per_s.median), middle), 2.5, GREY);
    }
    whiskers(svg, (at(rate.min), at(rate.max)), middle);
    let words = format!("{} ({})", number(rate.median), best.width);
    svg.text((x + PANEL, baseline), Anchor::End, BODY, &words);
}

/// From the smallest to the largest.
fn whiskers(svg: &mut Drawing, (from, to): (f64, f64), y: f64) {
    svg.line((from, y), (to, y), INK);
    for x in [from, to] {
        svg.line((x, y - 3.0), (x, y + 3.0), INK);
    }
}

fn title(kind: Kind) -> &'static str {
    match kind {
        Kind::Primary => "camera rays",
        Kind::Diffuse => "diffuse rays",
        Kind::Shadow => "shadow rays",
        Kind::Orthographic => "orthographic camera",
        Kind::Sun => "shadow rays, sun",
        Kind::Pixel => "pixel to hit",
    }
}

/// As in `native over Embree robust 1.43, fast 1.33`.
fn ratios(ratio: &Ratio) -> String {
    let parts = [("robust", ratio.over_embree_robust), ("fast", ratio.over_embree_fast)];
    let known: Vec<String> = parts.iter().filter_map(|(mode, x)| x.map(|x| format!("{mode} {x:.2}"))).collect();
    if known.is_empty() { String::new() } else { format!("native over Embree {}", known.join(", ")) }
}

/// The step between ticks, and how many it takes to reach `most`: steps of 1, 2 or 5 times a power of ten, at most 5 of
/// them.
fn scale(most: f64) -> (f64, u32) {
    if !(most > 0.0 && most.is_finite()) {
        return (1.0, 1);
    }
    let power = 10f64.powf((most / 5.0).log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|step| step * 5.0 >= most).unwrap_or(most);
    (step, (most / step).ceil() as u32)
}

/// With three digits that count, and no more than six behind the point.
fn number(x: f64) -> String {
    let digits = if x > 0.0 { (2.0 - x.log10().floor()).clamp(0.0, 6.0) as usize } else { 0 };
    format!("{x:.digits$}")
}

/// A path's last part: the folder is in the table.
fn file_name(scene: &str) -> &str {
    Path::new(scene).file_name().and_then(OsStr::to_str).unwrap_or(scene)
}

/// 2,000,000 for 2000000.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let groups: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().filter_map(|group| std::str::from_utf8(group).ok()).collect();
    groups.join(",")
}

/// At most `most` letters: where there are more, the last ones, with the numbers and suffixes that tell names apart.
fn shortened(text: &str, most: usize) -> String {
    let count = text.chars().count();
    if count <= most {
        return text.to_owned();
    }
    std::iter::once('\u{2026}').chain(text.chars().skip(count + 1 - most)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::report::Spread;
    use super::*;

    fn report(scene: &str, rates: &[(&'static str, &'static str, usize, f64)]) -> Report {
        let row = |&(backend, mode, width, rate): &(_, _, _, f64)| TraversalRow {
            backend,
            mode,
            width,
            kind: Kind::Primary,
            mrays_per_s: Spread { min: 0.5 * rate, median: rate, max: 1.5 * rate },
            rays: 1,
            hits: 1,
            turns: vec![rate],
        };
        let traversal: Vec<TraversalRow> = rates.iter().map(row).collect();
        let ratios = vec![Ratio::new(Kind::Primary, &traversal), Ratio::new(Kind::Diffuse, &traversal)];
        let (processor, isa, size, repeat) = ("a processor".to_owned(), "avx2", 8, 1);
        let (scene, builds, answers) = (scene.to_owned(), Vec::new(), Vec::new());
        let (triangles, threads) = (1_234_567, 2);
        Report { scene, triangles, threads, processor, isa, size, repeat, builds, traversal, ratios, answers }
    }

    /// The values of an attribute in the elements of a name, in order.
    fn attribute(svg: &str, element: &str, name: &str) -> Vec<f64> {
        let of =
            |line: &str| Some(line.split_once(&format!(" {name}=\""))?.1.split_once('"')?.0.parse().expect("a number"));
        svg.lines().filter(|line| line.starts_with(&format!("<{element} "))).filter_map(of).collect()
    }

    #[test]
    fn bars_begin_at_zero_and_are_as_long_as_rates_are_high() {
        let rates = [("native", "default", 1, 9.0), ("native", "default", 8, 40.0), ("embree", "robust", 8, 10.0)];
        let svg = chart(&[report("a<b.obj", &rates)], &["a & b".to_owned()]);
        // The legend and the background are rectangles too.
        let (x, width) = (attribute(&svg, "rect", "x"), attribute(&svg, "rect", "width"));
        let (bars, starts) = (&width[width.len() - 2..], &x[x.len() - 2..]);
        assert!((bars[0] / bars[1] - 4.0).abs() < 0.01, "{bars:?}");
        assert_eq!(starts, [MARGIN + NAMES; 2]);
        // The largest rate of all, 60, is where the axis ends.
        assert!((bars[0] - PLOT * 40.0 / 60.0).abs() < 0.1, "{bars:?}");
        for text in
            ["a&lt;b.obj: 1,234,567 triangles, 2 threads", "a &amp; b", "native over Embree robust 4.00", "40.0 (8)"]
        {
            assert!(svg.contains(text), "{text}:\n{svg}");
        }
    }

    #[test]
    fn everything_is_inside_the_picture_whatever_is_drawn() {
        let rates = [("native", "default", 1, 1e-7), ("embree", "robust", 8, 0.0), ("embree", "fast", 8, 123_456.0)];
        let reports = [report("terrain1", &rates), report(&"long".repeat(100), &[]), report("empty", &rates[1..2])];
        let svg = chart(&reports, &["words ".repeat(100)]);
        let height = attribute(&svg, "svg", "height")[0];
        for (elements, names, most) in [
            (["text", "rect", "line"], ["x", "x1", "x2"], WIDTH),
            (["text", "rect", "line"], ["y", "y1", "y2"], height),
        ] {
            let all: Vec<f64> =
                elements.iter().flat_map(|e| names.iter().flat_map(|n| attribute(&svg, e, n))).collect();
            assert!(all.len() > 100 && all.iter().all(|x| (0.0..=most).contains(x)), "{all:?}");
        }
        let opened = svg.matches("<text").count();
        assert_eq!(opened, svg.matches("</text>").count());
        assert_eq!(svg.matches('<').count(), svg.matches('>').count());
    }

    #[test]
    fn axes_have_round_numbers_and_few_of_them() {
        for (most, expected) in
            [(0.0, (1.0, 1)), (4.9, (1.0, 5)), (5.1, (2.0, 3)), (44.0, (10.0, 5)), (0.07, (0.02, 4))]
        {
            let (step, ticks) = scale(most);
            assert!((step / expected.0 - 1.0).abs() < 1e-9 && ticks == expected.1, "{most}: {step}, {ticks}");
        }
        assert_eq!(grouped(0) + &grouped(1234) + &grouped(999_000_001), "01,234999,000,001");
        assert_eq!(shortened("abcdef", 4), "\u{2026}def");
    }
}
