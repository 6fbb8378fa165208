//! What is given at time steps.

use std::ops::Deref;

use smallvec::SmallVec;

/// One a time step, of which there is mostly one alone.
pub type PerStep<T> = SmallVec<[T; 1]>;

/// What is there at equally distant times of a range, of which the first and the last are its ends; at least one. What
/// has one alone stands still, and is there at all times.
#[derive(Clone, Debug)]
pub struct TimeSteps<T> {
    steps: PerStep<T>,
    range: (f32, f32),
}

impl<T> TimeSteps<T> {
    pub fn new(steps: PerStep<T>, range: (f32, f32)) -> Self {
        Self { steps, range }
    }

    /// From when to when it moves.
    pub fn range(&self) -> (f32, f32) {
        self.range
    }

    /// Whether it stands still.
    pub fn is_still(&self) -> bool {
        self.len() == 1
    }

    /// Whether it is there at a time at all. At the end of its range what follows on it is, unless that is the end of
    /// all time, 1.
    #[inline]
    pub fn is_at(&self, time: f32) -> bool {
        let (begin, end) = self.range;
        self.is_still() || (begin..end).contains(&time) || time == end && (end >= 1.0 || begin == end)
    }

    /// The steps around a time, as [`around`] has them.
    pub fn around(&self, time: f32) -> (&T, Option<(&T, f32)>) {
        around(self, self.range, time)
    }
}

impl<T> Deref for TimeSteps<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.steps
    }
}

/// The step before a time, and, of what moves, the next one and how far it is to that; outside of the range those at
/// that end.
#[inline]
pub fn around<T>(steps: &[T], (begin, end): (f32, f32), time: f32) -> (&T, Option<(&T, f32)>) {
    if let [only] = steps {
        return (only, None);
    }
    let segments = (steps.len() - 1) as f32;
    let at = ((time - begin) / (end - begin) * segments).clamp(0.0, segments);
    // NaN becomes 0.
    let step = (at.floor() as usize).min(steps.len() - 2);
    let fraction = if at.is_nan() { 0.0 } else { at - step as f32 };
    (&steps[step], Some((&steps[step + 1], fraction)))
}
