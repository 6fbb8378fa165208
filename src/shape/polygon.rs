//! A polygon with any number of corners, convex or not, also one that crosses itself.
//!
//! Looked at along the ray, the corners are points of a plane and the line is one point of it. A half-line from that
//! point crosses the outline an odd number of times where the point is inside (Shimrat 1962, *Algorithm 112*; Haines
//! 1994, *Point in polygon strategies*). Which edges it crosses is told by signs: on which side of the half-line's own
//! line the corners are, where one on it counts as above, and for edges with an end on either side the sign of the
//! volume d . (b x c), as for triangles. All signs are exact, so a ray through a corner is counted once, and a point on
//! an edge or a corner is seen as such: it is inside. Two polygons that share an edge leave no gap.
//!
//! Where the line meets the plane is computed by itself. Four corners in f32 hardly ever lie in one plane: the
//! polygon's is that of Newell's normal (Sutherland, Sproull, Schumacker 1974, *A characterization of ten
//! hidden-surface algorithms*) through the mean of the corners, in f64, and corners may be off it by
//! [`Polygon::FLATNESS`] of the polygon's size. Hits stay within the bounds of the corners. Triangulating, the simpler
//! way, would choose among outlines that are not the polygon's where it is not flat.

use super::distance::Support;
use super::flat::Flat;
use super::line::{Interval, Line, NO_ROOTS, Roots};
use super::{InvalidShape, in_f32};
use crate::math::number::{Formula, Number, cross, dot, minus, vector};
use crate::math::{Aabb, DVec2, DVec3, Vec3, is_traceable};
use crate::ray::Ray;

/// A polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    corners: Vec<Vec3>,
    /// A point of its plane.
    centre: DVec3,
    /// Of length 1, to the side from which the corners run counter-clockwise.
    normal: DVec3,
    bounds: Aabb,
}

impl Polygon {
    /// How far from the polygon's plane a corner may be, in units of the diagonal of its bounds: files have five digits
    /// or six.
    pub const FLATNESS: f64 = 1e-3;

    /// The polygon with these corners, in order; the last is joined to the first.
    ///
    /// # Errors
    /// For fewer than three corners, corners without an area (collinear, or an outline that turns both ways alike),
    /// corners that are not in one plane, and what is not finite.
    pub fn new(corners: Vec<Vec3>) -> Result<Self, InvalidShape> {
        Self::with_names(corners, None)
    }

    /// The same, and what corners are called in messages, where that is not where they are.
    ///
    /// # Errors
    /// As [`Polygon::new`].
    pub(crate) fn with_names(corners: Vec<Vec3>, names: Option<&[DVec3]>) -> Result<Self, InvalidShape> {
        let name = |i: usize| names.map_or_else(|| corners[i].to_string(), |names| names[i].to_string());
        let count = corners.len();
        InvalidShape::unless(count >= 3, || format!("a polygon of {count} corners; it needs three at least"))?;
        for (i, &corner) in corners.iter().enumerate() {
            InvalidShape::unless(is_traceable(corner), || format!("corner {i}, {}, is not finite", name(i)))?;
        }
        let bounds = Aabb::around(corners.iter().copied());
        let first = corners[0].as_dvec3();
        let from_first = || corners.iter().map(|p| p.as_dvec3() - first);
        let normal: DVec3 = from_first().zip(from_first().skip(1)).map(|(p, q)| p.cross(q)).sum();
        let size = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length();
        // Of the sum's rounding, relative to its terms.
        let noise = size * size * f64::EPSILON * count as f64;
        InvalidShape::unless(normal.length() > noise, || {
            "the polygon has no area: its corners lie on a line, or its outline turns both ways alike".to_owned()
        })?;
        let normal = normal.normalize();
        let centre = first + from_first().sum::<DVec3>() / count as f64;
        let off = |p: &Vec3| (p.as_dvec3() - centre).dot(normal).abs();
        let farthest = (0..count).max_by(|&i, &j| off(&corners[i]).total_cmp(&off(&corners[j]))).unwrap_or(0);
        let distance = off(&corners[farthest]);
        let tolerance = Self::FLATNESS * size;
        InvalidShape::unless(distance <= tolerance, || {
            format!(
                "corner {farthest}, {}, is {distance:.3e} off the plane of the polygon, of which {tolerance:.3e} is let \
                 pass; divide it into triangles",
                name(farthest)
            )
        })?;
        Ok(Self { corners, centre, normal, bounds })
    }

    /// The corners, in order.
    pub fn corners(&self) -> &[Vec3] {
        &self.corners
    }

    /// A point of the polygon's plane, and its unit normal.
    pub fn plane(&self) -> (DVec3, DVec3) {
        (self.centre, self.normal)
    }

    pub(super) fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The corners are rounded in their new place. Where that leaves no polygon (it is smaller than a step of f32
    /// there), it keeps the plane, and is not hit.
    pub(super) fn translated(&self, offset: DVec3) -> Self {
        let corners: Vec<Vec3> = self.corners.iter().map(|p| in_f32(p.as_dvec3() + offset)).collect();
        Self::new(corners.clone()).unwrap_or_else(|_| Self { corners, bounds: Aabb::EMPTY, ..self.clone() })
    }

    pub(super) fn roots(&self, ray: &Ray) -> Roots {
        if self.bounds.is_empty() {
            return NO_ROOTS;
        }
        let flat = self.flat(ray);
        match flat.t() {
            Some(t) if self.contains(&flat.line) => [Some(self.within_bounds(ray, t)), None],
            _ => NO_ROOTS,
        }
    }

    /// Its plane, where `t` is not that of its bounds.
    pub(super) fn support(&self, ray: &Ray, t: f64) -> Support {
        let is_of_plane = self.flat(ray).t() == Some(t);
        if is_of_plane { Support::Plane(self.centre, self.normal) } else { Support::Itself }
    }

    fn flat(&self, ray: &Ray) -> Flat {
        let reach = self.bounds.min.abs().max(self.bounds.max.abs());
        let line = Line::new(ray, reach.max_element());
        Flat { point: line.place_f64(self.centre), normal: self.normal, line }
    }

    /// The t within the bounds that is nearest to `t`.
    ///
    /// Corners are off the plane by a trifle, so a ray that grazes it may pass inside the outline and meet the plane
    /// outside, even far away. Bounds would not contain such a hit; not to count it would open a gap between polygons
    /// that share an edge. A line that passes inside the outline meets the convex hull of the corners, so it does meet
    /// the bounds.
    fn within_bounds(&self, ray: &Ray, t: f64) -> f64 {
        let mut inside = Interval::ALL;
        for axis in (0..3).filter(|&axis| ray.direction[axis] != 0.0) {
            let [low, high] = [self.bounds.min[axis], self.bounds.max[axis]]
                .map(|bound| (f64::from(bound) - f64::from(ray.origin[axis])) / f64::from(ray.direction[axis]));
            inside = inside.and(Interval::between(low, high));
        }
        t.max(inside.enter).min(inside.exit.max(inside.enter))
    }

    /// Whether the line passes inside the outline, or through it.
    fn contains(&self, line: &Line) -> bool {
        let size = line.direction.abs();
        let mut axes = [0, 1, 2];
        axes.sort_by(|&i, &j| size[i].total_cmp(&size[j]));
        // The half-line goes along the axis that is farthest from the direction.
        let [along, across, _] = axes;
        let side = |p: Vec3, axis: usize| Side { line, axis, corner: line.place(p) }.signs()[0];
        let mut is_inside = false;
        let Some(&last) = self.corners.last() else { return false };
        let (mut from, mut from_side) = (last, side(last, along));
        for &to in &self.corners {
            let to_side = side(to, along);
            if (from_side >= 0) != (to_side >= 0) {
                let volume = Volume { line, ends: [from, to].map(|p| line.place(p)) }.signs()[0];
                if volume == 0 {
                    return true;
                }
                is_inside ^= (volume > 0) == (to_side >= 0);
            } else if to_side == 0 {
                // In a corner, or on an edge along the half-line.
                let place = side(to, across);
                if place == 0 || from_side == 0 && side(from, across) * place < 0 {
                    return true;
                }
            }
            (from, from_side) = (to, to_side);
        }
        is_inside
    }

    pub(super) fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Coordinates in the plane, in units of length: from the first corner, along the first edge that has a length and
    /// across.
    pub(super) fn uv(&self, at: DVec3) -> DVec2 {
        let first = self.corners[0].as_dvec3();
        let edge = self.corners.iter().map(|p| p.as_dvec3() - first).find(|edge| *edge != DVec3::ZERO);
        let x = edge.and_then(|edge| (edge - self.normal * edge.dot(self.normal)).try_normalize()).unwrap_or(DVec3::X);
        let from = at - first;
        DVec2::new(from.dot(x), from.dot(self.normal.cross(x)))
    }
}

/// d . (e x v) for an axis e and v from the ray's origin to a corner: on which side of the plane of d and e the corner
/// is.
struct Side<'a> {
    line: &'a Line,
    axis: usize,
    corner: DVec3,
}

impl Formula<1> for Side<'_> {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 1] {
        let (i, j) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let v = |k: usize| N::new(self.corner[k]).sub(&N::new(self.line.origin[k]));
        let d = |k: usize| N::new(self.line.direction[k]);
        [d(j).mul(&v(i)).sub(&d(i).mul(&v(j)))]
    }
}

/// d . (b x c), with the edge in place of c, which cancels less.
struct Volume<'a> {
    line: &'a Line,
    ends: [DVec3; 2],
}

impl Formula<1> for Volume<'_> {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 1] {
        let [from, to] = self.ends.map(vector::<N>);
        let (b, edge) = (minus(&from, &vector(self.line.origin)), minus(&to, &from));
        [dot(&vector(self.line.direction), &cross(&b, &edge))]
    }
}
