//! A rectangle as a point sees it: directions to it, chosen evenly by the solid angle that it fills (Ureña, Fajardo,
//! King 2013, *An area-preserving parametrization for spherical rectangles*).

use std::f64::consts::TAU;

use crate::math::{DVec2, DVec3};

/// The part of the unit sphere around a point that a rectangle fills.
pub(super) struct SphericalRectangle {
    /// Unit vectors along the edges, and across, to the point's side.
    axes: [DVec3; 3],
    /// The rectangle in these axes, from the point: where it begins and ends along the first two, and where it lies on
    /// the third; below 0.
    low: DVec2,
    high: DVec2,
    depth: f64,
    /// Third components of the normals of the planes through the point and the edges that are parallel to the first
    /// axis.
    lean: [f64; 2],
    /// Where the sum of angles begins.
    start: f64,
    /// Steradians.
    pub(super) solid_angle: f64,
}

impl SphericalRectangle {
    /// What `point` sees of the rectangle around `centre` with half edges that are perpendicular, but for what f32
    /// rounds. None where it is far away for its size: there an even choice by area is nearly one by solid angle, and
    /// angles would be small differences. None, too, where it turns its back, and for a point in its plane.
    pub(super) fn seen_from(point: DVec3, centre: DVec3, half_edges: [DVec3; 2]) -> Option<Self> {
        let x = half_edges[0].normalize();
        let second = half_edges[1] - x * half_edges[1].dot(x);
        let (halves, y) = ([half_edges[0].length(), second.length()], second.normalize());
        let z = x.cross(y);
        let offset = centre - point;
        let (middle, depth) = (DVec2::new(offset.dot(x), offset.dot(y)), offset.dot(z));
        let half = DVec2::from(halves);
        let (low, high) = (middle - half, middle + half);
        // From the point to the nearest one of the rectangle.
        let nearest = DVec2::ZERO.clamp(low, high).length_squared() + depth * depth;
        // Half edges against whole distances: from twice its diagonal on, densities within it differ by a factor of 3.4
        // at most.
        if nearest > 16.0 * half.length_squared() || depth > -1e-6 * half.length() {
            return None;
        }
        let corner = |x: f64, y: f64| DVec3::new(x, y, depth);
        let [v00, v01, v10, v11] =
            [corner(low.x, low.y), corner(low.x, high.y), corner(high.x, low.y), corner(high.x, high.y)];
        let planes = [v00.cross(v10), v10.cross(v11), v11.cross(v01), v01.cross(v00)].map(DVec3::normalize);
        // By sine and cosine: an arc cosine alone would lose half of the digits of angles near 0 and pi.
        let angle = |i: usize| {
            let (a, b) = (planes[i], planes[(i + 1) % 4]);
            libm::atan2(a.cross(b).length(), -a.dot(b))
        };
        let start = TAU - angle(2) - angle(3);
        let solid_angle = angle(0) + angle(1) - start;
        let lean = [planes[0].z, planes[2].z];
        (solid_angle > 1e-6).then_some(Self { axes: [x, y, z], low, high, depth, lean, start, solid_angle })
    }

    /// From the point to where a direction meets the rectangle that `xi`, a point of the unit square, chooses.
    pub(super) fn at(&self, xi: DVec2) -> DVec3 {
        let Self { axes: [x, y, z], low, high, depth, lean: [first, second], start, solid_angle } = *self;
        let sum = xi.x * solid_angle + start;
        let slope = (libm::cos(sum) * first - second) / libm::sin(sum);
        let cosine = (slope.hypot(first).recip().copysign(slope)).clamp(-1.0, 1.0);
        let across = (-(cosine * depth) / (1.0 - cosine * cosine).max(1e-300).sqrt()).clamp(low.x, high.x);
        let distance = across.hypot(depth);
        let [begin, end] = [low.y, high.y].map(|end| end / end.hypot(distance));
        let height = begin + xi.y * (end - begin);
        let along = (height * distance / (1.0 - height * height).max(1e-300).sqrt()).clamp(low.y, high.y);
        x * across + y * along + z * depth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DQuat;

    const CENTRE: DVec3 = DVec3::new(0.3, -0.2, 0.5);

    fn edges(width: f64, height: f64) -> [DVec3; 2] {
        let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.1);
        [turn * DVec3::X * width, turn * DVec3::Y * height]
    }

    /// The solid angle of a triangle by van Oosterom and Strackee 1983, two for a rectangle.
    fn by_triangles(point: DVec3, [a, b]: [DVec3; 2]) -> f64 {
        let corner = |s: f64, t: f64| (CENTRE + a * s + b * t - point).normalize();
        let triangle =
            |p: DVec3, q: DVec3, r: DVec3| 2.0 * p.cross(q).dot(r).abs().atan2(1.0 + p.dot(q) + q.dot(r) + r.dot(p));
        let [p, q, r, s] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        triangle(p, q, r) + triangle(p, r, s)
    }

    #[test]
    fn solid_angles_are_those_of_two_triangles() {
        for (width, height) in [(1.0, 1.0), (2.0, 0.1), (100.0, 60.0)] {
            let edges = edges(width, height);
            let across = edges[0].cross(edges[1]).normalize();
            for (right, up, away) in
                [(0.0, 0.0, 1.0), (0.0, 0.0, 0.3), (1.5, 0.2, 0.4), (-0.9, 1.3, 1e-3), (0.99, 0.99, 0.01)]
            {
                let point = CENTRE + edges[0] * right + edges[1] * up + across * away;
                let seen = SphericalRectangle::seen_from(point, CENTRE, edges).expect("it is near");
                let expected = by_triangles(point, edges);
                let error = (seen.solid_angle - expected).abs() / expected;
                assert!(error < 1e-9, "{width} {height} {right} {up} {away}: {} {expected}", seen.solid_angle);
            }
        }
    }

    /// As many directions fall into each part as it fills of the whole.
    #[test]
    fn parts_are_met_by_their_solid_angle() {
        let whole = edges(3.0, 0.7);
        let across = whole[0].cross(whole[1]).normalize();
        let point = CENTRE + whole[0] * 0.4 - whole[1] * 1.2 + across * 0.2;
        let seen = SphericalRectangle::seen_from(point, CENTRE, whole).expect("it is near");
        let side = 500;
        let mut counts = [[0u32; 3]; 3];
        for k in 0..side * side {
            let xi = (DVec2::new(f64::from(k % side), f64::from(k / side)) + 0.5) / f64::from(side);
            let at = point + seen.at(xi) - CENTRE;
            let [s, t] = whole.map(|edge| at.dot(edge) / edge.length_squared());
            assert!(s.abs() <= 1.0 + 1e-9 && t.abs() <= 1.0 + 1e-9 && at.dot(across).abs() < 1e-9, "{at}");
            let third = |x: f64| ((x + 1.0) * 1.5).clamp(0.0, 2.0) as usize;
            counts[third(s)][third(t)] += 1;
        }
        for (i, row) in counts.iter().enumerate() {
            for (j, &count) in row.iter().enumerate() {
                let middle = |k: usize| (k as f64 - 1.0) / 1.5;
                let moved = point - (whole[0] * middle(i) + whole[1] * middle(j));
                let expected = by_triangles(moved, whole.map(|edge| edge / 3.0)) / seen.solid_angle;
                let share = f64::from(count) / f64::from(side * side);
                assert!((share - expected).abs() < 0.003, "{i} {j}: {share} {expected}");
            }
        }
    }

    #[test]
    fn what_is_far_or_seen_from_the_side_or_from_behind_is_left_to_others() {
        let edges = edges(1.0, 2.0);
        let across = edges[0].cross(edges[1]).normalize();
        assert!(SphericalRectangle::seen_from(CENTRE + across * 20.0, CENTRE, edges).is_none());
        assert!(SphericalRectangle::seen_from(CENTRE + edges[0] * 1.5, CENTRE, edges).is_none());
        assert!(SphericalRectangle::seen_from(CENTRE - across, CENTRE, edges).is_none());
    }
}
