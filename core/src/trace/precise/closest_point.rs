//! The point of the meshes that is nearest to a given one.
//!
//! The tree finds it among what may be nearest for all that rounding hides; distances are computed in f64 from the
//! corners as they were given.

use super::{PreciseScene, is_traceable};
use crate::math::DVec3;
use crate::once::made_outside;
use crate::shape::closest::{TrianglePoint, closest_point};
use crate::shape::triangle::weights_within;
use crate::trace::bvh::{Bvh, Discs, NearestTriangle, Sought, Surveyor};

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreciseClosestPoint {
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

impl PreciseClosestPoint {
    const fn id(&self) -> (u32, u32) {
        (self.geometry, self.primitive)
    }

    /// Nearer; of points as near that of the lowest triangle.
    #[inline]
    fn is_before(&self, other: &Self) -> bool {
        self.distance_squared < other.distance_squared
            || self.distance_squared == other.distance_squared && self.id() < other.id()
    }

    fn new(point: DVec3, on: TrianglePoint, [a, b, c]: [DVec3; 3], geometry: u32, primitive: u32) -> Self {
        let TrianglePoint { offset, distance_squared, u, v } = on;
        let [u, v] = weights_within(u, v);
        // From farther away than the triangle is from zero, the way to it is rounded more than the triangle is.
        let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
        let is_far = offset.abs().max_element() > reach;
        let point = if is_far { a + (b - a) * u + (c - a) * v } else { point + offset };
        Self { point, distance_squared, u, v, primitive, geometry }
    }
}

/// Farther away, in the coordinates of the tree, squares of distances leave f32.
const FARTHEST: f32 = 1e18;

impl PreciseScene {
    /// The point on any triangle that is nearest to `point`; at equal distances that of the lowest (geometry,
    /// primitive). Triangles without an area count too. None for a point that is not finite, and where there are no
    /// triangles. Squares of distances above 1e154 are infinite.
    pub fn closest_point(&self, point: DVec3) -> Option<PreciseClosestPoint> {
        let mut nearest = [None];
        self.closest_point_batch(&[point], &mut nearest);
        nearest[0]
    }

    /// The same for many points, into `nearest` of the same length. Up to 32 stretches of them go side by side; sooner
    /// where in each of these one point is near the next: the triangle that was nearest to the last one is looked at
    /// first.
    ///
    /// # Panics
    /// Unless there is one answer a point.
    pub fn closest_point_batch(&self, points: &[DVec3], nearest: &mut [Option<PreciseClosestPoint>]) {
        self.survey(points, nearest, None);
    }

    /// How far these points are, squared, from any triangle, into `distances` of the same length; NaN where
    /// [`Self::closest_point_batch`] finds none. That is a little faster than to find the points as well.
    ///
    /// # Panics
    /// Unless there is one answer a point.
    pub fn distance_squared_batch(&self, points: &[DVec3], distances: &mut [f64]) {
        self.survey(points, distances, f64::NAN);
    }

    fn survey<A: Answer>(&self, points: &[DVec3], answers: &mut [A], none: A) {
        assert_eq!(points.len(), answers.len(), "one answer a point");
        answers.fill(none);
        if !points.iter().any(|point| point.is_finite()) {
            return;
        }
        let run = points.len().div_ceil(Bvh::POINTS).max(1);
        let mut survey = Survey { precise: self, runs: Vec::new() };
        for (points, answers) in points.chunks(run).zip(answers.chunks_mut(run)) {
            survey.runs.push(Run { points, answers, asked: 0 });
        }
        self.bvh.nearest_triangles(self.discs(), survey.runs.len(), &mut survey);
    }

    /// Makes what points need besides the tree, which the first of them does otherwise: threads that ask their first
    /// points together would make it once each.
    pub fn prepare_for_points(&self) {
        self.discs();
    }

    fn discs(&self) -> &Discs {
        made_outside(&self.discs, || self.bvh.discs())
    }

    /// By a look at every triangle, which are all about as far away.
    fn nearest_of_all(&self, point: DVec3) -> Option<PreciseClosestPoint> {
        let mut best: Option<PreciseClosestPoint> = None;
        for (mesh, geometry) in self.meshes.iter().zip(0..) {
            for primitive in 0..mesh.triangles.len() as u32 {
                let corners = self.corners(geometry, primitive);
                if corners.iter().all(|&corner| is_traceable(corner)) {
                    let answer =
                        PreciseClosestPoint::new(point, closest_point(point, corners), corners, geometry, primitive);
                    if best.as_ref().is_none_or(|best| answer.is_before(best)) {
                        best = Some(answer);
                    }
                }
            }
        }
        best
    }
}

/// What is wanted of the triangle that is nearest to a point.
trait Answer: Clone {
    /// Whether the nearest point is part of it.
    const HAS_POINT: bool;
    /// Of a triangle that the tree has found.
    fn of(precise: &PreciseScene, point: DVec3, nearest: &NearestTriangle) -> Self;
    /// Of a look at every triangle.
    fn of_all(nearest: Option<PreciseClosestPoint>) -> Self;
}

impl Answer for Option<PreciseClosestPoint> {
    const HAS_POINT: bool = true;

    fn of(precise: &PreciseScene, point: DVec3, nearest: &NearestTriangle) -> Self {
        let NearestTriangle { on, geometry, primitive, .. } = *nearest;
        on.map(|on| PreciseClosestPoint::new(point, on, precise.corners(geometry, primitive), geometry, primitive))
    }

    fn of_all(nearest: Option<PreciseClosestPoint>) -> Self {
        nearest
    }
}

/// The squared distance.
impl Answer for f64 {
    const HAS_POINT: bool = false;

    fn of(_: &PreciseScene, _: DVec3, nearest: &NearestTriangle) -> Self {
        nearest.distance_squared
    }

    fn of_all(nearest: Option<PreciseClosestPoint>) -> Self {
        nearest.map_or(f64::NAN, |nearest| nearest.distance_squared)
    }
}

/// Points of which one seeker takes one after the other.
struct Run<'a, A> {
    points: &'a [DVec3],
    answers: &'a mut [A],
    /// So many were asked for.
    asked: usize,
}

/// Batches of points on their way through the tree.
struct Survey<'a, A> {
    precise: &'a PreciseScene,
    runs: Vec<Run<'a, A>>,
}

impl<A: Answer> Surveyor for Survey<'_, A> {
    fn next(&mut self, seeker: usize, last: Option<NearestTriangle>) -> Option<Sought> {
        let run = &mut self.runs[seeker];
        if let Some(nearest) = last {
            let asked = run.asked - 1;
            run.answers[asked] = A::of(self.precise, run.points[asked], &nearest);
        }
        loop {
            let point = *run.points.get(run.asked)?;
            run.asked += 1;
            if !point.is_finite() {
                continue;
            }
            let (local, error) = self.precise.frame.blurred_point(point);
            if local.abs().max_element() <= FARTHEST {
                return Some(Sought { point, local, error: error as f32 * 1.01 });
            }
            run.answers[run.asked - 1] = A::of_all(self.precise.nearest_of_all(point));
        }
    }

    #[inline]
    fn corners(&self, geometry: u32, primitive: u32) -> [DVec3; 3] {
        self.precise.corners(geometry, primitive)
    }

    #[inline]
    fn is_exact(&self) -> bool {
        self.precise.frame.is_identity()
    }

    #[inline]
    fn wants_points(&self) -> bool {
        A::HAS_POINT
    }

    #[inline]
    fn scale(&self) -> f64 {
        self.precise.frame.scale()
    }
}
