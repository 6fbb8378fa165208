//! Cameras: where they stand, what they project, through which lens.

use std::fmt;

use super::pose::{Pose, PoseInterpolation};
use crate::math::{DAabb, DAffine3, DMat3, DVec2, DVec3};

/// The vertical angle of view where nothing else is asked for, in degrees.
pub const DEFAULT_FOV: f64 = 40.0;

/// A camera. It looks along its -z, +y is up, +x is right (glTF's convention).
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, for `--camera`; may be empty.
    pub name: String,
    /// Position of the pinhole, or of the lens's middle, in scene coordinates; of one that moves, at time 0.
    pub eye: DVec3,
    /// Right, up and back as unit columns; of one that moves, at time 0.
    pub frame: DMat3,
    /// Of one that moves, where it is at time 1. In between it is on its [`PoseInterpolation`] there.
    pub end: Option<Pose>,
    /// Which ray belongs to a point of the picture.
    pub projection: Projection,
    /// Lens shift: how far the picture's middle is moved from where the camera looks, to the right and up, as shares of
    /// the picture's width and height (half of it puts the view's centre on the picture's edge).
    pub shift: DVec2,
    /// A lens with an opening; none for a pinhole, which is sharp at every distance. Not for
    /// [`Projection::Equirectangular`].
    pub lens: Option<ThinLens>,
    /// How the lens bends straight lines; for [`Projection::Perspective`] alone.
    pub distortion: Option<Distortion>,
    /// When it is open, of the time from 0 to 1 in which things move: from the first to the second.
    pub shutter: [f32; 2],
}

/// Which ray belongs to a point of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// All rays meet in the eye.
    Perspective(Fov),
    /// All rays are parallel; the picture's height in metres, above 0. Pixels are square.
    Orthographic(f64),
    /// The whole sphere: longitude along the width, with the view's middle in the picture's, latitude along the height.
    Equirectangular,
}

impl Projection {
    /// Half the width and half the height of a picture that is `aspect` times as wide as high: at distance 1 for a
    /// perspective, in metres if orthographic, else in radians. None for what [`Fov`] and the height do not allow.
    pub fn half_extent(self, aspect: f64) -> Option<DVec2> {
        match self {
            Self::Perspective(fov) => fov.half_extent(aspect),
            Self::Orthographic(height) => {
                (height > 0.0 && height.is_finite()).then(|| DVec2::new(aspect, 1.0) * (height / 2.0))
            }
            Self::Equirectangular => Some(DVec2::new(std::f64::consts::PI, std::f64::consts::FRAC_PI_2)),
        }
    }
}

/// A lens without thickness: what lies in the plane of focus is sharp (Cook, Porter, Carpenter 1984, *Distributed ray
/// tracing*).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinLens {
    /// Of the opening, metres, above 0.
    pub radius: f64,
    /// From the lens to the plane of focus, along the view, metres, above 0.
    pub focus: f64,
    /// Blades of the diaphragm, which is a regular polygon in the circle of `radius`; below 3 for a round one.
    pub blades: u32,
}

/// The distortion of Brown (1966, *Decentering distortion of lenses*) and Conrady (1919), in OpenCV's order and sense:
/// a point that would be seen at (x, y) at distance 1, x to the right and y down, is seen at x (1 + k1 r^2 + k2 r^4 +
/// k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2), y (1 + ...) + p1 (r^2 + 2 y^2) + 2 p2 x y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Radial, second power.
    pub k1: f64,
    /// Radial, fourth power.
    pub k2: f64,
    /// Radial, sixth power.
    pub k3: f64,
    /// Tangential.
    pub p1: f64,
    /// Tangential.
    pub p2: f64,
}

/// Full angles of view, radians, each in (0, pi).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fov {
    /// From the lower edge of the picture to the upper; pixels are square.
    Vertical(f64),
    /// From the left edge to the right; pixels are square.
    Horizontal(f64),
    /// Both, whatever shape that gives to pixels.
    Both {
        /// From the left edge to the right.
        horizontal: f64,
        /// From the lower edge to the upper.
        vertical: f64,
    },
}

impl Fov {
    /// Half the width and half the height of a picture at distance 1, which is `aspect` times as wide as high. None for
    /// angles outside (0, pi).
    pub fn half_extent(self, aspect: f64) -> Option<DVec2> {
        let half = |angle: f64| (angle > 0.0 && angle < std::f64::consts::PI).then(|| libm::tan(angle / 2.0));
        Some(match self {
            Self::Vertical(angle) => DVec2::new(half(angle)? * aspect, half(angle)?),
            Self::Horizontal(angle) => DVec2::new(half(angle)?, half(angle)? / aspect),
            Self::Both { horizontal, vertical } => DVec2::new(half(horizontal)?, half(vertical)?),
        })
    }
}

impl fmt::Display for Fov {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Vertical(angle) => write!(f, "{}", angle.to_degrees()),
            Self::Horizontal(angle) => write!(f, "{} (horizontal)", angle.to_degrees()),
            Self::Both { horizontal, vertical } => {
                write!(f, "{} (horizontal), {} (vertical)", horizontal.to_degrees(), vertical.to_degrees())
            }
        }
    }
}

impl Camera {
    /// The largest [`shift`](Self::shift) that a picture is made with.
    pub const MAX_SHIFT: f64 = 1000.0;

    /// A camera at `eye` that looks at `target`, with a vertical angle of view of `fov` radians, between 0 and pi.
    /// Where `up` is along the view, up in the picture is what it becomes for a camera that is tilted until it looks up
    /// or down: -z for one that looks along -z and is tilted down. None where `eye` and `target` coincide, where `up`
    /// is zero, and where these are not finite; the angle is looked at by who renders.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, fov: f64) -> Option<Self> {
        let back = (eye - target).try_normalize()?;
        let up = up.try_normalize()?;
        let mut right = up.cross(back);
        // A sine below 1e-9: the frame would be noise.
        if right.length() <= 1e-9 {
            let ahead = if up.z.abs() < 0.9 { DVec3::NEG_Z } else { DVec3::Y };
            right = (ahead * up.dot(back).signum()).cross(back);
        }
        let right = right.normalize();
        let frame = DMat3::from_cols(right, back.cross(right), back);
        (eye.is_finite() && frame.is_finite()).then(|| Self {
            name: String::new(),
            eye,
            frame,
            end: None,
            projection: Projection::Perspective(Fov::Vertical(fov)),
            shift: DVec2::ZERO,
            lens: None,
            distortion: None,
            shutter: [0.0, 1.0],
        })
    }

    /// Why [`Camera::look_at`] gives none, where it does, in words for which the three have these names.
    #[doc(hidden)]
    pub fn no_look(names: [&str; 3], [eye, target, up]: [DVec3; 3]) -> String {
        let [eye_name, target_name, up_name] = names;
        if eye == target {
            format!("{eye_name} and {target_name} are one point")
        } else if up == DVec3::ZERO {
            format!("{up_name} is zero, which is no direction")
        } else if up.try_normalize().is_none() {
            format!("{up_name} is too long or too short; give it about the length 1")
        } else {
            format!("{eye_name} and {target_name} are too far apart, or too near each other")
        }
    }

    /// A view of the whole of `bounds`, from the front, a little from the right and above; of something about a point,
    /// where there is no more to see.
    ///
    /// # Panics
    /// For bounds that reach beyond 1e150, and an aspect that is not between 1e-100 and 1e100: lengths and angles are
    /// then not finite, or 0.
    pub fn framing(bounds: &DAabb, aspect: f64) -> Self {
        let fov = DEFAULT_FOV.to_radians();
        let half = (fov / 2.0).min(libm::atan(libm::tan(fov / 2.0) * aspect));
        // What f64 still keeps apart from the middle, so that there is a direction from there.
        let least = bounds.centre().abs().max_element() * 0.5f64.powi(40);
        let radius = if bounds.radius() > 0.0 { bounds.radius() } else { 1.0 }.max(least);
        let direction = DVec3::new(0.45, 0.35, 1.0).normalize();
        let eye = bounds.centre() + direction * (radius / libm::sin(half));
        Self::look_at(eye, bounds.centre(), DVec3::Y, fov).expect("bounds and aspect are of this world")
    }

    /// Where it is at a time from 0 to 1.
    pub fn pose(&self, time: f64) -> Pose {
        let start = Pose { eye: self.eye, frame: self.frame };
        self.end.map_or(start, |end| PoseInterpolation::new(start, end).at(time))
    }

    /// Moves the camera. Scale and shear move the eye and leave angles of view as they are; lengths are scaled.
    pub(crate) fn transform(&mut self, transform: &DAffine3) {
        Pose { eye: self.eye, frame: self.frame } = Pose { eye: self.eye, frame: self.frame }.transformed(transform);
        self.end = self.end.map(|end| end.transformed(transform));
        let scale = transform.matrix3.determinant().abs().cbrt();
        if let Projection::Orthographic(height) = &mut self.projection {
            *height *= scale;
        }
        if let Some(lens) = &mut self.lens {
            lens.radius *= scale;
            lens.focus *= scale;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// However far away and small, what is framed is in the middle of the picture.
    #[test]
    fn framing_looks_at_the_middle_from_a_distance() {
        for (away, size) in [(0.0, 1.0), (0.0, 0.0), (0.0, 1e30), (1e17, 0.0), (1e17, 1.0), (-1e30, 1e10), (1e6, 1e-3)]
        {
            let middle = DVec3::new(away, -away, away);
            let bounds = DAabb::EMPTY.include(middle).include(middle + DVec3::splat(size));
            let camera = Camera::framing(&bounds, 1.5);
            let way = bounds.centre() - camera.eye;
            assert!(way.length() >= bounds.radius() && camera.eye.is_finite(), "{away} {size}");
            assert!(way.normalize().dot(-camera.frame.z_axis) > 1.0 - 1e-6, "{away} {size}");
        }
    }
}
