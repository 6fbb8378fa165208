//! Values over time: keys, and what lies between them (Khronos Group 2021, *glTF 2.0 specification*, appendix C).

use std::array;
use std::collections::HashSet;

use crate::error::Result;
use crate::io::gltf::accessor::View;
use crate::io::gltf::document::Document;
use crate::io::gltf::schema::AnimationSampler;
use crate::math::DQuat;

/// A sampler of an animation.
pub(super) struct Curve<'a> {
    document: &'a Document<'a>,
    times: View<'a>,
    values: View<'a>,
    interpolation: Interpolation,
    place: &'a str,
}

#[derive(Clone, Copy, PartialEq)]
enum Interpolation {
    Step,
    Linear,
    /// Each key has a tangent on its way in, a value, and a tangent on its way out.
    CubicSpline,
}

/// Where a time lies among the keys.
struct Between {
    /// The key before it, or at it.
    key: usize,
    /// How far it is on the way to the next key, from 0 to below 1; 0 where there is no next.
    share: f64,
    /// From that key to the next, seconds.
    length: f64,
}

impl<'a> Curve<'a> {
    /// `kind` is the type of the values, `place` the sampler's pointer; `known_times` has the accessors of times that
    /// are checked.
    pub(super) fn new(
        document: &'a Document<'a>,
        sampler: &AnimationSampler,
        kind: &str,
        place: &'a str,
        known_times: &mut HashSet<usize>,
    ) -> Result<Self> {
        let interpolation = match sampler.interpolation.as_deref() {
            Some("STEP") => Interpolation::Step,
            None | Some("LINEAR") => Interpolation::Linear,
            Some("CUBICSPLINE") => Interpolation::CubicSpline,
            Some(other) => {
                let message = format!("{other:?} is none of LINEAR, STEP, CUBICSPLINE");
                return Err(document.error(format!("{place}/interpolation"), message));
            }
        };
        let times = View::new(document, sampler.input, &["SCALAR"])?;
        let values = View::new(document, sampler.output, &[kind])?;
        if times.count == 0 {
            return Err(document.error(format!("{place}/input"), "no key; a curve needs at least one"));
        }
        if known_times.insert(sampler.input) {
            let mut last = f32::NEG_INFINITY;
            let rises = |key| {
                let [time] = times.floats::<1>(key);
                time.is_finite() && std::mem::replace(&mut last, time) <= time
            };
            if !(0..times.count).all(rises) {
                let message = "the times of the keys have to rise, and to be finite";
                return Err(document.error(format!("{place}/input"), message));
            }
        }
        Ok(Self { document, times, values, interpolation, place })
    }

    /// Three values at a time.
    pub(super) fn vector(&self, time: f64) -> Result<[f64; 3]> {
        self.check(1)?;
        self.value(&self.between(time), 0, 1)
    }

    /// A unit quaternion at a time.
    pub(super) fn rotation(&self, time: f64) -> Result<[f64; 4]> {
        self.check(1)?;
        let between = self.between(time);
        let value = if self.interpolation == Interpolation::Linear && between.share > 0.0 {
            let [from, to] = [0, 1].map(|k| self.part::<4>(between.key + k, 0, 0, 1));
            slerp(from, to, between.share)
        } else {
            self.value(&between, 0, 1)?
        };
        let value = DQuat::from_array(value);
        if !(value.length() > 1e-6 && value.is_finite()) {
            let message = format!("the rotation at time {time} is no unit quaternion");
            return Err(self.document.error(format!("{}/output", self.place), message));
        }
        Ok(value.normalize().to_array())
    }

    /// The weights of all morph targets at a time: as many as there are values for a key.
    pub(super) fn weights(&self, time: f64) -> Result<Vec<f32>> {
        let width = self.values.count / self.times.count / self.parts();
        self.check(width.max(1))?;
        let between = self.between(time);
        (0..width).map(|k| self.value::<1>(&between, k, width).map(|[weight]| weight as f32)).collect()
    }

    /// How many elements a value takes.
    fn parts(&self) -> usize {
        if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }

    /// An error unless there are values of `width` elements for all keys.
    fn check(&self, width: usize) -> Result<()> {
        let (keys, there) = (self.times.count, self.values.count);
        let needed = keys * width * self.parts();
        if there >= needed {
            return Ok(());
        }
        let message = format!("{there} values, where {keys} keys need {needed}");
        Err(self.document.error(format!("{}/output", self.place), message))
    }

    fn between(&self, time: f64) -> Between {
        let at = |key: usize| f64::from(self.times.floats::<1>(key)[0]);
        // The number of keys that are not after the time, by halving.
        let (mut low, mut high) = (0, self.times.count);
        while low < high {
            let middle = low.midpoint(high);
            if at(middle) <= time {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        if low == 0 || low == self.times.count {
            return Between { key: low.saturating_sub(1), share: 0.0, length: 0.0 };
        }
        let (from, to) = (at(low - 1), at(low));
        Between { key: low - 1, share: (time - from) / (to - from), length: to - from }
    }

    /// Element `k` of the `width` that a value has. A finite number whatever the file has, or an error.
    fn value<const N: usize>(&self, between: &Between, k: usize, width: usize) -> Result<[f64; N]> {
        let Between { key, share: t, length } = *between;
        let middle = if self.interpolation == Interpolation::CubicSpline { 1 } else { 0 };
        let from: [f64; N] = self.part(key, middle, k, width);
        let value = if t == 0.0 || self.interpolation == Interpolation::Step {
            from
        } else {
            let to: [f64; N] = self.part(key + 1, middle, k, width);
            match self.interpolation {
                Interpolation::Step | Interpolation::Linear => array::from_fn(|i| from[i] + (to[i] - from[i]) * t),
                Interpolation::CubicSpline => {
                    let (out, into): ([f64; N], [f64; N]) =
                        (self.part(key, 2, k, width), self.part(key + 1, 0, k, width));
                    // Hermite's polynomials.
                    let (t2, t3) = (t * t, t * t * t);
                    let [a, b] = [2.0 * t3 - 3.0 * t2 + 1.0, -2.0 * t3 + 3.0 * t2];
                    let [c, d] = [length * (t3 - 2.0 * t2 + t), length * (t3 - t2)];
                    array::from_fn(|i| a * from[i] + c * out[i] + b * to[i] + d * into[i])
                }
            }
        };
        if value.iter().all(|x| x.is_finite()) {
            return Ok(value);
        }
        Err(self.document.error(format!("{}/output", self.place), "a value that is not finite"))
    }

    fn part<const N: usize>(&self, key: usize, part: usize, k: usize, width: usize) -> [f64; N] {
        self.values.floats((key * self.parts() + part) * width + k).map(f64::from)
    }
}

/// Between two rotations, the shorter way, at an even pace (Shoemake 1985, *Animating rotation with quaternion
/// curves*). By libm, so that it is the same on every system.
fn slerp(from: [f64; 4], to: [f64; 4], t: f64) -> [f64; 4] {
    let dot: f64 = from.iter().zip(&to).map(|(a, b)| a * b).sum();
    let (sign, cosine) = (dot.signum(), dot.abs().min(1.0));
    let angle = libm::acos(cosine);
    // Where the angle is so small that its sine rounds badly, the arc is a line.
    let [a, b] =
        if angle < 1e-4 { [1.0 - t, t] } else { [1.0 - t, t].map(|share| libm::sin(share * angle) / libm::sin(angle)) };
    array::from_fn(|i| a * from[i] + sign * b * to[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_is_even_and_takes_the_shorter_way() {
        // About z: by 0 and by 90 degrees, the second also with the other sign.
        let turn = |degrees: f64| {
            let half = degrees.to_radians() / 2.0;
            [0.0, 0.0, half.sin(), half.cos()]
        };
        for sign in [1.0, -1.0] {
            for t in [0.0, 0.25, 0.5, 1.0] {
                let got = slerp(turn(0.0), turn(90.0).map(|x| x * sign), t);
                let expected = turn(90.0 * t);
                assert!((0..4).all(|i| (got[i] - expected[i]).abs() < 1e-15), "{got:?} {expected:?}");
            }
        }
        assert_eq!(slerp(turn(0.0), turn(0.0), 0.5), turn(0.0));
    }
}
