//! Points and round linear curves, as they were when their scene was committed.

use twincast_core::math::{Aabb, Vec3, is_traceable};

use super::{State, TimeSteps};
use crate::buffer::View;

/// What is put at vertices with a radius.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    Sphere,
    /// Facing the ray.
    Disc,
    /// With a normal of its own.
    OrientedDisc,
    /// Spheres at both ends, and the cone that touches them.
    RoundCurve,
}

/// A centre and a radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    pub centre: Vec3,
    pub radius: f32,
}

/// A segment of a curve at a time.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    pub ends: [Ball; 2],
    /// The far ends of the segments before and behind it, where there are any.
    pub neighbours: [Option<Ball>; 2],
}

/// Points or curves.
#[derive(Clone, Debug)]
pub struct Linear {
    pub shape: Shape,
    pub steps: TimeSteps<Vec<Ball>>,
    normals: TimeSteps<Vec<Vec3>>,
    /// Of curves: the first vertex, and which neighbours there are.
    segments: Vec<(u32, u8)>,
}

const LEFT: u8 = 1;
const RIGHT: u8 = 2;

impl Linear {
    /// Reads the buffers.
    pub fn new(shape: Shape, state: &State) -> Self {
        let balls = |view: &Option<View>| -> Vec<Ball> {
            let Some(view) = view else { return Vec::new() };
            let balls = (0..view.count()).filter_map(|i| view.floats::<4>(i));
            balls.map(|[x, y, z, radius]| Ball { centre: Vec3::new(x, y, z), radius }).collect()
        };
        let normals = |view: &Option<View>| -> Vec<Vec3> {
            let Some(view) = view else { return Vec::new() };
            (0..view.count()).filter_map(|i| view.floats::<3>(i)).map(Vec3::from).collect()
        };
        let segments = if shape == Shape::RoundCurve { read_segments(state) } else { Vec::new() };
        Self {
            shape,
            steps: TimeSteps::new(state.vertices.iter().map(balls).collect(), state.time_range),
            normals: TimeSteps::new(state.normals.iter().map(normals).collect(), state.time_range),
            segments,
        }
    }

    /// How many primitives.
    pub fn count(&self) -> usize {
        if self.shape == Shape::RoundCurve { self.segments.len() } else { self.steps[0].len() }
    }

    /// The balls of a primitive at a step.
    fn balls(&self, primitive: usize, step: usize) -> Option<[Ball; 2]> {
        let vertices = &self.steps[step];
        if self.shape != Shape::RoundCurve {
            let ball = *vertices.get(primitive)?;
            return Some([ball; 2]);
        }
        let first = self.segments[primitive].0 as usize;
        Some([*vertices.get(first)?, *vertices.get(first.checked_add(1)?)?])
    }

    /// The box of a primitive at a step; empty for one that cannot be hit.
    pub fn bounds_at(&self, primitive: usize, step: usize) -> Aabb {
        let is_good = |step| {
            let good = |ball: &Ball| is_traceable(ball.centre) && ball.radius >= 0.0 && ball.radius < 1e18;
            self.balls(primitive, step).is_some_and(|balls| balls.iter().all(good))
        };
        let has_normals = self.shape != Shape::OrientedDisc || self.normals.iter().all(|step| step.len() > primitive);
        match self.balls(primitive, step) {
            Some(balls) if has_normals && (0..self.steps.len()).all(is_good) => {
                let around = |ball: &Ball| {
                    // A hit's own rounding.
                    let reach = Vec3::splat(ball.radius * (1.0 + 4.0 * f32::EPSILON));
                    Aabb { min: ball.centre - reach, max: ball.centre + reach }
                };
                around(&balls[0]).union(around(&balls[1]))
            }
            _ => Aabb::EMPTY,
        }
    }

    #[inline]
    fn ball_at(&self, vertex: usize, time: f32) -> Option<Ball> {
        let (before, after) = self.steps.around(time);
        let a = before.get(vertex)?;
        let Some((after, fraction)) = after else { return Some(*a) };
        let b = after.get(vertex)?;
        let radius = a.radius * (1.0 - fraction) + b.radius * fraction;
        Some(Ball { centre: a.centre * (1.0 - fraction) + b.centre * fraction, radius })
    }

    /// A point at a time.
    #[inline]
    pub fn point_at(&self, primitive: usize, time: f32) -> Option<Ball> {
        self.ball_at(primitive, time)
    }

    /// The normal of an oriented disc at a time.
    pub fn normal_at(&self, primitive: usize, time: f32) -> Option<Vec3> {
        let (before, after) = self.normals.around(time);
        let a = *before.get(primitive)?;
        let Some((after, fraction)) = after else { return Some(a) };
        Some(a * (1.0 - fraction) + *after.get(primitive)? * fraction)
    }

    /// A segment of a curve at a time.
    pub fn segment_at(&self, primitive: usize, time: f32) -> Option<Segment> {
        let &(first, flags) = self.segments.get(primitive)?;
        let first = first as usize;
        let neighbour = |flag: u8, vertex: Option<usize>| {
            if flags & flag != 0 { vertex.and_then(|vertex| self.ball_at(vertex, time)) } else { None }
        };
        let ends = [self.ball_at(first, time)?, self.ball_at(first + 1, time)?];
        Some(Segment { ends, neighbours: [neighbour(LEFT, first.checked_sub(1)), neighbour(RIGHT, Some(first + 2))] })
    }
}

/// First vertices, and neighbours: as flagged, or those that share a vertex.
fn read_segments(state: &State) -> Vec<(u32, u8)> {
    let Some(index) = &state.index else { return Vec::new() };
    let firsts: Vec<u32> = (0..index.count()).filter_map(|i| index.words::<1>(i)).map(|[first]| first).collect();
    let follows = |i: usize| firsts.get(i + 1).is_some_and(|&next| Some(next) == firsts[i].checked_add(1));
    let flags = |i: usize| match &state.flags {
        Some(flags) => flags.byte(i).unwrap_or(0),
        None => {
            let left = if i > 0 && follows(i - 1) { LEFT } else { 0 };
            left | if follows(i) { RIGHT } else { 0 }
        }
    };
    firsts.iter().enumerate().map(|(i, &first)| (first, flags(i))).collect()
}
