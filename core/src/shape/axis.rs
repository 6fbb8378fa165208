//! What a cylinder and a cone share: an axis, an end plane at each end of it, and what lies between.
//!
//! Capped, they are convex: the line is inside where it is inside the lateral surface and between the end planes, and
//! hits where it enters and leaves. One comparison of t decides for the side and the cap at once, so no ray slips
//! through the rim between them; testing the side and two disks by themselves, the simpler way, loses rays there. Open,
//! they are hit at the lateral surface's roots, where those are between the end planes.

use super::line::{Interval, Line, NO_ROOTS, PRECISION, Roots};
use super::quadric::Inside;
use super::round::{disk_reach, outwards, turn};
use super::{InvalidShape, in_f32};
use crate::math::number::{Bounded, Formula, Number, dot, minus, vector};
use crate::math::{Aabb, DVec2, DVec3, Vec3, is_traceable, tangents};

/// A surface of revolution with a straight side.
pub(super) struct Frustum {
    pub ends: [Vec3; 2],
    pub radii: [f32; 2],
    pub capped: bool,
}

impl Frustum {
    /// Whether the ends are a way apart; what is wrong with the radii is said by who has them.
    pub fn check(&self) -> Result<(), InvalidShape> {
        let [base, apex] = self.ends;
        InvalidShape::unless(is_traceable(base) && is_traceable(apex), || {
            format!("the ends {base} and {apex} are not finite")
        })?;
        InvalidShape::unless(base != apex, || format!("both ends are {base}; let them lie apart"))
    }

    pub fn size(&self) -> f32 {
        let ends = self.ends[0].abs().max(self.ends[1].abs()).max_element();
        ends.max(self.radii[0]).max(self.radii[1])
    }

    pub fn bounds(&self) -> Aabb {
        let disk = |k: usize| {
            let centre = self.ends[k].as_dvec3();
            outwards(centre, disk_reach(self.axis(), self.radii[k].into()))
        };
        disk(0).union(disk(1))
    }

    /// The ends, moved.
    pub fn moved_ends(&self, offset: DVec3) -> [Vec3; 2] {
        self.ends.map(|end| in_f32(end.as_dvec3() + offset))
    }

    fn axis(&self) -> DVec3 {
        self.ends[1].as_dvec3() - self.ends[0].as_dvec3()
    }

    /// The crossings of a line of which `inside` is within the lateral surface. `widens`: whether the line goes towards
    /// larger radii, on the side of the apex where the surface is.
    pub fn roots(&self, line: &Line, inside: Inside, widens: bool) -> Roots {
        let within = match inside {
            Inside::Nothing => return NO_ROOTS,
            Inside::All if !self.capped => return NO_ROOTS,
            Inside::All => Interval::ALL,
            Inside::Between(roots) => roots,
            // A double cone: the half on this side.
            Inside::Beyond(roots) if widens => Interval { enter: roots.exit, ..Interval::ALL },
            Inside::Beyond(roots) => Interval { exit: roots.enter, ..Interval::ALL },
        };
        let between = Ends { line, ends: self.ends.map(|end| line.place(end)) }.between();
        let roots = if self.capped {
            within.and(between).ends()
        } else {
            let side = |t: f64| (t.is_finite() && between.contains(t)).then_some(t);
            let [first, second] = [side(within.enter), side(within.exit)];
            if first.is_some() { [first, second] } else { [second, None] }
        };
        roots.map(|t| t.map(|t| line.t(t)))
    }

    /// The outward unit normal, and the parameters: the angle over [0, 1], and the way from base to apex; on a cap the
    /// distance from the axis in radii.
    pub fn at(&self, point: DVec3) -> (DVec3, DVec2) {
        let axis = self.axis();
        let length = axis.length();
        let along = axis / length;
        let from = point - self.ends[0].as_dvec3();
        let height = from.dot(along);
        let out = from - along * height;
        let [x, y] = tangents(along);
        let angle = turn(out.dot(y), out.dot(x));
        let [base, apex] = self.radii.map(f64::from);
        let slope = (apex - base) / length;
        let away = (out.length() - (base + slope * height)).abs() / f64::hypot(1.0, slope);
        if self.capped && height.abs().min((height - length).abs()) < away {
            let is_base = height.abs() < (height - length).abs();
            let (normal, radius) = if is_base { (-along, base) } else { (along, apex) };
            // Clockwise as seen from outside, as on disks.
            let clockwise = if is_base { angle } else { 1.0 - angle };
            (normal, DVec2::new(clockwise, out.length() / radius.max(f64::MIN_POSITIVE)))
        } else {
            let normal = (out.normalize_or(x) - along * slope).normalize();
            (normal, DVec2::new(angle, height / length))
        }
    }
}

/// The end planes, as seen from a line.
struct Ends<'a> {
    line: &'a Line,
    ends: [DVec3; 2],
}

impl Ends<'_> {
    /// What of the line is between them.
    fn between(&self) -> Interval {
        let [base, apex, speed] = self.values(|values| values.iter().all(|x: &Bounded| x.is_within(PRECISION)));
        if speed != 0.0 {
            Interval::between(base / speed, apex / speed)
        } else if base <= 0.0 && apex >= 0.0 {
            Interval::ALL
        } else {
            Interval::EMPTY
        }
    }
}

/// The ways to both planes, and the direction, along the axis.
impl Formula<3> for Ends<'_> {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 3] {
        let [base, apex] = self.ends.map(vector::<N>);
        let (origin, axis) = (vector::<N>(self.line.origin), minus(&apex, &base));
        let way = |end: &[N; 3]| dot(&axis, &minus(end, &origin));
        [way(&base), way(&apex), dot(&axis, &vector(self.line.direction))]
    }
}
