//! `twincast render`: from a scene file to finished pictures.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};

use super::build::BuildArgs;
use super::cache::CacheArgs;
use super::camera::{CameraArgs, camera_flags};
use super::common::{SceneArgs, Size, parse_vector};
use super::engine::{BackendArg, Job, Outcome};
use super::metadata::metadata;
use super::report::{EngineStats, Rays, Stats, Summary, counted, grouped, peak_memory, size, time};
use super::{interrupt, outputs, say, warn};
use crate::error::{Error, Result};
use crate::image::{self, Image};
use crate::io;
use crate::math::{DVec3, Vec3};
use crate::plan::BuildChoice;
use crate::render::{Filter, Renderer, Sampling, Settings, TileOrder};
use crate::scene::{Geometry, Light, Request, Scene};
use crate::trace::bvh::Preset;
use crate::trace::{Batch, Primitives, Width, World};

/// Render a scene
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  twincast render bunny.glb -o bunny.png
  twincast render scan.ply --up-axis z --unit mm --normals smooth -o scan.exr -o scan.png
  twincast render city.glb --backend both --size 1920x1080 --spp 16 -o city.exr
  twincast render large.ply --cache ~/.cache/twincast -o large.png
  twincast render part.stl --eye 1,2,3 --look-at 0,0,0 --fov 30 -o part.png --stats part.json")]
pub(super) struct RenderArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// Picture to write; the suffix decides the format (may be repeated; default: what the scene names, in the current
    /// folder)
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,

    /// Engine
    #[arg(long, value_enum, default_value_t)]
    backend: BackendArg,

    /// Pixels (default: the scene's, else 1280x720)
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,

    /// Samples a pixel; 1 is the pixel's centre (default: the scene's, else 4)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65536))]
    spp: Option<u32>,

    /// How often a ray may be mirrored or refracted; what it would see after that is black (default: the scene's, else 5)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=1000))]
    max_depth: Option<u32>,

    /// Print the camera as flags that give it again; without --output, do nothing else
    #[arg(long)]
    print_camera: bool,

    /// Picture of the same size to compare with; exit code 1 if it differs by more than --threshold
    #[arg(long, value_name = "FILE", requires = "output")]
    reference: Option<PathBuf>,

    /// Largest root mean square difference of the linear channels that passes
    #[arg(long, value_name = "X", default_value_t = 0.01, value_parser = parse_threshold, requires = "reference")]
    threshold: f64,

    /// Threads; 0 is one for each core
    #[arg(short, long, value_name = "N", default_value_t = 0, value_parser = parse_threads)]
    threads: usize,

    /// Chooses among equally good sample patterns (default: the scene's, else 0)
    #[arg(long, value_name = "N")]
    seed: Option<u64>,

    /// How samples are spread: sobol, blue-noise, halton, stratified or independent
    #[arg(long, value_name = "NAME", default_value_t)]
    sampler: Sampling,

    /// How samples become a pixel: box, tent, gaussian, mitchell or blackman-harris
    #[arg(long, value_name = "NAME", default_value_t)]
    filter: Filter,

    /// Write times, rays, rays a second and memory as JSON
    #[arg(long, value_name = "FILE.json", requires = "output")]
    stats: Option<PathBuf>,

    /// Rays traced together (default: 8 for embree, else 1); never changes a native picture
    #[arg(long, value_name = "N")]
    packet: Option<Packet>,

    #[command(flatten)]
    build: BuildArgs,

    #[command(flatten)]
    cache: CacheArgs,

    /// Order of the tiles; never changes a picture
    #[arg(long, value_enum, default_value_t)]
    tile_order: Order,

    /// Linear colour behind the scene, opaque (default: the scene's, transparent where it has none)
    #[arg(long, value_name = "R,G,B", value_parser = parse_color)]
    background: Option<Vec3>,

    /// Light with hard shadows that comes from this direction, in place of the scene's lights
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_direction, allow_hyphen_values = true)]
    sun: Option<DVec3>,

    /// Say more: plan, rays, memory
    #[arg(short, long, conflicts_with = "quiet")]
    verbose: bool,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    quiet: bool,

    // Last, for clap puts what follows a heading under it.
    #[command(flatten)]
    camera: CameraArgs,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Packet {
    #[value(name = "1")]
    One,
    #[value(name = "4")]
    Four,
    #[value(name = "8")]
    Eight,
    #[value(name = "16")]
    Sixteen,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Order {
    /// Row by row from the top
    Scanline,
    /// Along a curve from neighbour to neighbour
    #[default]
    Hilbert,
    /// From the middle outwards
    Spiral,
}

pub(super) fn run(args: &RenderArgs) -> Result<()> {
    args.backend.check_available()?;
    let cancel = interrupt::install()?;
    if args.output.is_empty() && !args.print_camera && !io::may_name_a_picture(&args.scene.scene) {
        return Err(no_picture());
    }
    outputs::check(&args.output, &args.stats, args.inputs())?;
    let cache = args.cache.open(args.backend)?;
    let reference = args.reference.as_deref().map(image::read).transpose()?;

    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build();
    let pool = pool.map_err(|error| Error::Usage(format!("--threads {}: {error}", args.threads)))?;
    pool.install(|| {
        let start = Instant::now();
        let (mut scene, warnings) = args.scene.load_with_bar(args.quiet)?;
        warn(&warnings);
        if let Some(sun) = args.sun {
            scene.lights = vec![Light::Directional { direction: -sun, color: Vec3::ONE }];
        }
        let load_seconds = start.elapsed().as_secs_f64();
        interrupt::check()?;

        let settings = args.settings(&scene.request);
        let (width, height) = (settings.width, settings.height);
        args.check_reference(reference.as_ref(), width, height)?;
        let pictures = args.pictures(&scene.request)?;
        let aspect = f64::from(width) / f64::from(height);
        let (camera, camera_source) = args.camera.choose(&scene, aspect)?;
        if args.print_camera {
            say(camera_flags(&camera, &scene.bounds()))?;
            if pictures.is_empty() {
                return Ok(());
            }
        }

        let start = Instant::now();
        let world = World::new(&scene)?;
        let renderer = Renderer::new(&scene, &world, camera.clone(), settings.clone())?;
        let prepare_seconds = start.elapsed().as_secs_f64();
        interrupt::check()?;

        let pixels = u64::from(width) * u64::from(height);
        let stored = stored_triangles(&world);
        let build =
            args.build.choose(args.backend, stored, pixels * u64::from(settings.spp), pixels, renderer.plan())?;
        let job = Job {
            world: &world,
            renderer: &renderer,
            pixels,
            cancel,
            quiet: args.quiet,
            build: build.as_ref().map_or(Preset::Default, |build| build.preset),
            cache: cache.as_ref(),
        };
        let outcome = job.run(args.backend)?;
        let picture = &outcome.passes[0];

        let start = Instant::now();
        let metadata = metadata(&camera, &settings, picture.render_seconds);
        outputs::write_pictures(&pictures, &picture.image, &metadata)?;
        let write_seconds = start.elapsed().as_secs_f64();

        let stats = Stats {
            scene: args.scene.scene.display().to_string(),
            triangles: placed_triangles(&scene),
            size: [width, height],
            spp: settings.spp,
            threads: rayon::current_num_threads(),
            packet: settings.batch.width.rays(),
            load_seconds,
            prepare_seconds,
            write_seconds,
            peak_memory: peak_memory(),
            engines: outcome
                .passes
                .iter()
                .map(|pass| EngineStats::new(pass, stored, pixels * u64::from(settings.spp)))
                .collect(),
        };
        if let Some(path) = &args.stats {
            outputs::write_json(path, &stats)?;
        }
        if !args.quiet {
            let mut summary = args.summary(&scene, &renderer, &camera_source, build.as_ref(), &stats);
            pictures.iter().chain(&args.stats).for_each(|path| summary.line("wrote", path.display()));
            say(summary)?;
        }
        args.judge(&outcome, reference.as_ref())
    })
}

impl RenderArgs {
    /// What the flags say, else the scene's file, else what is usual.
    fn settings(&self, request: &Request) -> Settings {
        let usual = Settings::default();
        let size = self.size.map(|size| [size.width, size.height]).or(request.size);
        let [columns, rows] = size.unwrap_or([usual.width, usual.height]);
        let width = match self.packet {
            None => self.backend.best_width(),
            Some(Packet::One) => Width::One,
            Some(Packet::Four) => Width::Four,
            Some(Packet::Eight) => Width::Eight,
            Some(Packet::Sixteen) => Width::Sixteen,
        };
        Settings {
            width: columns,
            height: rows,
            spp: self.spp.or(request.spp).unwrap_or(usual.spp),
            seed: self.seed.or(request.seed).unwrap_or(usual.seed),
            sampling: self.sampler,
            filter: self.filter,
            max_depth: self.max_depth.or(request.max_depth).unwrap_or(usual.max_depth),
            batch: Batch { width, coherent: true },
            tile_order: match self.tile_order {
                Order::Scanline => TileOrder::Scanline,
                Order::Hilbert => TileOrder::Hilbert,
                Order::Spiral => TileOrder::Spiral,
            },
            background: self.background,
        }
    }

    /// The pictures to write: those of the flags, else the one that the scene names.
    fn pictures(&self, request: &Request) -> Result<Vec<PathBuf>> {
        if !self.output.is_empty() || self.print_camera {
            return Ok(self.output.clone());
        }
        // Of what a scene names the folder is left out: a scene must not choose whose files are replaced.
        let named = request.output.as_ref().and_then(|name| Path::new(name).file_name());
        let Some(picture) = named.map(PathBuf::from) else {
            return Err(no_picture());
        };
        let pictures = vec![picture];
        outputs::check(&pictures, &self.stats, self.inputs())?;
        Ok(pictures)
    }

    /// The files it reads.
    fn inputs(&self) -> impl Iterator<Item = &PathBuf> {
        [Some(&self.scene.scene), self.reference.as_ref()].into_iter().flatten()
    }

    fn check_reference(&self, reference: Option<&Image>, width: u32, height: u32) -> Result<()> {
        let (Some(picture), Some(path)) = (reference, &self.reference) else { return Ok(()) };
        if (picture.width, picture.height) == (width, height) {
            return Ok(());
        }
        let own = format_args!("{}x{}", picture.width, picture.height);
        let message = format!("--reference {}: it is {own}, and the picture {width}x{height}", path.display());
        Err(Error::Usage(message))
    }

    fn summary(
        &self,
        scene: &Scene,
        renderer: &Renderer,
        camera_source: &str,
        build: Option<&BuildChoice>,
        stats: &Stats,
    ) -> Summary {
        let mut summary = Summary::default();
        let parts = [
            counted(stats.triangles, "triangle", "triangles"),
            counted(scene.materials.len() as u64, "material", "materials"),
            counted(scene.lights.len() as u64, "light", "lights"),
        ];
        summary.line("scene", format_args!("{}: {}", stats.scene, parts.join(", ")));
        if self.verbose {
            summary.line("plan", renderer.plan());
            if let Some(build) = build {
                summary.line("build", format_args!("{}: {}", build.preset.name(), build.why));
            }
        }
        summary.line("camera", camera_source);
        let [width, height] = stats.size;
        let samples = counted(u64::from(stats.spp), "sample", "samples");
        let threads = counted(stats.threads as u64, "thread", "threads");
        summary.line("picture", format_args!("{width}x{height}, {samples} a pixel, {threads}"));
        if self.verbose {
            summary.line("load", format_args!("{}, prepare {}", time(stats.load_seconds), time(stats.prepare_seconds)));
        }
        for engine in &stats.engines {
            let (build, render) = (time(engine.build_seconds), time(engine.render_seconds));
            summary.line("backend", format_args!("{}: build {build}, render {render}", engine.backend));
            if self.verbose {
                if let Some(cache) = &engine.cache {
                    summary.line("cache", cache);
                }
                let Rays { camera, sent_on, shadow } = &engine.rays;
                let speed = engine.rays_per_second / 1e6;
                let (camera, shadow) = (grouped(*camera), grouped(*shadow));
                let sent_on = if *sent_on > 0 { format!(" + {} sent on", grouped(*sent_on)) } else { String::new() };
                summary.line(
                    "rays",
                    format_args!("{camera} camera{sent_on} + {shadow} shadow, {speed:.2} million a second"),
                );
                let each = engine.bytes_per_triangle.map(|b| format!(", {b:.0} B a triangle")).unwrap_or_default();
                summary.line("memory", format_args!("{}{each}", size(engine.bytes as u64)));
            }
        }
        if let (true, Some(peak)) = (self.verbose, stats.peak_memory) {
            summary.line("peak", format_args!("{} of memory for everything", size(peak)));
        }
        summary
    }

    /// Says how the checks that were asked for went; an error where one did not hold.
    fn judge(&self, outcome: &Outcome, reference: Option<&Image>) -> Result<()> {
        let mut checks = Vec::new();
        checks.extend(outcome.verdict.clone());
        if let (Some(reference), Some(path)) = (reference, &self.reference) {
            let rmse = outcome.passes[0].image.difference(reference)?.rmse;
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

fn no_picture() -> Error {
    Error::Usage("no picture to write: name one with --output FILE; the scene names none".to_owned())
}

fn placed_triangles(scene: &Scene) -> u64 {
    let triangles = |geometry: &Geometry| match geometry {
        Geometry::Mesh(mesh) => mesh.triangles.len() as u64,
        Geometry::Shapes { .. } => 0,
    };
    let placed = scene.instances.iter().flat_map(|instance| scene.group_geometries(instance.group));
    placed.map(|(_, geometry)| triangles(geometry)).sum()
}

fn stored_triangles(world: &World) -> u64 {
    let triangles = world.parts.iter().map(|part| match &part.primitives {
        Primitives::Triangles { triangles, .. } => triangles.len() as u64,
        Primitives::Shapes(_) => 0,
    });
    triangles.sum()
}

fn parse_threshold(text: &str) -> std::result::Result<f64, String> {
    let limit = text.parse().ok().filter(|limit: &f64| *limit >= 0.0 && limit.is_finite());
    limit.ok_or_else(|| "expected a number, at least 0".to_owned())
}

pub(super) fn parse_threads(text: &str) -> std::result::Result<usize, String> {
    text.parse().ok().filter(|&n| n <= 4096).ok_or_else(|| "expected a number from 0 to 4096".to_owned())
}

/// As a unit vector.
fn parse_direction(text: &str) -> std::result::Result<DVec3, String> {
    let direction = parse_vector(text)?.try_normalize();
    direction.ok_or_else(|| "expected a direction, which is not zero".to_owned())
}

fn parse_color(text: &str) -> std::result::Result<Vec3, String> {
    let color = parse_vector(text)?.as_vec3();
    let valid = color.is_finite() && color.cmpge(Vec3::ZERO).all();
    valid.then_some(color).ok_or_else(|| "expected three numbers of at least 0".to_owned())
}
