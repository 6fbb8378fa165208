//! `twincast plan`: what a render of a scene would do, and what that saves.

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use serde::Serialize;

use super::accel::AccelArgs;
use super::build::BuildArgs;
use super::cache::CacheArgs;
use super::camera::CameraArgs;
use super::common::SceneArgs;
use super::engine::BackendArg;
use super::light::LightArgs;
use super::picture::PictureArgs;
use super::threads::{parse_threads, pool};
use super::{interrupt, progress, say, say_json, warn};
use crate::error::Result;
use crate::lab::savings::{Saving, Setup, Table};
use crate::plan::{self, Census, Complete, Plan, PlanReport, Reduction};
use crate::render::Control;
use crate::trace::accel::Accel;

/// How much is modelled.
#[derive(Clone, Debug, Args)]
pub(super) struct PlanArgs {
    /// What is modelled: no more than the scene needs, all of it (full), or named parts of what it does not need, so
    /// that what leaving them out saves can be told
    #[arg(long = "plan", value_name = "NAME,...", value_parser = parts(), value_delimiter = ',', default_value = NEEDED)]
    plan: Vec<Complete>,
}

const NEEDED: &str = "needed";
const FULL: &str = "full";

/// What each name asks to be modelled completely.
fn parts() -> impl TypedValueParser<Value = Complete> {
    let whole = [(NEEDED, "no more than the scene needs"), (FULL, "everything")];
    let each = Reduction::ALL.map(|reduction| (reduction.name(), reduction.words()));
    let values = whole.into_iter().chain(each).map(|(name, words)| PossibleValue::new(name).help(words));
    PossibleValuesParser::new(values).map(|name| match name.as_str() {
        FULL => Complete::ALL,
        name => {
            let named = Reduction::ALL.into_iter().filter(|reduction| reduction.name() == name);
            named.fold(Complete::NOTHING, Complete::with)
        }
    })
}

impl PlanArgs {
    /// What is modelled whether it is needed or not.
    pub(super) fn complete(&self) -> Complete {
        self.plan.iter().copied().fold(Complete::NOTHING, Complete::union)
    }
}

/// Say what a render of a scene would do: no more than the scene needs
///
/// Counts what is in the scene, and says what follows: accelerator, how well its tree is built, levels, integrator,
/// lights, what is computed at each hit, how many rays there will be, and what of the complete model is left out.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  twincast plan room.glb
  twincast plan room.glb --size 3840x2160 --spp 256 --json
  twincast plan room.glb --measure 9 --size 640x480 --spp 1 --threads 1")]
pub(super) struct PlanCommand {
    #[command(flatten)]
    scene: SceneArgs,

    /// Engine
    #[arg(long, value_enum, default_value_t)]
    backend: BackendArg,

    #[command(flatten)]
    picture: PictureArgs,

    #[command(flatten)]
    accel: AccelArgs,

    #[command(flatten)]
    build: BuildArgs,

    #[command(flatten)]
    light: LightArgs,

    /// Measure what leaving each thing out saves, by the native BVH: renders with it and without, in turn, so often
    /// each
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    measure: Option<u32>,

    /// Threads; 0 is one for each core
    #[arg(short, long, value_name = "N", default_value_t = 0, value_parser = parse_threads)]
    threads: usize,

    /// Print one JSON document, and nothing else
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    camera: CameraArgs,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    plan: &'a PlanReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<&'a [Saving]>,
}

pub(super) fn run(args: &PlanCommand) -> Result<()> {
    args.backend.check_available()?;
    let cache = CacheArgs::default();
    args.accel.check(args.backend, Some(&args.build), &cache)?;
    args.build.check_file(args.backend, &args.scene.scene)?;
    let cancel = interrupt::install()?;
    let (mut scene, warnings) = args.scene.load(args.camera.has_shutter())?;
    warn(&warnings);
    args.light.apply(&mut scene)?;
    let accel = args.accel.choose(scene.request.search, args.backend, Some(&args.build), &cache)?.0;
    let settings = args.picture.settings(&scene.request, args.backend.best_width());
    settings.check()?;
    let world = plan::world(&scene, settings.complete)?;
    let census = Census::new(&scene, &world);
    let options = settings.plan_options();
    let plan = Plan::of_census(&scene, &world, &options, &census);
    let left_out = plan.left_out(&scene, &world, &options, &census);
    let rays = settings.expected_rays(&plan);
    let pixels = settings.window().len() as u64;
    let build = match accel {
        Accel::Bvh => args.build.choose(args.backend, world.stored_triangles(), &rays, pixels, &[])?,
        _ => None,
    };
    let accelerator = if args.backend == BackendArg::Embree { "embree" } else { accel.name() };
    let name = args.scene.scene.display().to_string();
    let report = PlanReport::new(name, census, &plan, &left_out, (accelerator, build.as_ref()), rays);
    let measured = match args.measure {
        None => None,
        Some(repeat) => {
            let aspect = f64::from(settings.width) / f64::from(settings.height);
            let (camera, _) = args.camera.choose(&scene, aspect)?;
            let pool = pool(args.threads)?;
            let renders = 2 * (u64::from(repeat) + 1) * (left_out.len() as u64 + 1);
            let bar = progress::bar(renders * pixels, "measuring", args.json);
            let on_tile = |pixels| bar.inc(pixels);
            let control = Control { cancel: Some(cancel), on_tile: Some(&on_tile), ..Control::default() };
            let (scene, camera, settings) = (&scene, &camera, &settings);
            let setup = Setup { scene, camera, settings, repeat: repeat as usize, control };
            let rows = pool.install(|| setup.run(&left_out));
            bar.finish_and_clear();
            Some(rows?)
        }
    };
    if args.json {
        return say_json(&Document { plan: &report, measured: measured.as_deref() });
    }
    say(report.to_string().trim_end())?;
    measured.map_or(Ok(()), |rows| say(Table(&rows).to_string().trim_end()))
}
