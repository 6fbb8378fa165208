//! Time against the number of primitives, for every accelerator: which are linear, which are not, and from where on it
//! matters.
//!
//! Two families of triangles: *scattered* ones of no order, with edges of about the distance to the next, which is what
//! grids are good at; and a *terrain*, a mesh in which most of space is empty. The same rays for all accelerators, from
//! a sphere around the scene to points in its bounds; the best of a few passes, and of a few builds that are short,
//! counts, since whatever else the machine does makes them slower and never faster. An accelerator that takes longer
//! than a limit for a step is not asked for more primitives, nor is one that would take more memory than there may be,
//! by what it took for each primitive while it was built before.
//!
//! A grid is as good as its resolution: a second series traces one scene with grids from too coarse to too fine.

use std::fmt;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::Serialize;

use crate::error::Result;
use crate::lab::Entrant;
use crate::math::{Random, Vec3};
use crate::memory::{self, process};
use crate::ray::Ray;
use crate::render::Control;
use crate::scene::{self, Geometry, Material, Mesh, Scene};
use crate::trace::accel::{Accel, Options, Resolution};
use crate::trace::{Tracer, World};

/// Rays of a pass.
const RAYS: u64 = 1 << 14;
/// Rays that are traced together, between looks at the clock.
const CHUNK: usize = 64;
/// Passes, of which the best counts.
const PASSES: usize = 5;
/// How long a pass takes at most; with what was traced by then it ends.
const PASS: Duration = Duration::from_millis(500);
/// An accelerator that took so long to build, or so long for 2^14 rays, is not asked for more primitives.
const LONGEST: Duration = Duration::from_secs(10);
/// Bytes of a scene for each triangle: corners and indices, and their copies while they are made.
const MESH_BYTES: f64 = 120.0;
/// By how much more memory is counted with than it was before: numbers of primitives are not all that it depends on.
const SPARE: f64 = 1.25;
/// Triangles in the series over resolutions.
const SWEPT: u64 = 100_000;
/// Grids of that series, cells along the longest side.
const RESOLUTIONS: [u32; 9] = [2, 4, 8, 16, 32, 64, 128, 256, 512];

/// What is measured.
pub struct Scaling<'a> {
    /// Most primitives.
    pub max: u64,
    /// Most memory that the process may hold, bytes; None for any.
    pub max_memory: Option<u64>,
    /// Stops it once set.
    pub cancel: Option<&'a AtomicBool>,
    /// Called before each step, with what it is.
    pub on_step: Option<&'a (dyn Fn(&str) + Sync)>,
}

/// A kind of scene that can have any number of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Small triangles without order.
    Scattered,
    /// A height field.
    Terrain,
}

/// One accelerator and one number of primitives.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// The scene.
    pub family: Family,
    /// The accelerator.
    pub accel: &'static str,
    /// Triangles.
    pub primitives: u64,
    /// Seconds to build it, on the threads of the pool that asks.
    pub build_seconds: f64,
    /// Microseconds for a ray, on one thread.
    pub microseconds_a_ray: f64,
    /// Memory for each triangle.
    pub bytes_a_primitive: f64,
    /// By how much more the process held while it was built, at most; less than was used where freed memory was used
    /// again. None where the system does not tell.
    pub bytes_a_primitive_building: Option<f64>,
    /// What there is to say about how it was built.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// One grid of the series over resolutions.
#[derive(Clone, Debug, Serialize)]
pub struct Swept {
    /// Cells along the longest side; none for the grid's own choice.
    pub cells: Option<u32>,
    /// As in [`Point`].
    pub point: Point,
}

/// What was measured. Serialises as the document of `bench --scaling --json`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ScalingReport {
    /// One for each family, accelerator and number.
    pub points: Vec<Point>,
    /// Where accelerators were given up.
    pub stopped: Vec<String>,
    /// The grid by its resolution.
    pub grids: Vec<Swept>,
}

impl Family {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Scattered, Self::Terrain];

    /// As in the reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scattered => "scattered",
            Self::Terrain => "terrain",
        }
    }

    /// A scene of about so many triangles.
    fn mesh(self, count: u64) -> Mesh {
        match self {
            Self::Scattered => scattered(count),
            Self::Terrain => scene::terrain(((count as f64 / 2.0).sqrt().round() as u32).max(1)),
        }
    }
}

/// Triangles in the cube [-1, 1]^3, of half the size of the room that each of them has.
fn scattered(count: u64) -> Mesh {
    let size = 1.0 / (count as f32).cbrt();
    let corners = (0..count).into_par_iter().flat_map_iter(|i| {
        let mut random = Random::new(1, i);
        let middle = random.vector();
        [0; 3].map(|_| middle + random.vector() * size)
    });
    let triangles = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh::new(corners.collect(), triangles)
}

/// From a sphere around the world to points in its bounds.
fn rays(world: &World) -> Vec<Ray> {
    let bounds = world.bounds();
    let (centre, half) = (bounds.centre(), bounds.size() * 0.5);
    let ray = |i| {
        let mut random = Random::new(2, i);
        let from = centre + random.direction() * (2.0 * half.length());
        let to: Vec3 = centre + random.vector() * half;
        Ray::new(from, to - from)
    };
    (0..RAYS).map(ray).collect()
}

impl Scaling<'_> {
    /// Measures all families, accelerators and numbers in turn, then the grids.
    ///
    /// # Errors
    /// [`Error::Interrupted`](crate::Error::Interrupted) once `cancel` is set, and those of Embree.
    pub fn run(&self) -> Result<ScalingReport> {
        let mut report = ScalingReport::default();
        for family in Family::ALL {
            let mut entrants: Vec<_> = Entrant::all().into_iter().map(|entrant| (entrant, 0.0)).collect();
            let (mut count, mut last) = (10, 0);
            while count <= self.max && !entrants.is_empty() {
                let name = family.name();
                if let Some(why) = self.too_much(MESH_BYTES, count) {
                    report.stopped.push(format!("{name} ends at {last}: {count} triangles {why}"));
                    break;
                }
                let world = world(family.mesh(count))?;
                let rays = rays(&world);
                let mut kept = Vec::new();
                for (entrant, bytes) in entrants {
                    let accel = entrant.name();
                    if let Some(why) = self.too_much(bytes, count) {
                        report.stopped.push(format!("{name}: {accel} ends at {last}, building for {count} {why}"));
                        continue;
                    }
                    self.step(&format!("{name} {count}: {accel}"))?;
                    let point = measure(&world, &rays, family, entrant, &Options::default())?;
                    let longest = LONGEST.as_secs_f64();
                    let (build, trace) = (point.build_seconds, point.microseconds_a_ray * 1e-6 * RAYS as f64);
                    if build.max(trace) < longest {
                        let most = point.bytes_a_primitive_building.unwrap_or(0.0).max(point.bytes_a_primitive);
                        kept.push((entrant, most));
                    } else if count < self.max {
                        let what = if build > trace { "building" } else { "tracing" };
                        report.stopped.push(format!("{name}: {accel} ends at {count}, {what} takes over {longest} s"));
                    }
                    report.points.push(point);
                }
                entrants = kept;
                last = count;
                // 10, 30, 100, 300 ...
                count = if count.to_string().starts_with('1') { count * 3 } else { count / 3 * 10 };
            }
        }
        self.sweep(&mut report)?;
        Ok(report)
    }

    fn sweep(&self, report: &mut ScalingReport) -> Result<()> {
        let (family, grid) = (Family::Scattered, Entrant::Accel(Accel::Grid));
        let world = world(family.mesh(SWEPT.min(self.max)))?;
        let rays = rays(&world);
        let mut bytes = MESH_BYTES;
        for cells in [None].into_iter().chain(RESOLUTIONS.into_iter().map(Some)) {
            let name = cells.map_or("its own choice".to_owned(), |n| n.to_string());
            if let Some(why) = self.too_much(bytes, world.primitive_count()) {
                report.stopped.push(format!("grids end before {name}: building {why}"));
                break;
            }
            self.step(&format!("grid of {name}"))?;
            let options = Options { grid: cells.map(Resolution::Longest), ..Options::default() };
            let point = measure(&world, &rays, family, grid, &options)?;
            if cells.is_some() {
                // The next has eight times as many cells.
                bytes = 8.0 * point.bytes_a_primitive_building.unwrap_or(0.0).max(point.bytes_a_primitive);
            }
            report.grids.push(Swept { cells, point });
        }
        let first = usize::from(!report.grids.is_empty());
        report.grids.rotate_left(first);
        Ok(())
    }

    /// Where so many bytes for each of `count` primitives, and some to spare, are more than there may be: that, in
    /// words.
    fn too_much(&self, bytes: f64, count: u64) -> Option<String> {
        let limit = self.max_memory? as f64;
        let wanted = process::held().unwrap_or(0) as f64 + SPARE * bytes * count as f64;
        let size = |bytes: f64| memory::in_words(bytes as u64);
        (wanted > limit).then(|| format!("may take {} in all, of {} allowed", size(wanted), size(limit)))
    }

    fn step(&self, what: &str) -> Result<()> {
        if let Some(on_step) = self.on_step {
            on_step(what);
        }
        Control::stopping(self.cancel).check()
    }
}

fn world(mesh: Mesh) -> Result<World> {
    World::new(&Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]))
}

fn measure(world: &World, rays: &[Ray], family: Family, entrant: Entrant, options: &Options) -> Result<Point> {
    let build = || {
        let start = Instant::now();
        entrant.build(world, options).map(|built| (built, start.elapsed()))
    };
    let (built, growth) = process::growth(build);
    let (mut built, mut fastest) = built?;
    let mut spent = fastest;
    for _ in 1..PASSES {
        if spent > PASS {
            break;
        }
        // Its memory goes before the next one takes its own.
        drop(built);
        let again;
        (built, again) = build()?;
        spent += again;
        fastest = fastest.min(again);
    }
    let build_seconds = fastest.as_secs_f64();
    let best = (0..PASSES).map(|_| pass(&built, rays)).fold(f64::INFINITY, f64::min);
    let primitives = world.primitive_count();
    Ok(Point {
        family,
        accel: entrant.name(),
        primitives,
        build_seconds,
        microseconds_a_ray: best * 1e6,
        bytes_a_primitive: built.bytes as f64 / primitives as f64,
        bytes_a_primitive_building: growth.map(|bytes| bytes as f64 / primitives as f64),
        notes: built.notes,
    })
}

/// Seconds for a ray.
fn pass(tracer: &impl Tracer, rays: &[Ray]) -> f64 {
    let start = Instant::now();
    let (mut hits, mut traced) = ([None; CHUNK], 0);
    for rays in rays.chunks(CHUNK) {
        tracer.closest_batch(rays, &mut hits[..rays.len()], Default::default());
        std::hint::black_box(&hits);
        traced += rays.len();
        if start.elapsed() > PASS {
            break;
        }
    }
    start.elapsed().as_secs_f64() / traced as f64
}

impl fmt::Display for ScalingReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = |f: &mut fmt::Formatter<'_>, first: &str| {
            writeln!(f, "  {first:<12}{:>12}{:>12}{:>14}", "build, ms", "us a ray", "B a triangle")
        };
        let row = |f: &mut fmt::Formatter<'_>, name: &str, point: &Point| {
            let Point { build_seconds, microseconds_a_ray, bytes_a_primitive, .. } = point;
            let build = build_seconds * 1e3;
            writeln!(f, "  {name:<12}{build:>12.2}{microseconds_a_ray:>12.3}{bytes_a_primitive:>14.1}")
        };
        for same in self.points.chunk_by(|a, b| (a.family, a.primitives) == (b.family, b.primitives)) {
            writeln!(f, "{}, {} triangles", same[0].family.name(), same[0].primitives)?;
            head(f, "")?;
            same.iter().try_for_each(|point| row(f, point.accel, point))?;
            let notes = same.iter().filter(|point| point.accel != Accel::Grid.name());
            for (name, note) in notes.flat_map(|point| point.notes.iter().map(|note| (point.accel, note))) {
                writeln!(f, "  {name}: {note}")?;
            }
            writeln!(f)?;
        }
        for stopped in &self.stopped {
            writeln!(f, "{stopped}")?;
        }
        if let Some(first) = self.grids.first() {
            writeln!(f, "\ngrids, {} scattered triangles", first.point.primitives)?;
            head(f, "cells a side")?;
            for Swept { cells, point } in &self.grids {
                row(f, &cells.map_or("own choice".to_owned(), |n| n.to_string()), point)?;
            }
        }
        Ok(())
    }
}
