//! Triangles from polygons of any number of corners, concave ones too.
//!
//! Ear clipping (Meisters 1975, *Polygons have ears*) in the plane that fits best, whose normal is Newell's
//! (Sutherland, Sproull, Schumacker 1974). A fan from the first corner would be right for convex polygons alone, and is
//! what those get. Whether a corner is in the way of an ear is asked of a tree ([`Reflex`]), so that a million corners
//! take a second. A sweep (O(n log n)) would have a bound for outlines that cross themselves, too, and be a page of
//! cases for the corners on which it fails.

mod reflex;
mod spikes;

use std::collections::VecDeque;
use std::iter;

use self::reflex::Reflex;
use super::Placeless;
use crate::math::{DVec2, DVec3};

/// Most corners and boxes of corners that are looked at for one polygon of so many corners: some seconds, and for a
/// million corners some more. A hundred for each corner are enough for outlines that do not cross themselves.
const fn most_looks(count: usize) -> usize {
    200_000_000 + 1000 * count
}

/// Splits the polygon with the given corners into `corners.len() - 2` triangles of indices into `corners`, appended to
/// `triangles`. Polygons that cross themselves, have no area or have corners that are not finite get triangles too.
/// Where an outline goes somewhere and straight back, triangles without area stand for the way.
///
/// # Errors
/// A message where the polygon is so large, and crosses itself so often, that it would take too long; nothing is
/// appended then.
pub(super) fn triangulate(corners: &[DVec3], triangles: &mut Vec<[u32; 3]>) -> Placeless<()> {
    let count = corners.len();
    let split = if spikes::are_there(corners) {
        let (kept, flat) = spikes::cut(corners);
        let (around, mut parts) = (kept.iter().map(|&i| corners[i as usize]).collect::<Vec<_>>(), Vec::new());
        let split = if kept.len() > 2 { triangulate_within(most_looks(count), &around, &mut parts) } else { Some(()) };
        split.map(|()| {
            triangles.extend(flat);
            triangles.extend(parts.iter().map(|triangle| triangle.map(|i| kept[i as usize])));
        })
    } else {
        triangulate_within(most_looks(count), corners, triangles)
    };
    split
        .ok_or_else(|| format!("a face with {count} corners crosses itself too often to be split; write smaller faces"))
}

/// The same, with a bound on how many corners and boxes of corners may be looked at; none where these do not do.
fn triangulate_within(most: usize, corners: &[DVec3], triangles: &mut Vec<[u32; 3]>) -> Option<()> {
    let count = corners.len();
    let projected = if count > 3 { project(corners) } else { Vec::new() };
    let previous = |i: usize| (i + count - 1) % count;
    let is_reflex = |i: usize| cross(projected[previous(i)], projected[i], projected[(i + 1) % count]) < 0.0;
    let reflex: Vec<usize> = (0..projected.len()).filter(|&i| is_reflex(i)).collect();
    if reflex.is_empty() {
        triangles.extend((2..count as u32).map(|i| [0, i - 1, i]));
        return Some(());
    }

    let mut reflex = Reflex::new(&projected, reflex);
    let begin = triangles.len();
    // The corners that are left, each with its neighbours.
    let mut next: Vec<usize> = (1..=count).map(|i| i % count).collect();
    let mut before: Vec<usize> = (0..count).map(previous).collect();
    // Whether a corner is an ear's tip changes with its neighbours only, so each waits to be looked at when they have
    // changed; with how often it was put there, for the last time counts.
    let mut waiting: VecDeque<(usize, usize)> = (0..count).map(|i| (i, 0)).collect();
    let mut turns = vec![0; count];
    let (mut left, mut has_clipped, mut somewhere) = (count, false, 0);
    while left > 3 {
        let (b, is_waiting) = match waiting.pop_front() {
            Some((b, turn)) if turns[b] == turn => (b, true),
            Some(_) => continue,
            // Once more, for bridges to holes lie upon each other, and the one may have been in the way of the other.
            None if has_clipped => {
                waiting.extend(iter::successors(Some(somewhere), |&i| Some(next[i])).take(left).map(|i| (i, turns[i])));
                has_clipped = false;
                continue;
            }
            // No ear is left: the polygon crosses itself or what is left has no area; clip anyway.
            None => (somewhere, false),
        };
        let (a, c) = (before[b], next[b]);
        let [pa, pb, pc] = [projected[a], projected[b], projected[c]];
        let is_convex = cross(pa, pb, pc) > 0.0;
        let is_blocked = !is_convex || reflex.any_in([pa, pb, pc]);
        reflex.looked += 1;
        if reflex.looked > most {
            triangles.truncate(begin);
            return None;
        }
        if is_waiting && is_blocked {
            continue;
        }
        triangles.push([a as u32, b as u32, c as u32]);
        (next[a], before[c]) = (c, a);
        (left, has_clipped, somewhere, turns[b]) = (left - 1, true, c, usize::MAX);
        reflex.remove(b);
        // Last, behind the others: slices instead of a fan of slivers. They may have become convex; they never become
        // reflex.
        for k in [a, c] {
            if cross(projected[before[k]], projected[k], projected[next[k]]) >= 0.0 {
                reflex.remove(k);
            }
            turns[k] += 1;
            waiting.push_back((k, turns[k]));
        }
    }
    let (a, c) = (before[somewhere], next[somewhere]);
    triangles.push([a as u32, somewhere as u32, c as u32]);
    Some(())
}

/// The corners in their best-fit plane, seen so that they turn counterclockwise.
fn project(corners: &[DVec3]) -> Vec<DVec2> {
    let origin = corners[0];
    let local: Vec<DVec3> = corners.iter().map(|&p| p - origin).collect();
    let next = local.iter().cycle().skip(1);
    let normal: DVec3 = local.iter().zip(next).map(|(a, b)| a.cross(*b)).sum();
    // No plane (no area, NaN): everything falls on one point, which counts as convex.
    let Some(normal) = normal.try_normalize() else {
        return vec![DVec2::ZERO; corners.len()];
    };
    let (x, y) = normal.any_orthonormal_pair();
    local.iter().map(|p| DVec2::new(p.dot(x), p.dot(y))).collect()
}

/// Twice the signed area of a triangle, positive where it turns counterclockwise.
fn cross(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[DVec3], triangles: &[[u32; 3]]) -> (f64, DVec3) {
        let cross = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| corners[i as usize]);
            (b - a).cross(c - a) * 0.5
        };
        (triangles.iter().map(|t| cross(t).length()).sum(), triangles.iter().map(cross).sum())
    }

    /// Splits and checks that the triangles cover the polygon once: the sum of their areas is the length of the vector
    /// sum, and that is the polygon's own area.
    fn check(flat: &[[f64; 2]], expected: f64) {
        for (turn, far) in [(false, 0.0), (true, 1e7)] {
            let place = |p: &[f64; 2]| {
                if turn { DVec3::new(far, p[0] + far, p[1]) } else { DVec3::new(p[0], p[1], far) }
            };
            let corners: Vec<DVec3> = flat.iter().map(place).collect();
            let mut triangles = Vec::new();
            triangulate(&corners, &mut triangles).unwrap();
            assert_eq!(triangles.len(), flat.len() - 2);
            let (sum, vector) = area(&corners, &triangles);
            assert!((sum - expected).abs() < 1e-6 * expected, "{sum} for {expected}: {triangles:?}");
            assert!((vector.length() - expected).abs() < 1e-6 * expected);
        }
    }

    #[test]
    fn convex_and_concave() {
        check(&[[0., 0.], [1., 0.], [0., 1.]], 0.5);
        check(&[[0., 0.], [2., 0.], [2., 1.], [0., 1.]], 2.0);
        // An arrow head, its notch at each of the four places in turn.
        let arrow = [[0., 0.], [2., 1.], [0., 2.], [0.5, 1.]];
        for shift in 0..4 {
            let mut turned = arrow;
            turned.rotate_left(shift);
            check(&turned, 1.5);
            turned.reverse();
            check(&turned, 1.5);
        }
        // An L, a comb, a square with a hole bridged in.
        check(&[[0., 0.], [2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.]], 3.0);
        check(
            &[
                [0., 0.],
                [5., 0.],
                [5., 2.],
                [4., 2.],
                [4., 1.],
                [3., 1.],
                [3., 2.],
                [2., 2.],
                [2., 1.],
                [1., 1.],
                [1., 2.],
                [0., 2.],
            ],
            8.0,
        );
        check(
            &[[0., 0.], [3., 0.], [3., 3.], [0., 3.], [0., 0.], [1., 1.], [1., 2.], [2., 2.], [2., 1.], [1., 1.]],
            8.0,
        );
    }

    /// A way out of a square or into it and back, at a corner, within a side, of several edges, and across the end of
    /// the list.
    #[test]
    fn ways_there_and_back_have_no_area() {
        let square = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]];
        let ways: [&[[f64; 2]]; 8] = [
            &[[2., 0.]],
            &[[2., -1.]],
            &[[1., -1.]],
            &[[0.5, 0.5]],
            &[[1., 0.5]],
            &[[2., 0.], [3., 0.]],
            &[[1.5, -0.5], [2., 0.], [2., 3.]],
            &[[0.75, 0.25], [0.5, 0.75], [0.25, 0.5]],
        ];
        for way in ways {
            let back = way.iter().rev().skip(1).copied();
            let at_corner: Vec<_> = square[..2]
                .iter()
                .chain(way)
                .copied()
                .chain(back)
                .chain([[1., 0.]])
                .chain(square[2..].to_vec())
                .collect();
            let side = |p: &[f64; 2]| [p[0] - 0.5, p[1]];
            let mut in_side: Vec<_> = at_corner[1..at_corner.len() - 2].iter().map(side).collect();
            in_side.splice(0..0, [square[0]]);
            in_side.extend(&square[1..]);
            for outline in [at_corner, in_side] {
                for shift in 0..outline.len() {
                    let mut turned = outline.clone();
                    turned.rotate_left(shift);
                    check(&turned, 1.0);
                    turned.reverse();
                    check(&turned, 1.0);
                }
            }
        }
        // Nothing but ways there and back, of an even number of corners and of an odd one.
        let [a, b, c, d] = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]].map(|[x, y]| DVec3::new(x, y, 0.0));
        for outline in [&[a, b, c, b][..], &[a, b, a, c, a, d], &[a, b, c, b, a], &[b, a, b, c, d, c]] {
            let mut triangles = Vec::new();
            triangulate(outline, &mut triangles).unwrap();
            assert_eq!((triangles.len(), area(outline, &triangles).0), (outline.len() - 2, 0.0), "{outline:?}");
        }
    }

    /// Within the time that others take, however the list begins.
    #[test]
    fn long_ways_there_and_back() {
        let way = (1..300_000).map(|i| [1.0 + f64::from(i), 0.0]);
        let mut outline: Vec<[f64; 2]> = vec![[0., 0.], [1., 0.]];
        outline.extend(way.clone().chain(way.rev().skip(1)).chain([[1., 0.], [1., 1.], [0., 1.]]));
        for shift in [0, 150_000, 300_000, 450_000] {
            let mut turned = outline.clone();
            turned.rotate_left(shift);
            check(&turned, 1.0);
        }
    }

    #[test]
    fn stars_of_any_size() {
        for points in [5usize, 50, 500] {
            let star: Vec<[f64; 2]> = (0..2 * points)
                .map(|i| {
                    let (angle, r) = (i as f64 * std::f64::consts::PI / points as f64, [1.0, 0.5][i % 2]);
                    [r * angle.cos(), r * angle.sin()]
                })
                .collect();
            let expected = points as f64 * 0.5 * (std::f64::consts::PI / points as f64).sin();
            check(&star, expected);
        }
    }

    /// Bands along a spiral of some turns: half of all corners are reflex, and most corners are no ear's tip for a long
    /// time.
    #[test]
    fn ribbons_of_any_length() {
        for (corners, turns) in [(400, 1.0), (3000, 0.99), (3000, 5.0), (12_000, 20.0), (200_000, 50.0)] {
            let half = corners / 2;
            let at = |i: usize, aside: f64| {
                let angle = i as f64 / half as f64 * turns * std::f64::consts::TAU;
                let r = 3.0 + angle + aside;
                [r * angle.cos(), r * angle.sin()]
            };
            let ribbon: Vec<_> = (0..half).map(|i| at(i, 0.0)).chain((0..half).rev().map(|i| at(i, -0.5))).collect();
            let next = ribbon.iter().cycle().skip(1);
            let area: f64 = ribbon.iter().zip(next).map(|(p, q)| p[0] * q[1] - p[1] * q[0]).sum();
            check(&ribbon, area * 0.5);
        }
    }

    /// Nothing is left of what was begun.
    #[test]
    fn what_would_take_too_long_is_left() {
        let place = |i: usize| DVec3::new((i * i % 101) as f64, (i * i * i % 103) as f64, 0.0);
        let corners: Vec<DVec3> = (0..300).map(place).collect();
        let mut triangles = vec![[7, 8, 9]];
        assert_eq!(triangulate_within(2000, &corners, &mut triangles), None);
        assert_eq!(triangles, [[7, 8, 9]]);
        assert_eq!(triangulate(&corners, &mut triangles), Ok(()));
        assert_eq!(triangles.len(), 1 + 298);
    }

    #[test]
    fn broken_polygons_get_triangles_too() {
        let bow_tie = [DVec3::ZERO, DVec3::ONE, DVec3::X, DVec3::Y];
        let nan = [DVec3::ZERO, DVec3::NAN, DVec3::X, DVec3::Y, DVec3::INFINITY];
        let point = [DVec3::ONE; 7];
        for corners in [&bow_tie[..], &nan, &point] {
            let mut triangles = Vec::new();
            triangulate(corners, &mut triangles).unwrap();
            assert_eq!(triangles.len(), corners.len() - 2);
        }
    }
}
