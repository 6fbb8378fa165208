//! A pinhole camera.

use std::fmt;

use crate::math::{DAabb, DAffine3, DMat3, DVec2, DVec3};

/// A pinhole camera. It looks along its -z, +y is up, +x is right (glTF's convention).
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, for `--camera`; may be empty.
    pub name: String,
    /// Position of the pinhole, in scene coordinates.
    pub eye: DVec3,
    /// Right, up and back as unit columns.
    pub frame: DMat3,
    /// How much of the view is in the picture.
    pub fov: Fov,
    /// Lens shift: how far the picture's middle is moved from where the camera looks, to the right and up, as shares of
    /// the picture's width and height (half of it puts the view's centre on the picture's edge).
    pub shift: DVec2,
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
    /// A camera at `eye` that looks at `target`, with a vertical angle of view. Where `up` is along the view, up in the
    /// picture is what it becomes for a camera that is tilted until it looks up or down: -z for one that looks along -z
    /// and is tilted down. None where `eye` and `target` coincide, where `up` is zero, and for what is not finite.
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
            fov: Fov::Vertical(fov),
            shift: DVec2::ZERO,
        })
    }

    /// A view of the whole of `bounds`, from the front, a little from the right and above.
    pub fn framing(bounds: &DAabb, aspect: f64) -> Self {
        let fov = 40f64.to_radians();
        let half = (fov / 2.0).min(libm::atan(libm::tan(fov / 2.0) * aspect));
        let radius = if bounds.radius() > 0.0 { bounds.radius() } else { 1.0 };
        let direction = DVec3::new(0.45, 0.35, 1.0).normalize();
        let eye = bounds.centre() + direction * (radius / libm::sin(half));
        Self::look_at(eye, bounds.centre(), DVec3::Y, fov).expect("the direction is neither zero nor vertical")
    }

    /// Moves the camera. Scale and shear move the eye and leave the angle of view as it is.
    pub(crate) fn transform(&mut self, transform: &DAffine3) {
        self.eye = transform.transform_point3(self.eye);
        let back = (transform.matrix3 * self.frame.z_axis).normalize();
        let right = (transform.matrix3 * self.frame.y_axis).cross(back).normalize();
        self.frame = DMat3::from_cols(right, back.cross(right), back);
    }
}
