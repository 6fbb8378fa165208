//! Convex polyhedra, the cells of a BSP tree: how large their surface is, and how a plane cuts them.
//!
//! The area decides which plane is chosen, and nothing else: of the lines that pass a convex body, the share that
//! passes a convex part of it is the ratio of their surfaces (Santaló 1976, *Integral geometry and geometric
//! probability*). So plain f64 will do.

use super::Plane;
use crate::math::{Aabb, DVec3};

/// Faces as their corners in turn.
#[derive(Clone, Debug)]
pub(super) struct Polyhedron {
    faces: Vec<Vec<DVec3>>,
}

impl Polyhedron {
    pub fn of_box(bounds: &Aabb) -> Self {
        let corners = [bounds.min.as_dvec3(), bounds.max.as_dvec3()];
        let corner = |k: usize| DVec3::new(corners[k & 1].x, corners[k >> 1 & 1].y, corners[k >> 2 & 1].z);
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        Self { faces: faces.map(|face| face.map(corner).to_vec()).to_vec() }
    }

    /// The area of its surface.
    pub fn area(&self) -> f64 {
        self.faces.iter().map(|face| area(face)).sum()
    }

    /// The parts behind and in front of a plane; one without faces where it does not reach there.
    pub fn cut(&self, plane: &Plane) -> [Self; 2] {
        let nothing = || Self { faces: Vec::new() };
        let corners = || self.faces.iter().flatten();
        if corners().all(|&p| plane.distance(p) >= 0.0) {
            return [nothing(), self.clone()];
        }
        if corners().all(|&p| plane.distance(p) <= 0.0) {
            return [self.clone(), nothing()];
        }
        let mut parts = [nothing(), nothing()];
        let mut rim = Vec::new();
        for face in &self.faces {
            let mut pieces = [Vec::new(), Vec::new()];
            for (i, &p) in face.iter().enumerate() {
                let q = face[(i + 1) % face.len()];
                let (a, b) = (plane.distance(p), plane.distance(q));
                if a <= 0.0 {
                    pieces[0].push(p);
                }
                if a >= 0.0 {
                    pieces[1].push(p);
                }
                if a < 0.0 && b > 0.0 || a > 0.0 && b < 0.0 {
                    let between = p.lerp(q, a / (a - b));
                    pieces.iter_mut().for_each(|piece| piece.push(between));
                    rim.push(between);
                } else if a == 0.0 {
                    rim.push(p);
                }
            }
            for (part, piece) in parts.iter_mut().zip(pieces) {
                if piece.len() > 2 {
                    part.faces.push(piece);
                }
            }
        }
        let lid = around(rim, plane.normal);
        if lid.len() > 2 {
            parts.iter_mut().for_each(|part| part.faces.push(lid.clone()));
        }
        parts
    }
}

fn area(face: &[DVec3]) -> f64 {
    let Some((&first, rest)) = face.split_first() else { return 0.0 };
    let doubled: DVec3 = rest.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first)).sum();
    0.5 * doubled.length()
}

/// Points of a convex rim in turn, seen along `normal`.
fn around(mut rim: Vec<DVec3>, normal: DVec3) -> Vec<DVec3> {
    let middle = rim.iter().sum::<DVec3>() / rim.len().max(1) as f64;
    let (x, y) = normal.any_orthonormal_pair();
    // Grows with the angle, and needs no arc tangent.
    let turn = |p: &DVec3| {
        let (a, b) = ((*p - middle).dot(x), (*p - middle).dot(y));
        let along = a / (a.abs() + b.abs()).max(f64::MIN_POSITIVE);
        if b < 0.0 { along - 1.0 } else { 1.0 - along }
    };
    rim.sort_by(|p, q| turn(p).total_cmp(&turn(q)));
    rim
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn parts_of_a_box_have_the_areas_of_geometry() {
        let whole = Polyhedron::of_box(&Aabb { min: Vec3::ZERO, max: Vec3::new(2.0, 1.0, 1.0) });
        assert_eq!(whole.area(), 10.0);
        let [left, right] = whole.cut(&Plane { normal: DVec3::X, offset: 0.5 });
        assert!((left.area() - 4.0).abs() < 1e-12 && (right.area() - 8.0).abs() < 1e-12);
        // A corner off a cube: three half squares and an equilateral triangle of side sqrt 2.
        let [corner, _] = right.cut(&Plane { normal: DVec3::splat(1.0 / 3f64.sqrt()), offset: 1.5 / 3f64.sqrt() });
        let expected = 1.5 + 3f64.sqrt() / 4.0 * 2.0;
        assert!((corner.area() - expected).abs() < 1e-12, "{} {expected}", corner.area());
        // Nothing is left behind a plane that does not reach it, or touches it.
        for offset in [0.0, -1.0] {
            let [none, all] = whole.cut(&Plane { normal: DVec3::X, offset });
            assert!(none.area() == 0.0 && (all.area() - 10.0).abs() < 1e-12, "{offset}");
        }
    }
}
