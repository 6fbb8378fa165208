//! What picture to make: flags, and what the scene asks for.

use clap::Args;
use clap::builder::TypedValueParser;

use super::common::{Size, parse_vector};
use super::named::{OrAuto, one_of, one_of_or_auto};
use super::plan::PlanArgs;
use crate::math::Vec3;
use crate::render::{Adaptive, Crop, Filter, MAX_LIGHT_SAMPLES, Sampling, Settings, TileOrder};
use crate::scene::{Integrator, MAX_DEPTH, MAX_SPP, Request};
use crate::trace::{Batch, Width};

/// Everything about a picture but its camera.
#[derive(Clone, Debug, Args)]
pub(super) struct PictureArgs {
    /// Pixels (default: the scene's, else 1280x720)
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,

    /// Render this part alone: columns and rows to its left and above it, and its size; the same pixels as in the whole
    /// picture
    #[arg(long, value_name = "X,Y,WxH", value_parser = parse_crop, allow_hyphen_values = true)]
    crop: Option<Crop>,

    /// Samples a pixel; 1 is the pixel's centre (default: the scene's, else 4)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SPP)))]
    spp: Option<u32>,

    /// Take samples where they are needed: until the error of the pixels that are noisy is this, root mean square, as a
    /// screen shows it, 1 being white (0.01 is about 2 of 255); no pixel has fewer than --spp and 16, nor more
    /// than --max-spp
    #[arg(long, value_name = "X", value_parser = parse_noise)]
    noise: Option<f32>,

    /// The most samples of a pixel, with --noise (default: 1024)
    #[arg(long, value_name = "N", requires = "noise", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SPP)))]
    max_spp: Option<u32>,

    /// How far light is followed (default: the scene's, else auto)
    #[arg(long, value_name = "NAME", value_parser = integrators())]
    integrator: Option<OrAuto<Integrator>>,

    /// How often a ray may be sent on; what it would see after that is black (default: the scene's, else 5, for
    /// paths 64)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=i64::from(MAX_DEPTH)))]
    max_depth: Option<u32>,

    /// Chooses among equally good sample patterns (default: the scene's, else 0)
    #[arg(long, value_name = "N")]
    seed: Option<u64>,

    /// Shadow rays to each light with a surface, where a ray hits; paths ask one light
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_LIGHT_SAMPLES)))]
    light_samples: u32,

    /// How samples are spread
    #[arg(long, value_name = "NAME", default_value_t, value_parser = samplers())]
    sampler: Sampling,

    /// How samples become a pixel
    #[arg(long, value_name = "NAME", default_value_t, value_parser = filters())]
    filter: Filter,

    /// Rays that Embree traces together (default: 8, with --backend both 1); the native engine chooses by itself
    #[arg(long, value_name = "N", value_parser = widths())]
    packet: Option<Width>,

    /// Order of the tiles; never changes a picture
    #[arg(long, value_name = "ORDER", value_parser = tile_orders(), default_value = TileOrder::default().name())]
    tile_order: TileOrder,

    /// Edge of the tiles that threads take, pixels: 4, 8, 16, 32 or 64; never changes a native picture
    #[arg(long, value_name = "N", default_value_t = Settings::default().tile)]
    tile_size: u32,

    /// Linear colour behind the scene, opaque (default: the scene's, transparent where it has none)
    #[arg(long, value_name = "R,G,B", value_parser = parse_color, allow_hyphen_values = true)]
    background: Option<Vec3>,

    #[command(flatten)]
    plan: PlanArgs,
}

fn integrators() -> impl TypedValueParser<Value = OrAuto<Integrator>> {
    one_of_or_auto(Integrator::ALL, Integrator::name, |integrator| match integrator {
        None => {
            "Paths where nothing but what glows, or is behind everything, lights the scene; else the cheapest of the others that shows all there is"
        }
        Some(Integrator::RayCast) => "From the lights to what the camera sees, and no farther",
        Some(Integrator::Whitted) => "Mirrors and glass as well",
        Some(Integrator::Path) => "All light, however often it was scattered, and that of surfaces that glow",
    })
}

fn samplers() -> impl TypedValueParser<Value = Sampling> {
    one_of(Sampling::ALL, Sampling::name, |sampling| match sampling {
        Sampling::Sobol => "Sobol's sequence, scrambled: the least noise for most pictures",
        Sampling::BlueNoise => "The same along a curve over the pixels: what noise is left is spread evenly",
        Sampling::Halton => "Halton's sequence, scrambled",
        Sampling::Stratified => "One in each cell of a grid, rows and columns evenly filled",
        Sampling::Grid => "The middles of a grid's cells: bands where others show noise",
        Sampling::Independent => "Random numbers",
    })
}

fn filters() -> impl TypedValueParser<Value = Filter> {
    one_of(Filter::ALL, Filter::name, |filter| match filter {
        Filter::Box => "The mean over the pixel",
        Filter::Tent => "Weights that fall off to the next pixels' middles",
        Filter::Gaussian => "Soft",
        Filter::Mitchell => "Sharp, negative in parts",
        Filter::BlackmanHarris => "Soft, with next to nothing from one frequency in another",
    })
}

fn widths() -> impl TypedValueParser<Value = Width> {
    let name = |width| match width {
        Width::One => "1",
        Width::Four => "4",
        Width::Eight => "8",
        Width::Sixteen => "16",
    };
    one_of(Width::ALL, name, |width| match width {
        Width::One => "Each ray by itself",
        Width::Four => "Packets of 4",
        Width::Eight => "Packets of 8",
        Width::Sixteen => "Packets of 16",
    })
}

fn tile_orders() -> impl TypedValueParser<Value = TileOrder> {
    one_of(TileOrder::ALL, TileOrder::name, |order| match order {
        TileOrder::Scanline => "Row by row from the top",
        TileOrder::Hilbert => "Along a curve from neighbour to neighbour",
        TileOrder::Spiral => "From the middle outwards",
    })
}

impl PictureArgs {
    /// What the flags say, else the scene's file, else what is usual.
    pub(super) fn settings(&self, request: &Request, usual_width: Width) -> Settings {
        let asked = Settings::of_request(request);
        let (columns, rows) = self.size.map_or((asked.width, asked.height), |size| (size.width, size.height));
        let width = self.packet.unwrap_or(usual_width);
        Settings {
            width: columns,
            height: rows,
            spp: self.spp.unwrap_or(asked.spp),
            seed: self.seed.unwrap_or(asked.seed),
            sampling: self.sampler,
            filter: self.filter,
            light_samples: self.light_samples,
            integrator: self.integrator.map_or(asked.integrator, |OrAuto(integrator)| integrator),
            max_depth: self.max_depth.or(asked.max_depth),
            batch: Batch { width, coherent: true },
            tile_order: self.tile_order,
            tile: self.tile_size,
            background: self.background,
            crop: self.crop,
            aovs: Vec::new(),
            adaptive: self.noise.map(|noise| Adaptive { noise, max_spp: self.max_spp.unwrap_or(DEFAULT_MAX_SPP) }),
            complete: self.plan.complete(),
        }
    }
}

/// As many samples as a pixel has at most where nothing else is asked for.
const DEFAULT_MAX_SPP: u32 = 1024;

/// `X,Y,WxH`.
fn parse_crop(text: &str) -> std::result::Result<Crop, String> {
    let crop = || {
        let (x, rest) = text.split_once(',')?;
        let (y, size) = rest.split_once(',')?;
        let Size { width, height } = size.trim().parse().ok()?;
        Some(Crop { x: x.trim().parse().ok()?, y: y.trim().parse().ok()?, width, height })
    };
    crop().ok_or_else(|| "expected X,Y,WIDTHxHEIGHT, as in 600,300,200x100".to_owned())
}

fn parse_noise(text: &str) -> std::result::Result<f32, String> {
    let noise = text.parse().ok().filter(|noise: &f32| *noise > 0.0 && noise.is_finite());
    noise.ok_or_else(|| "expected a number above 0, as in 0.01".to_owned())
}

fn parse_color(text: &str) -> std::result::Result<Vec3, String> {
    let color = parse_vector(text)?.as_vec3();
    let valid = color.is_finite() && color.cmpge(Vec3::ZERO).all();
    valid.then_some(color).ok_or_else(|| "expected three numbers of at least 0".to_owned())
}
