//! A random search for rays on which a tracer and exact arithmetic differ.
//!
//! A few triangles, perhaps a sphere, and a handful of rays at their edges are changed again and again: by a step of
//! f32, a power of two, a zero, a coordinate copied from elsewhere. A change stays if the textbooks' methods, which are
//! cheap to ask and fail where the numbers are hard, fail on no fewer rays than before. So the search climbs towards
//! the edge of f32, and the subjects are asked there. Without the climb, uniform rays find next to nothing.

use std::time::{Duration, Instant};

use super::run::answers;
use super::verdict::{Fault, Gate, Tally};
use super::{Column, Probe, file, loose};
use crate::error::Result;
use crate::lab::oracle::{self, Primitive};
use crate::lab::tree::{Exact, Oracle};
use crate::math::{DVec3, Random, Vec3};
use crate::ray::Ray;
use crate::render::Control;
use crate::shape::{Shape, Sphere, TriangleMethod};
use crate::trace::World;

/// Rays of a candidate.
const RAYS: usize = 32;
/// Changes that may come to nothing before a new start.
const PATIENCE: u32 = 60;

/// What is looked for.
pub struct Search {
    /// Who is asked.
    pub columns: Vec<Column>,
    /// How long; none for no limit but `most`.
    pub time: Option<Duration>,
    /// Rays after which it ends.
    pub most: u64,
    /// Found cases after which it ends.
    pub enough: usize,
    /// Where it starts.
    pub seed: u64,
}

/// A ray that a column fails on.
#[derive(Clone, Debug)]
pub struct Found {
    /// Who fails.
    pub column: Column,
    /// Its name, and its form.
    pub who: String,
    /// What is wrong.
    pub fault: Fault,
    /// The case as a file.
    pub text: String,
}

/// Something to be changed.
#[derive(Clone)]
struct Candidate {
    corners: Vec<[Vec3; 3]>,
    sphere: Option<Sphere>,
    rays: Vec<Ray>,
}

impl Search {
    /// Looks; the number of rays that were asked, and what was found.
    ///
    /// # Errors
    /// Those of Embree.
    pub fn run(&self, control: Control<'_>) -> Result<(u64, Vec<Found>)> {
        let start = Instant::now();
        let mut random = Random::new(self.seed, 2);
        let (mut asked, mut found) = (0, Vec::new());
        let (mut best, mut score, mut tried) = (Candidate::new(&mut random), 0, 0);
        let is_over = |asked: u64, found: &[Found]| {
            asked >= self.most
                || found.len() >= self.enough
                || self.time.is_some_and(|time| start.elapsed() >= time)
                || control.is_cancelled()
        };
        while !is_over(asked, &found) {
            let candidate = best.changed(&mut random);
            tried += 1;
            let Some(probe) = candidate.probe() else { continue };
            let oracle = Oracle::new(&probe.world, 0.0);
            let exact: Vec<Exact> = probe.rays.iter().map(|ray| oracle.closest(ray)).collect();
            asked += probe.rays.len() as u64;
            for &column in &self.columns {
                if let Some(new) = self.ask(column, &probe, &exact)? {
                    found.push(new);
                    // Not the same one again.
                    tried = PATIENCE + 1;
                }
            }
            let reached = difficulty(&probe);
            if tried > PATIENCE {
                (best, score, tried) = (Candidate::new(&mut random), 0, 0);
            } else if reached >= score {
                (best, score) = (candidate, reached);
            }
        }
        Ok((asked, found))
    }

    fn ask(&self, column: Column, probe: &Probe, exact: &[Exact]) -> Result<Option<Found>> {
        let mut found = None;
        if !column.applies(&probe.world) {
            return Ok(None);
        }
        column.each(&probe.world, &mut |form, tracer, batch| {
            if found.is_none() {
                let (hits, occluded) = answers(tracer, &probe.rays, batch);
                let failing = Tally::default().add(column.gate(Gate::Hits), &probe.rays, exact, &hits, &occluded);
                if let Some(&(i, fault)) = failing.first() {
                    let who = format!("{} {form}", column.name()).trim_end().to_owned();
                    let note = format!("{who}: {fault:?}; found by the search, seed {}", self.seed);
                    let text = file::to_text(&note, &probe.world, &probe.rays[i..=i]);
                    found = text.map(|text| Found { column, who, fault, text });
                }
            }
            Ok(())
        })?;
        Ok(found)
    }
}

/// On how many rays and triangles textbooks' methods are wrong.
fn difficulty(probe: &Probe) -> usize {
    let triangles: Vec<(Primitive<'_>, [Vec3; 3])> = oracle::primitives(&probe.world, 0.0)
        .filter_map(|(_, primitive)| match primitive.body {
            oracle::Body::Triangle(corners) => Some((primitive, corners)),
            oracle::Body::Shape(_) => None,
        })
        .collect();
    let methods = [TriangleMethod::MoellerTrumbore, TriangleMethod::Woop];
    let wrong = |ray: &Ray| {
        let of = |(primitive, corners): &(Primitive<'_>, [Vec3; 3])| {
            let is_hit = oracle::meet(ray, primitive).is_some_and(|meeting| meeting.in_range);
            methods.iter().filter(|method| method.intersect(ray, *corners).is_some() != is_hit).count()
        };
        triangles.iter().map(of).sum::<usize>()
    };
    probe.rays.iter().map(wrong).sum()
}

impl Candidate {
    fn new(random: &mut Random) -> Self {
        // A fan of triangles around an edge, so that there is something to leak between.
        let [a, b] = [random.vector(), random.vector()];
        let corners = (0..2 + random.below(4)).map(|_| [a, b, random.vector()]).collect();
        let sphere = (random.below(3) == 0)
            .then(|| Sphere { centre: random.vector(), radius: libm::exp10f(random.unit() * 8.0 - 4.0) });
        let mut new = Self { corners, sphere, rays: Vec::new() };
        new.rays = (0..RAYS).map(|_| new.ray(random)).collect();
        new
    }

    fn point(&self, random: &mut Random) -> Vec3 {
        let [a, b, c] = self.corners[random.below(self.corners.len() as u64) as usize];
        match random.below(4) {
            0 => a,
            1 => a.lerp(b, random.unit()),
            2 => b.lerp(c, 0.5),
            _ => a.lerp(b, random.unit()).lerp(c, random.unit()),
        }
    }

    fn ray(&self, random: &mut Random) -> Ray {
        let to = match (self.sphere, random.below(3)) {
            // Near its silhouette, more often than not.
            (Some(sphere), 0) => sphere.centre + random.direction() * sphere.radius,
            _ => self.point(random),
        };
        let from = match random.below(4) {
            0 => self.point(random),
            1 => to - Vec3::AXES[random.below(3) as usize] * 4.0,
            _ => to + random.vector() * libm::exp10f(random.unit() * 8.0 - 3.0),
        };
        Ray::new(from, (to - from) * libm::scalbnf(1.0, random.below(9) as i32 - 4))
    }

    /// With a few numbers changed.
    fn changed(&self, random: &mut Random) -> Self {
        let mut new = self.clone();
        for _ in 0..=random.below(3) {
            let source = self.point(random)[random.below(3) as usize];
            let k = random.below(new.corners.len() as u64) as usize;
            match random.below(6) {
                0 | 1 => change(&mut new.corners[k][random.below(3) as usize], source, random),
                2 => {
                    // The same corner for two triangles, as in a mesh.
                    let other = random.below(new.corners.len() as u64) as usize;
                    new.corners[k][random.below(3) as usize] = new.corners[other][random.below(3) as usize];
                }
                3 => {
                    let i = random.below(RAYS as u64) as usize;
                    new.rays[i] = new.ray(random);
                }
                _ => {
                    let ray = &mut new.rays[random.below(RAYS as u64) as usize];
                    let vector = if random.below(2) == 0 { &mut ray.origin } else { &mut ray.direction };
                    change(vector, source, random);
                }
            }
        }
        new
    }

    /// None where it would be moved to its middle, or holds what cannot be hit.
    fn probe(&self) -> Option<Probe> {
        let shapes = self.sphere.map(Shape::Sphere).into_iter().collect();
        let world = World::new(&file::scene(loose(&self.corners), shapes)).ok()?;
        let rays: Vec<Ray> = self.rays.iter().copied().filter(Ray::is_valid).collect();
        (world.centre == DVec3::ZERO && !rays.is_empty()).then(|| Probe { label: String::new(), world, rays })
    }
}

/// Changes a coordinate.
fn change(vector: &mut Vec3, source: f32, random: &mut Random) {
    let axis = random.below(3) as usize;
    let x = vector[axis];
    let new = match random.below(8) {
        0 | 1 => x.next_up(),
        2 | 3 => x.next_down(),
        4 => source,
        5 => [0.0, -0.0][random.below(2) as usize],
        6 => x * libm::scalbnf(1.0, random.below(21) as i32 - 10),
        _ => x + (random.unit() - 0.5) * 1e-6,
    };
    if new.abs() < 1e15 {
        vector[axis] = new;
    }
}
