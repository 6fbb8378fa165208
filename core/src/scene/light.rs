//! Light sources.

use crate::math::{DAffine3, DVec3, Vec3, cofactor};

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

    /// The same where lengths are `scale` times as long.
    fn scale(&mut self, scale: f32) {
        self.linear /= scale;
        self.quadratic /= scale * scale;
    }

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
    /// From a surface, each point of which shines alike to all sides it faces: shadows are soft. It cannot be seen
    /// itself; a shape of a material with emission in its place can, and is not in its way.
    Area {
        /// Where.
        shape: AreaShape,
        /// Linear RGB that it would show if it were seen: what a white matte surface reflects that sees nothing else.
        radiance: Vec3,
    },
}

/// What a scene without lights is lit by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DefaultLighting {
    /// A light that the viewer carries: for formats that know shapes alone.
    #[default]
    Headlight,
    /// Nothing: the file describes all light there is.
    None,
}

/// The surface of a light.
#[derive(Clone, Debug, PartialEq)]
pub enum AreaShape {
    /// A rectangle or any parallelogram; shines to the side of the edges' cross product.
    Rectangle {
        /// The middle.
        centre: DVec3,
        /// From the middle to the middles of two sides that meet.
        half_edges: [DVec3; 2],
    },
    /// A disk; shines to the side of its normal.
    Disk {
        /// The middle.
        centre: DVec3,
        /// Unit vector.
        normal: DVec3,
        /// Above 0.
        radius: f64,
    },
    /// A ball.
    Sphere {
        /// The middle.
        centre: DVec3,
        /// Above 0.
        radius: f64,
    },
}

impl Light {
    /// Moves the light; colours stay, and so does what it gives at a distance that is scaled with it.
    pub fn transform(&mut self, transform: &DAffine3) {
        let scale = transform.matrix3.determinant().abs().cbrt();
        let turn = |direction: &mut DVec3| *direction = transform.transform_vector3(*direction).normalize();
        let place = |position: &mut DVec3, range: &mut f64, attenuation: &mut Attenuation| {
            *position = transform.transform_point3(*position);
            *range *= scale;
            attenuation.scale(scale as f32);
        };
        match self {
            Self::Directional { direction, color: _ } => turn(direction),
            Self::Point { position, color: _, attenuation, range, radius } => {
                place(position, range, attenuation);
                *radius *= scale;
            }
            Self::Spot { position, direction, color: _, attenuation, range, inner_angle: _, outer_angle: _ } => {
                turn(direction);
                place(position, range, attenuation);
            }
            Self::Area { shape, radiance: _ } => shape.transform(transform, scale),
        }
    }

    /// Whether what arrives depends on which part of the light is asked.
    pub const fn is_extended(&self) -> bool {
        match self {
            Self::Area { .. } => true,
            Self::Directional { .. } | Self::Point { .. } | Self::Spot { .. } => false,
        }
    }
}

impl AreaShape {
    /// Of a flat one.
    pub(crate) fn area(&self) -> Option<f64> {
        match *self {
            Self::Rectangle { half_edges: [a, b], .. } => Some(4.0 * a.cross(b).length()),
            Self::Disk { radius, .. } => Some(std::f64::consts::PI * radius * radius),
            Self::Sphere { .. } => None,
        }
    }

    /// Moves it; `scale` is how much longer lengths become on average.
    fn transform(&mut self, transform: &DAffine3, scale: f64) {
        match self {
            Self::Rectangle { centre, half_edges } => {
                *centre = transform.transform_point3(*centre);
                *half_edges = half_edges.map(|edge| transform.transform_vector3(edge));
                if transform.matrix3.determinant() < 0.0 {
                    half_edges.swap(0, 1);
                }
            }
            Self::Disk { centre, normal, radius } => {
                *centre = transform.transform_point3(*centre);
                // That of the plane that its own becomes, on the side to which its front goes.
                *normal = (cofactor(&transform.matrix3) * *normal).normalize();
                *radius *= scale;
            }
            Self::Sphere { centre, radius } => {
                *centre = transform.transform_point3(*centre);
                *radius *= scale;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::tangents;

    /// A disk faces what a flat surface in its place faces, stretched and mirrored.
    #[test]
    fn a_disk_stays_across_its_normal() {
        for stretch in [DVec3::new(3.0, 1.0, 1.0), DVec3::new(-1.0, 0.5, 2.0)] {
            let normal = DVec3::new(1.0, 1.0, 0.5).normalize();
            let mut disk = AreaShape::Disk { centre: DVec3::ONE, normal, radius: 1.0 };
            let transform = DAffine3::from_scale(stretch);
            disk.transform(&transform, 1.0);
            let AreaShape::Disk { normal: turned, .. } = disk else { panic!("{disk:?}") };
            for along in tangents(normal) {
                assert!(turned.dot(transform.transform_vector3(along)).abs() < 1e-12, "{stretch}");
            }
            assert!(turned.dot(transform.transform_vector3(normal)) > 0.0 && turned.is_normalized(), "{stretch}");
        }
    }

    /// In whatever unit a scene is written, it looks the same.
    #[test]
    fn attenuation_scales_with_lengths() {
        let light = Light::Spot {
            position: DVec3::X,
            direction: DVec3::Y,
            color: Vec3::ONE,
            attenuation: Attenuation { constant: 0.5, linear: 0.25, quadratic: 2.0 },
            range: 6.0,
            inner_angle: 0.1,
            outer_angle: 0.2,
        };
        for scale in [0.01, 25.4, 1000.0] {
            let mut scaled = light.clone();
            scaled.transform(&DAffine3::from_scale(DVec3::splat(scale)));
            let [(before, range), (after, range_after)] = [&light, &scaled].map(|light| match light {
                Light::Spot { attenuation, range, .. } => (*attenuation, *range),
                _ => unreachable!("it stays a spot"),
            });
            assert!((range_after / range / scale - 1.0).abs() < 1e-12);
            for d in [0.1, 1.0, 30.0f32] {
                let ratio = after.factor(d * scale as f32) / before.factor(d);
                assert!((ratio - 1.0).abs() < 1e-5, "{ratio} at {d}, scaled by {scale}");
            }
        }
    }
}
