//! What picture to make: flags, and what the scene asks for.

use clap::{Args, ValueEnum};

use super::common::{Size, by_name, parse_vector};
use super::plan::PlanArgs;
use crate::math::Vec3;
use crate::render::{Adaptive, Crop, Filter, MOST_LIGHT_SAMPLES, Sampling, Settings, TileOrder};
use crate::scene::{Integrator, MOST_DEPTH, MOST_SPP, Request};
use crate::trace::{Batch, Width};

/// Everything about a picture but its camera.
#[derive(Clone, Debug, Args)]
pub(super) struct PictureArgs {
    /// Pixels (default: the scene's, else 1280x720)
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,

    /// Render this part alone: columns and rows to its left and above it, and its size; the same pixels as in the whole picture
    #[arg(long, value_name = "X,Y,WxH", value_parser = parse_crop, allow_hyphen_values = true)]
    crop: Option<Crop>,

    /// Samples a pixel; 1 is the pixel's centre (default: the scene's, else 4)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SPP)))]
    spp: Option<u32>,

    /// Take samples where they are needed: until the error of the pixels that are noisy is this, root mean square, as a screen shows it, 1
    /// being white (0.01 is about 2 of 255); no pixel has fewer than --spp and 16, nor more than --max-spp
    #[arg(long, value_name = "X", value_parser = parse_noise)]
    noise: Option<f32>,

    /// The most samples of a pixel, with --noise (default: 1024)
    #[arg(long, value_name = "N", requires = "noise", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SPP)))]
    max_spp: Option<u32>,

    /// How far light is followed: ray-cast, whitted (mirrors and glass), path (all light), or auto, the cheapest that
    /// shows everything (default: the scene's, else auto)
    #[arg(long, value_name = "NAME", value_parser = parse_integrator)]
    integrator: Option<Wish>,

    /// How often a ray may be sent on; what it would see after that is black (default: the scene's, else 5, for paths 64)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=i64::from(MOST_DEPTH)))]
    max_depth: Option<u32>,

    /// Chooses among equally good sample patterns (default: the scene's, else 0)
    #[arg(long, value_name = "N")]
    seed: Option<u64>,

    /// Shadow rays to each light with a surface, where a ray hits; paths ask one light
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_LIGHT_SAMPLES)))]
    light_samples: u32,

    /// How samples are spread: sobol, blue-noise, halton, stratified, grid or independent
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse_sampling)]
    sampler: Sampling,

    /// How samples become a pixel: box, tent, gaussian, mitchell or blackman-harris
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse_filter)]
    filter: Filter,

    /// Rays that Embree traces together (default: 8, with --backend both 1); the native engine chooses by itself
    #[arg(long, value_name = "N")]
    packet: Option<Packet>,

    /// Order of the tiles; never changes a picture
    #[arg(long, value_enum, default_value_t)]
    tile_order: Order,

    /// Edge of the tiles that threads take, pixels: 4, 8, 16, 32 or 64; never changes a native picture
    #[arg(long, value_name = "N", default_value_t = Settings::default().tile)]
    tile_size: u32,

    /// Linear colour behind the scene, opaque (default: the scene's, transparent where it has none)
    #[arg(long, value_name = "R,G,B", value_parser = parse_color, allow_hyphen_values = true)]
    background: Option<Vec3>,

    #[command(flatten)]
    plan: PlanArgs,
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

impl PictureArgs {
    /// What the flags say, else the scene's file, else what is usual.
    pub(super) fn settings(&self, request: &Request, usual_width: Width) -> Settings {
        let asked = Settings::of_request(request);
        let (columns, rows) = self.size.map_or((asked.width, asked.height), |size| (size.width, size.height));
        let width = match self.packet {
            None => usual_width,
            Some(Packet::One) => Width::One,
            Some(Packet::Four) => Width::Four,
            Some(Packet::Eight) => Width::Eight,
            Some(Packet::Sixteen) => Width::Sixteen,
        };
        Settings {
            width: columns,
            height: rows,
            spp: self.spp.unwrap_or(asked.spp),
            seed: self.seed.unwrap_or(asked.seed),
            sampling: self.sampler,
            filter: self.filter,
            light_samples: self.light_samples,
            integrator: self.integrator.map_or(asked.integrator, |Wish(integrator)| integrator),
            max_depth: self.max_depth.or(asked.max_depth),
            batch: Batch { width, coherent: true },
            tile_order: match self.tile_order {
                Order::Scanline => TileOrder::Scanline,
                Order::Hilbert => TileOrder::Hilbert,
                Order::Spiral => TileOrder::Spiral,
            },
            tile: self.tile_size,
            background: self.background,
            crop: self.crop,
            aovs: Vec::new(),
            adaptive: self.noise.map(|noise| Adaptive { noise, max_spp: self.max_spp.unwrap_or(USUAL_MOST_SPP) }),
            complete: self.plan.complete(),
        }
    }
}

/// As many samples as a pixel has at most where nothing else is asked for.
const USUAL_MOST_SPP: u32 = 1024;

/// An integrator, or none for the one that is chosen.
#[derive(Clone, Copy, Debug)]
struct Wish(Option<Integrator>);

fn parse_integrator(name: &str) -> std::result::Result<Wish, String> {
    if name == "auto" {
        return Ok(Wish(None));
    }
    let found = by_name(Integrator::ALL, Integrator::name, name).map(|integrator| Wish(Some(integrator)));
    found.map_err(|expected| format!("{expected}, auto"))
}

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

fn parse_sampling(name: &str) -> std::result::Result<Sampling, String> {
    by_name(Sampling::ALL, Sampling::name, name)
}

fn parse_filter(name: &str) -> std::result::Result<Filter, String> {
    by_name(Filter::ALL, Filter::name, name)
}

fn parse_color(text: &str) -> std::result::Result<Vec3, String> {
    let color = parse_vector(text)?.as_vec3();
    let valid = color.is_finite() && color.cmpge(Vec3::ZERO).all();
    valid.then_some(color).ok_or_else(|| "expected three numbers of at least 0".to_owned())
}
