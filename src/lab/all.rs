//! Every accelerator on the same rays, held against brute force.
//!
//! Rays are those of a picture, one through the middle of each pixel, and difficult ones, in random order, so that any
//! number of them from the start is a fair sample of all. Brute force goes first and answers as many as it can within a
//! time; the others are asked the same. To hold them against each other on all rays instead would compare trees that
//! are built of the same parts.
//!
//! A native accelerator must give the hits of brute force to the bit, so whatever differs is wrong; with a textbook's
//! methods, whose t are f32's, it must name the same primitives. Embree is judged as [`compare`](super::compare) judges
//! it.

use std::fmt;
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::Serialize;

use super::classify::{Answers, Class, classify_closest, classify_occluded};
use super::entrants::Entrant;
use super::rays::{Aim, Query};
use crate::error::{Error, Result};
use crate::math::Random;
use crate::memory::{self, process};
use crate::ray::{Hit, Ray};
use crate::render::{Control, Renderer};
use crate::trace::accel::Options;
use crate::trace::{Tracer, World};

/// Rays that are asked together.
const CHUNK: usize = 256;

/// What is compared.
pub struct Setup<'a> {
    /// The scene's name in the report.
    pub scene: &'a str,
    /// Makes the camera rays, of the world that everything is built from.
    pub renderer: &'a Renderer<'a>,
    /// Pixels of its picture.
    pub size: (u32, u32),
    /// How many difficult rays.
    pub random: u64,
    /// Chooses them.
    pub seed: u64,
    /// How long brute force may take.
    pub longest: Duration,
    /// For the accelerators.
    pub options: &'a Options,
}

/// What came of it. Serialises as the document of `compare --all --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Name of the scene.
    pub scene: String,
    /// Primitives as placed.
    pub primitives: u64,
    /// Rays that there are.
    pub rays: u64,
    /// Rays that brute force had time for, on which all are compared.
    pub compared: u64,
    /// One for each accelerator, brute force first.
    pub rows: Vec<Row>,
}

/// One accelerator's figures.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The accelerator.
    pub name: &'static str,
    /// Seconds.
    pub build_seconds: f64,
    /// Memory it holds.
    pub bytes: usize,
    /// Millions of the compared rays a second, on all threads.
    pub mrays_per_s: f64,
    /// Rays on which the answer is not that of brute force: for native accelerators to the bit, for Embree and
    /// textbooks' methods the primitive.
    pub differing: u64,
    /// Of those, [`Class::Tie`].
    pub tie: u64,
    /// [`Class::Boundary`].
    pub boundary: u64,
    /// [`Class::NativeWrong`]: any difference of a native accelerator, and of Embree where brute force is at fault.
    pub native_wrong: u64,
    /// [`Class::EmbreeWrong`].
    pub embree_wrong: u64,
    /// What there is to say about how it was built.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// The first ray that shows a native accelerator to be wrong.
    #[serde(skip)]
    pub example: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Answer {
    Closest(Option<Hit>),
    Occluded(bool),
}

fn ask(tracer: &dyn Tracer, query: &Query) -> Answer {
    match query {
        Query::Closest(ray) => Answer::Closest(tracer.closest(ray)),
        Query::Occluded(ray) => Answer::Occluded(tracer.occluded(ray)),
    }
}

/// Asks as many as there is time for, in chunks on all threads; the answers to the first so many.
fn ask_within(tracer: &dyn Tracer, queries: &[Query], longest: Duration) -> Vec<Answer> {
    let start = Instant::now();
    let mut answers = Vec::with_capacity(queries.len());
    for queries in queries.chunks(CHUNK * rayon::current_num_threads()) {
        answers.par_extend(queries.par_iter().with_min_len(CHUNK / 8).map(|query| ask(tracer, query)));
        if start.elapsed() > longest {
            break;
        }
    }
    answers
}

impl Setup<'_> {
    /// Builds and asks one after the other.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once `control.cancel` is set, [`Error::Memory`] for more rays than there is room for, and
    /// those of Embree.
    pub fn run(&self, control: Control<'_>) -> Result<Report> {
        let world = self.renderer.world();
        let queries = self.queries()?;
        let mut expected: Vec<Answer> = Vec::new();
        let mut rows = Vec::new();
        for entrant in Entrant::all() {
            control.check()?;
            let is_exact = entrant.is_exact(self.options);
            let start = Instant::now();
            let built = entrant.build(world, self.options)?;
            let build_seconds = start.elapsed().as_secs_f64();
            let start = Instant::now();
            let answers = if rows.is_empty() {
                ask_within(&*built.tracer, &queries, self.longest)
            } else {
                ask_within(&*built.tracer, &queries[..expected.len()], Duration::MAX)
            };
            let mrays_per_s = answers.len() as f64 / start.elapsed().as_secs_f64().max(1e-9) / 1e6;
            if rows.is_empty() {
                expected.clone_from(&answers);
            }
            let mut row = Row {
                name: entrant.name(),
                build_seconds,
                bytes: built.bytes,
                mrays_per_s,
                differing: 0,
                tie: 0,
                boundary: 0,
                native_wrong: 0,
                embree_wrong: 0,
                notes: built.notes.clone(),
                example: None,
            };
            for ((query, expected), found) in queries.iter().zip(&expected).zip(&answers) {
                row.judge(world, (entrant, is_exact), &*built.tracer, query, *expected, *found);
            }
            rows.push(row);
            if let Some(on_tile) = control.on_tile {
                on_tile(1);
            }
        }
        Ok(Report {
            scene: self.scene.to_owned(),
            primitives: world.primitive_count(),
            rays: queries.len() as u64,
            compared: expected.len() as u64,
            rows,
        })
    }

    /// All rays, in random order.
    fn queries(&self) -> Result<Vec<Query>> {
        let (width, height) = self.size;
        let rays = u64::from(width) * u64::from(height) + self.random.min(u64::MAX / 2);
        // Each has an answer of each of two tracers beside it.
        let bytes = rays.saturating_mul((size_of::<Query>() + 2 * size_of::<Answer>()) as u64);
        if let Some(free) = process::available().filter(|&free| bytes > free) {
            let [bytes, free] = [bytes, free].map(memory::in_words);
            return Err(Error::Memory(format!(
                "{rays} rays take {bytes}, and {free} are free; take fewer random ones, or a smaller picture"
            )));
        }
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let mut queries = Vec::with_capacity(rays as usize);
        queries.extend(pixels.map(|(x, y)| Query::Closest(self.renderer.camera_ray(x, y, 0))));
        if let Some(aim) = Aim::new(self.renderer.world()) {
            queries.extend((0..self.random).map(|index| aim.ray(self.seed, index)));
        }
        let mut random = Random::new(self.seed, u64::MAX);
        for i in (1..queries.len()).rev() {
            queries.swap(i, random.below(i as u64 + 1) as usize);
        }
        Ok(queries)
    }
}

impl Row {
    fn judge(
        &mut self,
        world: &World,
        (entrant, is_exact): (Entrant, bool),
        tracer: &dyn Tracer,
        query: &Query,
        expected: Answer,
        found: Answer,
    ) {
        if expected == found {
            return;
        }
        let class = match (query, expected, found) {
            (_, Answer::Closest(Some(a)), Answer::Closest(Some(b))) if !is_exact && a.id() == b.id() => Class::Agree,
            _ if entrant.is_native() => Class::NativeWrong,
            (Query::Closest(ray), Answer::Closest(native), Answer::Closest(embree)) => {
                classify_closest(world, ray, &Answers { native, embree, brute: None })
            }
            (Query::Occluded(ray), Answer::Occluded(native), Answer::Occluded(embree)) => {
                // Where what the entrant names explains neither answer, every primitive is asked.
                let closest = || Answers { native: None, embree: tracer.closest(ray), brute: None };
                classify_occluded(world, ray, native, embree, None, closest)
            }
            _ => unreachable!("an answer is of the kind of its question"),
        };
        self.differing += u64::from(class != Class::Agree);
        match class {
            Class::Agree => {}
            Class::Tie => self.tie += 1,
            Class::Boundary => self.boundary += 1,
            Class::NativeWrong => self.native_wrong += 1,
            Class::EmbreeWrong => self.embree_wrong += 1,
        }
        if class == Class::NativeWrong && self.example.is_none() {
            let (Query::Closest(ray) | Query::Occluded(ray)) = query;
            self.example =
                Some(format!("{expected:?} by brute force, {found:?} by {}, for {}", self.name, exactly(ray)));
        }
    }
}

/// A ray as Rust that makes it again, to the bit: Rust prints floats so that they are read back the same.
fn exactly(ray: &Ray) -> String {
    let Ray { origin: o, direction: d, tmin, tmax, time } = ray;
    let vector = |v: &crate::math::Vec3| format!("Vec3::new({:?}, {:?}, {:?})", v.x, v.y, v.z);
    let (o, d) = (vector(o), vector(d));
    format!("Ray {{ origin: {o}, direction: {d}, tmin: {tmin:?}, tmax: {tmax:?}, time: {time:?} }}")
}

impl Report {
    /// # Errors
    /// [`Error::Check`] where a native accelerator is wrong.
    pub fn check(&self) -> Result<()> {
        let wrong = self.rows.iter().filter(|row| row.native_wrong > 0);
        let faults: Vec<String> = wrong
            .map(|row| {
                let example = row.example.as_deref().unwrap_or_default();
                format!("{} is wrong on {} of {} rays; the first: {example}", row.name, row.native_wrong, self.compared)
            })
            .collect();
        if faults.is_empty() { Ok(()) } else { Err(Error::Check(format!("{}: {}", self.scene, faults.join("; ")))) }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, primitives, rays, compared, rows } = self;
        writeln!(f, "{scene}: {primitives} primitives")?;
        match compared {
            all if all == rays => writeln!(f, "all {rays} rays compared with brute force")?,
            some => writeln!(f, "{some} of {rays} rays compared with brute force: a random sample, as it takes long")?,
        }
        writeln!(
            f,
            "\n  {:<12}{:>10}{:>9}{:>10}{:>11}{:>6}{:>10}{:>14}{:>14}",
            "", "build, ms", "MB", "Mray/s", "differing", "tie", "boundary", "native_wrong", "embree_wrong"
        )?;
        for row in rows {
            let Row { name, build_seconds, bytes, mrays_per_s, differing, .. } = row;
            write!(f, "  {name:<12}{:>10.1}{:>9.1}{mrays_per_s:>10.3}", build_seconds * 1e3, *bytes as f64 / 1e6)?;
            writeln!(
                f,
                "{differing:>11}{:>6}{:>10}{:>14}{:>14}",
                row.tie, row.boundary, row.native_wrong, row.embree_wrong
            )?;
        }
        for row in rows {
            for note in &row.notes {
                writeln!(f, "  {}: {note}", row.name)?;
            }
        }
        Ok(())
    }
}
