//! `twincast render`: from a scene file to finished pictures.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use clap::Args;
use rayon::ThreadPool;

use super::accel::AccelArgs;
use super::aov::AovArgs;
use super::build::BuildArgs;
use super::cache::CacheArgs;
use super::camera::{CameraArgs, camera_flags};
use super::checkpoint::{CheckpointArgs, Kept};
use super::common::SceneArgs;
use super::denoise::{DenoiseArgs, Denoising};
use super::display::{Display, parse_address};
use super::engine::{BackendArg, Job, Outcome, Pass};
use super::explain::ExplainArgs;
use super::frames::{self, FrameArgs};
use super::light::LightArgs;
use super::picture::PictureArgs;
use super::report::Stats;
use super::request::{RenderRequest, no_picture};
use super::response::{ResponseArgs, beyond_numbers, too_bright};
use super::summary::Rendered;
use super::threads::{parse_threads, pool};
use super::trial::Trial;
use super::{interrupt, outputs, say, warn};
use crate::error::{Error, Result, Warning};
use crate::image::{self, Metadata, Reference, Response, WriteOptions};
use crate::io::Format;
use crate::memory::process;
use crate::output::AtomicWrites;
use crate::plan::{self, BuildChoice};
use crate::render::Renderer;
use crate::trace::accel::Accel;
use crate::trace::bvh::{Preset, prepare_thread};

/// Render a scene
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Examples:
  twincast render bunny.glb -o bunny.png
  twincast render scan.ply --up-axis z --unit mm --normals smooth -o scan.exr -o scan.png
  twincast render city.glb --backend both --size 1920x1080 --spp 16 -o city.exr
  twincast render large.ply --cache ~/.cache/twincast -o large.png
  twincast render bunny.glb --accel kd-tree -o bunny.png
  twincast render part.stl --eye 1,2,3 --look-at 0,0,0 --fov 30 -o part.png --stats part.json
  twincast render fox.glb --animation Walk --time 0.5 --shutter 0,0.5 -o fox.png
  twincast render fox.glb --animation Walk --frames 0-23 --skip-existing -o walk.%04d.png
  twincast render room.glb --integrator path --spp 64 --denoise -o room.png
  twincast render room.glb --integrator path --noise 0.01 --aov all --checkpoint 60s -o room.exr")]
pub(super) struct RenderArgs {
    #[command(flatten)]
    pub(super) scene: SceneArgs,

    #[command(flatten)]
    pub(super) frames: FrameArgs,

    /// Picture to write; the suffix decides the format (may be repeated; default: what the scene names, in the current
    /// folder)
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: Vec<PathBuf>,

    /// Engine
    #[arg(long, value_enum, default_value_t)]
    pub(super) backend: BackendArg,

    #[command(flatten)]
    pub(super) picture: PictureArgs,

    #[command(flatten)]
    pub(super) aov: AovArgs,

    #[command(flatten)]
    denoise: DenoiseArgs,

    #[command(flatten)]
    pub(super) checkpoint: CheckpointArgs,

    /// Print the camera as flags that give it again; without --output, do nothing else
    #[arg(long)]
    pub(super) print_camera: bool,

    /// Picture of the same size to compare with, as its format would hold this one; exit code 1 if they differ by more
    /// than --threshold
    #[arg(long, value_name = "FILE", requires = "output")]
    pub(super) reference: Option<PathBuf>,

    /// Largest root mean square difference of the linear channels that passes
    #[arg(long, value_name = "X", default_value_t = 0.01, value_parser = parse_threshold, requires = "reference")]
    threshold: f64,

    /// Threads; 0 is one for each core
    #[arg(short, long, value_name = "N", default_value_t = 0, value_parser = parse_threads)]
    threads: usize,

    /// Write times, rays, rays a second and memory as JSON
    #[arg(long, value_name = "FILE.json", requires = "output")]
    pub(super) stats: Option<PathBuf>,

    #[command(flatten)]
    pub(super) accel: AccelArgs,

    #[command(flatten)]
    pub(super) build: BuildArgs,

    #[command(flatten)]
    pub(super) cache: CacheArgs,

    #[command(flatten)]
    pub(super) light: LightArgs,

    /// Viewer that shows the picture while it is made: where tev listens
    #[arg(long, value_name = "HOST:PORT", value_parser = parse_address)]
    display_server: Option<String>,

    /// Say more: plan, rays, memory
    #[arg(short, long, conflicts_with = "quiet")]
    verbose: bool,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    pub(super) quiet: bool,

    // Last, for clap puts what follows a heading under it.
    #[command(flatten)]
    pub(super) camera: CameraArgs,

    #[command(flatten)]
    response: ResponseArgs,

    #[command(flatten)]
    pub(super) explain: ExplainArgs,
}

pub(super) fn run(args: &RenderArgs) -> Result<()> {
    if args.frames.are_given() {
        return frames::run(args, render);
    }
    render(args)
}

/// Renders one picture.
fn render(args: &RenderArgs) -> Result<()> {
    args.backend.check_available()?;
    args.explain.check(args.backend)?;
    args.accel.check(args.backend, Some(&args.build), &args.cache)?;
    args.build.check_file(args.backend, &args.scene.scene)?;
    let cancel = interrupt::install()?;
    let may_be_without = args.print_camera || args.explain.is_wanted();
    if args.output.is_empty()
        && !may_be_without
        && !Format::of(&args.scene.scene).is_some_and(Format::may_name_a_picture)
    {
        return Err(no_picture());
    }
    outputs::check_places(&args.output, &args.stats, &args.inputs())?;
    let pool = pool(args.threads)?;
    // Starting a thread takes the dynamic loader's lock, which is held as long as a library is being loaded: so all
    // threads are started, and have what ends with them, before the trial loads any.
    pool.broadcast(|_| prepare_thread());
    let trial = Trial::start(args.output.clone(), cancel)?;
    trial.join(produce(args, &pool, cancel))
}

/// What is left once it is known that there will be a picture.
fn produce(args: &RenderArgs, pool: &ThreadPool, cancel: &AtomicBool) -> Result<()> {
    let denoising = args.denoise.open(&args.aov.aovs())?;
    let cache = args.cache.open(args.backend)?;
    let reference = args.reference.as_deref().map(Reference::read).transpose()?;
    let title = || args.scene.scene.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let display = args.display_server.as_deref().map(|address| Display::connect(address, title())).transpose()?;

    pool.install(|| {
        let request = args.request(denoising.as_ref(), reference.as_ref())?;
        let RenderRequest { scene, settings, camera, accel, .. } = &request;
        if args.print_camera {
            say(camera_flags(camera, &scene.bounds()))?;
            if request.pictures.is_empty() {
                return Ok(());
            }
        }

        let start = Instant::now();
        let world = plan::world(scene, settings.complete)?;
        let renderer = Renderer::new(scene, &world, camera.clone(), settings.clone())?;
        let prepare_seconds = start.elapsed().as_secs_f64();
        interrupt::check()?;
        if args.explain.is_wanted() {
            return args.explain.run(&world, &renderer, args.backend, accel);
        }

        let build = args.choose_build(&request, &renderer)?;
        let job = Job {
            world: &world,
            renderer: &renderer,
            pixels: request.pixels(),
            cancel,
            quiet: args.quiet,
            build: build.as_ref().map_or(Preset::Default, |build| build.preset),
            accel,
            cache: cache.as_ref(),
            display: display.as_ref(),
            kept: request.kept.as_ref(),
        };
        let outcome = job.run(args.backend).and_then(|mut outcome| {
            let denoise =
                |denoising: &Denoising| denoising.run(&mut outcome.passes[0], cancel, display.as_ref(), args.quiet);
            let denoised = denoising.as_ref().map(denoise).transpose()?;
            Ok((outcome, denoised))
        });
        warn(display.and_then(Display::finish).as_slice());
        if !args.quiet
            && interrupt::is_wanted()
            && let (Err(Error::Interrupted), Some(kept)) = (&outcome, &request.kept)
        {
            kept.tell()?;
        }
        let (outcome, denoise) = outcome?;
        let stats = Stats {
            prepare_seconds,
            denoise,
            ..Stats::new(&args.scene.scene.display().to_string(), &world, &request, &outcome)
        };
        let stats = args.write(&request, &outcome, stats)?;
        if !args.quiet {
            let camera = &request.camera_source;
            let mut summary = Rendered { scene, renderer: &renderer, camera, build: build.as_ref(), stats: &stats }
                .summary(args.verbose);
            request.pictures.iter().chain(&args.stats).for_each(|path| summary.line("wrote", path.display()));
            say(summary)?;
        }
        args.judge(&outcome, reference.as_ref(), &args.response.choose(&scene.request))
    })
}

impl RenderArgs {
    /// How well the native tree is worth building for this render; none where another accelerator was named, whose
    /// choice it is.
    fn choose_build(&self, request: &RenderRequest, renderer: &Renderer<'_>) -> Result<Option<BuildChoice>> {
        if request.accel.0 != Accel::Bvh {
            return Ok(None);
        }
        let settings = &request.settings;
        let rays = settings.expected_rays(renderer.plan());
        let triangles = renderer.world().stored_triangles();
        self.build.choose(self.backend, triangles, &rays, request.pixels(), &settings.aovs)
    }

    /// Writes pictures and statistics, and puts them in place together; the statistics with the time that took.
    fn write(&self, request: &RenderRequest, outcome: &Outcome, stats: Stats) -> Result<Stats> {
        let mut files = AtomicWrites::default();
        let write_seconds = self.write_pictures(&mut files, request, &outcome.passes[0]);
        let stats = Stats { write_seconds, peak_memory: process::peak(), ..stats };
        if let Some(path) = &self.stats {
            outputs::write_json(&mut files, path, &stats);
        }
        outputs::commit(files)?;
        request.kept.as_ref().map_or(Ok(()), Kept::remove)?;
        Ok(stats)
    }

    /// Writes the pictures, to be put in place with `files`; in how many seconds.
    fn write_pictures(&self, files: &mut AtomicWrites, request: &RenderRequest, pass: &Pass) -> f64 {
        let start = Instant::now();
        let picture = &pass.picture;
        let mean_spp = picture.samples as f64 / request.pixels() as f64;
        let metadata = Metadata {
            samples_per_pixel: Some(mean_spp.round() as u32),
            texts: picture.texts.clone(),
            render_time_seconds: Some(pass.render_seconds),
            ..Metadata::of_camera(&request.camera, &request.settings)
        };
        let response = self.response.choose(&request.scene.request);
        let options = WriteOptions { response, ..WriteOptions::default() };
        outputs::write_pictures(files, &request.pictures, &picture.image, &picture.channels, &metadata, &options);
        let of_codes = request.pictures.iter().find(|path| !image::keeps_radiance(path));
        let beyond = request.pictures.first().zip(beyond_numbers(&picture.image, &request.settings.window()));
        let bright = |path| Some((path, too_bright(&picture.image, &options.response)?));
        let told = beyond.or_else(|| of_codes.and_then(bright));
        warn(told.map(|(path, message)| Warning::new(path, "", message)).as_slice());
        start.elapsed().as_secs_f64()
    }

    /// Says how the checks that were asked for went; an error where one did not hold.
    fn judge(&self, outcome: &Outcome, reference: Option<&Reference>, response: &Response) -> Result<()> {
        let mut checks = Vec::new();
        checks.extend(outcome.verdict.clone());
        if let (Some(reference), Some(path)) = (reference, &self.reference) {
            let rmse = reference.difference(&outcome.passes[0].picture.image, response)?.rmse;
            let (path, limit) = (path.display(), self.threshold);
            let above = if rmse <= limit { "within" } else { "above" };
            checks.push((format!("{path}: root mean square difference {rmse:.3e}, {above} {limit}"), rmse <= limit));
        }
        let (held, failed): (Vec<_>, Vec<_>) = checks.into_iter().partition(|(_, holds)| *holds);
        if !self.quiet {
            held.iter().try_for_each(|(words, _)| say(format_args!("{:<8}  {words}", "check")))?;
        }
        if failed.is_empty() {
            return Ok(());
        }
        Err(Error::Check(failed.into_iter().map(|(words, _)| words).collect::<Vec<_>>().join("; ")))
    }
}

fn parse_threshold(text: &str) -> std::result::Result<f64, String> {
    let limit = text.parse().ok().filter(|limit: &f64| *limit >= 0.0 && limit.is_finite());
    limit.ok_or_else(|| "expected a number, at least 0".to_owned())
}
