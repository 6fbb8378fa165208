//! Triangles from polygons of any number of corners, concave ones too.
//!
//! Ear clipping (Meisters 1975, *Polygons have ears*) in the plane that fits best, whose normal is Newell's (Sutherland,
//! Sproull, Schumacker 1974). A fan from the first corner would be right for convex polygons alone, and is what those
//! get; a sweep (O(n log n)) would only pay above some thousand corners, which faces of meshes do not have.

use crate::math::{DVec2, DVec3};

/// Most point-in-triangle tests for one polygon: about a second.
const MOST_TESTS: usize = 200_000_000;

/// Splits the polygon with the given corners into `corners.len() - 2` triangles of indices into `corners`, appended to
/// `triangles`. Polygons that cross themselves, have no area or have corners that are not finite get triangles too.
///
/// # Errors
/// None where the polygon is so large and so concave that it would take too long; nothing is appended then.
pub(super) fn triangulate(corners: &[DVec3], triangles: &mut Vec<[u32; 3]>) -> Option<()> {
    let count = corners.len();
    let projected = if count > 3 { project(corners) } else { Vec::new() };
    let previous = |i: usize| (i + count - 1) % count;
    let is_reflex = |i: usize| cross(projected[previous(i)], projected[i], projected[(i + 1) % count]) < 0.0;
    let mut reflex: Vec<usize> = (0..projected.len()).filter(|&i| is_reflex(i)).collect();
    if reflex.is_empty() {
        triangles.extend((2..count as u32).map(|i| [0, i - 1, i]));
        return Some(());
    }

    let begin = triangles.len();
    let mut left: Vec<usize> = (0..count).collect();
    let (mut tests, mut at, mut refused) = (0, 0, 0);
    while left.len() > 3 {
        let n = left.len();
        let [a, b, c] = [left[(at + n - 1) % n], left[at % n], left[(at + 1) % n]];
        let [pa, pb, pc] = [projected[a], projected[b], projected[c]];
        tests += reflex.len() + 1;
        if tests > MOST_TESTS {
            triangles.truncate(begin);
            return None;
        }
        // Corners that coincide with the ear's do not block it: they are bridges to holes.
        let blocks = |&&r: &&usize| {
            let p = projected[r];
            ![pa, pb, pc].contains(&p) && cross(pa, pb, p) >= 0.0 && cross(pb, pc, p) >= 0.0 && cross(pc, pa, p) >= 0.0
        };
        let is_ear = cross(pa, pb, pc) > 0.0 && reflex.iter().find(blocks).is_none();
        // A whole round without an ear: the polygon crosses itself or what is left has no area; clip anyway.
        if !is_ear && refused < n {
            refused += 1;
            at = (at + 1) % n;
            continue;
        }
        triangles.push([a as u32, b as u32, c as u32]);
        left.remove(at % n);
        refused = 0;
        // Neighbours may have become convex; they never become reflex.
        let n = left.len();
        at %= n;
        reflex.retain(|&r| r != b);
        for k in [(at + n - 1) % n, at] {
            let r = left[k];
            if cross(projected[left[(k + n - 1) % n]], projected[r], projected[left[(k + 1) % n]]) >= 0.0 {
                reflex.retain(|&x| x != r);
            }
        }
        // The corner after next: slices instead of a fan of slivers.
        at = (at + 1) % n;
    }
    triangles.push([left[0] as u32, left[1] as u32, left[2] as u32]);
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
