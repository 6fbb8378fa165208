//! The point of the meshes that is nearest to a given one.
//!
//! The tree offers what may be nearest for all that rounding hides; distances are computed in f64 from the corners as they were given.

use super::{Precise, is_traceable};
use crate::math::{DVec3, Vec3};
use crate::shape::closest::{TrianglePoint, closest_point};
use crate::trace::bvh::{Bvh, Sought, Surveyor};

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
        let mut nearest = [None];
        self.nearest_point_batch(&[point], &mut nearest);
        nearest[0]
    }

    /// The same for many points, into `nearest` of the same length. Sooner where one point is near the next: the triangle that was
    /// nearest to the last one is looked at first.
    ///
    /// # Panics
    /// Unless there is one answer a point.
    pub fn nearest_point_batch(&self, points: &[DVec3], nearest: &mut [Option<NearestPoint>]) {
        assert_eq!(points.len(), nearest.len(), "one answer a point");
        nearest.fill(None);
        let run = points.len().div_ceil(Bvh::POINTS).max(1);
        let mut survey = Survey { precise: self, is_exact: self.frame.is_identity(), runs: Vec::new() };
        for (points, nearest) in points.chunks(run).zip(nearest.chunks_mut(run)) {
            survey.runs.push(Run { points, nearest, asked: 0, best: None });
        }
        let discs = self.discs.get_or_init(|| self.bvh.discs());
        self.bvh.near_triangles(discs, survey.runs.len(), &mut survey);
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
}

/// Points of which one traveller takes one after the other.
struct Run<'a> {
    points: &'a [DVec3],
    nearest: &'a mut [Option<NearestPoint>],
    /// So many were asked for.
    asked: usize,
    /// What is nearest to the last of them that is on its way, or was.
    best: Option<NearestPoint>,
}

/// Batches of points on their way through the tree.
struct Survey<'a> {
    precise: &'a Precise,
    /// Whether the corners in the tree are those that were given.
    is_exact: bool,
    runs: Vec<Run<'a>>,
}

impl Survey<'_> {
    /// The distance in the tree.
    fn distance(&self, best: &NearestPoint) -> f64 {
        best.distance_squared.sqrt() * self.precise.frame.scale()
    }
}

impl Surveyor for Survey<'_> {
    fn next(&mut self, traveller: usize) -> Option<Sought> {
        let run = &mut self.runs[traveller];
        if run.asked > 0 {
            run.nearest[run.asked - 1] = run.best;
        }
        loop {
            let point = *run.points.get(run.asked)?;
            run.asked += 1;
            if !point.is_finite() {
                continue;
            }
            let (local, error) = self.precise.frame.blurred_point(point);
            if local.abs().max_element() > FARTHEST {
                run.nearest[run.asked - 1] = self.precise.nearest_of_all(point);
                continue;
            }
            run.best = run.best.map(|last| {
                let (geometry, primitive) = last.id();
                NearestPoint::on(point, self.precise.corners(geometry, primitive), geometry, primitive)
            });
            let wanted = self.runs[traveller].best.as_ref().map_or(f64::INFINITY, |best| self.distance(best));
            return Some(Sought { point: local, error: error as f32 * 1.01, wanted });
        }
    }

    fn measure(&mut self, traveller: usize, geometry: u32, primitive: u32, rounded: &[Vec3; 3]) -> f64 {
        let corners =
            if self.is_exact { rounded.map(|p| p.as_dvec3()) } else { self.precise.corners(geometry, primitive) };
        let run = &mut self.runs[traveller];
        let answer = NearestPoint::on(run.points[run.asked - 1], corners, geometry, primitive);
        if run.best.as_ref().is_none_or(|best| answer.is_before(best)) {
            run.best = Some(answer);
        }
        self.runs[traveller].best.as_ref().map_or(f64::INFINITY, |best| self.distance(best))
    }
}
