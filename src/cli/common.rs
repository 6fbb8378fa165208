//! Arguments that several subcommands share.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};

use super::progress;
use crate::error::{Error, Result, Warning};
use crate::io::{self, LoadOptions};
use crate::math::{DAabb, DVec3};
use crate::render::LARGEST_SIDE;
use crate::scene::{Camera, Scene};

/// Vertical angle of view where none is given, degrees.
const DEFAULT_FOV: f64 = 40.0;

/// A scene file and how to read it.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneArgs {
    /// Scene file: .glb, .gltf, .obj, .ply or .stl
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,

    /// Axis of the file that points up
    #[arg(long, value_enum, default_value_t)]
    up_axis: UpAxis,

    /// Length unit of the file
    #[arg(long, value_enum, default_value_t)]
    unit: Unit,

    /// Shading normals: those of the file, flat everywhere, or smooth everywhere
    #[arg(long, value_enum, default_value_t)]
    normals: Normals,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum UpAxis {
    #[default]
    Y,
    Z,
}

impl UpAxis {
    /// As the loaders have it.
    pub(crate) const fn axis(self) -> io::UpAxis {
        match self {
            Self::Y => io::UpAxis::Y,
            Self::Z => io::UpAxis::Z,
        }
    }
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Unit {
    #[default]
    M,
    Cm,
    Mm,
    In,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Normals {
    #[default]
    File,
    Flat,
    Smooth,
}

impl SceneArgs {
    /// Reads the scene.
    pub(crate) fn load(&self) -> Result<(Scene, Vec<Warning>)> {
        io::load(&self.scene, &self.options())
    }

    /// Reads the scene with a bar over the bytes of the file.
    pub(crate) fn load_with_bar(&self, quiet: bool) -> Result<(Scene, Vec<Warning>)> {
        // Whatever is wrong with the file is for the loader to say.
        let length = std::fs::metadata(&self.scene).map_or(0, |file| file.len());
        let bar = progress::bar(length, "loading", quiet);
        let scene = io::load_watched(&self.scene, &self.options(), Some(&|bytes| bar.inc(bytes)));
        bar.finish_and_clear();
        scene
    }

    /// How the file is understood.
    pub(crate) fn options(&self) -> LoadOptions {
        LoadOptions {
            up_axis: self.up_axis.axis(),
            unit: match self.unit {
                Unit::M => io::Unit::Metre,
                Unit::Cm => io::Unit::Centimetre,
                Unit::Mm => io::Unit::Millimetre,
                Unit::In => io::Unit::Inch,
            },
            normals: match self.normals {
                Normals::File => io::Normals::File,
                Normals::Flat => io::Normals::Flat,
                Normals::Smooth => io::Normals::Smooth,
            },
        }
    }
}

/// Where to look from: a camera of the file by name, or flags. Without either, the file's first camera, else a view of
/// everything.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Camera of the file, by name (default: its first; without any, a view of the whole scene)
    #[arg(long, value_name = "NAME", conflicts_with_all = ["eye", "look_at", "up", "fov"])]
    camera: Option<String>,

    /// Position, in metres with +y up, as --unit and --up-axis leave the scene
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    eye: Option<DVec3>,

    /// Point in the middle of the picture (default: the middle of the scene)
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, requires = "eye")]
    look_at: Option<DVec3>,

    /// Direction that points up in the picture (default: 0,1,0)
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, requires = "eye")]
    up: Option<DVec3>,

    /// Vertical angle of view, degrees (default: 40)
    #[arg(long, value_name = "DEG", value_parser = parse_fov, requires = "eye")]
    fov: Option<f64>,
}

impl CameraArgs {
    /// The camera, and in words where it comes from.
    pub(crate) fn choose(&self, scene: &Scene, aspect: f64) -> Result<(Camera, String)> {
        let bounds = scene.bounds();
        if let Some(eye) = self.eye {
            return Ok((self.flagged(eye, &bounds)?, "from the flags".to_owned()));
        }
        if let Some(name) = &self.camera {
            let found = scene.cameras.iter().find(|camera| camera.name == *name);
            let camera = found.ok_or_else(|| Error::Usage(unknown_camera(name, &scene.cameras)))?;
            return Ok((camera.clone(), format!("{name:?} of the file")));
        }
        Ok(match scene.cameras.first() {
            Some(camera) if camera.name.is_empty() => (camera.clone(), "the file's first".to_owned()),
            Some(camera) => (camera.clone(), format!("{:?}, the file's first", camera.name)),
            None => (Camera::framing(&bounds, aspect), "framed on the scene".to_owned()),
        })
    }

    fn flagged(&self, eye: DVec3, bounds: &DAabb) -> Result<Camera> {
        let target = self.look_at.unwrap_or_else(|| bounds.centre());
        let up = self.up.unwrap_or(DVec3::Y);
        let fov = self.fov.unwrap_or(DEFAULT_FOV).to_radians();
        Camera::look_at(eye, target, up, fov).ok_or_else(|| {
            Error::Usage(if eye == target {
                format!("--eye {} and --look-at {} are one point", list(eye), list(target))
            } else {
                format!("--up {} must be neither zero nor along the view from --eye to --look-at", list(up))
            })
        })
    }
}

fn unknown_camera(name: &str, cameras: &[Camera]) -> String {
    let names: Vec<_> = cameras.iter().filter(|c| !c.name.is_empty()).map(|c| format!("{:?}", c.name)).collect();
    let known = if names.is_empty() { "none that has a name".to_owned() } else { names.join(", ") };
    format!("no camera {name:?} in the scene; it has {known}")
}

/// The camera as flags that give it again.
pub(crate) fn camera_flags(camera: &Camera, bounds: &DAabb) -> String {
    let forward = -camera.frame.z_axis;
    // Any point ahead would do; one as far as the middle of the scene reads well.
    let ahead = (bounds.centre() - camera.eye).dot(forward);
    let target = camera.eye + forward * if ahead > 0.0 && ahead.is_finite() { ahead } else { 1.0 };
    let (eye, target, up) = (list(camera.eye), list(target), list(camera.frame.y_axis));
    format!("--eye {eye} --look-at {target} --up {up} --fov {}", camera.fov_y.to_degrees())
}

fn list(v: DVec3) -> String {
    // Adding zero makes -0 print as 0.
    format!("{},{},{}", v.x + 0.0, v.y + 0.0, v.z + 0.0)
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
        let side = |text: &str| text.parse().ok().filter(|side| (1..=LARGEST_SIDE).contains(side));
        text.split_once(['x', 'X'])
            .and_then(|(width, height)| Some(Self { width: side(width)?, height: side(height)? }))
            .ok_or_else(|| format!("expected WIDTHxHEIGHT, each 1 to {LARGEST_SIDE}, as in 1280x720"))
    }
}

/// Three finite numbers with commas between.
pub(crate) fn parse_vector(text: &str) -> std::result::Result<DVec3, String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|n| n.trim().parse().ok().filter(|n: &f64| n.is_finite())).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err("expected three numbers with commas between, as in 1,2.5,-3".to_owned()),
    }
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

/// An angle of view in degrees.
fn parse_fov(text: &str) -> std::result::Result<f64, String> {
    let degrees = text.parse().ok().filter(|&degrees: &f64| degrees > 0.0 && degrees < 180.0);
    degrees.ok_or_else(|| "expected an angle above 0 and below 180 degrees".to_owned())
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
    fn vectors_and_angles() {
        assert_eq!(parse_vector("1,-2.5, 3e2"), Ok(DVec3::new(1.0, -2.5, 300.0)));
        for bad in ["", "1,2", "1,2,3,4", "1,2,nan", "1,2,inf", "a,b,c"] {
            assert!(parse_vector(bad).is_err(), "{bad:?}");
        }
        assert_eq!(parse_fov("179.5"), Ok(179.5));
        for bad in ["0", "180", "-3", "nan", "x"] {
            assert!(parse_fov(bad).is_err(), "{bad:?}");
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

    #[test]
    fn printed_flags_give_the_camera_again() {
        let bounds = DAabb { min: DVec3::new(1e7, 0.0, -3.0), max: DVec3::new(1e7 + 4.0, 2.0, 5.0) };
        let camera = Camera::framing(&bounds, 1.5);
        let flags = camera_flags(&camera, &bounds);
        let words: Vec<_> = flags.split(' ').collect();
        assert_eq!([words[0], words[2], words[4], words[6]], ["--eye", "--look-at", "--up", "--fov"]);
        let args = CameraArgs {
            eye: parse_vector(words[1]).ok(),
            look_at: parse_vector(words[3]).ok(),
            up: parse_vector(words[5]).ok(),
            fov: parse_fov(words[7]).ok(),
            camera: None,
        };
        let again = args.flagged(args.eye.unwrap(), &bounds).unwrap();
        assert_eq!(again.eye, camera.eye);
        assert!((again.fov_y - camera.fov_y).abs() < 1e-12);
        let turned = [again.frame.x_axis - camera.frame.x_axis, again.frame.z_axis - camera.frame.z_axis];
        assert!(turned.iter().all(|d| d.length() < 1e-8), "{turned:?}");
    }

    #[test]
    fn cameras_that_cannot_be_are_bad_usage() {
        let bounds = DAabb { min: DVec3::ZERO, max: DVec3::ONE };
        let at_target = CameraArgs { eye: Some(DVec3::ONE), look_at: Some(DVec3::ONE), ..CameraArgs::default() };
        let upright = CameraArgs { eye: Some(DVec3::Y), look_at: Some(DVec3::ZERO), ..CameraArgs::default() };
        for (args, word) in [(at_target, "one point"), (upright, "--up 0,1,0")] {
            let error = args.flagged(args.eye.unwrap(), &bounds).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(word), "{error}");
        }
        let front = Camera { name: "front".to_owned(), ..Camera::framing(&bounds, 1.0) };
        let scene = Scene { cameras: vec![front], ..Scene::default() };
        let args = CameraArgs { camera: Some("back".to_owned()), ..CameraArgs::default() };
        let error = args.choose(&scene, 1.0).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("\"front\""), "{error}");
    }
}
