//! The point of a triangle that is nearest to a given one.
//!
//! It is the foot of the perpendicular where that is inside (Ericson 2005, *Real-Time Collision Detection*, 5.1.5),
//! else on one of the edges (5.1.2). Ericson decides which of seven regions the point is in and computes one candidate;
//! here all edges are, and the nearest wins: the regions' signs are noise in slivers and in triangles without an area,
//! whose edges are sound. Ends of edges are taken in the order of their coordinates, so that triangles that share an
//! edge compute the same bits, and a tie between them is one. `trace/bvh/near/measure.rs` does the same, of all edges
//! at a time.

use crate::math::DVec3;

/// A point of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrianglePoint {
    /// From the given point to this one.
    pub offset: DVec3,
    /// The length of `offset`, squared.
    pub distance_squared: f64,
    /// Weight of the second corner.
    pub u: f64,
    /// Weight of the third corner.
    pub v: f64,
}

/// The point of the triangle that is nearest to `point`; always one between the corners, up to the rounding of f64.
pub fn closest_point(point: DVec3, corners: [DVec3; 3]) -> TrianglePoint {
    let p = corners.map(|corner| corner - point);
    let mut best = foot(p);
    for first in 0..3 {
        let second = (first + 1) % 3;
        let (offset, share) = on_edge(p[first], p[second]);
        let distance_squared = offset.length_squared();
        if best.is_none_or(|best| distance_squared < best.distance_squared) {
            let mut weights = [0.0; 3];
            (weights[first], weights[second]) = (1.0 - share, share);
            best = Some(TrianglePoint { offset, distance_squared, u: weights[1], v: weights[2] });
        }
    }
    let corner = TrianglePoint { offset: p[0], distance_squared: p[0].length_squared(), u: 0.0, v: 0.0 };
    best.unwrap_or(corner)
}

/// The foot of the perpendicular from zero, if it is inside.
fn foot([a, b, c]: [DVec3; 3]) -> Option<TrianglePoint> {
    let normal = (b - a).cross(c - a);
    let areas = [normal.dot(b.cross(c)), normal.dot(c.cross(a)), normal.dot(a.cross(b))];
    let sum = areas[0] + areas[1] + areas[2];
    if !(areas.iter().all(|&area| area > 0.0) && sum.is_finite()) {
        return None;
    }
    let (u, v) = (areas[1] / sum, areas[2] / sum);
    let offset = a * (areas[0] / sum) + b * u + c * v;
    Some(TrianglePoint { offset, distance_squared: offset.length_squared(), u, v })
}

/// The point between `a` and `b` that is nearest to zero, and the weight of `b`.
fn on_edge(a: DVec3, b: DVec3) -> (DVec3, f64) {
    if a.to_array() > b.to_array() {
        let (offset, share) = on_edge(b, a);
        return (offset, 1.0 - share);
    }
    let edge = b - a;
    let (along, square) = (-a.dot(edge), edge.length_squared());
    if along <= 0.0 || square == 0.0 {
        (a, 0.0)
    } else if along >= square {
        (b, 1.0)
    } else {
        let share = along / square;
        (a + edge * share, share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    #[test]
    fn every_region() {
        let near = |x, y, z| {
            let found = closest_point(DVec3::new(x, y, z), CORNERS);
            (found.u, found.v, found.distance_squared)
        };
        assert_eq!(near(0.25, 0.5, 2.0), (0.25, 0.5, 4.0));
        assert_eq!(near(-1.0, -2.0, 2.0), (0.0, 0.0, 9.0));
        assert_eq!(near(3.0, 1.0, 0.0), (1.0, 0.0, 5.0));
        assert_eq!(near(0.0, 2.0, 1.0), (0.0, 1.0, 2.0));
        assert_eq!(near(0.5, -1.0, 1.0), (0.5, 0.0, 2.0));
        assert_eq!(near(-2.0, 0.5, 0.0), (0.0, 0.5, 4.0));
        assert_eq!(near(1.0, 1.0, 0.0), (0.5, 0.5, 0.5));
    }

    #[test]
    fn a_triangle_without_an_area_is_its_longest_edge() {
        let line = [DVec3::X, DVec3::X * 3.0, DVec3::X * 2.0];
        let found = closest_point(DVec3::new(2.5, 1.0, 0.0), line);
        assert_eq!((found.distance_squared, found.offset), (1.0, DVec3::NEG_Y));
        let found = closest_point(DVec3::new(0.0, 3.0, 4.0), [DVec3::ZERO; 3]);
        assert_eq!((found.distance_squared, found.u, found.v), (25.0, 0.0, 0.0));
    }
}
