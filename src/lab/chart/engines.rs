//! Native and Embree, in every mode and width: rays a second of whole renders, against hits that exact arithmetic
//! refutes.

use std::time::Instant;

use super::rate::per_million;
use super::scatter::{Panel, Point, Scatter};
use super::{Figure, Setup, csv};
use crate::error::Result;
use crate::io::UpAxis;
use crate::lab::bench::{Spread, Subject};
use crate::lab::classify::{Answers, Class, classify_closest};
use crate::lab::rays::{Aim, Query};
use crate::math::{DVec3, Vec3};
use crate::ray::{Hit, Ray};
use crate::render::{Control, Counted, Renderer, Settings};
use crate::scene::Light;
use crate::trace::accel::{Accel, Options};
use crate::trace::bvh::{self, Bvh, Preset};
use crate::trace::{Batch, Tracer, Width, World};

/// Rays that are traced together.
const WIDTHS: [Width; 3] = [Width::One, Width::Eight, Width::Sixteen];
/// Scenes made by rule: one of small even triangles, one of long thin ones.
const SCENES: [&str; 2] = ["terrain200", "architecture12"];
/// Rays whose answers are compared at a time.
const CHUNK: u64 = 4096;

struct Engine {
    name: String,
    tracer: Box<dyn Tracer>,
}

/// What one engine did at one width.
struct Measured {
    engine: usize,
    width: Width,
    mrays_per_s: Spread,
    wrong: u64,
}

/// Measures and draws.
pub(super) fn figure(setup: &Setup<'_>) -> Result<Figure> {
    let (side, turns, rays) = (setup.pick(192, 512), setup.pick(3, 9), setup.pick(200_000, 4_000_000));
    let mut panels = Vec::new();
    let mut rows = Vec::new();
    let mut names: Vec<String> = Vec::new();
    for scene in SCENES {
        setup.step(&format!("engines: {scene}"))?;
        let (mut subject, _) = Subject::new(scene, UpAxis::Y)?;
        let direction = DVec3::new(-0.5, -1.0, -0.3).normalize();
        subject.scene.lights = vec![Light::Directional { direction, color: Vec3::ONE }];
        let engines = engines(&subject.world)?;
        let measured = measure(setup, &subject, &engines, (side, turns, rays))?;
        names = engines.into_iter().map(|engine| engine.name).collect();
        let points = measured.iter().map(|m| {
            let y = per_million(m.wrong, rays);
            let Spread { min, median, max } = m.mrays_per_s;
            let [median, min, max] = [median, min, max].map(|rate| format!("{rate:.4}"));
            let [rate, low, high] = [y.median, y.min, y.max].map(|wrong| format!("{wrong:.4}"));
            let fields = [names[m.engine].clone(), m.width.rays().to_string(), m.wrong.to_string(), rays.to_string()];
            let [engine, width, wrong, rays] = fields;
            rows.push([scene.to_owned(), engine, width, median, min, max, wrong, rays, rate, low, high]);
            Point { group: m.engine, label: m.width.rays().to_string(), x: m.mrays_per_s, y }
        });
        let triangles = subject.world.stored_triangles();
        panels.push(Panel { title: format!("{scene}: {triangles} triangles"), points: points.collect() });
    }
    let legend: Vec<&str> = names.iter().map(String::as_str).collect();
    let scatter = Scatter {
        title: "Engines and modes: rays a second against wrong hits",
        legend: &legend,
        x: "millions of rays a second, a whole render",
        y: "wrong hits in a million difficult rays",
        more_is_better: true,
        joined: false,
        columns: 2,
        panels,
    };
    let (drawing, size) = scatter.draw();
    let columns = [
        "scene",
        "engine",
        "width",
        "mrays_per_s",
        "mrays_min",
        "mrays_max",
        "wrong",
        "rays",
        "wrong_per_million",
        "wrong_low",
        "wrong_high",
    ];
    Ok(Figure {
        name: "engines",
        title: scatter.title.to_owned(),
        caption: format!(
            "Numbers beside points: rays traced together. Rates are camera and shadow rays of a render of {side} x {side} pixels with \
             one light, shading and all, on one thread; medians of {turns} turns in which engines alternate, bars from the slowest to the \
             fastest. Wrong: of {rays} rays aimed at corners and edges, along axes, from far away and from surface to surface, those whose \
             nearest hit names another primitive than the kd-tree's exact test does, where exact arithmetic refutes it; bars: 95 % \
             intervals (Wilson). An engine in f32 may be wrong there by rounding alone; what it is held to here is the exact \
             answer. {}",
            setup.made_by()
        ),
        csv: csv(columns, rows),
        drawing,
        size,
    })
}

/// Every engine and mode of this build.
fn engines(world: &World) -> Result<Vec<Engine>> {
    let native = Preset::ALL.map(|preset| {
        let bvh = Bvh::build_with(world, bvh::Options { preset, ..bvh::Options::default() });
        Engine { name: format!("native {}", preset.name()), tracer: Box::new(bvh) }
    });
    let engines = native.into_iter().map(Ok);
    #[cfg(feature = "embree")]
    let engines = engines.chain({
        use crate::trace::embree::{self, Embree};
        let fast = embree::Options { robust: false, threads: Some(1), ..embree::Options::default() };
        let modes = [
            ("fast", fast),
            ("robust", embree::Options { robust: true, ..fast }),
            ("compact", embree::Options { compact: true, ..fast }),
        ];
        modes.map(|(mode, options)| {
            let tracer = Box::new(Embree::new(world, &options)?);
            Ok(Engine { name: format!("embree {mode}"), tracer })
        })
    });
    engines.collect()
}

fn measure(
    setup: &Setup<'_>,
    subject: &Subject,
    engines: &[Engine],
    (side, turns, rays): (u32, usize, u64),
) -> Result<Vec<Measured>> {
    let renderer = |width| {
        let batch = Batch { width, coherent: true };
        let settings = Settings { width: side, height: side, spp: 1, batch, ..Settings::default() };
        Renderer::new(&subject.scene, &subject.world, subject.camera.clone(), settings)
    };
    let renderers = WIDTHS.into_iter().map(renderer).collect::<Result<Vec<_>>>()?;
    // How many rays there are depends on what is hit, by a few in a million.
    let counted = Counted::new(&*engines[0].tracer);
    renderers[0].render(&counted, Control::default())?;
    let traced = counted.closest_rays() + counted.occluded_rays();
    let ways: Vec<(usize, usize)> = (0..engines.len()).flat_map(|e| (0..WIDTHS.len()).map(move |w| (e, w))).collect();
    let mut rates = vec![Vec::new(); ways.len()];
    for turn in 0..=turns {
        setup.step("engines: times")?;
        for ((engine, width), rates) in ways.iter().zip(&mut rates) {
            let start = Instant::now();
            renderers[*width].render(&*engines[*engine].tracer, setup.control())?;
            if turn > 0 {
                rates.push(traced as f64 / start.elapsed().as_secs_f64().max(1e-9) / 1e6);
            }
        }
    }
    setup.step("engines: wrong hits")?;
    let wrong = wrong_hits(&subject.world, engines, &ways, rays);
    let measured = ways.into_iter().zip(rates).zip(wrong).map(|(((engine, width), rates), wrong)| Measured {
        engine,
        width: WIDTHS[width],
        mrays_per_s: Spread::of(&rates),
        wrong,
    });
    Ok(measured.collect())
}

/// Of so many difficult rays, by engine and width.
fn wrong_hits(world: &World, engines: &[Engine], ways: &[(usize, usize)], rays: u64) -> Vec<u64> {
    let reference = Accel::Kd.build(world, &Options::default());
    let mut wrong = vec![0; ways.len()];
    let Some(aim) = Aim::new(world) else { return wrong };
    let mut next = 0;
    let mut left = rays;
    while left > 0 {
        let mut chunk: Vec<Ray> = Vec::new();
        while (chunk.len() as u64) < left.min(CHUNK) {
            if let Query::Closest(ray) = aim.ray(17, next) {
                chunk.push(ray);
            }
            next += 1;
        }
        left -= chunk.len() as u64;
        let mut expected = vec![None; chunk.len()];
        reference.closest_batch(&chunk, &mut expected, Batch::default());
        for ((engine, width), wrong) in ways.iter().zip(&mut wrong) {
            let mut hits = vec![None; chunk.len()];
            let batch = Batch { width: WIDTHS[*width], coherent: false };
            engines[*engine].tracer.closest_batch(&chunk, &mut hits, batch);
            let judged = chunk.iter().zip(&hits).zip(&expected);
            *wrong += judged.filter(|((ray, hit), expected)| is_wrong(world, ray, **hit, **expected)).count() as u64;
        }
    }
    wrong
}

/// Whether exact arithmetic refutes an answer. The one that is judged stands where native's is judged, which is held to
/// exactness.
fn is_wrong(world: &World, ray: &Ray, hit: Option<Hit>, expected: Option<Hit>) -> bool {
    if hit.map(|hit| hit.id()) == expected.map(|hit| hit.id()) {
        return false;
    }
    let answers = Answers { native: hit, embree: expected, brute: None };
    classify_closest(world, ray, &answers) == Class::NativeWrong
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers as another engine, but for every tenth ray, of which it says that nothing is hit.
    struct Forgetful(Bvh);

    impl Tracer for Forgetful {
        fn closest(&self, ray: &Ray) -> Option<Hit> {
            self.0.closest(ray).filter(|hit| hit.t.to_bits() % 10 != 0)
        }

        fn occluded(&self, ray: &Ray) -> bool {
            self.closest(ray).is_some()
        }
    }

    #[test]
    fn native_is_never_wrong_and_what_forgets_hits_is() {
        let (subject, _) = Subject::new("terrain10", UpAxis::Y).expect("made by rule");
        let engine = |name: &str, tracer| Engine { name: name.to_owned(), tracer };
        let engines = [
            engine("native", Box::new(Bvh::build(&subject.world)) as Box<dyn Tracer>),
            engine("forgetful", Box::new(Forgetful(Bvh::build(&subject.world)))),
        ];
        let wrong = wrong_hits(&subject.world, &engines, &[(0, 0), (0, 1), (0, 2), (1, 0)], 5000);
        assert_eq!(wrong[..3], [0; 3]);
        assert!(wrong[3] > 50, "{wrong:?}");
    }
}
