//! Which triangle a ray crosses where several touch: at a shared edge or corner.
//!
//! [`intersect`] lets a zero volume count as inside, so a ray through an edge or a corner hits every triangle there. To
//! count crossings, the ray is moved aside by an infinitesimal (e, e^2, e^3), the same for all triangles (Edelsbrunner,
//! Mücke 1990, *Simulation of simplicity*): it then passes through no edge, and what it crosses is what counts. Moved
//! so, the volume d.(B x C) of the edge from B to C becomes d.(B x C) + (e, e^2, e^3).(d x (C - B)); where the first
//! term is zero, the first component of d x (C - B) that is not has the sign. The direction stays, so a ray in a
//! triangle's plane still misses it.
//!
//! A closed mesh is therefore crossed an even number of times from outside and an odd number from inside, always; a ray
//! that touches an edge or a corner from one side crosses twice (in and out), or not at all. To keep one of the hits
//! whose t differ by little, the simpler alternative, needs a tolerance, counts a touched silhouette once, and loses
//! thin walls.

use super::exactly::Seen;
use super::triangle::{Corners, TriangleHit, intersect, intersect_line};
use crate::math::DVec3;
use crate::math::expansion::count_decision;
use crate::ray::Ray;

/// A hit, and where in the triangle it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The hit.
    pub hit: TriangleHit,
    /// None in the triangle's interior, which is always crossed.
    pub touch: Option<Touch>,
}

/// A hit on an edge or in a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Touch {
    /// The corners of weight above zero: the two ends of an edge, or a corner.
    pub between: [bool; 3],
    /// Whether the direction and the normal have the same sign.
    pub is_leaving: bool,
    /// Whether the ray, moved aside, crosses the triangle.
    pub is_crossed: bool,
}

/// Where a volume is zero, its weight is 0 to the bit (second and third corner), or 1 less the others by at most 4
/// roundings: their t, u and v come from exact volumes, each rounded, divided and added once.
const NEAR: f64 = 1e-12;

/// What [`intersect`] answers, with the place.
pub fn crossing(ray: &Ray, corners: &impl Corners) -> Option<Crossing> {
    let hit = intersect(ray, corners)?;
    Some(with_place(ray.origin.as_dvec3(), ray.direction.as_dvec3(), corners, hit))
}

/// What [`intersect_line`] answers, with the place.
pub fn crossing_line(origin: DVec3, d: DVec3, corners: &impl Corners) -> Option<Crossing> {
    let hit = intersect_line(origin, d, corners)?;
    Some(with_place(origin, d, corners, hit))
}

#[inline]
fn with_place(origin: DVec3, d: DVec3, corners: &impl Corners, hit: TriangleHit) -> Crossing {
    let may_touch = hit.u == 0.0 || hit.v == 0.0 || (1.0 - hit.u - hit.v).abs() <= NEAR;
    let touch = if may_touch { touch(origin, d, corners) } else { None };
    Crossing { hit, touch }
}

#[cold]
#[inline(never)]
fn touch(origin: DVec3, d: DVec3, corners: &impl Corners) -> Option<Touch> {
    count_decision();
    let signs = match Seen::in_integers(origin, d, [corners.in_f64()]) {
        Some(seen) => seen.signs_aside(),
        None => Seen::in_expansions(origin, d, corners).signs_aside(),
    };
    let between = signs.map(|[sign, _]| sign != 0);
    if between == [true; 3] {
        return None;
    }
    let is_crossed = signs.iter().all(|[_, aside]| *aside == signs[0][1]);
    Some(Touch { between, is_leaving: signs.iter().map(|[sign, _]| sign).sum::<i32>() > 0, is_crossed })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    fn down(x: f32, y: f32) -> Ray {
        Ray::new(Vec3::new(x, y, 1.0), Vec3::NEG_Z)
    }

    /// Four triangles around the middle of a square, counter-clockwise from above.
    fn fan() -> [[Vec3; 3]; 4] {
        let rim = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0));
        [0, 1, 2, 3].map(|i| [Vec3::ZERO, rim[i], rim[(i + 1) % 4]])
    }

    #[test]
    fn one_of_those_that_touch_is_crossed() {
        // The middle, two edges inside, and the interior.
        for (ray, touching) in [(down(0.0, 0.0), 4), (down(0.5, 0.5), 2), (down(-0.25, 0.25), 2), (down(0.5, 0.0), 1)] {
            let all: Vec<Crossing> = fan().iter().filter_map(|corners| crossing(&ray, corners)).collect();
            assert_eq!(all.len(), touching);
            let crossed = all.iter().filter(|c| c.touch.is_none_or(|touch| touch.is_crossed)).count();
            assert_eq!(crossed, 1, "{ray:?} {all:?}");
            assert!(all.iter().filter_map(|c| c.touch).all(|touch| !touch.is_leaving), "down onto the upper side");
        }
    }

    #[test]
    fn the_rim_counts_where_the_moved_ray_stays_inside() {
        // The move is towards +x: the left rim counts, the right one does not.
        let crossed = |ray: Ray| fan().iter().filter_map(|c| crossing(&ray, c)?.touch).filter(|t| t.is_crossed).count();
        assert_eq!((crossed(down(-1.0, 0.5)), crossed(down(1.0, 0.5))), (1, 0));
        // Along the lower rim it stays on it, and the second move is towards +y.
        assert_eq!((crossed(down(0.5, -1.0)), crossed(down(0.5, 1.0))), (1, 0));
    }

    #[test]
    fn the_place_is_named() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let between = |x, y| crossing(&down(x, y), &corners).expect("hit").touch.map(|touch| touch.between);
        assert_eq!(between(0.25, 0.25), None);
        assert_eq!(between(0.5, 0.5), Some([false, true, true]));
        assert_eq!(between(0.0, 0.5), Some([true, false, true]));
        assert_eq!(between(0.5, 0.0), Some([true, true, false]));
        assert_eq!(between(0.0, 0.0), Some([true, false, false]));
        assert_eq!(between(0.0, 1.0), Some([false, false, true]));
    }
}
