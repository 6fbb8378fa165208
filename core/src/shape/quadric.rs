//! Where a line crosses a quadric: the roots of a t^2 + 2 b t + c.
//!
//! With q = -(b + sign(b) sqrt(b^2 - a c)) they are q / a and c / q: no sum cancels (Press, Teukolsky, Vetterling,
//! Flannery 1992, *Numerical Recipes in C*, section 5.6). The discriminant is not taken from the difference b^2 - a c,
//! which loses every digit of a small or far shape: each quadric gives it in a form that cancels at the silhouette only
//! (for the sphere that of Haines, Günther, Akenine-Möller 2019, *Precision improvements for ray/sphere intersection*).
//! And where f64's error bound leaves a doubt of its sign or of the digits of t, it is exact.

use super::line::{Interval, PRECISION};
use crate::math::number::{Bounded, Formula};

/// The coefficients, as a [`Formula`] of five values: a, b, c, e, s with b^2 - a c = s^2 e. The quadric is negative
/// inside.
pub(super) trait Quadric: Formula<5> {
    /// What of the line is inside.
    #[inline]
    fn solve(&self) -> Inside {
        let [a, b, c, e, s] = self.values(is_good);
        if e < 0.0 {
            return Inside::Nothing;
        }
        let root = s.abs() * e.sqrt();
        let q = if b > 0.0 { -(b + root) } else { root - b };
        let roots = if q != 0.0 {
            // Parallel to a cone's side: one of the roots is at infinity, as if a were below 0 by a trifle.
            [c / q, if a == 0.0 { f64::INFINITY.copysign(-q) } else { q / a }]
        } else if a != 0.0 {
            // Both are 0.
            [0.0; 2]
        } else {
            return match c {
                0.0 => Inside::Along,
                c if c < 0.0 => Inside::All,
                _ => Inside::Nothing,
            };
        };
        let roots = Interval::between(roots[0], roots[1]);
        if a > 0.0 { Inside::Between(roots) } else { Inside::Beyond(roots) }
    }
}

impl<T: Formula<5>> Quadric for T {}

/// What of a line is inside a quadric.
#[derive(Clone, Copy, Debug)]
pub(super) enum Inside {
    /// Nothing.
    Nothing,
    /// Nothing, but the line lies in the surface.
    Along,
    /// The line does not cross the surface.
    All,
    /// What is between the roots.
    Between(Interval),
    /// What is before the first root and after the second.
    Beyond(Interval),
}

/// Whether f64 tells how many roots there are, and each to [`PRECISION`].
fn is_good([a, b, c, e, s]: &[Bounded; 5]) -> bool {
    if e.has_sign() && e.value < 0.0 {
        return true;
    }
    let root = s.value.abs() * e.value.sqrt();
    // Half the relative error of the square is that of the root, and to spare.
    let root_error = root * (e.error / e.value + s.error / s.value.abs());
    let q = b.value.abs() + root;
    // False for NaN, where e is 0.
    e.has_sign()
        && Bounded::MARGIN * (b.error + root_error) <= q * PRECISION
        && a.is_within(PRECISION)
        && c.is_within(PRECISION)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::math::expansion::Expansion;
    use crate::math::number::Ring;
    use crate::math::{DVec3, Vec3};
    use crate::ray::Ray;
    use crate::shape::line::Line;

    /// Holds the short form of the discriminant against its definition, in exact arithmetic. `quadric` makes one that
    /// is seen from a line, of points that it may ask for by number.
    #[track_caller]
    pub fn assert_discriminants<Q: Formula<5>>(quadric: impl Fn(Line, &dyn Fn(f32) -> DVec3) -> Q) {
        for i in 0..50 {
            let x = i as f32;
            let v = |k: f32| Vec3::new((x * k).sin(), x + k, (x + k * k).cos());
            let line = Line::new(&Ray::new(v(1.0), v(2.1)), 8.0);
            let [a, b, c, e, s] = quadric(line, &|k| line.place(v(k))).evaluate::<Expansion>();
            let difference = b.mul(&b).sub(&a.mul(&c)).sub(&s.mul(&s).mul(&e));
            assert_eq!(difference.signum(), 0, "{} {}", b.estimate(), e.estimate());
        }
    }
}
