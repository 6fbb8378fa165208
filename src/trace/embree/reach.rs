//! How far from zero a ray may be, so that Embree's numbers suffice: in the world and in every object that is placed.
//!
//! Debian's Embree is built with an assertion that ends the process on a ray with a coordinate above [`MAX`]; and it
//! holds rays of objects to the same, after it has moved them by the inverse that it makes of a transform in f32.

use crate::error::{Error, Result};
use crate::math::{Affine3, Mat3};
use crate::ray::Ray;
use crate::trace::{Placement, World};

/// The largest coordinate that Embree takes, its `FLT_LARGE`.
const MAX: f32 = 1.844e18;

/// Times at which what moves is looked at, from 0 to this.
const TIMES: u8 = 16;

/// The largest coordinate of a ray that Embree can trace, and whether it needs to know a ray's time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// Whether anything moves.
    pub is_moving: bool,
    most: f32,
    /// Its square, less what sums of squares are rounded by.
    pub square: f32,
}

impl Reach {
    const fn new(most: f32) -> Self {
        Self { is_moving: false, most, square: 0.999 * most * most }
    }

    /// In a world.
    ///
    /// # Errors
    /// [`Error::Backend`] where an object is placed such that rays from what is in the scene cannot be traced.
    pub fn of(world: &World) -> Result<Self> {
        if world.placements.is_empty() {
            return Ok(Self::new(MAX));
        }
        let size = world.bounds();
        let size = if size.is_empty() { 0.0 } else { size.min.abs().max(size.max.abs()).max_element() };
        let mut most = MAX;
        for placement in &world.placements {
            let times = if placement.motion.is_some() { 0..=TIMES } else { 0..=0 };
            for time in times {
                let reach = reach(&placement.at(f32::from(time) / f32::from(TIMES)).to_world);
                if reach.is_none_or(|reach| reach <= size) {
                    return Err(unable(placement));
                }
                most = most.min(reach.unwrap_or(most));
            }
        }
        Ok(Self { is_moving: world.moves(), ..Self::new(most) })
    }

    /// Whether a ray is [valid](Ray::is_valid) and Embree can trace it; any other misses.
    #[inline]
    pub fn has(&self, ray: &Ray) -> bool {
        ray.is_valid() && ray.origin.abs().max(ray.direction.abs()).max_element() < self.most
    }
}

/// The largest coordinate of a ray in the world that stays below [`MAX`] in the object, with a factor of 2 to spare;
/// none where the inverse is beyond f32.
fn reach(to_world: &Affine3) -> Option<f32> {
    // As Embree does: the adjugate over the determinant, in f32.
    let m = to_world.matrix3;
    let rows = [m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis)];
    let determinant = m.x_axis.dot(rows[0]);
    let inverse = Mat3::from_cols(rows[0] / determinant, rows[1] / determinant, rows[2] / determinant).transpose();
    let magnitudes = inverse.abs();
    let stretch = (magnitudes.x_axis + magnitudes.y_axis + magnitudes.z_axis).max_element();
    let away = (magnitudes * to_world.translation.abs()).max_element();
    let reach = (MAX / 2.0 - away) / stretch;
    (determinant.is_normal() && inverse.is_finite() && reach > 0.0).then_some(reach.min(MAX))
}

fn unable(placement: &Placement) -> Error {
    Error::Backend {
        backend: "embree",
        message: format!(
            "instance {} is placed by a transform that Embree's f32 cannot invert for this scene; scale it up, or use \
             the native engine",
            placement.instance
        ),
    }
}

#[cfg(test)]
impl Reach {
    /// Without anything that is placed.
    pub const WORLD: Self = Self::new(MAX);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn small_objects_reach_less_far_and_the_smallest_are_none() {
        let scaled = |scale: f32, place: f32| {
            reach(&Affine3 { matrix3: Mat3::from_diagonal(Vec3::splat(scale)), translation: Vec3::splat(place) })
        };
        assert_eq!(scaled(1.0, 0.0), Some(MAX / 2.0));
        assert_eq!(scaled(1e9, 0.0), Some(MAX));
        let near = |x: Option<f32>, y: f32| (x.expect("it can be placed") / y - 1.0).abs() < 1e-5;
        assert!(near(scaled(1e-6, 0.0), MAX / 2.0 * 1e-6));
        assert_eq!(scaled(1e-6, 1e13), None, "the place is beyond Embree's numbers");
        assert_eq!(scaled(1e-13, 0.0), None, "the determinant is not normal");
        assert_eq!(scaled(0.0, 0.0), None);
    }
}
