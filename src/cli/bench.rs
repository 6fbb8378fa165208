//! `twincast bench`: native and Embree against the clock, in turn.

use std::path::PathBuf;

use clap::builder::TypedValueParser;
use clap::{Args, ValueEnum};

use super::accel::{AccelOptionArgs, accels};
use super::common::{needs, parse_bytes, up_axes};
use super::engine::BackendArg;
use super::named::one_of;
use super::scaling;
use super::threads::parse_threads;
use crate::error::Result;
use crate::io::UpAxis;
use crate::lab::bench::{Kind, SIDE};
use crate::trace::accel::Accel;
use crate::trace::bvh::Isa;

/// Measure builds and rays of native and Embree, in turn
///
/// For each scene: builds (millions of triangles a second; bytes of trees and placements for each triangle) and rays
/// (millions a second) of every engine and mode, ray by ray and in packets of 8 and 16, and for each kind of ray
/// native's rate over Embree's, each at its best width: the median of the ratios within a turn. Rates move with
/// whatever else the machine does; only these ratios can be compared between runs. The answers are compared as well:
/// exit code 1 if native is wrong on a ray, textbooks' methods apart.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  twincast bench bunny.obj
  twincast bench scan.obj --up-axis z --rays primary,shadow --repeat 9
  twincast bench terrain1000 architecture instances --json --chart rates.svg
  twincast bench terrain3162 --modes default,fast,robust --threads 2
  twincast bench bunny.obj --modes default --accel binary-bvh,grid,octree,kd-tree
  twincast bench --scaling --max 10000000 --chart scaling.svg")]
pub(super) struct BenchArgs {
    /// Scene files, or scenes made by rule: terrainN (2 N^2 triangles), architecture (or architectureN: N storeys),
    /// instances (or instancesN: N placements of one mesh). All but terrains get a floor, two triangles that count
    #[arg(value_name = "SCENE", default_value = "terrain1000")]
    scenes: Vec<String>,

    /// Axis of the files that points up
    #[arg(long, value_name = "AXIS", value_parser = up_axes(), default_value = UpAxis::default().name())]
    up_axis: UpAxis,

    /// Kinds of rays
    #[arg(
        long,
        value_name = "KIND,...",
        value_parser = kinds(),
        value_delimiter = ',',
        default_value = "primary,diffuse,shadow,orthographic,sun,pixel"
    )]
    rays: Vec<Kind>,

    /// Modes: native's default, native-fast, native-high, native-compact, native-fast-compact; Embree's fast, robust,
    /// compact, and high (quality, fast otherwise)
    #[arg(
        long,
        value_name = "MODE,...",
        value_enum,
        value_delimiter = ',',
        default_value = "default,native-fast,native-high,native-compact,native-fast-compact,fast,robust,compact,high"
    )]
    modes: Vec<ModeArg>,

    /// Camera rays to a side, in whole tiles of 8 x 8; diffuse and shadow rays start where they hit
    #[arg(long, value_name = "N", default_value_t = SIDE as u32, value_parser = clap::value_parser!(u32).range(4..=16_384))]
    size: u32,

    /// Threads that build and trace; 0 is one for each core
    #[arg(short, long, value_name = "N", default_value_t = 1, value_parser = parse_threads)]
    pub(super) threads: usize,

    /// Instructions that both engines may use at most (default: what the processor has)
    #[arg(long, value_name = "ISA", value_parser = isas())]
    isa: Option<Isa>,

    /// How often everything is measured; builds of small meshes are measured up to 41 times
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    repeat: u32,

    /// Other accelerators to measure beside these modes: brute, groups, bvh, binary-bvh, grid, octree, kd-tree, bsp
    #[arg(long, value_name = "NAME,...", value_parser = accels(), value_delimiter = ',', hide_possible_values = true)]
    accel: Vec<Accel>,

    #[command(flatten)]
    options: AccelOptionArgs,

    /// Measure time against the number of triangles instead, for every accelerator: builds on --threads, rays on one.
    /// One that takes over 10 seconds for a step is not asked for more
    #[arg(long, conflicts_with_all = ["scenes", "up_axis", "rays", "modes", "size", "isa", "repeat", "accel", "grid", "triangle_method", "sphere_method"])]
    scaling: bool,

    /// Most triangles of --scaling (default: 1000000)
    #[arg(long, value_name = "N", requires = "scaling", value_parser = clap::value_parser!(u64).range(10..=100_000_000))]
    pub(super) max: Option<u64>,

    /// Most memory that --scaling may hold, as in 8G or 500M (powers of 1024): accelerators that would take more are
    /// not asked for more triangles (default: three quarters of what is free)
    #[arg(long, value_name = "SIZE", requires = "scaling", value_parser = parse_bytes)]
    pub(super) max_memory: Option<u64>,

    /// Print the figures as one JSON document, and nothing else; of several scenes, a list
    #[arg(long)]
    pub(super) json: bool,

    /// Draw the rates: bars from zero with their ranges, for each scene and kind of ray
    #[arg(long, value_name = "FILE.svg", value_parser = parse_chart)]
    pub(super) chart: Option<PathBuf>,
}

fn parse_chart(name: &str) -> std::result::Result<PathBuf, String> {
    let path = PathBuf::from(name);
    let is_svg = path.extension().is_some_and(|suffix| suffix.eq_ignore_ascii_case("svg"));
    if is_svg { Ok(path) } else { Err("a chart is an SVG file: give a name that ends in .svg".to_owned()) }
}

fn isas() -> impl TypedValueParser<Value = Isa> {
    one_of(Isa::ALL, Isa::name, |isa| match isa {
        Isa::Portable => "What every processor has, as it is without AVX",
        Isa::Avx2 => "Vectors of 8",
        Isa::Avx512 => "Vectors of 16",
    })
}

fn kinds() -> impl TypedValueParser<Value = Kind> {
    one_of(Kind::ALL, Kind::name, |kind| match kind {
        Kind::Primary => "From the camera",
        Kind::Diffuse => "From what the camera sees, in random directions",
        Kind::Shadow => "From what the camera sees to a point light",
        Kind::Orthographic => "From an orthographic camera",
        Kind::Sun => "From what the camera sees to a distant light",
        Kind::Pixel => "From the camera, made from pixels within the time; all others are made before",
    })
}

/// Native first, as they are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ModeArg {
    /// Native, as it renders
    Default,
    /// Native, built fastest
    NativeFast,
    /// Native, built best: large triangles are in several leaves
    NativeHigh,
    /// Native, in least memory
    NativeCompact,
    /// Native, built fastest in least memory
    NativeFastCompact,
    /// Embree, medium quality, rays may slip between triangles
    Fast,
    /// Embree, medium quality, robust
    Robust,
    /// Embree, medium quality, compact
    Compact,
    /// Embree, high quality: spatial splits
    High,
}

pub(super) fn run(args: &BenchArgs) -> Result<()> {
    if args.scaling {
        return scaling::run(args);
    }
    needs(("--max", args.max.is_some()), ("--scaling", false))?;
    needs(("--max-memory", args.max_memory.is_some()), ("--scaling", false))?;
    BackendArg::Both.check_available()?;
    bench(args)
}

#[cfg(not(feature = "embree"))]
fn bench(_: &BenchArgs) -> Result<()> {
    unreachable!("check_available refused it")
}

#[cfg(feature = "embree")]
use with_embree::bench;

#[cfg(feature = "embree")]
mod with_embree {
    use std::path::PathBuf;
    use std::sync::{Arc, OnceLock};
    use std::time::Instant;

    use clap::ValueEnum;

    use super::{BenchArgs, ModeArg};
    use crate::cli::{interrupt, outputs, progress, say, say_json, warn};
    use crate::error::{Error, Result};
    use crate::lab::bench::{Built, Contender, Setup, Subject, chart, processor};
    use crate::scene::AcceleratorRequest;
    use crate::trace::World;
    use crate::trace::accel::{self, Accel};
    use crate::trace::bvh::{self, Bvh, Isa, Preset};
    use crate::trace::embree::{self, Embree, Instructions, Options, Quality};

    pub(super) fn bench(args: &BenchArgs) -> Result<()> {
        let cancel = interrupt::install()?;
        let files: Vec<PathBuf> = args.scenes.iter().map(PathBuf::from).filter(|path| path.exists()).collect();
        outputs::check(&[], &args.chart, &files)?;
        let threads = match args.threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            threads => threads,
        };
        let (isa, instructions) = match args.isa {
            None => (Isa::detect(), Instructions::All),
            Some(Isa::Portable) => (Isa::Portable, Instructions::Sse2),
            Some(Isa::Avx2) => (Isa::Avx2, Instructions::Avx2),
            Some(Isa::Avx512) => (Isa::Avx512, Instructions::All),
        };
        if !isa.is_available() {
            return Err(Error::Usage(format!("--isa {}: this processor does not have it", isa.name())));
        }
        let options = args.options.choose(&args.accel, AcceleratorRequest::default())?;
        let mut kinds = args.rays.clone();
        kinds.sort_by_key(|&kind| kind as u8);
        kinds.dedup();
        // Before hours are spent on others.
        args.scenes.iter().try_for_each(|name| Subject::check(name))?;
        let mut reports = Vec::new();
        for name in &args.scenes {
            let (subject, warnings) = interrupt::while_nothing_is_written(|| Subject::new(name, args.up_axis))?;
            warn(&warnings);
            interrupt::check()?;
            let costs = Arc::default();
            let modes = ModeArg::value_variants().iter().filter(|mode| args.modes.contains(mode));
            let modes = modes.map(|&mode| contender(mode, threads, (isa, instructions), &costs));
            let others = args.accel.iter().map(|&accel| other(accel, &options));
            let contenders: Vec<_> = modes.chain(others).collect();
            let setup = Setup {
                subject: &subject,
                contenders: &contenders,
                kinds: &kinds,
                side: args.size as usize,
                threads,
                isa: isa.name(),
                repeat: args.repeat as usize,
                cancel: Some(cancel),
                on_step: None,
            };
            let bar = progress::bar(setup.steps(), name, args.json);
            let report = Setup { on_step: Some(&|| bar.inc(1)), ..setup }.run();
            bar.finish_and_clear();
            let report = report?;
            if !args.json {
                say(&report)?;
            }
            reports.push(report);
        }
        if let Some(path) = &args.chart {
            outputs::write_text(path, &chart(&reports, &notes(isa)?))?;
            if !args.json {
                say(format_args!("wrote {}", path.display()))?;
            }
        }
        match &reports[..] {
            _ if !args.json => Ok(()),
            [report] => say_json(report),
            reports => say_json(&reports),
        }
    }

    /// What was measured on what.
    fn notes(isa: Isa) -> Result<Vec<String>> {
        let embree = Embree::new(&World::default(), &Options::default())?.version();
        let most = isa.name().to_uppercase();
        Ok(vec![
            format!("{}, instructions up to {most}", processor()),
            format!("Twincast {}, native: watertight and exact. Embree {embree}", env!("CARGO_PKG_VERSION")),
        ])
    }

    /// An engine as it is set up in `mode`, with native's instructions and Embree's.
    fn contender(
        mode: ModeArg,
        threads: usize,
        (isa, instructions): (Isa, Instructions),
        costs: &Arc<TreeCosts>,
    ) -> Contender {
        let medium = Options { robust: false, threads: Some(threads), instructions, ..Options::default() };
        let embree = |mode, options: Options| {
            let costs = Arc::clone(costs);
            let build = Box::new(move |world: &World| build_embree(world, &options, &costs));
            Contender { backend: "embree", mode, is_exact: false, build }
        };
        let native = |preset: Preset| Contender {
            backend: "native",
            mode: preset.name(),
            is_exact: true,
            build: Box::new(move |world| Ok(build_native(world, preset, isa))),
        };
        match mode {
            ModeArg::Default => native(Preset::Default),
            ModeArg::NativeFast => native(Preset::Fast),
            ModeArg::NativeHigh => native(Preset::High),
            ModeArg::NativeCompact => native(Preset::Compact),
            ModeArg::NativeFastCompact => native(Preset::FastCompact),
            ModeArg::Fast => embree("fast", medium),
            ModeArg::Robust => embree("robust", Options { robust: true, ..medium }),
            ModeArg::Compact => embree("compact", Options { compact: true, ..medium }),
            ModeArg::High => embree("high", Options { quality: Quality::High, ..medium }),
        }
    }

    /// Another accelerator, which answers as native unless it is told to use a textbook's methods.
    fn other(accel: Accel, options: &accel::Options) -> Contender {
        let options = options.clone();
        let is_exact = options.are_exact_for(accel);
        let build = move |world: &World| {
            let start = Instant::now();
            let built = accel.build(world, &options);
            let seconds = start.elapsed().as_secs_f64();
            Ok(Built { seconds, bytes: built.bytes, sah_cost: None, tracer: Box::new(built) })
        };
        Contender { backend: "native", mode: accel.name(), is_exact, build: Box::new(build) }
    }

    fn build_native(world: &World, preset: Preset, isa: Isa) -> Built {
        let start = Instant::now();
        let bvh = Bvh::build_with(world, bvh::Options { preset, isa, ..bvh::Options::default() });
        let seconds = start.elapsed().as_secs_f64();
        Built { seconds, bytes: bvh.bytes(), sah_cost: Some(bvh.sah_cost()), tracer: Box::new(bvh) }
    }

    /// Only what Embree itself does is charged to it, placements included as in native's trees: neither our copies of
    /// the triangles for it, nor their bytes.
    fn build_embree(world: &World, options: &Options, costs: &TreeCosts) -> Result<Built> {
        let sah_cost = Some(costs.of(world, options)?);
        let embree = Embree::new(world, options)?;
        let (seconds, bytes) = (embree.build_time().as_secs_f64(), embree.tree_bytes());
        Ok(Built { seconds, bytes, sah_cost, tracer: Box::new(embree) })
    }

    /// What Embree's trees of one scene cost, by quality. Each takes another build, so it is found once.
    #[derive(Default)]
    struct TreeCosts {
        medium: OnceLock<f64>,
        high: OnceLock<f64>,
    }

    impl TreeCosts {
        fn of(&self, world: &World, options: &Options) -> Result<f64> {
            let known = if options.quality == Quality::High { &self.high } else { &self.medium };
            match known.get() {
                Some(&cost) => Ok(cost),
                None => embree::sah_cost(world, options, Bvh::NODE_COST).map(|cost| *known.get_or_init(|| cost)),
            }
        }
    }
}
