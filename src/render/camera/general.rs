//! Rays of every other camera: parallel, of the whole sphere, through a lens with an opening, through one that bends
//! lines, from one that moves.

use super::no_ray;
use crate::error::{Error, Result};
use crate::math::{DVec2, DVec3, MAX_COORDINATE};
use crate::ray::Ray;
use crate::scene::{Camera, Distortion, Pose, PoseInterpolation, Projection, ThinLens};

/// A camera in front of a film of given size, in world coordinates.
#[derive(Clone, Debug)]
pub(in crate::render) struct General {
    /// At time 0.
    pose: Pose,
    poses: Option<PoseInterpolation>,
    projection: Projection,
    /// Pixels.
    size: DVec2,
    /// See [`Projection::half_extent`].
    half: DVec2,
    shift: DVec2,
    lens: Option<ThinLens>,
    distortion: Option<Distortion>,
}

impl General {
    pub(super) fn new(camera: &Camera, centre: DVec3, size: DVec2, half: DVec2) -> Result<Self> {
        let Camera { frame, end, projection, shift, lens, distortion, .. } = *camera;
        let pose = Pose { eye: camera.eye - centre, frame };
        let poses = end.map(|end| PoseInterpolation::new(pose, Pose { eye: end.eye - centre, ..end }));
        if let Some(ThinLens { radius, focus, .. }) = lens {
            for (name, length) in [("opening of radius", radius), ("focus at", focus)] {
                if !(length > 0.0 && length <= MAX_COORDINATE.into()) {
                    let range = format!("must be above 0, and at most {MAX_COORDINATE:e}");
                    return Err(Error::Usage(format!("a lens with an {name} {length} m: {range}")));
                }
            }
            if projection == Projection::Equirectangular {
                return Err(Error::Usage(
                    "a view of the whole sphere has no plane of focus: leave out the lens".into(),
                ));
            }
        }
        if shift != DVec2::ZERO && projection == Projection::Equirectangular {
            return Err(Error::Usage("a view of the whole sphere has no lens shift: turn the camera".into()));
        }
        if distortion.is_some() && !matches!(projection, Projection::Perspective(_)) {
            return Err(Error::Usage("lens distortion is for perspective views alone".into()));
        }
        Ok(Self { pose, poses, projection, size, half, shift, lens, distortion })
    }

    pub(super) const fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    pub(super) const fn moves(&self) -> bool {
        self.poses.is_some()
    }

    /// What chooses the middle of the lens.
    pub(super) fn middle_of_lens(&self) -> DVec2 {
        // Of a polygon the second number is the way outwards; a disk is made of a square.
        if self.lens.is_some_and(|lens| lens.blades >= 3) { DVec2::ZERO } else { DVec2::splat(0.5) }
    }

    /// The ray through a point of the film and, where there is a lens, through the point of it that `lens` gives.
    pub(super) fn ray(&self, film: DVec2, lens: DVec2, time: f32) -> Ray {
        let Pose { eye, frame } = self.poses.map_or(self.pose, |poses| poses.at(time.into()));
        // From the picture's middle, in halves of its sides, y up.
        let at = (film / self.size * 2.0 - 1.0) * DVec2::new(1.0, -1.0) + self.shift * 2.0;
        let (mut origin, mut direction) = (DVec3::ZERO, DVec3::NEG_Z);
        match self.projection {
            Projection::Perspective(_) => {
                let seen = at * self.half;
                let Some(straight) = self.distortion.map_or(Some(seen), |distortion| undistorted(&distortion, seen))
                else {
                    return no_ray(eye.as_vec3());
                };
                direction = straight.extend(-1.0);
            }
            Projection::Orthographic(_) => origin = (at * self.half).extend(0.0),
            Projection::Equirectangular => {
                let DVec2 { x: longitude, y: latitude } = at * self.half;
                let around = libm::cos(latitude);
                direction =
                    DVec3::new(libm::sin(longitude) * around, libm::sin(latitude), -libm::cos(longitude) * around);
            }
        }
        if let Some(ThinLens { radius, focus, blades }) = self.lens {
            // The direction is 1 long along the axis, so that this is a point of the plane of focus.
            let sharp = origin + direction * focus;
            origin += (on_lens(lens, blades) * radius).extend(0.0);
            direction = sharp - origin;
        }
        let origin = eye + frame * origin;
        Ray { time, ..Ray::new(origin.as_vec3(), (frame * direction).normalize().as_vec3()) }
    }
}

/// Evenly from the unit square to the unit disk (Shirley and Chiu 1997, *A low distortion map between disk and
/// square*), or to the regular polygon in it.
fn on_lens(xi: DVec2, blades: u32) -> DVec2 {
    let at_angle = |angle: f64| DVec2::new(libm::cos(angle), libm::sin(angle));
    if blades >= 3 {
        let sector = xi.x * f64::from(blades);
        let corner = |k: f64| at_angle(k * std::f64::consts::TAU / f64::from(blades));
        let (first, second) = (corner(sector.floor()), corner(sector.floor() + 1.0));
        let across = sector.fract();
        return (first + (second - first) * across) * xi.y.sqrt();
    }
    let DVec2 { x, y } = xi * 2.0 - 1.0;
    if x == 0.0 && y == 0.0 {
        return DVec2::ZERO;
    }
    let quarter = std::f64::consts::FRAC_PI_4;
    if x.abs() > y.abs() { at_angle(quarter * y / x) * x } else { at_angle(2.0 * quarter - quarter * x / y) * y }
}

/// What would be seen at `seen` (y up) without the distortion: Newton's method. None where the distortion maps nothing,
/// or only what lies behind a fold.
fn undistorted(distortion: &Distortion, seen: DVec2) -> Option<DVec2> {
    let seen = DVec2::new(seen.x, -seen.y);
    let mut at = seen;
    for _ in 0..50 {
        let (value, [dx, dy]) = distorted(distortion, at);
        let determinant = dx.x * dy.y - dx.y * dy.x;
        if determinant.is_nan() || determinant <= 0.0 {
            return None;
        }
        let off = seen - value;
        if off.length() <= 1e-14 * (1.0 + seen.length()) {
            return Some(DVec2::new(at.x, -at.y));
        }
        at += DVec2::new(off.x * dy.y - off.y * dy.x, off.y * dx.x - off.x * dx.y) / determinant;
    }
    None
}

/// Where (x, y) at distance 1, y down, is seen, and how that changes with x and with y.
fn distorted(d: &Distortion, at: DVec2) -> (DVec2, [DVec2; 2]) {
    let DVec2 { x, y } = at;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3));
    // By r^2.
    let slope = d.k1 + r2 * (2.0 * d.k2 + 3.0 * r2 * d.k3);
    let value = DVec2::new(
        x * radial + 2.0 * d.p1 * x * y + d.p2 * (r2 + 2.0 * x * x),
        y * radial + d.p1 * (r2 + 2.0 * y * y) + 2.0 * d.p2 * x * y,
    );
    let mixed = 2.0 * x * y * slope + 2.0 * d.p1 * x + 2.0 * d.p2 * y;
    let dx = DVec2::new(radial + 2.0 * x * x * slope + 2.0 * d.p1 * y + 6.0 * d.p2 * x, mixed);
    let dy = DVec2::new(mixed, radial + 2.0 * y * y * slope + 6.0 * d.p1 * y + 2.0 * d.p2 * x);
    (value, [dx, dy])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn undistorting_is_the_inverse() {
        let wide = Distortion { k1: -0.28, k2: 0.07, k3: 0.0, p1: 1e-3, p2: -2e-3 };
        let tele = Distortion { k1: 0.1, k2: -0.02, k3: 0.01, p1: -1e-3, p2: 0.0 };
        for distortion in [wide, tele, Distortion::default()] {
            for i in -8..=8 {
                for j in -8..=8 {
                    let at = DVec2::new(f64::from(i), f64::from(j)) * 0.07;
                    let (seen, [dx, dy]) = distorted(&distortion, at);
                    let back = undistorted(&distortion, DVec2::new(seen.x, -seen.y)).expect("before the fold");
                    assert!((DVec2::new(back.x, -back.y) - at).length() < 1e-12, "{at}: {back}");
                    let h = 1e-6;
                    let numeric = |step: DVec2| {
                        (distorted(&distortion, at + step).0 - distorted(&distortion, at - step).0) / (2.0 * h)
                    };
                    assert!(
                        (numeric(DVec2::X * h) - dx).length() < 1e-8 && (numeric(DVec2::Y * h) - dy).length() < 1e-8
                    );
                }
            }
        }
        // x (1 - x^2 / 3) is never above 2/3, which it is at 1.
        let fold = Distortion { k1: -1.0 / 3.0, ..Distortion::default() };
        assert!(undistorted(&fold, DVec2::X * 0.66).is_some());
        assert_eq!(undistorted(&fold, DVec2::X * 0.67), None);
    }

    /// Even over the lens: no part of it is preferred, and all of it is reached.
    #[test]
    fn lenses_are_evenly_covered() {
        for blades in [0, 3, 5, 6] {
            let (side, mut sum, mut second, mut reach) = (200, DVec2::ZERO, 0.0, 0f64);
            for k in 0..side * side {
                let xi = (DVec2::new(f64::from(k % side), f64::from(k / side)) + 0.5) / f64::from(side);
                let at = on_lens(xi, blades);
                sum += at;
                second += at.length_squared();
                reach = reach.max(at.length());
            }
            let n = f64::from(side * side);
            // The mean square distance from the middle: 1/2 for a disk, (2 + cos(2 pi / n)) / 6 for a regular polygon.
            let expected =
                if blades < 3 { 0.5 } else { (2.0 + (std::f64::consts::TAU / f64::from(blades)).cos()) / 6.0 };
            assert!((sum / n).length() < 1e-3 && (second / n - expected).abs() < 1e-3, "{blades}: {}", second / n);
            assert!(reach <= 1.0 && reach > 0.98, "{blades}: {reach}");
        }
    }
}
