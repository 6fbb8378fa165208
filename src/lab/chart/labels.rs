//! Where the words beside points go, so that they neither cover each other nor a point.
//!
//! One after the other, each takes the free place that is nearest to its point, of a few on rings around it; from the
//! second ring on a line leads there. What finds none is left out: the numbers are in the table. Moving all of them at
//! once until they fit, the usual alternative, would give every chart another look for one point more.

use super::scatter::NOTE;

/// Half of what a point covers.
const DOT: f64 = 6.0;
/// Of a letter and of a line of text, about, as parts of the font's size.
const LETTER: f64 = 0.58;
const LINE: f64 = 1.0;
/// How far from a point: the first ring touches it.
const RINGS: [f64; 4] = [8.6, 19.0, 31.0, 45.0];
/// Directions, by preference: across and up.
const DIRECTIONS: [(f64, f64); 8] = {
    const D: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [(D, D), (D, -D), (-D, D), (-D, -D), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
};

/// A rectangle: left, top, right, bottom.
type Area = [f64; 4];

/// A label where it goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    /// Which point's.
    pub index: usize,
    /// Where its text begins, on its base line.
    pub at: (f64, f64),
    /// From where to where a line leads, if it is not beside its point.
    pub lead: Option<[(f64, f64); 2]>,
    area: Area,
}

/// Places for labels of points at these places within an area; empty labels and those without a place get none.
pub(super) fn place(points: &[((f64, f64), &str)], within: Area) -> Vec<Placed> {
    let dots = points.iter().map(|&((x, y), _)| [x - DOT, y - DOT, x + DOT, y + DOT]);
    let mut taken: Vec<Area> = dots.collect();
    let mut placed = Vec::new();
    for (index, &(point, label)) in points.iter().enumerate().filter(|(_, (_, label))| !label.is_empty()) {
        let is_free = |area: &Area| is_inside(area, &within) && !taken.iter().any(|other| overlap(area, other));
        let places =
            RINGS.into_iter().flat_map(|ring| DIRECTIONS.map(|direction| beside(index, point, label, ring, direction)));
        if let Some(free) = places.into_iter().find(|place| is_free(&place.area)) {
            taken.push(free.area);
            placed.push(free);
        }
    }
    placed
}

fn beside(index: usize, (x, y): (f64, f64), label: &str, ring: f64, (across, up): (f64, f64)) -> Placed {
    let (width, height) = (NOTE.size * LETTER * label.chars().count() as f64, NOTE.size * LINE);
    let end = (x + across * ring, y - up * ring);
    // What of it is at the end of the line: the side that is nearer to the point, and the middle where that line runs
    // straight.
    let (left, top) = (end.0 + (sign(across) - 1.0) / 2.0 * width, end.1 - (sign(up) + 1.0) / 2.0 * height);
    let area = [left, top, left + width, top + height];
    let lead = (ring > RINGS[0]).then_some([(x, y), end]);
    Placed { index, at: (left, top + 0.8 * height), lead, area }
}

/// -1, 0 or 1.
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

fn is_inside(area: &Area, within: &Area) -> bool {
    area[0] >= within[0] && area[1] >= within[1] && area[2] <= within[2] && area[3] <= within[3]
}

fn overlap(a: &Area, b: &Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    const WITHIN: Area = [0.0, 0.0, 400.0, 300.0];

    #[test]
    fn a_label_alone_stands_at_the_right_above_its_point() {
        let [placed] = place(&[((100.0, 100.0), "16")], WITHIN)[..] else { panic!("one label") };
        assert!(placed.at.0 > 100.0 && placed.at.1 < 100.0 && placed.lead.is_none());
        // At the right edge, on the other side.
        let [placed] = place(&[((398.0, 100.0), "16")], WITHIN)[..] else { panic!("one label") };
        assert!(placed.area[2] < 398.0);
        assert!(place(&[((100.0, 100.0), "")], WITHIN).is_empty());
    }

    #[test]
    fn a_label_touches_the_end_of_its_line_with_the_side_that_is_nearer() {
        let point = (100.0, 100.0);
        for (across, up) in DIRECTIONS {
            let Placed { area: [left, top, right, bottom], lead, .. } = beside(0, point, "16", RINGS[1], (across, up));
            let (x, y) = lead.expect("beyond the first ring")[1];
            assert!((left..=right).contains(&x) && (top..=bottom).contains(&y));
            // Where it goes neither way, its middle; else it lies beyond the line's end altogether.
            for (towards, near, far) in [(across, left, right), (-up, top, bottom)] {
                let (end, middle) = (if near == left { x } else { y }, near.midpoint(far));
                assert!(if towards == 0.0 { middle == end } else { (middle - end) * towards > 0.0 });
                assert!(towards == 0.0 || end == if towards > 0.0 { near } else { far });
            }
        }
    }

    #[test]
    fn crowded_labels_cover_neither_each_other_nor_a_point() {
        let points: Vec<((f64, f64), &str)> =
            (0..21).map(|i| ((150.0 + f64::from(i % 7) * 9.0, 100.0 + f64::from(i / 7) * 11.0), "16")).collect();
        let placed = place(&points, WITHIN);
        assert!(placed.len() > 12 && placed.iter().any(|label| label.lead.is_some()), "{}", placed.len());
        for (i, a) in placed.iter().enumerate() {
            assert!(is_inside(&a.area, &WITHIN));
            assert!(placed[i + 1..].iter().all(|b| !overlap(&a.area, &b.area)));
            assert!(points.iter().all(|((x, y), _)| !overlap(&a.area, &[x - DOT, y - DOT, x + DOT, y + DOT])));
        }
    }
}
