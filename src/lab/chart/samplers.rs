//! Samplers, filters and adaptive sampling: seconds of a render against the error of its picture.
//!
//! The reference of each filter is rendered with that filter, since filters converge to pictures of their own; it is
//! the mean of two with seeds of their own, whose difference says how far it is off itself.

use std::time::Instant;

use super::scatter::{Panel, Point, Scatter};
use super::{Figure, Setup, csv};
use crate::error::Result;
use crate::image::Image;
use crate::image::flip::{PIXELS_PER_DEGREE, Seen};
use crate::lab::bench::Spread;
use crate::math::{DVec3, Vec3, Vec4};
use crate::render::{Adaptive, Control, Filter, Renderer, Sampling, Settings};
use crate::scene::{AreaShape, Camera, Light, RECIPES, Scene};
use crate::trace::World;
use crate::trace::bvh::Bvh;

/// Seeds of the two pictures that the reference is the mean of.
const SEEDS: [u64; 2] = [0x00c0_ffee, 0x00be_ef00];
/// Samples that adaptive sampling may take at most.
const MAX: u32 = 4096;

/// A picture to be made again and again.
struct Way {
    panel: usize,
    group: usize,
    label: String,
    settings: Settings,
    /// Which reference.
    filter: usize,
}

/// A picture of many samples, and about how far it is off: root mean square.
struct Reference {
    image: Image,
    seen: Seen,
    error: f64,
}

/// How far a picture is off.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Errors {
    rmse: f64,
    /// Mean of (x - r)^2 / (r + 0.01)^2.
    relative: f64,
    /// Mean of LDR-FLIP.
    flip: f64,
}

struct Stage<'a> {
    scene: &'a Scene,
    world: &'a World,
    bvh: &'a Bvh,
    camera: &'a Camera,
    control: Control<'a>,
}

impl Stage<'_> {
    fn render(&self, settings: &Settings) -> Result<Image> {
        let renderer = Renderer::new(self.scene, self.world, self.camera.clone(), settings.clone())?;
        renderer.render(self.bvh, self.control)
    }

    fn reference(&self, settings: &Settings, spp: u32) -> Result<Reference> {
        let of_seed = |seed| self.render(&Settings { spp, seed, sampling: Sampling::Sobol, ..settings.clone() });
        let [mut image, other] = [of_seed(SEEDS[0])?, of_seed(SEEDS[1])?];
        let error = rmse(&image, &other) / 2.0;
        image.pixels.iter_mut().zip(&other.pixels).for_each(|(a, b)| *a = a.midpoint(*b));
        Ok(Reference::new(image, error))
    }
}

/// Measures and draws.
pub(super) fn figure(setup: &Setup<'_>) -> Result<Figure> {
    let scene = scene();
    let world = World::new(&scene)?;
    let (bvh, camera) = (Bvh::build(&world), scene.cameras[0].clone());
    let control = setup.control();
    let stage = Stage { scene: &scene, world: &world, bvh: &bvh, camera: &camera, control };
    let (width, height) = setup.pick((64, 48), (160, 120));
    let (reference_spp, turns) = (setup.pick(1024, 8192), setup.pick(5, 15));
    let usual = Settings { width, height, ..Settings::default() };
    let mut references = Vec::new();
    for filter in Filter::ALL {
        setup.step(&format!("samplers: reference by {}", filter.name()))?;
        references.push(stage.reference(&Settings { filter, ..usual.clone() }, reference_spp)?);
    }
    let ways = ways(&usual, setup.pick(32, 128));
    let mut seconds = vec![Vec::new(); ways.len()];
    let mut rmses = vec![Vec::new(); ways.len()];
    let mut relatives = vec![Vec::new(); ways.len()];
    let mut flips = vec![Vec::new(); ways.len()];
    for turn in 0..=turns {
        setup.step(&format!("samplers: turn {turn} of {turns}"))?;
        for (i, way) in ways.iter().enumerate() {
            let settings = Settings { seed: turn as u64, ..way.settings.clone() };
            let start = Instant::now();
            let image = stage.render(&settings)?;
            // The first turn warms up.
            if turn > 0 {
                seconds[i].push(start.elapsed().as_secs_f64());
                let Errors { rmse, relative, flip } = references[way.filter].errors(&image)?;
                rmses[i].push(rmse);
                relatives[i].push(relative);
                flips[i].push(flip);
            }
        }
    }

    let legend = legend();
    let mut panels = PANELS.map(|title| Panel { title: title.to_owned(), points: Vec::new() });
    let mut rows = Vec::new();
    for (i, way) in ways.iter().enumerate() {
        let (x, y) = (Spread::of(&seconds[i]), Spread::of(&rmses[i]));
        let [relative, flip] = [&relatives[i], &flips[i]].map(|errors| Spread::of(errors).median);
        let efficiency = 1.0 / (y.median * y.median * x.median);
        let numbers = [x.median, x.min, x.max, y.median, y.min, y.max, relative, flip, efficiency];
        let [s, s_min, s_max, e, e_min, e_max, relative, flip, efficiency] = numbers.map(|x| format!("{x:.6e}"));
        let reference = format!("{:.3e}", references[way.filter].error);
        let names = [PANELS[way.panel].to_owned(), legend[way.group].to_owned(), way.label.clone()];
        let [panel, name, label] = names;
        rows.push([panel, name, label, s, s_min, s_max, e, e_min, e_max, relative, flip, efficiency, reference]);
        panels[way.panel].points.push(Point { group: way.group, label: way.label.clone(), x, y });
    }
    let scatter = Scatter {
        title: "Samplers, filters and adaptive sampling: time against error",
        legend: &legend,
        x: "seconds a picture",
        y: "root mean square error",
        more_is_better: false,
        joined: true,
        columns: 3,
        panels: panels.into(),
    };
    let (drawing, size) = scatter.draw();
    let columns = [
        "chart",
        "way",
        "samples_or_noise",
        "seconds",
        "seconds_min",
        "seconds_max",
        "rmse",
        "rmse_min",
        "rmse_max",
        "relmse",
        "flip",
        "efficiency",
        "reference_error",
    ];
    let off = references.iter().map(|reference| reference.error).fold(0.0, f64::max);
    Ok(Figure {
        name: "samplers",
        title: scatter.title.to_owned(),
        caption: format!(
            "A sphereflake of mirrors under a square light, {width} x {height} pixels, linear RGB; numbers beside points are samples a \
             pixel, of adaptive sampling the noise threshold. The reference has seeds of its own and {} samples a pixel by Sobol's points, \
             each filter its own; it is off by {off:.1e} itself. Medians of {turns} turns, each with another seed, in which all \
             alternate; bars from the smallest to the largest. The numbers hold the relative error, the mean of LDR-FLIP and the \
             efficiency 1 / (MSE x seconds) too. {}",
            2 * reference_spp,
            setup.made_by()
        ),
        csv: csv(columns, rows),
        drawing,
        size,
    })
}

const PANELS: [&str; 3] = ["samplers, box filter", "filters, Sobol's points", "adaptive and even sampling"];

/// Samplers, then filters, then adaptive sampling.
fn legend() -> Vec<&'static str> {
    let samplers = Sampling::ALL.into_iter().map(Sampling::name);
    samplers.chain(Filter::ALL.into_iter().map(Filter::name)).chain(["adaptive"]).collect()
}

/// Everything that is to be rendered, up to `most` samples a pixel.
fn ways(usual: &Settings, most: u32) -> Vec<Way> {
    let counts = || (0..).map(|power| 1u32 << power).take_while(|&spp| spp <= most);
    let mut ways = Vec::new();
    // Where among all filters the box is.
    let position = |filter| Filter::ALL.iter().position(|&other| other == filter).unwrap_or_default();
    let even = |panel, group, filter: Filter, sampling, spp: u32| Way {
        panel,
        group,
        label: spp.to_string(),
        settings: Settings { spp, sampling, filter, ..usual.clone() },
        filter: position(filter),
    };
    for (group, sampling) in Sampling::ALL.into_iter().enumerate() {
        ways.extend(counts().map(|spp| even(0, group, Filter::Box, sampling, spp)));
    }
    let first_filter = Sampling::ALL.len();
    for (i, filter) in Filter::ALL.into_iter().enumerate() {
        // One sample is the pixel's middle, whatever the filter.
        ways.extend(counts().skip(1).map(|spp| even(1, first_filter + i, filter, Sampling::Sobol, spp)));
    }
    let sobol = Sampling::ALL.iter().position(|&sampling| sampling == Sampling::Sobol).unwrap_or_default();
    ways.extend(counts().filter(|&spp| spp >= 4).map(|spp| even(2, sobol, Filter::Box, Sampling::Sobol, spp)));
    for noise in [0.1, 0.05, 0.025, 0.0125] {
        ways.push(Way {
            panel: 2,
            group: first_filter + Filter::ALL.len(),
            label: noise.to_string(),
            settings: Settings {
                filter: Filter::Box,
                adaptive: Some(Adaptive { noise, max_spp: MAX.min(8 * most) }),
                ..usual.clone()
            },
            filter: position(Filter::Box),
        });
    }
    ways
}

/// Edges, mirrors and a soft shadow.
fn scene() -> Scene {
    let recipe = RECIPES.iter().find(|recipe| recipe.name == "sphereflake").unwrap_or(&RECIPES[0]);
    let mut scene = recipe.make(2);
    let half_edges = [DVec3::X * 1.5, DVec3::Z * 1.5];
    let shape = AreaShape::Rectangle { centre: DVec3::new(2.0, 5.0, 2.0), half_edges };
    scene.lights = vec![Light::Area { shape, radiance: Vec3::splat(5.0) }];
    scene
}

impl Reference {
    fn new(image: Image, error: f64) -> Self {
        Self { seen: image.seen(PIXELS_PER_DEGREE).expect("a picture that was rendered"), image, error }
    }

    /// Of the colours of a picture.
    fn errors(&self, image: &Image) -> Result<Errors> {
        let flip = self.seen.mean_flip(image)?;
        let relative = mean(image, &self.image, |x, r| (x - r).powi(2) / (r + 0.01).powi(2));
        Ok(Errors { rmse: rmse(image, &self.image), relative, flip })
    }
}

/// Of the colours, alpha left out.
fn rmse(image: &Image, reference: &Image) -> f64 {
    mean(image, reference, |x, r| (x - r).powi(2)).sqrt()
}

/// Over the colours of all pixels.
fn mean(image: &Image, reference: &Image, error: impl Fn(f64, f64) -> f64) -> f64 {
    let pairs = image.pixels.iter().zip(&reference.pixels).flat_map(|(x, r)| rgb(*x).into_iter().zip(rgb(*r)));
    pairs.map(|(x, r)| error(x, r)).sum::<f64>() / (3 * image.pixels.len()).max(1) as f64
}

fn rgb(pixel: Vec4) -> [f64; 3] {
    [pixel.x, pixel.y, pixel.z].map(f64::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_those_of_the_formulas() {
        let image = |value: f32| {
            let mut image = Image::new(2, 1);
            image.pixels = vec![Vec4::new(value, 0.0, 0.0, 1.0), Vec4::ZERO];
            image
        };
        let Errors { rmse, relative, flip } =
            Reference::new(image(0.25), 0.0).errors(&image(0.5)).expect("of one size");
        assert!((rmse - (0.0625f64 / 6.0).sqrt()).abs() < 1e-12);
        assert!((relative - 0.0625 / 0.26f64.powi(2) / 6.0).abs() < 1e-12);
        assert_eq!(flip, image(0.25).mean_flip(&image(0.5), PIXELS_PER_DEGREE).expect("of one size"));
    }

    #[test]
    fn more_samples_are_nearer_to_the_reference_and_that_is_nearer_still() {
        let scene = scene();
        let world = World::new(&scene).expect("sound");
        let (bvh, camera) = (Bvh::build(&world), scene.cameras[0].clone());
        let stage = Stage { scene: &scene, world: &world, bvh: &bvh, camera: &camera, control: Control::default() };
        let usual = Settings { width: 16, height: 12, ..Settings::default() };
        let reference = stage.reference(&usual, 256).expect("rendered");
        let of = |spp| {
            let image = stage.render(&Settings { spp, ..usual.clone() }).expect("rendered");
            reference.errors(&image).expect("of one size")
        };
        let (few, more) = (of(1), of(16));
        assert!(
            few.rmse > 2.0 * more.rmse && more.rmse > 2.0 * reference.error,
            "{few:?} {more:?} {}",
            reference.error
        );
        assert!(few.flip > 1.5 * more.flip, "{few:?} {more:?}");
    }

    #[test]
    fn every_way_has_a_panel_and_a_name() {
        let ways = ways(&Settings::default(), 8);
        assert!(ways.iter().all(|way| way.panel < PANELS.len() && way.group < legend().len()));
        assert!((0..PANELS.len()).all(|panel| ways.iter().filter(|way| way.panel == panel).count() > 4));
    }
}
