//! The measurement: build in turn, compare, trace in turn.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use rayon::prelude::*;

use super::answers::{Answers, CHUNK, Room};
use super::machine::processor;
use super::pixel_loop::PixelLoop;
use super::rays::{Kind, RaySet};
use super::report::{BuildRow, Ratio, Report, Spread, TraversalRow, Verdict};
use super::subject::Subject;
use crate::error::{Error, Result};
use crate::lab::{Class, Paired};
use crate::render::Control;
use crate::trace::{Tracer, Width, World};

/// The widths that are measured.
pub const WIDTHS: [Width; 3] = [Width::One, Width::Eight, Width::Sixteen];

/// As long as all builds together have not taken so many seconds they are repeated: a single one of a small mesh takes
/// less than a millisecond, and says nothing.
const BUILDING: f64 = 0.25;

/// But no more often than this, if not asked to.
const MAX_BUILDS: usize = 41;

/// An engine in one of its modes.
pub struct Contender {
    /// `native` or `embree`.
    pub backend: &'static str,
    /// As it is set up: `default`, `fast`, `robust` ...
    pub mode: &'static str,
    /// Whether its answers must be right, and equal to the bit to those of every other exact one. So it is for native
    /// engines, unless they use a textbook's method.
    pub is_exact: bool,
    /// Builds it, on rayon's current pool or as many threads.
    pub build: Box<Build>,
}

/// Builds an engine for a world.
pub type Build = dyn Fn(&World) -> Result<Built> + Send + Sync;

/// A built engine of any kind.
pub type AnyTracer = Box<dyn Tracer + Send>;

/// A built engine.
pub struct Built {
    /// The engine.
    pub tracer: AnyTracer,
    /// Seconds from triangles in memory to a finished tree.
    pub seconds: f64,
    /// Bytes of the tree, without the mesh.
    pub bytes: usize,
    /// The surface area heuristic's cost of the tree, where it is known: see
    /// [`Bvh::sah_cost`](crate::trace::bvh::Bvh::sah_cost).
    pub sah_cost: Option<f64>,
}

/// What is measured, and how often.
pub struct Setup<'a> {
    /// The scene.
    pub subject: &'a Subject,
    /// The engines; the first exact one answers for the rays that start on surfaces.
    pub contenders: &'a [Contender],
    /// Kinds of rays, each once.
    pub kinds: &'a [Kind],
    /// Camera rays to a side: [`SIDE`](super::SIDE), or fewer to be quick.
    pub side: usize,
    /// Threads that build and trace, at least 1.
    pub threads: usize,
    /// Instructions that engines may use at most, as in reports.
    pub isa: &'static str,
    /// How often everything is measured, at least 1; builds that take no time more often.
    pub repeat: usize,
    /// Stops the measurement once set.
    pub cancel: Option<&'a AtomicBool>,
    /// Called after each of [`Setup::steps`].
    pub on_step: Option<&'a (dyn Fn() + Sync)>,
}

impl Setup<'_> {
    /// How many steps a run has: builds, comparisons and passes over the rays.
    pub fn steps(&self) -> u64 {
        let passes = self.kinds.len() * WIDTHS.len() * (self.repeat + 1);
        (self.contenders.len() * (self.repeat + passes)) as u64
    }

    /// Measures.
    ///
    /// # Errors
    /// [`Error::Check`] where native is wrong on a ray, or its answers depend on mode, width or turn;
    /// [`Error::Interrupted`] once `cancel` is set; those of the engines' builds.
    pub fn run(&self) -> Result<Report> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build();
        let pool = pool.map_err(|error| Error::Usage(format!("{} threads: {error}", self.threads)))?;
        pool.install(|| {
            let (tracers, builds) = self.build()?;
            let exact = self.contenders.iter().position(|contender| contender.is_exact);
            let Some(first) = exact.or(self.contenders.first().map(|_| 0)) else {
                return Err(Error::Usage("no engine to measure".to_owned()));
            };
            let pixels = PixelLoop::new(self.subject, self.side)?;
            let prepared = self.subject.view.rays(&self.subject.world, &*tracers[first], self.kinds, self.side);
            let mut prepared = prepared.into_iter();
            let (mut traversal, mut answers) = (Vec::new(), Vec::new());
            for &kind in self.kinds {
                let of_pixels = || RaySet { kind, rays: pixels.rays() };
                let set = if kind == Kind::Pixel { Some(of_pixels()) } else { prepared.next() };
                let Some(set) = set else { continue };
                let (hits, verdict) = self.compare(&set, &tracers, first)?;
                answers.extend(verdict);
                traversal.extend(self.trace(&set, &pixels, &tracers, &hits)?);
            }
            Ok(Report {
                scene: self.subject.name.clone(),
                triangles: self.subject.world.primitive_count(),
                threads: self.threads,
                processor: processor(),
                isa: self.isa,
                size: self.side,
                repeat: self.repeat,
                builds,
                ratios: self.kinds.iter().map(|&kind| Ratio::new(kind, &traversal)).collect(),
                traversal,
                answers,
            })
        })
    }

    /// Builds every engine in turn, `repeat` times and more, and keeps the last of each.
    fn build(&self) -> Result<(Vec<AnyTracer>, Vec<BuildRow>)> {
        let mut built: Vec<Option<Built>> = self.contenders.iter().map(|_| None).collect();
        let mut rates = vec![Vec::new(); built.len()];
        let triangles = self.subject.world.stored_triangles() as f64;
        let mut seconds = 0.0;
        for turn in 0..self.repeat.max(MAX_BUILDS) {
            if turn >= self.repeat && seconds >= BUILDING {
                break;
            }
            for ((contender, slot), rates) in self.contenders.iter().zip(&mut built).zip(&mut rates) {
                // Its memory goes before the next one takes its own.
                *slot = None;
                let new = (contender.build)(&self.subject.world)?;
                rates.push(triangles / new.seconds.max(1e-9) / 1e6);
                seconds += new.seconds;
                *slot = Some(new);
                if turn < self.repeat {
                    self.step()?;
                }
            }
        }
        let rows = self.contenders.iter().zip(&built).zip(&rates).map(|((contender, built), rates)| BuildRow {
            backend: contender.backend,
            mode: contender.mode,
            mtris_per_s: Spread::of(rates),
            sah_cost: built.as_ref().and_then(|b| b.sah_cost),
            bytes_per_triangle: built.as_ref().map_or(0.0, |b| b.bytes as f64) / triangles.max(1.0),
        });
        let rows = rows.collect();
        Ok((built.into_iter().flatten().map(|b| b.tracer).collect(), rows))
    }

    /// Has every engine answer once at every width. Exact answers must all be the same to the bit, and right
    /// wherever Embree's differ. Gives the hits by contender and width.
    fn compare(
        &self,
        set: &RaySet,
        tracers: &[AnyTracer],
        first: usize,
    ) -> Result<(Vec<[u64; WIDTHS.len()]>, Option<Verdict>)> {
        let name = &self.subject.name;
        let reference = Answers::of(set, &*tracers[first], set.kind.batch(Width::One));
        let mut counts = vec![[0; WIDTHS.len()]; tracers.len()];
        for ((contender, tracer), counts) in self.contenders.iter().zip(tracers).zip(&mut counts) {
            for (width, count) in WIDTHS.into_iter().zip(counts) {
                let answers = Answers::of(set, &**tracer, set.kind.batch(width));
                *count = answers.hits();
                if contender.is_exact && answers != reference {
                    let (mode, kind, width) = (contender.mode, set.kind.name(), width.rays());
                    return Err(Error::Check(format!(
                        "{name}: native {mode} answers differently at width {width} on {kind} rays"
                    )));
                }
                self.step()?;
            }
        }
        if !self.contenders[first].is_exact {
            return Ok((counts, None));
        }
        let Some(embree) = self.position("embree", Some("robust")).or(self.position("embree", None)) else {
            return Ok((counts, None));
        };
        let paired = Paired::new(&self.subject.world, &*tracers[first], &*tracers[embree], None);
        _ = Answers::of(set, &paired, set.kind.batch(Width::One));
        let tally = paired.tally();
        let wrong = tally.count(Class::NativeWrong);
        if wrong > 0 {
            let (rays, kind) = (set.rays.len(), set.kind.name());
            let example = tally.differences().first().map(ToString::to_string).unwrap_or_default();
            return Err(Error::Check(format!(
                "{name}: the native engine is wrong on {wrong} of {rays} {kind} rays; for example\n{example}"
            )));
        }
        Ok((counts, Some(Verdict::new(set.kind, tally))))
    }

    /// Times every engine at every width, in turn, `repeat` times.
    fn trace(
        &self,
        set: &RaySet,
        pixels: &PixelLoop<'_>,
        tracers: &[AnyTracer],
        hits: &[[u64; WIDTHS.len()]],
    ) -> Result<Vec<TraversalRow>> {
        let mut turns = vec![[const { Vec::new() }; WIDTHS.len()]; tracers.len()];
        for turn in 0..self.repeat {
            for (w, width) in WIDTHS.into_iter().enumerate() {
                for k in 0..tracers.len() {
                    // There and back, so that nobody is always the first.
                    let i = if turn % 2 == 0 { k } else { tracers.len() - 1 - k };
                    let start = Instant::now();
                    let count = if set.kind == Kind::Pixel {
                        pixels.pass(&*tracers[i], width)
                    } else {
                        self.pass(set, &*tracers[i], width)
                    };
                    turns[i][w].push(set.rays.len() as f64 / start.elapsed().as_secs_f64().max(1e-9) / 1e6);
                    if count != hits[i][w] {
                        let Contender { backend, mode, .. } = self.contenders[i];
                        let (name, kind, before) = (&self.subject.name, set.kind.name(), hits[i][w]);
                        return Err(Error::Check(format!(
                            "{name}: {backend} {mode} hit {count} times with {kind} rays, where it hit {before} before"
                        )));
                    }
                    self.step()?;
                }
            }
        }
        let rows = self.contenders.iter().zip(turns).zip(hits).flat_map(|((contender, turns), hits)| {
            WIDTHS.into_iter().zip(turns).zip(hits).map(|((width, turns), &hits)| TraversalRow {
                backend: contender.backend,
                mode: contender.mode,
                width: width.rays(),
                kind: set.kind,
                mrays_per_s: Spread::of(&turns),
                rays: set.rays.len() as u64,
                hits,
                turns,
            })
        });
        Ok(rows.collect())
    }

    /// Traces prepared rays and counts the hits.
    fn pass(&self, set: &RaySet, tracer: &dyn Tracer, width: Width) -> u64 {
        let batch = set.kind.batch(width);
        if self.threads == 1 {
            let mut room = Room::new();
            return set.rays.chunks(CHUNK).map(|rays| room.chunk(set.kind, rays, tracer, batch)).sum();
        }
        let chunks = set.rays.par_chunks(CHUNK);
        chunks.map_init(Room::new, |room, rays| room.chunk(set.kind, rays, tracer, batch)).sum()
    }

    fn position(&self, backend: &str, mode: Option<&str>) -> Option<usize> {
        self.contenders.iter().position(|c| c.backend == backend && mode.is_none_or(|mode| c.mode == mode))
    }

    fn step(&self) -> Result<()> {
        if let Some(on_step) = self.on_step {
            on_step();
        }
        Control::stopping(self.cancel).check()
    }
}
