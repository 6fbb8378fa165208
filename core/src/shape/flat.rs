//! Where a line meets a plane: t = n . (p - o) / n . d, a quotient that is exact where f64 does not give its digits.

use super::line::{Line, quotient};
use crate::math::number::{Formula, Number, dot, minus, vector};
use crate::math::{DVec3, Vec3};

/// A plane in the units of a line.
pub(super) struct Flat {
    pub line: Line,
    /// A point of it.
    pub point: DVec3,
    /// Of any length but 0.
    pub normal: DVec3,
}

impl Flat {
    pub fn new(line: Line, point: Vec3, normal: Vec3) -> Self {
        Self { line, point: line.place(point), normal: normal.as_dvec3() }
    }

    /// The ray's t; None for a line that is parallel to the plane, or lies in it.
    pub fn t(&self) -> Option<f64> {
        quotient(self).map(|t| self.line.t(t))
    }
}

impl Formula<2> for Flat {
    #[inline(always)]
    fn evaluate<N: Number>(&self) -> [N; 2] {
        let n = vector::<N>(self.normal);
        let to_point = minus(&vector(self.point), &vector(self.line.origin));
        [dot(&n, &to_point), dot(&n, &vector(self.line.direction))]
    }
}
