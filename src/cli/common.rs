//! Arguments that several subcommands share.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use clap::builder::TypedValueParser;

use super::named::one_of;
use super::{interrupt, progress};
use crate::error::{Error, Result, Warning};
use crate::io::{self, Animation, LoadOptions, Normals, Unit, UpAxis};
use crate::math::DVec3;
use crate::scene::MAX_SIDE;
use crate::scene::Scene;

/// A scene file and how to read it.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneArgs {
    /// Scene file: .glb, .gltf, .obj, .ply, .stl, .nff, .test or .toml
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,

    /// Axis of the file that points up
    #[arg(long, value_name = "AXIS", value_parser = up_axes(), default_value = UpAxis::default().name())]
    up_axis: UpAxis,

    /// Length unit of the file
    #[arg(long, value_name = "UNIT", value_parser = units(), default_value = Unit::default().name())]
    unit: Unit,

    /// Shading normals
    #[arg(long, value_name = "KIND", value_parser = normals(), default_value = Normals::default().name())]
    normals: Normals,

    /// Seconds from the start of an animation, for the pose that things have then; glTF (default: the pose that the
    /// file stores; 0 with --animation)
    #[arg(long, value_name = "SECONDS", value_parser = parse_time)]
    pub(crate) time: Option<f64>,

    /// Which animation of the file, by its name or its number from 0 on, or all; may be repeated for several at once
    /// (default: its only one)
    #[arg(long, value_name = "NAME")]
    animation: Vec<String>,

    /// Frames a second: with --time, what moves goes on for one of them while the time of --shutter goes from 0 to 1
    #[arg(long, value_name = "N", default_value_t = 24.0, value_parser = parse_fps)]
    pub(crate) fps: f64,

    /// Which of the sets of materials that the file offers, by its name; glTF (default: those that things have by
    /// themselves)
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
}

/// Reads the axis that points up.
pub(super) fn up_axes() -> impl TypedValueParser<Value = UpAxis> {
    one_of(UpAxis::ALL, UpAxis::name, |axis| match axis {
        UpAxis::Y => "As in glTF and OBJ",
        UpAxis::Z => "As in CAD and scans",
    })
}

fn units() -> impl TypedValueParser<Value = Unit> {
    one_of(Unit::ALL, Unit::name, |unit| match unit {
        Unit::Metre => "Metres",
        Unit::Centimetre => "Centimetres",
        Unit::Millimetre => "Millimetres",
        Unit::Inch => "Inches",
    })
}

fn normals() -> impl TypedValueParser<Value = Normals> {
    one_of(Normals::ALL, Normals::name, |normals| match normals {
        Normals::File => "Those of the file; flat where it has none",
        Normals::Flat => "Flat everywhere",
        Normals::Smooth => "Smooth everywhere, computed",
    })
}

/// An error where a flag is given, but not the one that it goes with. The parser of the command line says so itself
/// unless that one would be in the way of a third.
pub(crate) fn needs((flag, is_given): (&str, bool), (other, is_there): (&str, bool)) -> Result<()> {
    if is_given && !is_there {
        return Err(Error::Usage(format!("{flag} goes with {other}; add that, or leave it out")));
    }
    Ok(())
}

impl SceneArgs {
    /// Reads the scene. If `has_shutter`, what an animation moves is to move.
    pub(crate) fn load(&self, has_shutter: bool) -> Result<(Scene, Vec<Warning>)> {
        interrupt::while_nothing_is_written(|| io::load(&self.scene, &self.options(has_shutter)))
    }

    /// Reads the scene with a bar over the bytes of the file.
    pub(crate) fn load_with_bar(&self, has_shutter: bool, quiet: bool) -> Result<(Scene, Vec<Warning>)> {
        // Whatever is wrong with the file is for the loader to say.
        let length = std::fs::metadata(&self.scene).map_or(0, |file| file.len());
        let bar = progress::bar(length, "loading", quiet);
        let load = || io::load_watched(&self.scene, &self.options(has_shutter), Some(&|bytes| bar.inc(bytes)));
        let scene = interrupt::while_nothing_is_written(load);
        bar.finish_and_clear();
        scene
    }

    /// How the file is understood.
    fn options(&self, has_shutter: bool) -> LoadOptions {
        // A pose that is stored does not move.
        let is_animated = self.time.is_some() || !self.animation.is_empty();
        LoadOptions {
            animation: Animation {
                names: self.animation.clone(),
                time: self.time,
                exposure: if has_shutter && is_animated { 1.0 / self.fps } else { 0.0 },
            },
            variant: self.variant.clone(),
            up_axis: self.up_axis,
            unit: self.unit,
            normals: self.normals,
        }
    }
}

/// Pixels of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE).contains(side));
        text.split_once(['x', 'X'])
            .and_then(|(width, height)| Some(Self { width: side(width)?, height: side(height)? }))
            .ok_or_else(|| format!("expected WIDTHxHEIGHT, each 1 to {MAX_SIDE}, as in 1280x720"))
    }
}

/// A number of seconds, at least 0.
fn parse_time(text: &str) -> std::result::Result<f64, String> {
    let time = text.parse().ok().filter(|time: &f64| (0.0..=1e6).contains(time));
    time.ok_or_else(|| "expected seconds from 0 to 1000000, as in 1.5".to_owned())
}

/// Frames a second.
fn parse_fps(text: &str) -> std::result::Result<f64, String> {
    let fps = text.parse().ok().filter(|fps: &f64| (1e-3..=1e6).contains(fps));
    fps.ok_or_else(|| "expected frames a second, from 0.001 to 1000000, as in 24".to_owned())
}

/// Three finite numbers with commas between.
pub(crate) fn parse_vector(text: &str) -> std::result::Result<DVec3, String> {
    let vector = finite_list(text).map(DVec3::from_array);
    vector.ok_or_else(|| "expected three numbers with commas between, as in 1,2.5,-3".to_owned())
}

/// So many finite numbers with commas between.
pub(super) fn finite_list<const N: usize>(text: &str) -> Option<[f64; N]> {
    let finite = |number: &str| number.trim().parse().ok().filter(|number: &f64| number.is_finite());
    text.split(',').map(finite).collect::<Option<Vec<f64>>>()?.try_into().ok()
}

/// A number of bytes: `1.6G`, `500M`, `2GiB`, `123456`. K, M, G and T are powers of 1024.
pub(crate) fn parse_bytes(text: &str) -> std::result::Result<u64, String> {
    let lower = text.trim().to_ascii_lowercase();
    let digits = lower.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let factor = match &lower[digits.len()..] {
        "" | "b" => Some(1u64),
        "k" | "kb" | "ki" | "kib" => Some(1 << 10),
        "m" | "mb" | "mi" | "mib" => Some(1 << 20),
        "g" | "gb" | "gi" | "gib" => Some(1 << 30),
        "t" | "tb" | "ti" | "tib" => Some(1 << 40),
        _ => None,
    };
    let number = digits.trim_end().parse().ok().filter(|number: &f64| *number > 0.0);
    let bytes = number.zip(factor).map(|(number, factor)| number * factor as f64).filter(|bytes| *bytes < 1e18);
    bytes.map(|bytes| bytes as u64).ok_or_else(|| "expected a size as in 1.6G, 500M or 123456 (bytes)".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!("1280x720".parse(), Ok(Size { width: 1280, height: 720 }));
        assert_eq!("1X65536".parse(), Ok(Size { width: 1, height: 65536 }));
        for bad in ["", "x", "12", "0x1", "1x0", "65537x1", "-1x1", "1x1x1", "1.5x2", " 1x2"] {
            assert!(bad.parse::<Size>().is_err(), "{bad:?}");
        }
    }

    #[test]
    fn vectors() {
        assert_eq!(parse_vector("1,-2.5, 3e2"), Ok(DVec3::new(1.0, -2.5, 300.0)));
        for bad in ["", "1,2", "1,2,3,4", "1,2,nan", "1,2,inf", "a,b,c"] {
            assert!(parse_vector(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn sizes_of_memory() {
        let good = [
            ("1.5G", 3 << 29),
            ("500M", 500 << 20),
            ("2gib", 2 << 30),
            ("64 kB", 64 << 10),
            ("12", 12),
            ("1Ti", 1 << 40),
        ];
        for (text, bytes) in good {
            assert_eq!(parse_bytes(text), Ok(bytes), "{text}");
        }
        for bad in ["", "G", "-1G", "0", "1X", "nan", "inf", "1e30", "1 2M", "1.2.3G"] {
            assert!(parse_bytes(bad).is_err(), "{bad:?}");
        }
    }
}
