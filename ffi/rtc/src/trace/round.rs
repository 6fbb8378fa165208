//! Points and round curves against a ray, in f64.
//!
//! A segment of a curve is two balls and the cone that touches both. A place counts as a hit if it is on the surface of
//! one of these three and inside none of the others, nor inside the neighbours: so joints are smooth, and a curve that
//! is seen through is hit twice, going in and coming out. (Han, Wald, Usher, Wu, Wang, Pascucci, Hansen, Johnson
//! 2019, *Ray tracing generalized tube primitives*.)

use twincast_core::Ray;
use twincast_core::math::{DVec3, Vec3};

use crate::geometry::{Ball, Linear, Named, Segment, Shape};

/// Offers where `ray` meets a primitive, nearest first; the receiver looks at the range.
pub fn offer(linear: &Linear, primitive: u32, ray: &Ray, mut offer: impl FnMut(f32, &Named)) {
    let (org, dir) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let index = primitive as usize;
    let named = |u: f64, ng: DVec3| Named { primitive, u: u as f32, v: 0.0, ng: ng.as_vec3() };
    if linear.shape == Shape::RoundCurve {
        for hit in curve(linear, index, ray.time, org, dir) {
            offer(hit.t as f32, &named(hit.u, hit.ng));
        }
        return;
    }
    if let Some(ball) = linear.point_at(index, ray.time) {
        offer_point(linear, primitive, &ball, ray, offer);
    }
}

/// Offers where `ray` meets a point that is there now, likewise.
#[inline]
pub fn offer_point(linear: &Linear, primitive: u32, ball: &Ball, ray: &Ray, mut offer: impl FnMut(f32, &Named)) {
    let (org, dir) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let named = |u: f64, ng: DVec3| Named { primitive, u: u as f32, v: 0.0, ng: ng.as_vec3() };
    let (centre, radius) = (ball.centre.as_dvec3(), f64::from(ball.radius));
    match linear.shape {
        Shape::Sphere | Shape::RoundCurve => {
            for t in sphere(org - centre, dir, radius).into_iter().flatten() {
                offer(t as f32, &named(0.0, org + dir * t - centre));
            }
        }
        Shape::Disc => {
            let t = (centre - org).dot(dir) / dir.length_squared();
            // From within its ball it would shade itself, whatever the ray: Embree's rule.
            let is_apart = (org - centre).length_squared() > radius * radius;
            if is_apart && (org + dir * t - centre).length_squared() < radius * radius {
                offer(t as f32, &named(0.0, -dir));
            }
        }
        Shape::OrientedDisc => {
            let normal = linear.normal_at(primitive as usize, ray.time).unwrap_or(Vec3::ZERO).as_dvec3();
            let t = (centre - org).dot(normal) / dir.dot(normal);
            // Not a number, nor finite, where the ray runs along the disc.
            if (org + dir * t - centre).length_squared() < radius * radius {
                offer(t as f32, &named(0.0, normal));
            }
        }
    }
}

/// Where a ray meets a segment of a curve, nearest first.
#[inline(never)]
fn curve(linear: &Linear, segment: usize, time: f32, org: DVec3, dir: DVec3) -> Vec<Found> {
    linear.segment_at(segment, time).map_or_else(Vec::new, |segment| Capsule::new(&segment).hits(org, dir))
}

/// Where a ray enters and leaves a ball about zero.
#[inline]
fn sphere(org: DVec3, dir: DVec3, radius: f64) -> Option<[f64; 2]> {
    let square = dir.length_squared();
    let middle = -org.dot(dir) / square;
    // From the nearest point, so that far origins do not cancel.
    let aside = (org + dir * middle).length_squared();
    let rest = radius * radius - aside;
    (rest >= 0.0).then(|| {
        let half = (rest / square).sqrt();
        [middle - half, middle + half]
    })
}

struct Found {
    t: f64,
    u: f64,
    ng: DVec3,
}

/// A part of the surface: which it is decides what it may be inside of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Start,
    End,
    Side,
}

/// Two balls and the cone between them.
struct Cone {
    a: DVec3,
    b: DVec3,
    radius: [f64; 2],
    axis: DVec3,
    /// What the radius loses on the way.
    taper: f64,
    /// The axis' length, squared, less the taper's square; none or less where one ball is in the other.
    slant: f64,
}

impl Cone {
    fn new(start: &Ball, end: &Ball) -> Self {
        let (a, b) = (start.centre.as_dvec3(), end.centre.as_dvec3());
        let radius = [f64::from(start.radius), f64::from(end.radius)];
        let (axis, taper) = (b - a, radius[0] - radius[1]);
        Self { a, b, radius, axis, taper, slant: axis.length_squared() - taper * taper }
    }

    /// How far along the slant a place is: 0 at the first ball's circle, `slant` at the second's.
    fn along(&self, place: DVec3) -> f64 {
        (place - self.a).dot(self.axis) - self.radius[0] * self.taper
    }

    /// Whether a place is inside the cone proper, by more than rounding.
    fn holds_between(&self, place: DVec3) -> bool {
        let y = self.along(place);
        if self.slant <= 0.0 || y <= 0.0 || y >= self.slant {
            return false;
        }
        let from = place - self.a;
        let square = self.axis.length_squared();
        let (m1, ra) = (from.dot(self.axis), self.radius[0]);
        let side = self.slant * from.length_squared() - m1 * m1 + 2.0 * m1 * self.taper * ra - square * ra * ra;
        side < -1e-6 * square * ra.max(self.radius[1]).powi(2)
    }

    fn ball_holds(&self, end: usize, place: DVec3) -> bool {
        let centre = if end == 0 { self.a } else { self.b };
        let square = self.radius[end] * self.radius[end];
        (place - centre).length_squared() < square * (1.0 - 1e-6)
    }

    fn holds(&self, place: DVec3) -> bool {
        self.ball_holds(0, place) || self.ball_holds(1, place) || self.holds_between(place)
    }

    /// The roots of the cone's side, of which those count that are between the balls.
    fn side(&self, org: DVec3, dir: DVec3) -> Option<[f64; 2]> {
        if self.slant <= 0.0 {
            return None;
        }
        // From the point nearest to the first ball, so that far origins do not cancel.
        let shift = -(org - self.a).dot(dir) / dir.length_squared();
        let from = org + dir * shift - self.a;
        let square = self.axis.length_squared();
        let (m1, m2, ra) = (from.dot(self.axis), dir.dot(self.axis), self.radius[0]);
        let k2 = self.slant * dir.length_squared() - m2 * m2;
        let k1 = self.slant * dir.dot(from) - m1 * m2 + m2 * self.taper * ra;
        let k0 = self.slant * from.length_squared() - m1 * m1 + 2.0 * m1 * self.taper * ra - square * ra * ra;
        let discriminant = k1 * k1 - k0 * k2;
        if discriminant < 0.0 || k2 == 0.0 {
            return None;
        }
        let root = discriminant.sqrt();
        Some([shift + (-k1 - root) / k2, shift + (-k1 + root) / k2])
    }
}

/// A segment and what it touches.
struct Capsule {
    own: Cone,
    neighbours: [Option<Cone>; 2],
}

impl Capsule {
    fn new(segment: &Segment) -> Self {
        let [start, end] = &segment.ends;
        let [before, after] = &segment.neighbours;
        let neighbours =
            [before.as_ref().map(|ball| Cone::new(ball, start)), after.as_ref().map(|ball| Cone::new(end, ball))];
        Self { own: Cone::new(start, end), neighbours }
    }

    /// All hits, nearest first.
    fn hits(&self, org: DVec3, dir: DVec3) -> Vec<Found> {
        let own = &self.own;
        // Where two segments meet, the ball is the first one's.
        let start = if self.neighbours[0].is_none() { sphere(org - own.a, dir, own.radius[0]) } else { None };
        let roots = [
            (Part::Start, start),
            (Part::End, sphere(org - own.b, dir, own.radius[1])),
            (Part::Side, own.side(org, dir)),
        ];
        let mut hits = Vec::new();
        for (part, roots) in roots {
            for t in roots.into_iter().flatten() {
                let place = org + dir * t;
                if self.counts(part, place) {
                    hits.push(self.found(part, t, place));
                }
            }
        }
        hits.sort_by(|a, b| a.t.total_cmp(&b.t));
        hits
    }

    fn counts(&self, part: Part, place: DVec3) -> bool {
        let own = &self.own;
        let is_out = match part {
            Part::Start => !own.ball_holds(1, place) && !own.holds_between(place),
            Part::End => !own.ball_holds(0, place) && !own.holds_between(place),
            Part::Side => {
                let y = own.along(place);
                y > 0.0 && y < own.slant
            }
        };
        is_out && !self.neighbours.iter().flatten().any(|neighbour| neighbour.holds(place))
    }

    fn found(&self, part: Part, t: f64, place: DVec3) -> Found {
        let own = &self.own;
        match part {
            Part::Start => Found { t, u: 0.0, ng: place - own.a },
            Part::End => Found { t, u: 1.0, ng: place - own.b },
            Part::Side => {
                let y = own.along(place);
                let ng = ((place - own.a) * own.slant - own.axis * y) / own.axis.length_squared();
                Found { t, u: (y / own.slant).clamp(0.0, 1.0), ng }
            }
        }
    }
}
