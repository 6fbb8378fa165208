//! What round shapes share: boxes around disks and ellipsoids, and angles as parameters.

use crate::math::{Aabb, DVec2, DVec3, Vec3, gamma64};

/// The box around `centre` that reaches as far as `half` to each side, rounded outwards.
pub(super) fn outwards(centre: DVec3, half: DVec3) -> Aabb {
    let half = half + (centre.abs() + half) * gamma64(16);
    let (low, high) = (centre - half, centre + half);
    let round = |v: DVec3, out: fn(f32) -> f32| Vec3::from_array(v.to_array().map(|x| out(x as f32)));
    Aabb { min: round(low, f32::next_down), max: round(high, f32::next_up) }
}

/// How far a disk around zero reaches on each axis.
pub(super) fn disk_reach(normal: DVec3, radius: f64) -> DVec3 {
    let [x, y, z] = normal.normalize().to_array();
    // Of the other two components, for 1 - x^2 cancels.
    DVec3::new(f64::hypot(y, z), f64::hypot(z, x), f64::hypot(x, y)) * radius
}

/// Longitude from -z about +y, and latitude from the south pole, both over [0, 1], of a unit vector: a map of the world
/// is seen from outside as it is read, its middle at +z.
pub(super) fn spherical(n: DVec3) -> DVec2 {
    let latitude = libm::asin(n.y.clamp(-1.0, 1.0)) / std::f64::consts::PI;
    DVec2::new(turn(-n.x, -n.z), latitude + 0.5)
}

/// The angle from `x` towards `y`, over [0, 1].
pub(super) fn turn(y: f64, x: f64) -> f64 {
    let turn = libm::atan2(y, x) / std::f64::consts::TAU;
    turn + if turn < 0.0 { 1.0 } else { 0.0 }
}
