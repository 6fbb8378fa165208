//! Points in an order in which one is near the next.
//!
//! What is asked of a point leads to a few kilobytes of the tree. Asked in the order in which they came, which is often
//! none, most of these are fetched from far; along Morton's curve (1966, *A computer oriented geodetic data base*) the
//! next one finds them where they are. On a mesh of 100,000 triangles distances then take half of the time. Cells are
//! so large that a few points share one, which is as good as the finest order, and keys are counted, which costs less
//! than to compare them.
//!
//! Rays are not sorted: many are in flight together, so that none waits for long, and to sort them costs more than it
//! saves.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;
use twincast::math::{DAabb, DVec3};

use crate::arrays::Rows;

/// So few are not worth sorting.
const FEW: usize = 4096;

/// Bits of a key.
const BITS: u32 = 18;

/// Of an axis.
const AXIS_BITS: u32 = BITS / 3;

/// Each counting takes a mebibyte.
const MAX_COUNTINGS: usize = 8;

/// Numbers in another order.
pub struct Order {
    /// The numbers.
    which: Vec<u32>,
    /// Of each number, where it is.
    places: Vec<u32>,
}

impl Order {
    /// By rising key; by rising number where keys are the same.
    fn by(keys: &[u32]) -> Self {
        let threads = rayon::current_num_threads().min(MAX_COUNTINGS);
        let part = keys.len().div_ceil(threads).max(1);
        let count = |keys: &[u32]| {
            let mut counts = vec![0u32; 1 << BITS];
            keys.iter().for_each(|&key| counts[key as usize] += 1);
            counts
        };
        // Of each part how many there are of each key; then where the next of these goes.
        let mut next: Vec<Vec<u32>> = keys.par_chunks(part).map(count).collect();
        let mut place = 0;
        for key in 0..1 << BITS {
            for next in &mut next {
                place += std::mem::replace(&mut next[key], place);
            }
        }
        // Threads write everywhere between each other.
        let which: Vec<AtomicU32> = std::iter::repeat_with(AtomicU32::default).take(keys.len()).collect();
        let mut places = vec![0; keys.len()];
        let parts = keys.par_chunks(part).zip(places.par_chunks_mut(part)).zip(&mut next).enumerate();
        parts.for_each(|(i, ((keys, places), next))| {
            for ((&key, place), number) in keys.iter().zip(places).zip((i * part) as u32..) {
                *place = next[key as usize];
                next[key as usize] += 1;
                which[*place as usize].store(number, Ordering::Relaxed);
            }
        });
        Self { which: which.into_iter().map(AtomicU32::into_inner).collect(), places }
    }

    /// Where a number is.
    #[inline]
    pub fn place(&self, number: usize) -> usize {
        self.places[number] as usize
    }

    /// Answers that come [`along`] it, in the order of the numbers.
    pub fn undone<T: Copy + Send + Sync>(&self, answers: &[T], chunk: usize) -> Vec<T> {
        self.places.par_iter().with_min_len(chunk).map(|&place| answers[place as usize]).collect()
    }

    /// That of points; none where sorting is not worth it.
    pub fn of_points(rows: &Rows<'_>) -> Option<Self> {
        let count = u32::try_from(rows.len()).ok().filter(|&count| count as usize > FEW)?;
        let finite = |i| Some(rows.at(i as usize)).filter(|p: &DVec3| p.is_finite());
        let bounds = (0..count).into_par_iter().filter_map(finite);
        let bounds = bounds.fold(|| DAabb::EMPTY, DAabb::include).reduce(|| DAabb::EMPTY, DAabb::union);
        let cells = Cells::new(bounds);
        let key = |i| cells.key(rows.at(i));
        let keys: Vec<u32> = (0..count as usize).into_par_iter().with_min_len(FEW / 4).map(key).collect();
        Some(Self::by(&keys))
    }
}

/// Answers to so many questions, as they come in `order`; `ask` gets the numbers of up to `chunk` at a time, and
/// answers that say `none`.
pub fn along<T: Copy + Send + Sync>(
    count: usize,
    order: Option<&Order>,
    chunk: usize,
    none: T,
    ask: impl Fn(&[usize], &mut [T]) + Sync,
) -> Vec<T> {
    let mut answers = vec![none; count];
    let number = |place: usize| order.map_or(place, |order| order.which[place] as usize);
    answers.par_chunks_mut(chunk).enumerate().for_each(|(i, answers)| {
        let which: Vec<usize> = (i * chunk..i * chunk + answers.len()).map(number).collect();
        ask(&which, answers);
    });
    answers
}

/// A box, divided into cells that are numbered along the curve.
struct Cells {
    low: DVec3,
    scale: DVec3,
    /// Of an axis.
    last: f64,
}

impl Cells {
    fn new(bounds: DAabb) -> Self {
        let last = f64::from((1 << AXIS_BITS) - 1);
        Self { low: bounds.min, scale: last / (bounds.max - bounds.min).max(DVec3::splat(f64::MIN_POSITIVE)), last }
    }

    /// The cell of a point; the nearest for one outside, any for one that is NaN.
    fn key(&self, point: DVec3) -> u32 {
        // Casts saturate, and NaN becomes 0.
        let [x, y, z] = ((point - self.low) * self.scale).to_array().map(|x| spread(x.min(self.last) as u32));
        x | y << 1 | z << 2
    }
}

/// Up to ten bits, each followed by two zeros.
fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}
