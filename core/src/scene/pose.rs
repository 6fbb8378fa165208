//! Where a camera stands, and how it goes from one place to another.
//!
//! The eye runs along a straight line, as every point of what moves does; the camera turns about one axis, evenly, so
//! that its picture never shrinks or shears on the way. Interpolating the entries of its matrix, as is done with
//! instances, would do both. All of it is f64, for a camera may be far from zero.

use crate::math::{DAffine3, DMat3, DQuat, DVec3};

/// Where a camera stands, and which way it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position.
    pub eye: DVec3,
    /// Right, up and back as unit columns.
    pub frame: DMat3,
}

impl Pose {
    /// A point straight ahead, so far away at least, and not so near that its coordinates would not tell the direction.
    pub fn target(&self, distance: f64) -> DVec3 {
        // Rounding then turns it by 2^-42 at most.
        let least = self.eye.abs().max_element() / 1024.0;
        self.eye - self.frame.z_axis * distance.max(least)
    }

    /// Scale and shear move the eye and leave the frame a rotation.
    pub(super) fn transformed(&self, transform: &DAffine3) -> Self {
        let back = (transform.matrix3 * self.frame.z_axis).normalize();
        let right = (transform.matrix3 * self.frame.y_axis).cross(back).normalize();
        let frame = DMat3::from_cols(right, back.cross(right), back);
        Self { eye: transform.transform_point3(self.eye), frame }
    }
}

/// From one pose at time 0 to another at time 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseInterpolation {
    start: Pose,
    end: DVec3,
    /// What the camera turns about, by at most half a turn; of length 1.
    axis: DVec3,
    /// Radians.
    angle: f64,
}

impl PoseInterpolation {
    /// By the shorter way round.
    pub fn new(start: Pose, end: Pose) -> Self {
        let turn = DQuat::from_mat3(&(end.frame * start.frame.transpose()));
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let along = turn.xyz();
        let angle = 2.0 * libm::atan2(along.length(), turn.w);
        Self { start, end: end.eye, axis: along.normalize_or(DVec3::Y), angle }
    }

    /// The pose at a time from 0 to 1.
    pub fn at(&self, time: f64) -> Pose {
        let (sine, cosine) = (libm::sin(self.angle * time), libm::cos(self.angle * time));
        // Rodrigues's formula.
        let turned =
            |v: DVec3| v * cosine + self.axis.cross(v) * sine + self.axis * (self.axis.dot(v) * (1.0 - cosine));
        let DMat3 { x_axis, y_axis, z_axis } = self.start.frame;
        Pose {
            eye: self.start.eye * (1.0 - time) + self.end * time,
            frame: DMat3::from_cols(turned(x_axis), turned(y_axis), turned(z_axis)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(eye: DVec3, frame: DMat3) -> Pose {
        Pose { eye, frame }
    }

    #[test]
    fn a_camera_turns_evenly_the_shorter_way() {
        let start = pose(DVec3::new(1e7, 0.0, 0.0), DMat3::from_rotation_x(0.3));
        for degrees in [-170.0, -40.0, 0.0, 1e-6, 90.0, 179.0f64] {
            let turned = |share: f64| DMat3::from_rotation_y((degrees * share).to_radians()) * start.frame;
            let journey = PoseInterpolation::new(start, pose(DVec3::new(1e7, 8.0, 0.0), turned(1.0)));
            for share in [0.0, 0.25, 0.5, 1.0] {
                let Pose { eye, frame } = journey.at(share);
                assert_eq!(eye, DVec3::new(1e7, 8.0 * share, 0.0));
                let off = (frame - turned(share)).to_cols_array();
                assert!(off.iter().all(|x| x.abs() < 1e-14), "{degrees} at {share}: {frame}");
            }
            assert_eq!(journey.at(0.0).frame, start.frame, "exactly");
        }
    }
}
