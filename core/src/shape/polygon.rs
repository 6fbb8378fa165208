//! A polygon with any number of corners, convex or not, also one that crosses itself.
//!
//! Whether the line passes inside is the outline's to say ([`Outline`]). Where the line meets the plane is computed by
//! itself. Four corners in f32 hardly ever lie in one plane: the polygon's is that of Newell's normal (Sutherland,
//! Sproull, Schumacker 1974, *A characterization of ten hidden-surface algorithms*) through the mean of the corners, in
//! f64, and corners may be off it by [`Polygon::FLATNESS`] of the polygon's size. Hits stay within the bounds of the
//! corners. Triangulating, the simpler way, would choose among outlines that are not the polygon's where it is not
//! flat.

use super::distance::Support;
use super::flat::Flat;
use super::line::{Interval, Line, NO_ROOTS, Roots};
use super::outline::Outline;
use super::{InvalidShape, in_f32};
use crate::math::{Aabb, DVec2, DVec3, Vec3, is_traceable};
use crate::ray::Ray;

/// A polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    outline: Outline,
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
    #[doc(hidden)]
    pub fn with_names(corners: Vec<Vec3>, names: Option<&[DVec3]>) -> Result<Self, InvalidShape> {
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
                "corner {farthest} (from 0), {}, is {distance:.3e} off the plane of the polygon, of which {tolerance:.3e} is let \
                 pass; divide it into triangles",
                name(farthest)
            )
        })?;
        Ok(Self { outline: Outline::new(corners), centre, normal, bounds })
    }

    /// The corners, in order.
    pub fn corners(&self) -> &[Vec3] {
        self.outline.corners()
    }

    /// Memory it holds.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + self.outline.bytes()
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
        let corners: Vec<Vec3> = self.corners().iter().map(|p| in_f32(p.as_dvec3() + offset)).collect();
        Self::new(corners.clone()).unwrap_or_else(|_| Self {
            outline: Outline::new(corners),
            centre: self.centre,
            normal: self.normal,
            bounds: Aabb::EMPTY,
        })
    }

    pub(super) fn roots(&self, ray: &Ray) -> Roots {
        if self.bounds.is_empty() {
            return NO_ROOTS;
        }
        let flat = self.flat(ray);
        match flat.t() {
            Some(t) if self.outline.contains(&flat.line) => [Some(self.within_bounds(ray, t)), None],
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

    pub(super) fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Coordinates in the plane, in units of length: from the first corner, along the first edge that has a length and
    /// across.
    pub(super) fn uv(&self, at: DVec3) -> DVec2 {
        let first = self.corners()[0].as_dvec3();
        let edge = self.corners().iter().map(|p| p.as_dvec3() - first).find(|edge| *edge != DVec3::ZERO);
        let x = edge.and_then(|edge| (edge - self.normal * edge.dot(self.normal)).try_normalize()).unwrap_or(DVec3::X);
        let from = at - first;
        DVec2::new(from.dot(x), from.dot(self.normal.cross(x)))
    }
}
