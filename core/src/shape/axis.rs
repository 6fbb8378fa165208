//! What a cylinder and a cone share: an axis, an end plane at each end of it, and what lies between.
//!
//! Capped, they are convex: the line is inside where it is inside the lateral surface and between the end planes, and
//! hits where it enters and leaves, if it enters one before it leaves the other. Open, they are hit at the lateral
//! surface's roots, where those are between the end planes. Both are decided exactly. Testing the side and two disks by
//! themselves, the simpler way, loses rays between them.

use std::cmp::Ordering;

use super::line::{Interval, Line, NO_ROOTS, PRECISION, Roots};
use super::quadric::{Inside, Quadric};
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

    /// The crossings of a line; `surface` is the lateral one. `widens`: whether the line goes towards
    /// larger radii, on the side of the apex where the surface is.
    pub fn roots(&self, line: &Line, surface: &impl Quadric, widens: bool) -> Roots {
        let inside = surface.solve();
        let within = match inside {
            Inside::Nothing => return NO_ROOTS,
            // What lies in the side of a solid enters and leaves it by the ends.
            Inside::All | Inside::Along if self.capped => Interval::ALL,
            Inside::All | Inside::Along => return NO_ROOTS,
            Inside::Between(roots) => roots,
            // A double cone: the half on this side.
            Inside::Beyond(roots) if widens => Interval { enter: roots.exit, ..Interval::ALL },
            Inside::Beyond(roots) => Interval { exit: roots.enter, ..Interval::ALL },
        };
        let ends = Ends { line, ends: self.ends.map(|end| line.place(end)) };
        let between = ends.between();
        let rims = Rims { surface, ends, between, is_beyond: matches!(inside, Inside::Beyond(_)) };
        let roots = if !self.capped {
            let side = |t: f64, crossing| (t.is_finite() && rims.hold(t, crossing)).then_some(t);
            let [first, second] = [side(within.enter, Crossing::Enter), side(within.exit, Crossing::Exit)];
            if first.is_some() { [first, second] } else { [second, None] }
        } else if rims.meet(within) {
            let Interval { enter, exit } = within.and(between);
            // Where they are equal but for rounding, they may be rounded to the wrong order.
            [Some(enter), Some(exit.max(enter))]
        } else {
            NO_ROOTS
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

/// Where a line crosses a boundary.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Crossing {
    Enter,
    Exit,
}

/// A lateral surface and its end planes. On a rim two t meet, each of them rounded: there their order is that of exact
/// arithmetic, by the signs that the surface's polynomial and its slope have where the line meets the end plane.
struct Rims<'a, Q> {
    surface: &'a Q,
    ends: Ends<'a>,
    between: Interval,
    /// Whether the line is inside before the first crossing and after the second, and not between them.
    is_beyond: bool,
}

impl<Q: Quadric> Rims<'_, Q> {
    /// What two t that are one may differ by, relative to the larger, each being off by 2^-26 of itself; and as much
    /// again.
    const DOUBT: f64 = 1.0 / (1 << 24) as f64;

    /// Whether a crossing, which is at about t, is between the planes, or on one of them.
    fn hold(&self, t: f64, crossing: Crossing) -> bool {
        self.order(Crossing::Enter, t, crossing).is_le() && self.order(Crossing::Exit, t, crossing).is_ge()
    }

    /// Whether some of the line is inside the surface, which is `within`, and between the planes, or on them.
    fn meet(&self, within: Interval) -> bool {
        self.order(Crossing::Exit, within.enter, Crossing::Enter).is_ge()
            && self.order(Crossing::Enter, within.exit, Crossing::Exit).is_le()
    }

    /// Where the line comes between the planes, or leaves, beside a crossing of the surface that is at about t.
    fn order(&self, end: Crossing, t: f64, crossing: Crossing) -> Ordering {
        let at = match end {
            Crossing::Enter => self.between.enter,
            Crossing::Exit => self.between.exit,
        };
        let in_doubt = at.is_finite() && t.is_finite() && (t - at).abs() <= Self::DOUBT * t.abs().max(at.abs());
        if !in_doubt {
            return at.total_cmp(&t);
        }
        let [_, _, speed] = self.ends.signs();
        self.compare(usize::from((speed > 0) == (end == Crossing::Exit)), crossing)
    }

    /// Where the line meets an end plane, beside a crossing.
    fn compare(&self, end: usize, crossing: Crossing) -> Ordering {
        let is_first = (crossing == Crossing::Enter) != self.is_beyond;
        let signs = AtEnd { rims: self, end }.signs();
        match if self.is_beyond { signs.map(|sign| -sign) } else { signs } {
            [-1, _] if is_first => Ordering::Greater,
            [-1, _] => Ordering::Less,
            // On the surface: at the crossing that has this slope, or where both are one.
            [0, 1] if is_first => Ordering::Greater,
            [0, -1] if !is_first => Ordering::Less,
            [0, _] => Ordering::Equal,
            // Before both, or after both.
            [_, slope] => slope.cmp(&0),
        }
    }
}

/// The surface's polynomial and half its slope where the line meets an end plane, at t = n / s, times s^2: a n^2 + 2 b
/// n s + c s^2, and s (a n + b s). Where the line is inside beyond the crossings, a is below 0, or 0, when one of them
/// is at infinity; then the signs are turned round, for the first to be below 0 between the crossings.
struct AtEnd<'a, Q> {
    rims: &'a Rims<'a, Q>,
    end: usize,
}

impl<Q: Quadric> Formula<2> for AtEnd<'_, Q> {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 2] {
        let Rims { surface, ends, .. } = self.rims;
        let [a, b, c, ..] = surface.evaluate::<N>();
        let [base, apex, s] = ends.evaluate::<N>();
        let n = if self.end == 0 { base } else { apex };
        let (slope, rest) = (a.mul(&n).add(&b.mul(&s)), b.mul(&n).add(&c.mul(&s)));
        [slope.mul(&n).add(&rest.mul(&s)), slope.mul(&s)]
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
