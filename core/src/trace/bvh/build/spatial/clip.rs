//! The part of a triangle on each side of a plane.

use crate::math::{Aabb, Vec3};

/// The boxes of what lies on each side of a plane, of the triangle within `bounds`; rounded outwards. None where a side
/// would be empty.
pub(super) fn sides(bounds: &Aabb, corners: &[Vec3; 3], axis: usize, at: f32) -> Option<[Aabb; 2]> {
    let (mut left, mut right) = (Aabb::EMPTY, Aabb::EMPTY);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if a[axis] <= at {
            left = left.include(a);
        }
        if a[axis] >= at {
            right = right.include(a);
        }
        if (a[axis] < at) != (b[axis] < at) {
            // In f64, far finer than the step of f32 by which the point is then widened.
            let (a, b) = (a.as_dvec3(), b.as_dvec3());
            let mut point = a + (b - a) * ((f64::from(at) - a[axis]) / (b[axis] - a[axis]));
            point[axis] = f64::from(at);
            let point = point.as_vec3();
            let [mut low, mut high] = [point; 2];
            for other in (0..3).filter(|&other| other != axis) {
                (low[other], high[other]) = (point[other].next_down(), point[other].next_up());
            }
            left = left.include(low).include(high);
            right = right.include(low).include(high);
        }
    }
    let within = |side: Aabb| Aabb { min: side.min.max(bounds.min), max: side.max.min(bounds.max) };
    let mut sides = [within(left), within(right)];
    sides[0].max[axis] = sides[0].max[axis].min(at);
    sides[1].min[axis] = sides[1].min[axis].max(at);
    sides.iter().all(|side| !side.is_empty()).then_some(sides)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cut again and again, across the longest side.
    fn pieces(bounds: Aabb, corners: &[Vec3; 3], times: u32) -> Vec<Aabb> {
        let size = bounds.size();
        let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap();
        let at = bounds.min[axis] + 0.4 * size[axis];
        match sides(&bounds, corners, axis, at) {
            Some(sides) if times > 0 => sides.into_iter().flat_map(|side| pieces(side, corners, times - 1)).collect(),
            _ => vec![bounds],
        }
    }

    #[test]
    fn pieces_cover_the_triangle_and_waste_less() {
        let corners = [Vec3::new(0.1, 0.2, 0.3), Vec3::new(7.9, 6.1, 5.3), Vec3::new(7.7, 6.5, 1.1)];
        let whole = Aabb::around(corners);
        let pieces = pieces(whole, &corners, 5);
        assert_eq!(pieces.len(), 32);
        assert!(pieces.iter().all(|piece| piece.union(whole) == whole));
        let area: f32 = pieces.iter().map(Aabb::half_area).sum();
        assert!(area < whole.half_area(), "{area} of {}", whole.half_area());
        // Barycentric points, in f64: exact up to far less than a step of f32.
        for i in 0..=200 {
            for j in 0..=200 - i {
                let (u, v) = (f64::from(i) / 200.0, f64::from(j) / 200.0);
                let [a, b, c] = corners.map(|corner| corner.as_dvec3());
                let point = a + (b - a) * u + (c - a) * v;
                let contains = |piece: &Aabb| {
                    piece.min.as_dvec3().cmple(point + 1e-15).all() && piece.max.as_dvec3().cmpge(point - 1e-15).all()
                };
                assert!(pieces.iter().any(contains), "{point}");
            }
        }
    }
}
