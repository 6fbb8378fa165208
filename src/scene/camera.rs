//! A pinhole camera.

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
    /// Full vertical angle of view, radians, in (0, pi).
    pub fov_y: f64,
    /// Lens shift: how far the picture's middle is moved from where the camera looks, to the right and up, as shares of
    /// the picture's width and height (half of it puts the view's centre on the picture's edge).
    pub shift: DVec2,
}

impl Camera {
    /// A camera at `eye` that looks at `target`. None where they coincide or `up` is parallel to the view.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, fov_y: f64) -> Option<Self> {
        let back = (eye - target).try_normalize()?;
        let right = up.try_normalize()?.cross(back);
        // A sine below 1e-9: the frame would be noise.
        let right = if right.length() > 1e-9 {
            right.normalize()
        } else {
            return None;
        };
        let frame = DMat3::from_cols(right, back.cross(right), back);
        (eye.is_finite() && frame.is_finite()).then(|| Self {
            name: String::new(),
            eye,
            frame,
            fov_y,
            shift: DVec2::ZERO,
        })
    }

    /// A view of the whole of `bounds`, from the front, a little from the right and above.
    pub fn framing(bounds: &DAabb, aspect: f64) -> Self {
        let fov_y: f64 = 40f64.to_radians();
        let half = (fov_y / 2.0).min(libm::atan(libm::tan(fov_y / 2.0) * aspect));
        let radius = if bounds.radius() > 0.0 { bounds.radius() } else { 1.0 };
        let direction = DVec3::new(0.45, 0.35, 1.0).normalize();
        let eye = bounds.centre() + direction * (radius / libm::sin(half));
        Self::look_at(eye, bounds.centre(), DVec3::Y, fov_y).expect("the direction is neither zero nor vertical")
    }

    /// Moves the camera. Scale and shear move the eye and leave the angle of view as it is.
    pub(crate) fn transform(&mut self, transform: &DAffine3) {
        self.eye = transform.transform_point3(self.eye);
        let back = (transform.matrix3 * self.frame.z_axis).normalize();
        let right = (transform.matrix3 * self.frame.y_axis).cross(back).normalize();
        self.frame = DMat3::from_cols(right, back.cross(right), back);
    }
}
