//! From a point of the film to a ray.
//!
//! Directions and origins are computed in f64 and rounded once.

mod general;
mod pinhole;

use crate::error::{Error, Result};
use crate::math::{DMat3, DVec2, DVec3, MAX_COORDINATE, Vec3};
use crate::ray::Ray;
use crate::scene::{Camera, Distortion, Projection};

use general::General;
pub(super) use pinhole::Pinhole;

/// A camera in front of a film of given size, in world coordinates.
#[derive(Clone, Debug)]
pub(super) enum View {
    /// A perspective that is sharp everywhere and bends nothing.
    Pinhole(Pinhole),
    /// Any other.
    General(Box<General>),
}

impl View {
    /// `centre` is [`World::centre`](crate::World).
    ///
    /// # Errors
    /// [`Error::Usage`] for places, angles, heights and lenses that cannot be, for parts that do not go together, and
    /// for a view so narrow that neighbouring pixels would have the same ray.
    pub(super) fn new(camera: &Camera, centre: DVec3, width: u32, height: u32) -> Result<Self> {
        check_numbers(camera)?;
        let size = DVec2::new(f64::from(width), f64::from(height));
        let half = camera.projection.half_extent(size.x / size.y).ok_or_else(|| {
            Error::Usage(match camera.projection {
                Projection::Perspective(fov) => {
                    format!("angle of view {fov}: must be above 0 and below 180 degrees")
                }
                Projection::Orthographic(height) => format!("a view of height {height} m: must be above 0"),
                Projection::Equirectangular => "a view that cannot be".to_owned(),
            })
        })?;
        if let Projection::Perspective(_) = camera.projection {
            check_resolution(half, size)?;
        }
        let view = General::new(camera, centre, size, half)?;
        let plain = matches!(camera.projection, Projection::Perspective(_))
            && camera.lens.is_none()
            && camera.distortion.is_none()
            && camera.end.is_none();
        Ok(if plain { Self::Pinhole(Pinhole::new(camera, centre, size, half)) } else { Self::General(Box::new(view)) })
    }

    /// The ray through a point of the film in pixels, from its top left corner, and through the point of the lens that
    /// `lens` gives, evenly over the unit square, at a time from 0 to 1. Points of the film that the lens does not
    /// reach have a ray that is not valid, and sees nothing.
    pub(super) fn ray(&self, film: DVec2, lens: impl FnOnce() -> DVec2, time: f32) -> Ray {
        match self {
            Self::Pinhole(pinhole) => Ray { time, ..pinhole.ray(film) },
            Self::General(view) => {
                let lens = if view.has_lens() { lens() } else { DVec2::ZERO };
                view.ray(film, lens, time)
            }
        }
    }

    /// Whether its rays depend on the time.
    pub(super) fn moves(&self) -> bool {
        match self {
            Self::Pinhole(_) => false,
            Self::General(view) => view.moves(),
        }
    }

    /// The ray through a point of the film and through the middle of the lens, at a time.
    pub(super) fn middle_ray(&self, film: DVec2, time: f32) -> Ray {
        match self {
            Self::Pinhole(pinhole) => Ray { time, ..pinhole.ray(film) },
            Self::General(view) => view.ray(film, view.middle_of_lens(), time),
        }
    }
}

/// Whether the camera stands somewhere and looks somewhere; what else it has is checked where it is used.
fn check_numbers(camera: &Camera) -> Result<()> {
    let Camera { eye, frame, ref end, shift, distortion, .. } = *camera;
    for (eye, frame) in [(eye, frame)].into_iter().chain(end.as_ref().map(|end| (end.eye, end.frame))) {
        if !eye.is_finite() {
            return Err(Error::Usage(format!("a camera at {eye}: its place must be finite")));
        }
        if eye.abs().max_element() > MAX_COORDINATE.into() {
            let message = format!("a camera at {eye}: its coordinates must be at most {MAX_COORDINATE:e}");
            return Err(Error::Usage(message));
        }
        // Not so of NaN.
        let is_frame = (frame.transpose() * frame).abs_diff_eq(DMat3::IDENTITY, 1e-6);
        if !is_frame {
            let message = format!(
                "a camera with the axes {frame}: they must be unit vectors to the right, up and back, at right angles"
            );
            return Err(Error::Usage(message));
        }
    }
    let Distortion { k1, k2, k3, p1, p2 } = distortion.unwrap_or_default();
    if !shift.is_finite() || ![k1, k2, k3, p1, p2].into_iter().all(f64::is_finite) {
        return Err(Error::Usage("a camera whose lens shift or distortion is not finite".to_owned()));
    }
    if let Projection::Orthographic(height) = camera.projection
        && height > MAX_COORDINATE.into()
    {
        return Err(Error::Usage(format!("a view of height {height:e} m: must be at most {MAX_COORDINATE:e}")));
    }
    if shift.abs().max_element() > Camera::MAX_SHIFT {
        let most = Camera::MAX_SHIFT;
        let message = format!("a lens shift of {shift}: at most {most} pictures to a side are possible");
        return Err(Error::Usage(message));
    }
    Ok(())
}

/// Unit vectors in f32 differ by 2^-24 at least where a component is near 1; twice that tells every two pixels apart.
fn check_resolution(half: DVec2, size: DVec2) -> Result<()> {
    const STEP: f64 = 1.2e-7;
    if half.x * 2.0 >= STEP * size.x && half.y * 2.0 >= STEP * size.y {
        return Ok(());
    }
    let smallest = 2.0 * libm::atan(STEP * size.y / 2.0).to_degrees();
    Err(Error::Usage(format!(
        "an angle of view so small that neighbouring pixels would have the same ray: take at least {smallest:.2e} degrees \
         (vertical), or fewer pixels"
    )))
}

/// A ray that hits nothing.
fn no_ray(origin: Vec3) -> Ray {
    Ray::new(origin, Vec3::ZERO)
}
