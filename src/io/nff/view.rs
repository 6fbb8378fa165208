//! The view of an NFF file: six lines that make a camera.
//!
//! `angle` spans from the centre of the first row to that of the last. N rows are N / (N - 1) of that, by the tangents
//! of the half angles.

use super::super::Placeless;
use super::super::statement::Statement;
use crate::math::DVec3;
use crate::scene::Camera;

/// A view while its lines are read.
#[derive(Default)]
pub(super) struct View {
    from: Option<DVec3>,
    at: Option<DVec3>,
    up: Option<DVec3>,
    angle: Option<f64>,
    hither: Option<f64>,
    resolution: Option<[u32; 2]>,
}

impl View {
    /// Reads one of its lines.
    pub(super) fn read(&mut self, word: &[u8], statement: &mut Statement<'_>) -> Placeless<()> {
        match word {
            b"from" => self.from = Some(statement.vector()?),
            b"at" => self.at = Some(statement.vector()?),
            b"up" => self.up = Some(statement.vector()?),
            b"angle" => self.angle = Some(statement.angle_of_view()?),
            b"hither" => self.hither = Some(statement.number()?),
            _ => self.resolution = Some(statement.picture_size()?),
        }
        Ok(())
    }

    /// The camera, and the size of its picture.
    pub(super) fn camera(self) -> Placeless<(Camera, [u32; 2])> {
        let lacks = |line: &str| format!("the view above lacks the line {line:?}");
        let from = self.from.ok_or_else(|| lacks("from"))?;
        let at = self.at.ok_or_else(|| lacks("at"))?;
        let up = self.up.ok_or_else(|| lacks("up"))?;
        let angle = self.angle.ok_or_else(|| lacks("angle"))?;
        self.hither.ok_or_else(|| lacks("hither"))?;
        let size = self.resolution.ok_or_else(|| lacks("resolution"))?;
        // A single row has no first and last; the angle is then that of the row.
        let rows = f64::from(size[1]);
        let share = if rows > 1.0 { rows / (rows - 1.0) } else { 1.0 };
        let fov_y = 2.0 * libm::atan(libm::tan(angle.to_radians() / 2.0) * share);
        let camera = Camera::look_at(from, at, up, fov_y);
        let camera = camera.ok_or_else(|| Camera::no_look(["from", "at", "up"], [from, at, up]))?;
        Ok((camera, size))
    }
}
