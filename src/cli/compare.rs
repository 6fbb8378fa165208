//! `twincast compare`: both engines on the rays of a picture and on difficult ones, every difference judged.

use std::path::PathBuf;

use clap::Args;

use super::accel::AccelArgs;
use super::cache::CacheArgs;
use super::camera::CameraArgs;
use super::common::{SceneArgs, Size, needs};
use super::engine::BackendArg;
use super::plan::PlanArgs;
use super::{interrupt, say_report, warn};
use crate::error::Result;
use crate::plan;
use crate::render::Settings;
use crate::scene::{Camera, MAX_SPP, Scene};

/// Compare native with Embree on every ray of a picture and on difficult rays
///
/// Where they differ, exact arithmetic decides: agree, tie (two primitives at an equal t), boundary (within f32
/// rounding of an edge, a silhouette or an end of the ray's range), native_wrong, embree_wrong. Under 20,000 primitives
/// brute force is asked as well. Exit code 1 if native is wrong anywhere, or if a pixel differs and no ray explains it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  twincast compare bunny.glb
  twincast compare scan.ply --up-axis z --size 1920x1080 --random 1000000 --json
  twincast compare part.stl --diff difference.png
  twincast compare bunny.glb --accel kd-tree
  twincast compare bunny.glb --all")]
pub(super) struct CompareArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// Pixels of the picture whose rays are compared
    #[arg(long, value_name = "WxH", default_value = "640x480")]
    size: Size,

    /// Samples a pixel; 1 is the pixel's centre
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SPP)))]
    spp: u32,

    #[command(flatten)]
    camera: CameraArgs,

    /// Difficult rays: at corners and edges, along axes, from far away, between surfaces
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    random: u64,

    /// Chooses the difficult rays, and among equally good sample patterns
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    #[command(flatten)]
    plan: PlanArgs,

    #[command(flatten)]
    accel: AccelArgs,

    /// Hold every accelerator, and Embree where it is built, against brute force, on as many of the rays as that has
    /// time for; exit code 1 if any of this program's own differs on one, with textbooks' methods in what it names
    #[arg(long, conflicts_with_all = ["accel", "diff", "folder", "spp"])]
    all: bool,

    /// Most seconds that brute force takes with --all (default: 10)
    #[arg(long, value_name = "SECONDS", requires = "all")]
    seconds: Option<u64>,

    #[command(flatten)]
    cache: CacheArgs,

    /// Print the counts as one JSON document, and nothing else
    #[arg(long)]
    json: bool,

    /// Write a picture of the absolute differences; the suffix decides the format
    #[arg(long, value_name = "FILE")]
    diff: Option<PathBuf>,
}

impl CompareArgs {
    /// The scene, and from where it is seen.
    fn view(&self) -> Result<(Scene, Camera)> {
        let (scene, warnings) = self.scene.load(self.camera.has_shutter())?;
        warn(&warnings);
        interrupt::check()?;
        let (camera, _) = self.camera.choose(&scene, f64::from(self.size.width) / f64::from(self.size.height))?;
        Ok((scene, camera))
    }

    /// Of the picture: rays are sent on as, and as often as, the scene asks for.
    fn settings(&self, scene: &Scene) -> Settings {
        let Size { width, height } = self.size;
        let usual = Settings::default();
        let max_depth = scene.request.max_depth.or(usual.max_depth);
        let complete = self.plan.complete();
        Settings { width, height, max_depth, integrator: scene.request.integrator, seed: self.seed, complete, ..usual }
    }
}

pub(super) fn run(args: &CompareArgs) -> Result<()> {
    if args.all {
        return compare_all(args);
    }
    needs(("--seconds", args.seconds.is_some()), ("--all", false))?;
    BackendArg::Both.check_available()?;
    compare(args)
}

#[cfg(not(feature = "embree"))]
fn compare(_: &CompareArgs) -> Result<()> {
    unreachable!("check_available refused it")
}

#[cfg(feature = "embree")]
fn compare(args: &CompareArgs) -> Result<()> {
    use super::{cache, outputs, progress};
    use crate::image::{Metadata, WriteOptions};
    use crate::lab::Setup;
    use crate::lab::compare::BRUTE_LIMIT;
    use crate::output::AtomicWrites;
    use crate::render::{Control, Renderer};
    use crate::trace::Tracer;
    use crate::trace::accel::{Accel, Built};
    use crate::trace::brute::Brute;
    use crate::trace::bvh;
    use crate::trace::embree::{Embree, Options};

    args.accel.check(BackendArg::Both, None, &args.cache)?;
    let diff = args.diff.as_slice();
    outputs::check(diff, None, [&args.scene.scene])?;
    let cache = args.cache.open(BackendArg::Both)?;
    let cancel = interrupt::install()?;
    let (scene, camera) = args.view()?;
    outputs::spare(diff, &scene.files)?;
    let (accel, options) = args.accel.choose(scene.request.search, BackendArg::Both, None, &args.cache)?;
    let world = plan::world(&scene, args.plan.complete())?;
    let settings = Settings { spp: args.spp, ..args.settings(&scene) };
    let Settings { width, height, .. } = settings;
    let renderer = Renderer::new(&scene, &world, camera, settings)?;
    let native = match accel {
        Accel::Bvh => Built::from(cache::bvh(cache.as_ref(), &world, bvh::Options::default()).0),
        _ => accel.build(&world, &options),
    };
    let embree = Embree::new(&world, &Options::default())?;
    let brute = (world.primitive_count() < BRUTE_LIMIT).then(|| Brute::new(&world));
    interrupt::check()?;

    let name = args.scene.scene.display().to_string();
    let setup = Setup {
        scene: &name,
        renderer: &renderer,
        native: &native,
        is_exact: options.are_exact_for(accel),
        embree: &embree,
        brute: brute.as_ref().map(|brute| brute as &dyn Tracer),
        random: args.random,
        seed: args.seed,
    };
    // The picture is traced three times: by each engine, and by both.
    let bar = progress::bar(3 * u64::from(width) * u64::from(height), "comparing", args.json);
    let on_tile = |pixels| bar.inc(pixels);
    let comparison = setup.run(Control { cancel: Some(cancel), on_tile: Some(&on_tile), ..Control::default() })?;
    bar.finish_and_clear();

    let (a, b) = (&comparison.native_image, &comparison.embree_image);
    let mut written = Ok(());
    if !diff.is_empty() {
        let (picture, mut files) = (a.difference_image(b)?, AtomicWrites::default());
        outputs::write_pictures(&mut files, diff, &picture, &[], &Metadata::default(), &WriteOptions::default());
        written = outputs::commit(files);
    }
    let report = &comparison.report;
    say_report(args.json, report)?;
    written.and_then(|()| report.check())
}

/// Every accelerator against brute force.
fn compare_all(args: &CompareArgs) -> Result<()> {
    use super::progress;
    use crate::lab::{Entrant, all};
    use crate::render::{Control, Renderer};
    use crate::trace::accel::Accel;

    let cancel = interrupt::install()?;
    let (scene, camera) = args.view()?;
    let options = args.accel.options.choose(&Accel::ALL, scene.request.search)?;
    let world = plan::world(&scene, args.plan.complete())?;
    let settings = Settings { spp: 1, ..args.settings(&scene) };
    let Settings { width, height, .. } = settings;
    let renderer = Renderer::new(&scene, &world, camera, settings)?;
    let bar = progress::bar(Entrant::all().len() as u64, "comparing", args.json);
    let setup = all::Setup {
        scene: &args.scene.scene.display().to_string(),
        renderer: &renderer,
        size: (width, height),
        random: args.random,
        seed: args.seed,
        longest: std::time::Duration::from_secs(args.seconds.unwrap_or(10)),
        options: &options,
    };
    let report =
        setup.run(Control { cancel: Some(cancel), on_tile: Some(&|done| bar.inc(done)), ..Control::default() });
    bar.finish_and_clear();
    let report = report?;
    say_report(args.json, &report)?;
    report.check()
}
