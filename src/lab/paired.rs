//! Two engines asked as one, every difference judged.
//!
//! [`Paired`] is a [`Tracer`] itself, so whatever traces rays (a renderer, most of all) makes them as it always does:
//! its camera rays, its shadow rays. It passes native's answers on, so that the picture made through it is native's.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

use super::classify::{Answers, Class, classify_closest, classify_named, classify_occluded, starts_on, ulps};
use super::hex;
use crate::ray::{Hit, Ray};
use crate::trace::{Batch, Tracer, World};

/// Rays of each class that are kept for the report.
const KEPT: usize = 3;

/// Asks native and Embree (and brute force, where given) everything, judges, counts, and answers as native does.
pub struct Paired<'a, A: ?Sized, B: ?Sized> {
    world: &'a World,
    native: &'a A,
    embree: &'a B,
    brute: Option<&'a dyn Tracer>,
    judge: fn(&World, &Ray, &Answers) -> Class,
    tally: Tally,
}

impl<'a, A: Tracer + ?Sized, B: Tracer + ?Sized> Paired<'a, A, B> {
    /// Engines that were built from `world`.
    pub fn new(world: &'a World, native: &'a A, embree: &'a B, brute: Option<&'a dyn Tracer>) -> Self {
        Self { world, native, embree, brute, judge: classify_closest, tally: Tally::default() }
    }

    /// The same, of a native tracer whose t are not exact: it is judged by what it names.
    #[must_use]
    pub fn by_name(self) -> Self {
        Self { judge: classify_named, ..self }
    }

    /// What was found so far.
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    fn judge_closest(&self, ray: &Ray, native: Option<Hit>, embree: Option<Hit>) {
        let answers = Answers { native, embree, brute: self.brute.map(|b| b.closest(ray)) };
        let class = (self.judge)(self.world, ray, &answers);
        if let Some((a, b)) = native.zip(embree).filter(|(a, b)| a.id() == b.id()) {
            let steps = ulps(a.t, b.t);
            if steps > self.tally.max_t_ulp() && !starts_on(self.world, ray, &a) {
                self.tally.max_t_ulp.fetch_max(steps, Relaxed);
            }
        }
        self.tally.record(class, ray, || Asked::Closest(answers));
    }

    fn judge_occluded(&self, ray: &Ray, native: bool, embree: bool) {
        let brute = self.brute.map(|b| b.occluded(ray));
        let closest = || Answers {
            native: self.native.closest(ray),
            embree: self.embree.closest(ray),
            brute: self.brute.map(|b| b.closest(ray)),
        };
        let class = classify_occluded(self.world, ray, native, embree, brute, closest);
        self.tally.record(class, ray, || Asked::Occluded { native, embree });
    }
}

impl<A: Tracer + ?Sized, B: Tracer + ?Sized> Tracer for Paired<'_, A, B> {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let native = self.native.closest(ray);
        self.judge_closest(ray, native, self.embree.closest(ray));
        native
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let native = self.native.occluded(ray);
        self.judge_occluded(ray, native, self.embree.occluded(ray));
        native
    }

    fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>], batch: Batch) {
        let mut embree = vec![None; rays.len()];
        self.native.closest_batch(rays, hits, batch);
        self.embree.closest_batch(rays, &mut embree, batch);
        for ((ray, &native), embree) in rays.iter().zip(&*hits).zip(embree) {
            self.judge_closest(ray, native, embree);
        }
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool], batch: Batch) {
        let mut embree = vec![false; rays.len()];
        self.native.occluded_batch(rays, occluded, batch);
        self.embree.occluded_batch(rays, &mut embree, batch);
        for ((ray, &native), embree) in rays.iter().zip(&*occluded).zip(embree) {
            self.judge_occluded(ray, native, embree);
        }
    }
}

/// Counts of judged rays, and some that differ. The same whatever the threads and their order.
#[derive(Debug, Default)]
pub struct Tally {
    counts: [AtomicU64; 5],
    max_t_ulp: AtomicU32,
    /// The first few of each class in the order of the rays' bits: an order that does not depend on time.
    kept: [Mutex<BTreeMap<Key, Difference>>; 5],
}

type Key = [u32; 10];

impl Tally {
    /// Rays of one class.
    pub fn count(&self, class: Class) -> u64 {
        self.counts[class as usize].load(Relaxed)
    }

    /// Rays of all classes.
    pub fn rays(&self) -> u64 {
        Class::ALL.iter().map(|&class| self.count(class)).sum()
    }

    /// The largest distance between the two t of one primitive, in steps of f32. Rays that start on that primitive are
    /// left out: their t is nothing but rounding, and steps near zero are tiny.
    pub fn max_t_ulp(&self) -> u32 {
        self.max_t_ulp.load(Relaxed)
    }

    /// A few of the rays that are not [`Class::Agree`], the worst classes first.
    pub fn differences(&self) -> Vec<Difference> {
        let order = [Class::NativeWrong, Class::EmbreeWrong, Class::Boundary, Class::Tie];
        order.iter().flat_map(|&class| self.lock(class).values().copied().collect::<Vec<_>>()).collect()
    }

    fn record(&self, class: Class, ray: &Ray, asked: impl FnOnce() -> Asked) {
        self.counts[class as usize].fetch_add(1, Relaxed);
        if class == Class::Agree {
            return;
        }
        let asked = asked();
        let mut key: Key = [0; 10];
        key[0] = u32::from(matches!(asked, Asked::Occluded { .. }));
        let [o, d] = [ray.origin, ray.direction].map(|v| v.to_array());
        let floats = [o[0], o[1], o[2], d[0], d[1], d[2], ray.tmin, ray.tmax, ray.time];
        key[1..].copy_from_slice(&floats.map(f32::to_bits));
        let mut kept = self.lock(class);
        kept.insert(key, Difference { class, ray: *ray, asked });
        if kept.len() > KEPT {
            kept.pop_last();
        }
    }

    fn lock(&self, class: Class) -> std::sync::MutexGuard<'_, BTreeMap<Key, Difference>> {
        // A thread that panicked with the lock left a whole map behind.
        self.kept[class as usize].lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

/// What was asked, and what was answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Asked {
    /// The nearest hit.
    Closest(Answers),
    /// Any hit.
    Occluded {
        /// By the native engine.
        native: bool,
        /// By Embree.
        embree: bool,
    },
}

/// A ray on which the engines differ. Its `Display` is what it was judged to be, what was answered, and the ray as
/// `twincast trace --ray` takes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// What it was judged to be.
    pub class: Class,
    /// The ray.
    pub ray: Ray,
    /// The answers.
    pub asked: Asked,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.class.name())?;
        let answer = |hit: Option<Hit>| match hit {
            Some(Hit { t, primitive, geometry, instance, .. }) => format!("{instance}/{geometry}/{primitive} at {t:?}"),
            None => "miss".to_owned(),
        };
        match self.asked {
            Asked::Closest(Answers { native, embree, brute }) => {
                write!(f, "native {}, embree {}", answer(native), answer(embree))?;
                if let Some(brute) = brute {
                    write!(f, ", brute {}", answer(brute))?;
                }
            }
            Asked::Occluded { native, embree } => {
                let word = |occluded| if occluded { "occluded" } else { "free" };
                write!(f, "native {}, embree {}", word(native), word(embree))?;
            }
        }
        write!(f, "; --ray {}", hex::ray_to_hex(&self.ray))
    }
}
