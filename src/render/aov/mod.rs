//! What a render tells of each pixel beside its colour.
//!
//! | file | what |
//! | --- | --- |
//! | `geometry` | where and what the ray through the pixel's middle hits: distance, position, uv, numbers |
//! | `tally` | what is averaged over the pixel's samples as its colour is: normals, albedo, light apart |
//! | `expression` | which light: kinds of paths, in Heckbert's notation |
//! | `cryptomatte` | which objects and materials cover how much of the pixel |
//!
//! Places and numbers have no average, so that those of one ray are taken, and of a ray that does not depend on samples
//! or seed; a filtered depth, as many renderers write it, lies between the objects at every edge. Directions and
//! colours are averaged with the picture's own samples and filter, which is what denoisers expect.
//!
//! A render that is asked for none of this does none of it: tiles have no tally, paths no route.

mod cryptomatte;
mod expression;
mod geometry;
mod murmur;
mod tally;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

pub use expression::Expression;

pub(super) use cryptomatte::{Coverage, Mattes};
pub(super) use expression::{Automaton, Event};
pub(super) use tally::{Parts, Route, Tally};

use crate::error::{Error, Result};
use crate::image::Channel;
use crate::scene::Scene;

/// Something that is told of each pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Aov {
    /// Metres from the camera along the ray, infinite where nothing is hit: `depth.Z`.
    Depth,
    /// Scene coordinates: `position.X` and so on.
    Position,
    /// Unit shading normals in scene coordinates, turned towards the viewer and averaged; zero where nothing is hit:
    /// `normal.X` and so on.
    Normal,
    /// Texture coordinates, v up; a shape's own parameters: `uv.U`, `uv.V`.
    Uv,
    /// Number of the triangle or shape, `u32::MAX` where nothing is hit.
    Primitive,
    /// Number of the geometry, likewise.
    Geometry,
    /// Number of the instance, likewise.
    Instance,
    /// Share of light that the first surface sends on, linear RGB, from 0 to 1, averaged: `albedo.R` and so on.
    Albedo,
    /// Samples that the pixel has.
    Samples,
    /// Seconds of a thread that the pixel took: its share of its tile's. The one thing that differs from run to run.
    Time,
    /// Cryptomatte of objects: `CryptoObject00.R` and so on.
    CryptoObject,
    /// Cryptomatte of materials: `CryptoMaterial00.R` and so on.
    CryptoMaterial,
    /// Light that came by certain paths, linear RGB: `NAME.R` and so on.
    Light {
        /// The layer's name.
        name: String,
        /// Which paths.
        paths: Expression,
    },
}

/// Bytes of a layer's name at most: with a dot and a component it may have 255.
const LONGEST_NAME: usize = 253;

/// Names of what is no light.
const PLAIN: [(&str, Aov); 12] = [
    ("depth", Aov::Depth),
    ("position", Aov::Position),
    ("normal", Aov::Normal),
    ("uv", Aov::Uv),
    ("primitive", Aov::Primitive),
    ("geometry", Aov::Geometry),
    ("instance", Aov::Instance),
    ("albedo", Aov::Albedo),
    ("samples", Aov::Samples),
    ("time", Aov::Time),
    ("crypto-object", Aov::CryptoObject),
    ("crypto-material", Aov::CryptoMaterial),
];

/// Paths that have a name. The first three make up the picture, and so do the first and the last three.
const LIGHT: [(&str, &str); 6] = [
    ("emission", "LE"),
    ("direct", "L.E"),
    ("indirect", "L..+E"),
    ("diffuse", "L.*DE"),
    ("specular", "L.*SE"),
    ("transmission", "L.*TE"),
];

impl Aov {
    /// All that have a name of their own.
    pub fn all() -> Vec<Self> {
        let light = LIGHT.iter().filter_map(|(name, _)| name.parse().ok());
        PLAIN.into_iter().map(|(_, aov)| aov).chain(light).collect()
    }

    /// How many channels it has.
    pub const fn channels(&self) -> usize {
        match self {
            Self::Depth | Self::Primitive | Self::Geometry | Self::Instance | Self::Samples | Self::Time => 1,
            Self::Uv => 2,
            Self::Position | Self::Normal | Self::Albedo | Self::Light { .. } => 3,
            Self::CryptoObject | Self::CryptoMaterial => cryptomatte::CHANNELS,
        }
    }

    fn plain_name(&self) -> Option<&'static str> {
        PLAIN.iter().find(|(_, aov)| aov == self).map(|(name, _)| *name)
    }
}

impl FromStr for Aov {
    type Err = String;

    /// One of the names; an expression as in `LDE`; or `NAME=EXPRESSION`.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let text = text.trim();
        if let Some((_, aov)) = PLAIN.iter().find(|(name, _)| *name == text) {
            return Ok(aov.clone());
        }
        let known = LIGHT.iter().find(|(name, _)| *name == text);
        let (name, paths) = match (known, text.split_once('=')) {
            (Some((name, paths)), _) => (*name, *paths),
            (None, Some((name, paths))) => (name.trim(), paths),
            (None, None) if text.starts_with('L') => (text, text),
            (None, None) => {
                let names = PLAIN.iter().map(|(name, _)| *name).chain(LIGHT.map(|(name, _)| name));
                let names = names.collect::<Vec<_>>().join(", ");
                return Err(format!("{text:?} is none of {names}, and no kind of light path as LDE or NAME=L.*SE"));
            }
        };
        let paths = Expression::new(paths)?;
        let name: String = name.chars().filter(|c| !c.is_whitespace()).collect();
        let is_reserved = PLAIN.iter().any(|(plain, _)| *plain == name) || cryptomatte::is_layer(&name);
        if name.is_empty() || name.len() > LONGEST_NAME || name.contains(['.', '\0']) || is_reserved {
            let remedy = format!("name it, as in NAME={}", paths.text());
            return Err(format!(
                "{text:?}: {name:?} cannot be the name of a layer, which has up to {LONGEST_NAME} bytes, no dot, and not that of another layer; {remedy}"
            ));
        }
        Ok(Self::Light { name, paths })
    }
}

impl fmt::Display for Aov {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Light { name, paths } => write!(f, "{name}={}", paths.text()),
            plain => f.write_str(plain.plain_name().unwrap_or_default()),
        }
    }
}

/// What was asked for, ready to be taken down.
#[derive(Clone, Debug)]
pub(super) struct Request {
    aovs: Vec<Aov>,
    /// Where in a pixel's sums each thing begins; none for what is not asked for.
    pub(super) normal: Option<usize>,
    pub(super) albedo: Option<usize>,
    pub(super) time: Option<usize>,
    /// Of each kind of paths in turn.
    pub(super) light: usize,
    /// Names of the kinds of paths.
    kinds: Vec<String>,
    /// Sums of a pixel.
    pub(super) stride: usize,
    /// Follows paths, where any light is asked for.
    pub(super) automaton: Option<Arc<Automaton>>,
    pub(super) mattes: Option<Arc<Mattes>>,
}

impl Request {
    /// None where nothing is asked for.
    ///
    /// # Errors
    /// [`Error::Usage`] where two would have the same name, and where paths are of too many kinds.
    pub(super) fn new(aovs: &[Aov], scene: &Scene) -> Result<Option<Self>> {
        if aovs.is_empty() {
            return Ok(None);
        }
        let (mut kinds, mut expressions) = (Vec::new(), Vec::new());
        for (i, aov) in aovs.iter().enumerate() {
            let is_taken = match aov {
                Aov::Light { name, paths } => {
                    let taken = kinds.contains(name);
                    kinds.push(name.clone());
                    expressions.push(paths);
                    taken
                }
                plain => aovs[..i].contains(plain),
            };
            if is_taken {
                return Err(Error::Usage(format!("the AOV {aov} is asked for twice")));
            }
        }
        let mut stride = 0;
        let mut place = |wanted: bool, count: usize| {
            let at = stride;
            stride += if wanted { count } else { 0 };
            wanted.then_some(at)
        };
        let normal = place(aovs.contains(&Aov::Normal), 3);
        let albedo = place(aovs.contains(&Aov::Albedo), 3);
        let time = place(aovs.contains(&Aov::Time), 1);
        let light = place(true, 3 * kinds.len()).unwrap_or_default();
        let automaton = (!kinds.is_empty()).then(|| Automaton::new(&expressions)).transpose().map_err(Error::Usage)?;
        let objects = aovs.contains(&Aov::CryptoObject);
        let materials = aovs.contains(&Aov::CryptoMaterial);
        let mattes = (objects || materials).then(|| Arc::new(Mattes::new(scene, objects, materials)));
        let automaton = automaton.map(Arc::new);
        Ok(Some(Self { aovs: aovs.to_vec(), normal, albedo, time, light, kinds, stride, automaton, mattes }))
    }

    pub(super) fn wants(&self, aov: &Aov) -> bool {
        self.aovs.contains(aov)
    }

    /// Whether samples must be looked at on their way.
    pub(super) fn observes(&self) -> bool {
        self.normal.is_some() || self.albedo.is_some() || self.mattes.is_some()
    }

    /// The channels of what was added up: of each pixel `stride` sums, whose samples weigh `weights`.
    pub(super) fn averages(&self, sums: &[f32], weights: &[f32]) -> Vec<Channel> {
        let mut channels = Vec::new();
        let mut put = |name: String, at: usize, divide: bool| {
            let pixels = sums.chunks_exact(self.stride.max(1)).zip(weights);
            let mean = pixels.map(|(sums, weight)| if divide { sums[at] / weight.max(1.0) } else { sums[at] });
            channels.push(Channel::float(name, mean.collect()));
        };
        if let Some(at) = self.normal {
            ["X", "Y", "Z"].iter().zip(at..).for_each(|(axis, at)| put(format!("normal.{axis}"), at, true));
        }
        let colours = ["R", "G", "B"];
        if let Some(at) = self.albedo {
            colours.iter().zip(at..).for_each(|(c, at)| put(format!("albedo.{c}"), at, true));
        }
        if let Some(at) = self.time {
            put("time".to_owned(), at, false);
        }
        for (name, at) in self.kinds.iter().zip((self.light..).step_by(3)) {
            colours.iter().zip(at..).for_each(|(c, at)| put(format!("{name}.{c}"), at, true));
        }
        channels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for aov in Aov::all() {
            assert_eq!(aov.to_string().parse(), Ok(aov));
        }
        let caustics = Aov::Light { name: "caustics".to_owned(), paths: Expression::new("L[ST]+DE").unwrap() };
        assert_eq!("caustics=L [ST]+ D E".parse(), Ok(caustics));
        assert_eq!("L S* D E".parse::<Aov>().unwrap().to_string(), "LS*DE=LS*DE");
    }

    #[test]
    fn what_cannot_be_is_said() {
        for (text, words) in [
            ("colour", "none of depth"),
            ("L.E", "as in NAME=L.E"),
            ("depth=LDE", "cannot be the name"),
            ("x=DE", "begins with L"),
            ("=LE", "cannot be the name"),
        ] {
            let error = text.parse::<Aov>().unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
        let scene = Scene::default();
        let twice = Request::new(&[Aov::Uv, Aov::Depth, Aov::Uv], &scene).unwrap_err();
        assert!(twice.to_string().contains("uv is asked for twice"), "{twice}");
        assert!(Request::new(&[], &scene).unwrap().is_none());
    }
}
