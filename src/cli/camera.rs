//! Where to look from: a camera of the file, or flags; and a camera as flags.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::common::{finite_list, parse_vector};
use crate::error::{Error, Result};
use crate::image;
use crate::math::{DAabb, DVec2, DVec3};
use crate::scene::{Camera, DEFAULT_FOV, Distortion, Fov, Pose, Projection, Scene, ThinLens};

/// Where to look from: a camera of the file by name, or flags. Without either, the file's first camera, else a view of
/// everything.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Camera of the file, by name, or that of an OpenEXR picture which this program wrote (default: the file's first;
    /// without any, a view of the whole scene)
    #[arg(long, value_name = "NAME", conflicts_with_all = ["eye", "look_at", "up", "eye_end", "look_at_end", "up_end", "fov", "fov_x", "shift",
        "projection", "height"])]
    camera: Option<String>,

    /// Position, in metres with +y up, as --unit and --up-axis leave the scene; the flags from --look-at to --height go
    /// with it
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    eye: Option<DVec3>,

    /// Point in the middle of the picture (default: the middle of the scene)
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, requires = "eye")]
    look_at: Option<DVec3>,

    /// Direction that points up in the picture (default: 0,1,0)
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, requires = "eye")]
    up: Option<DVec3>,

    /// Position at time 1 of a camera that moves while the shutter is open (default: as --eye)
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, requires = "eye")]
    eye_end: Option<DVec3>,

    /// Point in the middle of the picture at time 1 (default: as --look-at)
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, requires = "eye")]
    look_at_end: Option<DVec3>,

    /// Direction that points up in the picture at time 1 (default: as --up)
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, requires = "eye")]
    up_end: Option<DVec3>,

    /// Vertical angle of view, degrees (default: 40, or what --fov-x leaves)
    #[arg(long, value_name = "DEG", value_parser = parse_fov, requires = "eye")]
    fov: Option<f64>,

    /// Horizontal angle of view, degrees; with --fov, pixels need not be square
    #[arg(long, value_name = "DEG", value_parser = parse_fov, requires = "eye")]
    fov_x: Option<f64>,

    /// Moves the picture to the right and up, in shares of its width and height, without turning the camera
    #[arg(long, value_name = "X,Y", value_parser = parse_shift, allow_hyphen_values = true, requires = "eye")]
    shift: Option<DVec2>,

    /// Which rays make the picture
    #[arg(long, value_enum, default_value_t, requires = "eye")]
    projection: ProjectionArg,

    /// Height of an orthographic picture, metres (default: that of the scene's bounding sphere)
    #[arg(long, value_name = "M", value_parser = parse_length, requires = "eye")]
    height: Option<f64>,

    /// Radius of the lens's opening, metres: what is not in the plane of focus is blurred (default: the file's)
    #[arg(long, value_name = "M", value_parser = parse_length)]
    aperture: Option<f64>,

    /// From the lens to the plane of focus, metres (default: the file's, else that of --look-at)
    #[arg(long, value_name = "M", value_parser = parse_length)]
    focus: Option<f64>,

    /// Blades of the lens's diaphragm, at least 3 (default: the file's, else round)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(3..=100))]
    blades: Option<u32>,

    /// Distortion of the lens after Brown and Conrady, as OpenCV has it
    #[arg(long, value_name = "K1,K2,K3,P1,P2", value_parser = parse_distortion, allow_hyphen_values = true)]
    distortion: Option<Distortion>,

    /// When the shutter opens and closes, of the time from 0 to 1 in which things move (default: the file's, else 0,1)
    #[arg(long, value_name = "OPEN,CLOSE", value_parser = parse_shutter)]
    shutter: Option<[f32; 2]>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum ProjectionArg {
    /// All rays meet in the eye
    #[default]
    Perspective,
    /// All rays are parallel
    Orthographic,
    /// The whole sphere around the eye
    Equirectangular,
}

impl CameraArgs {
    /// Whether it is said when the shutter opens and closes.
    pub(crate) const fn has_shutter(&self) -> bool {
        self.shutter.is_some()
    }

    /// The camera, and in words where it comes from.
    pub(crate) fn choose(&self, scene: &Scene, aspect: f64) -> Result<(Camera, String)> {
        let bounds = scene.bounds();
        let (mut camera, source) = self.without_lens(scene, &bounds, aspect)?;
        if self.aperture.is_some() || self.focus.is_some() || self.blades.is_some() {
            let radius = self.aperture.or(camera.lens.map(|lens| lens.radius)).ok_or_else(|| {
                Error::Usage(
                    "--focus and --blades are about a lens, which the camera does not have: add --aperture".to_owned(),
                )
            })?;
            let target = self.look_at.unwrap_or_else(|| bounds.centre());
            let to_target = (target - camera.eye).dot(-camera.frame.z_axis);
            let before = camera.lens.map(|lens| lens.focus);
            let focus = self.focus.or(before).or((to_target > 0.0).then_some(to_target)).ok_or_else(|| {
                Error::Usage("--aperture needs --focus: what the camera should look at is not ahead of it".to_owned())
            })?;
            let blades = self.blades.or(camera.lens.map(|lens| lens.blades)).unwrap_or(0);
            camera.lens = Some(ThinLens { radius, focus, blades });
        }
        camera.distortion = self.distortion.or(camera.distortion);
        camera.shutter = self.shutter.unwrap_or(camera.shutter);
        Ok((camera, source))
    }

    /// The picture whose camera is asked for, if it is one of a file.
    pub(super) fn picture(&self) -> Option<PathBuf> {
        let path = Path::new(self.camera.as_ref()?);
        (image::holds_channels(path) && path.is_file()).then(|| path.to_owned())
    }

    fn without_lens(&self, scene: &Scene, bounds: &DAabb, aspect: f64) -> Result<(Camera, String)> {
        if let Some(eye) = self.eye {
            return Ok((self.flagged(eye, bounds)?, "from the flags".to_owned()));
        }
        if let Some(name) = &self.camera {
            let found = scene.cameras.iter().find(|camera| camera.name == *name);
            if found.is_none() && image::holds_channels(Path::new(name)) {
                let path = Path::new(name);
                let camera = image::read_metadata(path)?.camera();
                let camera = camera.ok_or_else(|| Error::input(path, "", "does not tell of a camera"))?;
                return Ok((camera, format!("that of the picture {name}")));
            }
            let camera = found.ok_or_else(|| Error::Usage(unknown_camera(name, &scene.cameras)))?;
            return Ok((camera.clone(), format!("{name:?} of the file")));
        }
        Ok(match scene.cameras.first() {
            Some(camera) if camera.name.is_empty() => (camera.clone(), "the file's first".to_owned()),
            Some(camera) => (camera.clone(), format!("{:?}, the file's first", camera.name)),
            None => (Camera::framing(bounds, aspect), "framed on the scene".to_owned()),
        })
    }

    /// An error where a flag means nothing to the projection.
    fn check_projection(&self) -> Result<()> {
        let flags = [
            ("--fov", self.fov.is_some(), ProjectionArg::Perspective),
            ("--fov-x", self.fov_x.is_some(), ProjectionArg::Perspective),
            ("--height", self.height.is_some(), ProjectionArg::Orthographic),
        ];
        if self.shift.is_some() && self.projection == ProjectionArg::Equirectangular {
            let message =
                "--shift is not for --projection equirectangular, which shows the whole sphere; turn the camera";
            return Err(Error::Usage(message.to_owned()));
        }
        let alien = flags.into_iter().find(|(_, is_given, projection)| *is_given && *projection != self.projection);
        let Some((flag, _, projection)) = alien else { return Ok(()) };
        let name = |projection: ProjectionArg| {
            projection.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
        };
        let (needed, chosen) = (name(projection), name(self.projection));
        Err(Error::Usage(format!("{flag} is for --projection {needed}, and the projection is {chosen}")))
    }

    fn flagged(&self, eye: DVec3, bounds: &DAabb) -> Result<Camera> {
        self.check_projection()?;
        let target = self.look_at.unwrap_or_else(|| bounds.centre());
        let up = self.up.unwrap_or(DVec3::Y);
        let fov = match (self.fov_x, self.fov) {
            (None, vertical) => Fov::Vertical(vertical.unwrap_or(DEFAULT_FOV).to_radians()),
            (Some(horizontal), None) => Fov::Horizontal(horizontal.to_radians()),
            (Some(horizontal), Some(vertical)) => {
                Fov::Both { horizontal: horizontal.to_radians(), vertical: vertical.to_radians() }
            }
        };
        let camera = looking([eye, target, up], ["--eye", "--look-at", "--up"])?;
        let ends = [self.eye_end, self.look_at_end, self.up_end];
        let end = if ends.iter().any(Option::is_some) {
            let [eye, target, up] = [0, 1, 2].map(|i| ends[i].unwrap_or([eye, target, up][i]));
            let end = looking([eye, target, up], ["--eye-end", "--look-at-end", "--up-end"])?;
            Some(Pose { eye: end.eye, frame: end.frame })
        } else {
            None
        };
        let projection = match self.projection {
            ProjectionArg::Perspective => Projection::Perspective(fov),
            ProjectionArg::Orthographic => {
                let radius = if bounds.radius() > 0.0 { bounds.radius() } else { 1.0 };
                Projection::Orthographic(self.height.unwrap_or(2.0 * radius))
            }
            ProjectionArg::Equirectangular => Projection::Equirectangular,
        };
        Ok(Camera { projection, end, shift: self.shift.unwrap_or(DVec2::ZERO), ..camera })
    }
}

/// A camera at a point that looks at another; `flags` are where the three are from.
fn looking([eye, target, up]: [DVec3; 3], flags: [&str; 3]) -> Result<Camera> {
    Camera::look_at(eye, target, up, 1.0).ok_or_else(|| {
        let [eye_flag, target_flag, up_flag] =
            [0, 1, 2].map(|i| format!("{} {}", flags[i], list([eye, target, up][i])));
        Error::Usage(Camera::no_look([&eye_flag, &target_flag, &up_flag], [eye, target, up]))
    })
}

fn unknown_camera(name: &str, cameras: &[Camera]) -> String {
    let names: Vec<_> = cameras.iter().filter(|c| !c.name.is_empty()).map(|c| format!("{:?}", c.name)).collect();
    let known = if names.is_empty() { "none that has a name".to_owned() } else { names.join(", ") };
    format!("no camera {name:?} in the scene; it has {known}")
}

/// The camera as flags that give it again.
pub(crate) fn camera_flags(camera: &Camera, bounds: &DAabb) -> String {
    let pose = |pose: Pose, suffix: &str| {
        let Pose { eye, frame } = pose;
        // Any point ahead would do; one as far as the middle of the scene reads well.
        let ahead = (eye - bounds.centre()).dot(frame.z_axis);
        let target = pose.target(if ahead > 0.0 && ahead.is_finite() { ahead } else { 1.0 });
        let (eye, target, up) = (list(eye), list(target), list(frame.y_axis));
        format!("--eye{suffix} {eye} --look-at{suffix} {target} --up{suffix} {up}")
    };
    let mut flags = pose(camera.pose(0.0), "");
    if let Some(end) = camera.end {
        flags += &format!(" {}", pose(end, "-end"));
    }
    flags += &match camera.projection {
        Projection::Perspective(Fov::Vertical(angle)) => format!(" --fov {}", angle.to_degrees()),
        Projection::Perspective(Fov::Horizontal(angle)) => format!(" --fov-x {}", angle.to_degrees()),
        Projection::Perspective(Fov::Both { horizontal, vertical }) => {
            format!(" --fov-x {} --fov {}", horizontal.to_degrees(), vertical.to_degrees())
        }
        Projection::Orthographic(height) => format!(" --projection orthographic --height {height}"),
        Projection::Equirectangular => " --projection equirectangular".to_owned(),
    };
    let DVec2 { x, y } = camera.shift;
    if camera.shift != DVec2::ZERO {
        flags += &format!(" --shift {x},{y}");
    }
    if let Some(ThinLens { radius, focus, blades }) = camera.lens {
        flags += &format!(" --aperture {radius} --focus {focus}");
        if blades >= 3 {
            flags += &format!(" --blades {blades}");
        }
    }
    if let Some(Distortion { k1, k2, k3, p1, p2 }) = camera.distortion {
        flags += &format!(" --distortion {k1},{k2},{k3},{p1},{p2}");
    }
    if camera.shutter != [0.0, 1.0] {
        let [open, close] = camera.shutter;
        flags += &format!(" --shutter {open},{close}");
    }
    flags
}

fn list(v: DVec3) -> String {
    // Adding zero makes -0 print as 0.
    format!("{},{},{}", v.x + 0.0, v.y + 0.0, v.z + 0.0)
}

/// When the shutter opens and closes.
fn parse_shutter(text: &str) -> std::result::Result<[f32; 2], String> {
    let times = finite_list(text).filter(|&[open, close]| 0.0 <= open && open <= close && close <= 1.0);
    times
        .map(|times| times.map(|time| time as f32))
        .ok_or_else(|| "expected two times from 0 to 1, the earlier first, as in 0,0.5".to_owned())
}

/// Two finite numbers with a comma between.
fn parse_shift(text: &str) -> std::result::Result<DVec2, String> {
    finite_list(text)
        .map(DVec2::from_array)
        .ok_or_else(|| "expected two numbers with a comma between, as in 0.25,0".to_owned())
}

/// A finite number above 0.
fn parse_length(text: &str) -> std::result::Result<f64, String> {
    let length = text.parse().ok().filter(|&length: &f64| length > 0.0 && length.is_finite());
    length.ok_or_else(|| "expected a length above 0".to_owned())
}

/// Five finite numbers with commas between.
fn parse_distortion(text: &str) -> std::result::Result<Distortion, String> {
    let distortion = finite_list(text).map(|[k1, k2, k3, p1, p2]| Distortion { k1, k2, k3, p1, p2 });
    distortion.ok_or_else(|| "expected five numbers with commas between, as in -0.28,0.07,0,0.001,0".to_owned())
}

/// An angle of view in degrees.
fn parse_fov(text: &str) -> std::result::Result<f64, String> {
    let degrees = text.parse().ok().filter(|&degrees: &f64| degrees > 0.0 && degrees < 180.0);
    degrees.ok_or_else(|| "expected an angle above 0 and below 180 degrees".to_owned())
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::math::Vec3;
    use crate::scene::{Geometry, Mesh};

    #[derive(Parser)]
    struct Parsed {
        #[command(flatten)]
        camera: CameraArgs,
    }

    /// A scene of the given bounds.
    fn scene(bounds: &DAabb) -> Scene {
        let size = (bounds.max - bounds.min).as_vec3();
        let mesh = Mesh { origin: bounds.min, ..Mesh::new(vec![Vec3::ZERO, size, Vec3::X], vec![[0, 1, 2]]) };
        Scene::from_geometries(vec![Geometry::Mesh(mesh)], Vec::new())
    }

    #[test]
    fn angles_and_shifts() {
        assert_eq!(parse_fov("179.5"), Ok(179.5));
        for bad in ["0", "180", "-3", "nan", "x"] {
            assert!(parse_fov(bad).is_err(), "{bad:?}");
        }
        assert_eq!(parse_shift("-0.5, 2"), Ok(DVec2::new(-0.5, 2.0)));
        for bad in ["", "1", "1,2,3", "1,nan", "inf,0"] {
            assert!(parse_shift(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn printed_flags_give_the_camera_again() {
        let bounds = DAabb { min: DVec3::new(1e7, 0.0, -3.0), max: DVec3::new(1e7 + 4.0, 2.0, 5.0) };
        let framed = Camera::framing(&bounds, 1.5);
        let perspective = Projection::Perspective;
        let lens = ThinLens { radius: 0.1, focus: 7.0, blades: 5 };
        let distortion = Distortion { k1: -0.3, k2: 0.1, k3: 0.0, p1: 1e-3, p2: -1e-4 };
        for camera in [
            Camera { projection: perspective(Fov::Vertical(0.7)), ..framed.clone() },
            Camera { projection: perspective(Fov::Horizontal(1.1)), shift: DVec2::Y, ..framed.clone() },
            Camera { projection: perspective(Fov::Both { horizontal: 2.0, vertical: 0.3 }), ..framed.clone() },
            Camera { projection: Projection::Orthographic(4.5), shift: DVec2::new(-0.5, 0.25), ..framed.clone() },
            Camera { projection: Projection::Equirectangular, ..framed.clone() },
            Camera { lens: Some(lens), distortion: Some(distortion), ..framed.clone() },
            Camera { end: Some(Camera::framing(&bounds, 0.3).pose(0.0)), ..framed.clone() },
            Camera { lens: Some(ThinLens { blades: 0, ..lens }), ..framed },
        ] {
            let flags = camera_flags(&camera, &bounds);
            let args = Parsed::try_parse_from(["it"].into_iter().chain(flags.split(' '))).expect("valid flags").camera;
            let (again, _) = args.choose(&scene(&bounds), 1.5).unwrap();
            assert_eq!((again.eye, again.shift, again.lens), (camera.eye, camera.shift, camera.lens));
            assert_eq!(again.distortion, camera.distortion);
            let extents = [&again, &camera].map(|camera| camera.projection.half_extent(1.5).unwrap());
            assert!((extents[0] - extents[1]).length() < 1e-12, "{flags}");
            let turned = [again.frame.x_axis - camera.frame.x_axis, again.frame.z_axis - camera.frame.z_axis];
            assert!(turned.iter().all(|d| d.length() < 1e-8), "{turned:?}");
            assert_eq!(again.end.map(|end| end.eye), camera.end.map(|end| end.eye), "{flags}");
        }
    }

    #[test]
    fn cameras_that_cannot_be_are_bad_usage() {
        let bounds = DAabb { min: DVec3::ZERO, max: DVec3::ONE };
        let at_target = CameraArgs { eye: Some(DVec3::ONE), look_at: Some(DVec3::ONE), ..CameraArgs::default() };
        let no_up = CameraArgs { eye: Some(DVec3::Y), up: Some(DVec3::ZERO), ..CameraArgs::default() };
        let far = CameraArgs { eye: Some(DVec3::X * 1e300), ..CameraArgs::default() };
        for (args, word) in [(at_target, "one point"), (no_up, "--up 0,0,0"), (far, "too far")] {
            let error = args.flagged(args.eye.unwrap(), &bounds).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(word), "{error}");
        }
        let parsed = |flags: &[&str]| Parsed::parse_from([&["test", "--eye", "1,2,3"], flags].concat()).camera;
        for (flags, words) in [
            (&["--height", "3"][..], "--height is for --projection orthographic, and the projection is perspective"),
            (&["--projection", "orthographic", "--fov", "30"], "--fov is for --projection perspective"),
            (&["--projection", "equirectangular", "--fov-x", "30"], "the projection is equirectangular"),
            (&["--projection", "equirectangular", "--shift", "0,0.25"], "--shift is not for"),
        ] {
            let error = parsed(flags).flagged(DVec3::X, &bounds).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(words), "{error}");
        }
        assert!(parsed(&["--projection", "orthographic", "--height", "3"]).flagged(DVec3::X, &bounds).is_ok());
        let front = Camera { name: "front".to_owned(), ..Camera::framing(&bounds, 1.0) };
        let scene = Scene { cameras: vec![front], ..Scene::default() };
        let args = CameraArgs { camera: Some("back".to_owned()), ..CameraArgs::default() };
        let error = args.choose(&scene, 1.0).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("\"front\""), "{error}");
    }
}
