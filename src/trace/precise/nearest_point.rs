//! The point of the meshes that is nearest to a given one.
//!
//! The tree offers what may be nearest for all that rounding hides; distances are computed in f64 from the corners as they were given.

use super::Precise;
use crate::math::DVec3;
use crate::shape::closest::closest_point;
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
}

impl Precise {
    /// The point on any triangle that is nearest to `point`; at equal distances that of the lowest (geometry, primitive). Triangles
    /// without an area count too. None for a point that is not finite, and where there are no triangles.
    pub fn nearest_point(&self, point: DVec3) -> Option<NearestPoint> {
        self.nearest(point, &mut Waiting::new())
    }

    /// The same for many points, into `nearest` of the same length.
    ///
    /// # Panics
    /// Unless there is one answer a point.
    pub fn nearest_point_batch(&self, points: &[DVec3], nearest: &mut [Option<NearestPoint>]) {
        assert_eq!(points.len(), nearest.len(), "one answer a point");
        let mut waiting = Waiting::new();
        for (&point, nearest) in points.iter().zip(nearest) {
            *nearest = self.nearest(point, &mut waiting);
        }
    }

    fn nearest(&self, point: DVec3, waiting: &mut Waiting) -> Option<NearestPoint> {
        if !point.is_finite() {
            return None;
        }
        let (local, error) = self.frame.blurred_point(point);
        let mut best = None::<NearestPoint>;
        self.bvh.near_triangles(local, error as f32 * 1.01, waiting, &mut |geometry, primitive| {
            let found = closest_point(point, self.corners(geometry, primitive));
            let answer = NearestPoint {
                point: point + found.offset,
                distance_squared: found.distance_squared,
                u: found.u,
                v: found.v,
                primitive,
                geometry,
            };
            let is_better = |best: &NearestPoint| {
                answer.distance_squared < best.distance_squared
                    || answer.distance_squared == best.distance_squared && answer.id() < best.id()
            };
            if best.as_ref().is_none_or(is_better) {
                best = Some(answer);
            }
            best.map_or(f64::INFINITY, |best| best.distance_squared.sqrt() * self.frame.scale())
        });
        best
    }
}
