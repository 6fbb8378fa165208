//! Native against Embree, on every ray of a picture and on rays made to be difficult.

use std::fmt;

use rayon::prelude::*;
use serde::Serialize;

use super::classify::Class;
use super::paired::{Difference, Paired, Tally};
use super::pixels::{PixelReport, explain_pixels};
use super::rays::{Aim, Query};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::render::{Control, Renderer};
use crate::trace::{Tracer, World};

/// Primitives up to which brute force is asked for every ray as well.
pub const BRUTE_LIMIT: u64 = 20_000;

/// What is compared.
pub struct Setup<'a, A, B> {
    /// The scene's name in the report.
    pub scene: &'a str,
    /// Makes the pictures, and with them the camera and shadow rays; of the world that the engines were built from.
    pub renderer: &'a Renderer<'a>,
    /// The native engine.
    pub native: &'a A,
    /// Whether its t are exact but for rounding, as those of all but textbooks' methods are.
    pub is_exact: bool,
    /// Embree.
    pub embree: &'a B,
    /// Brute force, for scenes below [`BRUTE_LIMIT`].
    pub brute: Option<&'a dyn Tracer>,
    /// How many difficult rays.
    pub random: u64,
    /// Chooses them.
    pub seed: u64,
}

/// What came of it.
pub struct Comparison {
    /// The counts.
    pub report: Report,
    /// The picture of the native engine.
    pub native_image: Image,
    /// The picture of Embree.
    pub embree_image: Image,
}

/// The counts of a comparison. Serialises as the document of `compare --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Name of the scene.
    pub scene: String,
    /// Primitives as placed.
    pub triangles: u64,
    /// Queries: closest-hit and any-hit.
    pub rays: u64,
    /// [`Class::Agree`].
    pub agree: u64,
    /// [`Class::Tie`].
    pub tie: u64,
    /// [`Class::Boundary`].
    pub boundary: u64,
    /// [`Class::NativeWrong`].
    pub native_wrong: u64,
    /// [`Class::EmbreeWrong`].
    pub embree_wrong: u64,
    /// Largest distance between the two t of one primitive that the ray does not start on, in steps of f32.
    pub max_t_ulp: u32,
    /// The pictures.
    pub image: ImageReport,
    /// A few of the rays that differ, the worst first.
    #[serde(skip)]
    pub differences: Vec<Difference>,
    /// The first pixel that no ray explains.
    #[serde(skip)]
    pub first_unexplained: Option<(u32, u32)>,
}

/// How the two pictures differ.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ImageReport {
    /// Pixels in each.
    pub pixels: u64,
    /// Those that are not equal to the bit.
    pub differing: u64,
    /// Those that differ without a ray that explains it.
    pub unexplained: u64,
    /// The largest difference of a channel, linear.
    pub max_abs: f32,
}

impl<A: Tracer, B: Tracer> Setup<'_, A, B> {
    /// Renders on each engine alone, then on both together, then shoots the difficult rays; in parallel on rayon's
    /// current thread pool. The report does not depend on the threads.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once `control.cancel` is set.
    pub fn run(&self, control: Control<'_>) -> Result<Comparison> {
        let world = self.renderer.world();
        let native_image = self.renderer.render(self.native, control)?;
        let embree_image = self.renderer.render(self.embree, control)?;
        let paired = Paired::new(world, self.native, self.embree, self.brute);
        let paired = if self.is_exact { paired } else { paired.by_name() };
        self.renderer.render(&paired, control)?;
        shoot(&paired, world, self.random, self.seed, control)?;
        let pixels = explain_pixels(self.renderer, self.native, self.embree, &native_image, &embree_image);
        let report = Report::new(self.scene, world, paired.tally(), &pixels);
        Ok(Comparison { report, native_image, embree_image })
    }
}

/// Asks `tracer` the first `count` difficult rays of a seed.
///
/// # Errors
/// [`Error::Interrupted`] once `control.cancel` is set.
pub fn shoot<T: Tracer>(tracer: &T, world: &World, count: u64, seed: u64, control: Control<'_>) -> Result<()> {
    let Some(aim) = Aim::new(world) else { return Ok(()) };
    (0..count).into_par_iter().try_for_each(|index| {
        control.check()?;
        match aim.ray(seed, index) {
            Query::Closest(ray) => _ = tracer.closest(&ray),
            Query::Occluded(ray) => _ = tracer.occluded(&ray),
        }
        Ok(())
    })
}

impl Report {
    /// Puts the counts of rays and pixels together.
    pub fn new(scene: &str, world: &World, tally: &Tally, pixels: &PixelReport) -> Self {
        let &PixelReport { pixels, differing, unexplained, max_abs, first_unexplained, .. } = pixels;
        Self {
            scene: scene.to_owned(),
            triangles: world.primitive_count(),
            rays: tally.rays(),
            agree: tally.count(Class::Agree),
            tie: tally.count(Class::Tie),
            boundary: tally.count(Class::Boundary),
            native_wrong: tally.count(Class::NativeWrong),
            embree_wrong: tally.count(Class::EmbreeWrong),
            max_t_ulp: tally.max_t_ulp(),
            image: ImageReport { pixels, differing, unexplained, max_abs },
            differences: tally.differences(),
            first_unexplained,
        }
    }

    /// # Errors
    /// [`Error::Check`] where native is wrong on a ray, or a pixel differs and no ray explains it.
    pub fn check(&self) -> Result<()> {
        let mut faults = Vec::new();
        if self.native_wrong > 0 {
            faults.push(format!("the native engine is wrong on {} of {} rays", self.native_wrong, self.rays));
        }
        if self.image.unexplained > 0 {
            let first = self.first_unexplained.map(|(x, y)| format!(" (the first at x {x}, y {y})"));
            let (unexplained, first) = (self.image.unexplained, first.unwrap_or_default());
            faults.push(format!("{unexplained} pixels differ without a ray that explains it{first}"));
        }
        if faults.is_empty() { Ok(()) } else { Err(Error::Check(format!("{}: {}", self.scene, faults.join("; ")))) }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {} primitives", self.scene, self.triangles)?;
        let mut row = |name: &str, count: u64, share: &str| writeln!(f, "  {name:<20}{count:>12}{share}");
        let of = |count: u64, all: u64| format!("{:>12.4} %", 100.0 * count as f64 / all.max(1) as f64);
        row("rays", self.rays, "")?;
        let classes = [
            (Class::Agree, self.agree),
            (Class::Tie, self.tie),
            (Class::Boundary, self.boundary),
            (Class::NativeWrong, self.native_wrong),
            (Class::EmbreeWrong, self.embree_wrong),
        ];
        for (class, count) in classes {
            row(class.name(), count, &of(count, self.rays))?;
        }
        row("max t difference", self.max_t_ulp.into(), " ulp")?;
        row("pixels", self.image.pixels, "")?;
        row("differing", self.image.differing, &of(self.image.differing, self.image.pixels))?;
        row("unexplained", self.image.unexplained, "")?;
        writeln!(f, "  {:<20}{:>12}", "max difference", self.image.max_abs)?;
        if !self.differences.is_empty() {
            writeln!(f, "  some of the rays that differ, each with what `twincast trace` takes to say more of it:")?;
        }
        for difference in &self.differences {
            writeln!(f, "  {difference}")?;
        }
        Ok(())
    }
}
