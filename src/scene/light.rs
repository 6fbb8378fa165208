//! Light sources without extent.

use crate::math::{DAffine3, DVec3, Vec3};

/// How light weakens over a distance d in metres: 1 / (constant + linear d + quadratic d^2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attenuation {
    /// c0.
    pub constant: f32,
    /// c1, in 1/m.
    pub linear: f32,
    /// c2, in 1/m^2.
    pub quadratic: f32,
}

impl Attenuation {
    /// No weakening.
    pub const NONE: Self = Self { constant: 1.0, linear: 0.0, quadratic: 0.0 };
    /// As physics has it: 1 / d^2.
    pub const INVERSE_SQUARE: Self = Self { constant: 0.0, linear: 0.0, quadratic: 1.0 };

    /// The factor at distance `d`.
    pub fn factor(&self, d: f32) -> f32 {
        1.0 / (self.constant + d * (self.linear + d * self.quadratic))
    }
}

/// A light. `color` is what a white matte surface (diffuse = 1) that faces it reflects, as in the Phong model:
/// I = diffuse * color * attenuation * max(n . l, 0). Loaders of physical units divide by pi (glTF: lux, candela).
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// From infinitely far.
    Directional {
        /// Unit vector the light travels along.
        direction: DVec3,
        /// Linear RGB.
        color: Vec3,
    },
    /// From a point, to all sides.
    Point {
        /// Where.
        position: DVec3,
        /// Linear RGB at attenuation 1.
        color: Vec3,
        /// Weakening with distance.
        attenuation: Attenuation,
        /// Nothing farther than this is lit; infinite by default.
        range: f64,
        /// Of the lamp around the point: shadow rays end at its surface, so that a ball may stand there and glow.
        /// 0 for a bare point.
        radius: f64,
    },
    /// From a point, into a cone.
    Spot {
        /// Where.
        position: DVec3,
        /// Unit vector along the cone's axis, away from the light.
        direction: DVec3,
        /// Linear RGB at attenuation 1, on the axis.
        color: Vec3,
        /// Weakening with distance.
        attenuation: Attenuation,
        /// Nothing farther than this is lit; infinite by default.
        range: f64,
        /// Half-angle up to which the light is full, radians.
        inner_angle: f32,
        /// Half-angle from which there is none, radians; above `inner_angle`.
        outer_angle: f32,
    },
}

impl Light {
    /// Moves the light; colours stay.
    pub(crate) fn transform(&mut self, transform: &DAffine3) {
        if let Self::Directional { direction, .. } | Self::Spot { direction, .. } = self {
            *direction = transform.transform_vector3(*direction).normalize();
        }
        if let Self::Point { position, .. } | Self::Spot { position, .. } = self {
            *position = transform.transform_point3(*position);
        }
        let scale = transform.matrix3.determinant().abs().cbrt();
        if let Self::Point { range, .. } | Self::Spot { range, .. } = self {
            *range *= scale;
        }
        if let Self::Point { radius, .. } = self {
            *radius *= scale;
        }
    }
}
