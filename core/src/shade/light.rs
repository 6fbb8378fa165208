//! How much light arrives, and from where.
//!
//! Falloff follows the glTF extension
//! [KHR_lights_punctual](https://github.com/KhronosGroup/glTF/blob/main/extensions/2.0/Khronos/KHR_lights_punctual/README.md):
//! a range window that reaches zero smoothly, and a spot whose edge is the square of a linear ramp in the cosine.

use std::sync::Arc;

use super::area::{self, short_of};
use super::emitters::Patches;
use super::{EnvironmentLight, SurfacePoint};
use crate::math::{DAffine3, DVec2, DVec3, Vec3};
use crate::ray::Ray;
use crate::scene::{Attenuation, Light};

/// A light as the renderer uses it, in world coordinates.
#[derive(Clone, Debug)]
pub struct LightSource {
    kind: Kind,
    /// Whether anything can stand between it and what the camera sees.
    pub casts_shadows: bool,
}

/// What shines.
#[derive(Clone, Debug)]
enum Kind {
    /// A light of the scene.
    Light(Light),
    /// What is around the scene.
    Environment(Arc<EnvironmentLight>),
    /// Surfaces that glow.
    Patches(Patches),
}

/// Light that arrives at a point, before any shadow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit vector towards the light.
    pub to_light: DVec3,
    /// Linear RGB that a white matte surface facing the light would reflect.
    pub color: Vec3,
    /// Up to where the way must be free, world coordinates; none for all of it.
    pub end: Option<DVec3>,
    /// How densely the direction was chosen, per steradian, among those to an extended light.
    pub pdf: Option<f64>,
}

impl LightSource {
    /// A light of the scene in a world whose centre is at `centre`.
    pub fn new(light: &Light, centre: DVec3) -> Self {
        let mut light = light.clone();
        light.transform(&DAffine3::from_translation(-centre));
        Self { kind: Kind::Light(light), casts_shadows: true }
    }

    /// What is around the scene.
    pub fn environment(environment: Arc<EnvironmentLight>) -> Self {
        Self { kind: Kind::Environment(environment), casts_shadows: true }
    }

    /// Surfaces that glow.
    pub(super) fn patches(patches: Patches) -> Self {
        Self { kind: Kind::Patches(patches), casts_shadows: true }
    }

    /// A white light at the viewer's `eye` (world coordinates), the same at any distance. Its shadows lie where the
    /// viewer cannot see them, so that none are traced.
    pub fn headlight(eye: DVec3) -> Self {
        let (attenuation, range) = (Attenuation::NONE, f64::INFINITY);
        let light = Light::Point { position: eye, color: Vec3::ONE, attenuation, range, radius: 0.0 };
        Self { kind: Kind::Light(light), casts_shadows: false }
    }

    /// Whether what arrives depends on which part of the light is asked.
    pub const fn is_extended(&self) -> bool {
        match &self.kind {
            Kind::Light(light) => light.is_extended(),
            Kind::Environment(_) | Kind::Patches(_) => true,
        }
    }

    /// What kind of light it is, in a word.
    pub const fn kind(&self) -> &'static str {
        match &self.kind {
            Kind::Light(Light::Directional { .. }) => "directional",
            Kind::Light(Light::Point { .. }) if !self.casts_shadows => "headlight",
            Kind::Light(Light::Point { .. }) => "point",
            Kind::Light(Light::Spot { .. }) => "spot",
            Kind::Light(Light::Area { .. }) => "area",
            Kind::Environment(_) => "environment",
            Kind::Patches(_) => "glowing surfaces",
        }
    }

    /// The light of the scene, in world coordinates, if it is one.
    pub(super) const fn light(&self) -> Option<&Light> {
        match &self.kind {
            Kind::Light(light) => Some(light),
            Kind::Environment(_) | Kind::Patches(_) => None,
        }
    }

    /// What arrives at `point` if nothing is in between; none where the light does not reach. Of an extended light a
    /// part is asked that `xi`, a point of the unit square, chooses.
    pub fn sample(&self, point: DVec3, xi: DVec2) -> Option<LightSample> {
        match &self.kind {
            Kind::Light(light) => from_light(light, point, xi),
            Kind::Environment(environment) => environment.sample(xi),
            Kind::Patches(patches) => patches.sample(point, xi),
        }
    }

    /// The ray that must be free for `arriving` to reach `surface`.
    pub fn shadow_ray(surface: &SurfacePoint, arriving: &LightSample) -> Ray {
        match arriving.end {
            None => surface.spawn(arriving.to_light.as_vec3(), f32::INFINITY),
            Some(end) => surface.spawn_to(end),
        }
    }
}

/// What arrives from a light of the scene.
fn from_light(light: &Light, point: DVec3, xi: DVec2) -> Option<LightSample> {
    match light {
        Light::Directional { direction, color } => {
            Some(LightSample { to_light: -*direction, color: *color, end: None, pdf: None })
        }
        Light::Point { position, color, attenuation, range, radius } => {
            let mut arriving = from_point(point, *position, *color, attenuation, *range)?;
            if *radius > 0.0 {
                // Within the lamp nothing is in between.
                let way = ((*position - point).length() - radius).max(0.0);
                arriving.end = Some(short_of(point + arriving.to_light * way, arriving.to_light, point, 1.0));
            }
            Some(arriving)
        }
        Light::Area { shape, radiance } => area::sample(shape, *radiance, point, xi),
        Light::Spot { position, direction, color, attenuation, range, inner_angle, outer_angle } => {
            let mut arriving = from_point(point, *position, *color, attenuation, *range)?;
            arriving.color *= cone(-arriving.to_light.dot(*direction), *inner_angle, *outer_angle);
            (arriving.color != Vec3::ZERO).then_some(arriving)
        }
    }
}

fn from_point(
    point: DVec3,
    position: DVec3,
    color: Vec3,
    attenuation: &Attenuation,
    range: f64,
) -> Option<LightSample> {
    let offset = position - point;
    let distance = offset.length();
    let color = color * (attenuation.factor(distance as f32) * window(distance, range));
    // At the light itself there is neither a direction nor, with 1 / d^2, a finite colour.
    (distance > 0.0 && color.is_finite() && color != Vec3::ZERO).then(|| LightSample {
        to_light: offset / distance,
        color,
        end: Some(position),
        pdf: None,
    })
}

/// 1 near the light, 0 from `range` on.
fn window(distance: f64, range: f64) -> f32 {
    let share = distance / range;
    (1.0 - share * share * share * share).clamp(0.0, 1.0) as f32
}

/// 1 within the inner angle, 0 outside the outer one, by the cosine of the angle to the axis.
fn cone(cosine: f64, inner_angle: f32, outer_angle: f32) -> f32 {
    let (inner, outer) = (libm::cos(f64::from(inner_angle)), libm::cos(f64::from(outer_angle)));
    if inner <= outer {
        // No soft edge, or one that f64 does not tell from none.
        return if cosine >= outer { 1.0 } else { 0.0 };
    }
    let ramp = ((cosine - outer) / (inner - outer)).clamp(0.0, 1.0);
    (ramp * ramp) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(range: f64) -> LightSource {
        let light = Light::Spot {
            position: DVec3::new(10.0, 3.0, 0.0),
            direction: DVec3::NEG_Y,
            color: Vec3::new(2.0, 4.0, 8.0),
            attenuation: Attenuation { constant: 1.0, linear: 0.5, quadratic: 0.25 },
            range,
            inner_angle: 30f32.to_radians(),
            outer_angle: 60f32.to_radians(),
        };
        LightSource::new(&light, DVec3::new(10.0, 0.0, 0.0))
    }

    #[test]
    fn attenuates_by_the_polynomial() {
        let arriving = spot(f64::INFINITY).sample(DVec3::Y, DVec2::ZERO).unwrap();
        // At distance 2: 1 / (1 + 0.5 * 2 + 0.25 * 4) = 1/3.
        assert!((arriving.color - Vec3::new(2.0, 4.0, 8.0) / 3.0).length() < 1e-6);
        assert_eq!(arriving.to_light, DVec3::Y);
    }

    #[test]
    fn the_range_window_is_gltfs() {
        let full = spot(f64::INFINITY).sample(DVec3::Y, DVec2::ZERO).unwrap().color;
        let half = spot(4.0).sample(DVec3::Y, DVec2::ZERO).unwrap().color;
        assert!((half - full * (1.0 - 0.5f32.powi(4))).length() < 1e-6);
        assert_eq!(spot(2.0).sample(DVec3::Y, DVec2::ZERO), None);
    }

    #[test]
    fn the_cone_falls_off_between_its_angles() {
        let (inner, outer) = (30f32.to_radians(), 60f32.to_radians());
        let at = |degrees: f64| cone(degrees.to_radians().cos(), inner, outer);
        assert_eq!([at(0.0), at(29.9), at(60.1), at(120.0)], [1.0, 1.0, 0.0, 0.0]);
        // KHR_lights_punctual: ((cos 45 - cos 60) / (cos 30 - cos 60))^2.
        let ramp = (0.5f64.sqrt() - 0.5) / (0.75f64.sqrt() - 0.5);
        assert!((f64::from(at(45.0)) - ramp * ramp).abs() < 1e-6);
        for outer in [0.5f32, 1e-3, 1e-5] {
            assert_eq!([cone(1.0, outer, outer), cone(f64::from(2.0 * outer).cos(), outer, outer)], [1.0, 0.0]);
            // Full light on the axis and at the inner angle, however narrow the cone and its edge are.
            for inner in [0.0, outer * 0.5, outer * 0.999] {
                assert_eq!(cone(f64::from(inner).cos(), inner, outer), 1.0, "{inner} {outer}");
            }
            assert_eq!(cone(f64::from(outer * 1.001).cos(), outer * 0.999, outer), 0.0);
            // In between by the angles' squares, to which cosines of small angles come down.
            let middle = cone(f64::from(outer * 0.75).cos(), outer * 0.5, outer);
            let exact = ((f64::from(outer).powi(2) * (1.0 - 0.5625)) / (f64::from(outer).powi(2) * 0.75)).powi(2);
            assert!(outer == 0.5 || (f64::from(middle) - exact).abs() < 1e-4, "{outer}: {middle} {exact}");
        }
    }

    #[test]
    fn at_the_light_itself_nothing_arrives() {
        let light = Light::Point {
            position: DVec3::ZERO,
            color: Vec3::ONE,
            attenuation: Attenuation::INVERSE_SQUARE,
            range: 1.0,
            radius: 0.0,
        };
        assert_eq!(LightSource::new(&light, DVec3::ZERO).sample(DVec3::ZERO, DVec2::ZERO), None);
    }
}
