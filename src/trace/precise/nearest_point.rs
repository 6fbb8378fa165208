//! The point of the meshes that is nearest to a given one.
//!
//! The tree offers what may be nearest for all that rounding hides; distances are computed in f64 from the corners as they were given.

use super::{Precise, is_traceable};
use crate::math::{DVec3, Vec3};
use crate::shape::closest::{TrianglePoint, closest_point};
use crate::trace::bvh::Waiting;

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoint {
    /// Where it is, in the coordinates of the meshes.
    pub point: DVec3,
    /// How far from the point that was asked for, squared.
    pub distance_squared: f64,
    /// Weight of the triangle's second corner.
    pub u: f64,
    /// Weight of the triangle's third corner.
    pub v: f64,
    /// Index of the triangle in its mesh.
    pub primitive: u32,
    /// Index of the mesh.
    pub geometry: u32,
}

impl NearestPoint {
    const fn id(&self) -> (u32, u32) {
        (self.geometry, self.primitive)
    }

    /// Nearer; of points as near that of the lowest triangle.
    #[inline]
    fn is_before(&self, other: &Self) -> bool {
        self.distance_squared < other.distance_squared
            || self.distance_squared == other.distance_squared && self.id() < other.id()
    }

    /// The point of one triangle.
    #[inline]
    fn on(point: DVec3, corners: [DVec3; 3], geometry: u32, primitive: u32) -> Self {
        let TrianglePoint { offset, distance_squared, u, v } = closest_point(point, corners);
        Self { point: point + offset, distance_squared, u, v, primitive, geometry }
    }
}

/// Farther away, in the coordinates of the tree, squares of distances leave f32.
const FARTHEST: f32 = 1e18;

impl Precise {
    /// The point on any triangle that is nearest to `point`; at equal distances that of the lowest (geometry, primitive). Triangles
    /// without an area count too. None for a point that is not finite, and where there are no triangles. Squares of distances above 1e154 are infinite.
    pub fn nearest_point(&self, point: DVec3) -> Option<NearestPoint> {
        self.nearest(point, None, &mut Waiting::new())
    }

    /// The same for many points, into `nearest` of the same length. Sooner where one point is near the next: the triangle that was
    /// nearest to the last one is looked at first.
    ///
    /// # Panics
    /// Unless there is one answer a point.
    pub fn nearest_point_batch(&self, points: &[DVec3], nearest: &mut [Option<NearestPoint>]) {
        assert_eq!(points.len(), nearest.len(), "one answer a point");
        let mut waiting = Waiting::new();
        let mut last = None;
        for (&point, nearest) in points.iter().zip(nearest) {
            *nearest = self.nearest(point, last, &mut waiting);
            last = nearest.or(last);
        }
    }

    /// By a look at every triangle, which are all about as far away.
    fn nearest_of_all(&self, point: DVec3) -> Option<NearestPoint> {
        let mut best: Option<NearestPoint> = None;
        for (mesh, geometry) in self.meshes.iter().zip(0..) {
            for primitive in 0..mesh.triangles.len() as u32 {
                let corners = self.corners(geometry, primitive);
                if corners.iter().all(|&corner| is_traceable(corner)) {
                    let answer = NearestPoint::on(point, corners, geometry, primitive);
                    if best.as_ref().is_none_or(|best| answer.is_before(best)) {
                        best = Some(answer);
                    }
                }
            }
        }
        best
    }

    fn nearest(&self, point: DVec3, last: Option<NearestPoint>, waiting: &mut Waiting) -> Option<NearestPoint> {
        if !point.is_finite() {
            return None;
        }
        let (local, error) = self.frame.blurred_point(point);
        let is_near = local.abs().max_element() <= FARTHEST;
        if !is_near {
            return self.nearest_of_all(point);
        }
        let is_exact = self.frame.is_identity();
        let distance = |best: &NearestPoint| best.distance_squared.sqrt() * self.frame.scale();
        let mut best = last.map(|last| {
            let (geometry, primitive) = last.id();
            NearestPoint::on(point, self.corners(geometry, primitive), geometry, primitive)
        });
        let wanted = best.as_ref().map_or(f64::INFINITY, distance);
        let mut measure = |geometry: u32, primitive: u32, rounded: &[Vec3; 3]| {
            let corners = if is_exact { rounded.map(|p| p.as_dvec3()) } else { self.corners(geometry, primitive) };
            let answer = NearestPoint::on(point, corners, geometry, primitive);
            if best.as_ref().is_none_or(|best| answer.is_before(best)) {
                best = Some(answer);
            }
            best.as_ref().map_or(f64::INFINITY, distance)
        };
        let discs = self.discs.get_or_init(|| self.bvh.discs());
        self.bvh.near_triangles(discs, local, error as f32 * 1.01, wanted, waiting, &mut measure);
        best
    }
}
