//! Boxes that move: where they are at a time, and the two boxes between which they always are.

use twincast_core::math::{Aabb, Vec3};

use crate::geometry::around;

/// The box between two.
pub fn between(a: Aabb, b: Aabb, at: f32) -> Aabb {
    Aabb { min: a.min.lerp(b.min, at), max: a.max.lerp(b.max, at) }
}

/// Where a box is that has these places, at equal distances of a range of time; outside it, where it is at that end.
pub fn at(steps: &[Aabb], range: (f32, f32), time: f32) -> Aabb {
    let (before, after) = around(steps, range, time);
    after.map_or(*before, |(after, fraction)| between(*before, *after, fraction))
}

/// Boxes at time 0 and at time 1 between which it then always is; empty for what is not there in that time.
pub fn ends(steps: &[Aabb], range: (f32, f32)) -> [Aabb; 2] {
    let (begin, end) = range;
    if let [only] = steps {
        return [*only; 2];
    }
    if begin > 1.0 || end < 0.0 {
        return [Aabb::EMPTY; 2];
    }
    let last = steps.len().saturating_sub(1).max(1) as f32;
    let time = |step: usize| begin + (end - begin) * (step as f32 / last);
    let inner = steps.iter().enumerate().map(|(step, bounds)| (time(step), *bounds));
    let inner = inner.filter(|&(time, _)| time > 0.0 && time < 1.0);
    let [first, last] = [0.0, 1.0].map(|time| std::iter::once((time, at(steps, range, time))));
    linear(first.chain(inner).chain(last))
}

/// Boxes at time 0 and at time 1 between which are those that move in straight lines from each of these times to the
/// next.
pub fn linear(knots: impl Iterator<Item = (f32, Aabb)> + Clone) -> [Aabb; 2] {
    let (Some((_, a)), Some((_, b))) = (knots.clone().next(), knots.clone().last()) else {
        return [Aabb::EMPTY; 2];
    };
    let (mut below, mut above) = (Vec3::ZERO, Vec3::ZERO);
    for (time, knot) in knots {
        let line = between(a, b, time);
        below = below.min(knot.min - line.min);
        above = above.max(knot.max - line.max);
    }
    [a, b].map(|bounds| Aabb { min: bounds.min + below, max: bounds.max + above })
}
