//! The catalogue of cases on which ray casters fail, every method on each of them, judged by exact arithmetic.
//!
//! | file | what |
//! | --- | --- |
//! | `triangles`, `quadrics`, `structures`, `placed`, `ranges` | the cases, a file a family |
//! | `subject` | who is asked: the native tracer in all its ways, the accelerators, the textbooks' methods, Embree |
//! | `verdict` | what an answer is worth, and what a case's gate forbids |
//! | `expected` | what is known to fail where, held in both directions |
//! | `run`, `report`, `heat` | the matrix of all that, as a table, JSON and a picture |
//! | `search` | a random search for cases that are in no catalogue |
//! | `file` | a case in a file, to the bit |
//!
//! A case is a few worlds in f32, as tracers hold them, and rays in their coordinates; nothing is read, moved or
//! rounded in between. The [`Oracle`](super::tree::Oracle) answers each ray once, and every subject is held against
//! that. Pictures that look right, the usual test, would show one leak in a thousand and no wrong neighbour.

mod expected;
pub mod file;
mod heat;
mod placed;
mod quadrics;
mod ranges;
mod report;
mod run;
mod search;
mod structures;
mod subject;
mod triangles;
pub mod verdict;

pub use heat::heat_map;
pub use report::{Cell, Replay, Report, Row};
pub use run::Setup;
pub use search::{Found, Search};
pub use subject::{Column, columns};
pub use verdict::{Fault, Gate, Tally, Verdict};

use crate::math::{Random, Vec3};
use crate::ray::Ray;
use crate::scene::{Geometry, Material, Mesh, Scene};
use crate::shape::Shape;
use crate::trace::World;

/// A case of the catalogue.
#[derive(Clone, Copy)]
pub struct Case {
    /// How it is asked for.
    pub name: &'static str,
    /// What is in it, and what fails there.
    pub about: &'static str,
    /// Who found it.
    pub source: &'static str,
    /// What textbook methods and Embree are held to; the native tracer is held to [`Gate::Exact`] everywhere.
    pub gate: Gate,
    /// The largest relative error of t that passes, where that is what the case is about.
    pub t_relative: Option<f64>,
    make: fn(usize, &mut Random) -> Vec<Probe>,
}

/// A world, and rays in its coordinates.
pub struct Probe {
    /// What tells it from the other probes of its case; empty for an only one.
    pub label: String,
    /// What is hit.
    pub world: World,
    /// Who hits it.
    pub rays: Vec<Ray>,
}

/// Every case, family by family.
pub fn catalogue() -> impl Iterator<Item = Case> {
    let families: [&[Case]; 5] = [triangles::CASES, quadrics::CASES, structures::CASES, placed::CASES, ranges::CASES];
    families.into_iter().flatten().copied()
}

impl Case {
    /// Its worlds, with about so many rays in all, and one at least; `seed` chooses among rays, and never changes a
    /// world.
    pub fn probes(&self, rays: usize, seed: u64) -> Vec<Probe> {
        let make = |rays| (self.make)(rays, &mut Random::new(seed, 0));
        let mut rays = rays.max(1);
        let mut probes = make(rays);
        // Of few rays, the share of each world may be none.
        while probes.iter().all(|probe| probe.rays.is_empty()) {
            rays *= 2;
            probes = make(rays);
        }
        probes
    }
}

impl Probe {
    fn new(label: impl Into<String>, scene: &Scene, rays: Vec<Ray>) -> Self {
        let world = World::new(scene).expect("the catalogue's scenes are sound");
        debug_assert!(world.centre == crate::math::DVec3::ZERO, "rays are in the coordinates of the scene");
        Self { label: label.into(), world, rays }
    }

    fn of_mesh(label: impl Into<String>, mesh: Mesh, rays: Vec<Ray>) -> Self {
        Self::new(label, &Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]), rays)
    }

    fn of_shapes(label: impl Into<String>, shapes: Vec<Shape>, rays: Vec<Ray>) -> Self {
        let geometry = Geometry::Shapes { shapes, material: 0 };
        Self::new(label, &Scene::from_geometries(vec![geometry], vec![Material::default()]), rays)
    }
}

/// Triangles with corners of their own.
fn loose(corners: &[[Vec3; 3]]) -> Mesh {
    let triangles = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh::new(corners.concat(), triangles)
}

/// A ray towards a point.
fn towards(from: Vec3, to: Vec3) -> Ray {
    Ray::new(from, to - from)
}

/// The same number, or the next one up or down.
fn nudged(x: f32, random: &mut Random) -> f32 {
    [x, x.next_up(), x.next_down()][random.below(3) as usize]
}
