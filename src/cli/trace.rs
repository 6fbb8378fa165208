//! `twincast trace`: what every engine says of one ray, to the last bit.

use std::fmt;
use std::path::Path;

use clap::Args;
use serde::Serialize;

use super::accel::AccelArgs;
use super::cache::CacheArgs;
use super::common::SceneArgs;
use super::engine::BackendArg;
use super::{say_report, warn};
use crate::error::{Error, Result};
use crate::lab::hex;
use crate::lab::oracle::Id;
use crate::lab::stress::{catalogue, file};
use crate::lab::tree::Oracle;
use crate::ray::{Hit, Ray};
use crate::scene::AcceleratorRequest;
use crate::trace::accel::Accel;
use crate::trace::{Tracer, World};

/// Say what every engine makes of one ray, to the last bit
///
/// The scene is a file, a case of `twincast stress` (case:edge-leak/6) or a case file. Numbers are decimal or
/// hexadecimal (0x1.8p+1); the ray is in the coordinates that are traced: those of the scene less its centre, which is
/// named where it is not zero.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  twincast trace bunny.glb --ray 0,0.1,2,0,0,-1 --oracle
  twincast trace bunny.glb --ray 0,0.1,2,0,0,-1 --accel kd-tree --triangle-method woop
  twincast trace case:edge-leak/6 --ray 0x1p-2,0,0,1,0,0 --oracle --json")]
pub(super) struct TraceArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// Origin and direction, and the range of t (default: 0 to infinity)
    #[arg(long, value_name = "OX,OY,OZ,DX,DY,DZ[,TMIN[,TMAX[,TIME]]]", value_parser = hex::ray_from_text, allow_hyphen_values = true)]
    ray: Ray,

    #[command(flatten)]
    accel: AccelArgs,

    /// Ask this engine alone (default: all of this build)
    #[arg(long, value_enum)]
    backend: Option<BackendArg>,

    /// Answer in exact arithmetic as well
    #[arg(long)]
    oracle: bool,

    /// Print one JSON document, and nothing else
    #[arg(long)]
    json: bool,
}

/// What is said of a ray. Serialises as the document of `trace --json`.
#[derive(Serialize)]
struct Said {
    /// What was subtracted from the scene's coordinates.
    centre: [f64; 3],
    ray: String,
    valid: bool,
    answers: Vec<Answer>,
    #[serde(skip_serializing_if = "Option::is_none")]
    exact: Option<ExactAnswer>,
}

#[derive(Serialize)]
struct Answer {
    engine: &'static str,
    occluded: bool,
    hit: Option<Place>,
}

/// A hit; hexadecimal where bits count.
#[derive(Serialize)]
struct Place {
    /// Instance, geometry, primitive.
    id: Id,
    t: f32,
    t_hex: String,
    u_hex: String,
    v_hex: String,
}

#[derive(Serialize)]
struct ExactAnswer {
    /// Everything at exactly the nearest t.
    nearest: Vec<Id>,
    #[serde(skip_serializing_if = "Option::is_none")]
    t: Option<f64>,
    touches: bool,
    at_range_end: bool,
}

pub(super) fn run(args: &TraceArgs) -> Result<()> {
    let backend = args.backend.unwrap_or_default();
    backend.check_available()?;
    let (world, request) = world(args)?;
    let (accel, options) = args.accel.choose(request, backend, None, &CacheArgs::default())?;
    let mut answers = Vec::new();
    if backend != BackendArg::Embree {
        answers.push(Answer::new(accel.name(), &accel.build(&world, &options), &args.ray));
        if accel != Accel::Brute {
            answers.push(Answer::new("brute", &Accel::Brute.build(&world, &options), &args.ray));
        }
    }
    #[cfg(feature = "embree")]
    if args.backend != Some(BackendArg::Native) {
        use crate::trace::embree::{Embree, Options};
        let robust = Embree::new(&world, &Options::default())?;
        answers.push(Answer::new("embree", &robust, &args.ray));
        let fast = Embree::new(&world, &Options { robust: false, ..Options::default() })?;
        answers.push(Answer::new("embree-fast", &fast, &args.ray));
    }
    let exact = args.oracle.then(|| {
        let exact = Oracle::new(&world, args.ray.moment()).closest(&args.ray);
        let t = exact.t.is_finite().then_some(exact.t);
        ExactAnswer { nearest: exact.nearest, t, touches: exact.touches, at_range_end: exact.at_range_end }
    });
    let (centre, ray) = (world.centre.to_array(), hex::ray_to_hex(&args.ray));
    let said = Said { centre, ray, valid: args.ray.is_valid(), answers, exact };
    say_report(args.json, &said)
}

/// The world that is meant, and how its file wants to be searched.
fn world(args: &TraceArgs) -> Result<(World, AcceleratorRequest)> {
    let path: &Path = &args.scene.scene;
    if let Some(name) = path.to_str().and_then(|path| path.strip_prefix("case:")) {
        return Ok((case(name)?, AcceleratorRequest::default()));
    }
    if file::is_case_file(path) {
        return Ok((file::read(path)?.1.world, AcceleratorRequest::default()));
    }
    let (scene, warnings) = args.scene.load(false)?;
    warn(&warnings);
    Ok((World::new(&scene)?, scene.request.search))
}

/// A case's world: its name, or its name and a label.
fn case(text: &str) -> Result<World> {
    let (name, label) = text.split_once('/').unwrap_or((text, ""));
    let case = catalogue().find(|case| case.name == name).ok_or_else(|| {
        let names = catalogue().map(|case| case.name).collect::<Vec<_>>().join(", ");
        Error::Usage(format!("no case {name:?}; there are {names}"))
    })?;
    let probes = case.probes(1, 0);
    let labels = probes.iter().map(|probe| format!("case:{name}/{}", probe.label)).collect::<Vec<_>>().join(", ");
    let found = probes.into_iter().find(|probe| probe.label == label);
    found.map(|probe| probe.world).ok_or_else(|| Error::Usage(format!("case {name} has several worlds: {labels}")))
}

impl Answer {
    fn new(engine: &'static str, tracer: &dyn Tracer, ray: &Ray) -> Self {
        Self { engine, occluded: tracer.occluded(ray), hit: tracer.closest(ray).map(Place::new) }
    }
}

impl Place {
    fn new(hit: Hit) -> Self {
        let [t_hex, u_hex, v_hex] = [hit.t, hit.u, hit.v].map(hex::to_hex);
        Self { id: hit.id(), t: hit.t, t_hex, u_hex, v_hex }
    }
}

impl fmt::Display for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let id = |(instance, geometry, primitive): &Id| format!("{instance}/{geometry}/{primitive}");
        writeln!(f, "ray {}", self.ray)?;
        if !self.valid {
            writeln!(
                f,
                "it is not valid, and so hits nothing: it needs finite numbers, a direction that is not zero, 0 <= tmin <= tmax"
            )?;
        }
        if self.centre != [0.0; 3] {
            writeln!(f, "coordinates are those of the scene less {:?}", self.centre)?;
        }
        for Answer { engine, occluded, hit } in &self.answers {
            match hit {
                None => write!(f, "{engine:<12} nothing")?,
                Some(Place { id: named, t, t_hex, u_hex, v_hex }) => {
                    write!(f, "{engine:<12} {:<10} t {t:?} ({t_hex}), u {u_hex}, v {v_hex}", id(named))?;
                }
            }
            writeln!(f, "{}", if *occluded == hit.is_some() { "" } else { "; any-hit says otherwise" })?;
        }
        let Some(exact) = &self.exact else { return Ok(()) };
        match exact.t {
            None => writeln!(f, "exact        nothing"),
            Some(t) => {
                let ids: Vec<String> = exact.nearest.iter().map(id).collect();
                let touches = if exact.touches { ", touched" } else { "" };
                let end = if exact.at_range_end { ", at an end of the range" } else { "" };
                writeln!(f, "exact        {:<10} t {t:?}{touches}{end}", ids.join(" "))
            }
        }
    }
}
