//! The reflection models of Phong (1975, *Illumination for computer generated pictures*) and Blinn (1977, *Models of
//! light reflection for computer synthesized pictures*).
//!
//! I = emission + ambient * La + sum over lights of (diffuse * max(n . l, 0) + specular * highlight) * light. What the
//! lights of a picture share is in [`Shading`]; each light then adds [`Shading::reflect`].

use super::{SurfacePoint, light::Illumination, texture};
use crate::math::{DVec3, Vec3};
use crate::scene::{Material, Specular, Texture};

/// A surface with its colours looked up, ready for any number of lights.
#[derive(Clone, Copy, Debug)]
pub struct Shading {
    /// Unit vector towards the viewer.
    to_viewer: DVec3,
    normal: DVec3,
    geometric: DVec3,
    diffuse: Vec3,
    specular: Vec3,
    shininess: f32,
    model: Specular,
    /// Light the point sends out without any light source: emission and ambient.
    pub base: Vec3,
}

impl Shading {
    /// The colours of `material` at `point`, seen along `direction`, in a scene with the given ambient light.
    pub fn new(
        point: &SurfacePoint,
        direction: Vec3,
        material: &Material,
        textures: &[Texture],
        ambient: Vec3,
    ) -> Self {
        let texture = material.diffuse_texture.and_then(|i| textures.get(i as usize));
        let texel = texture.map_or(Vec3::ONE, |t| texture::sample(t, point.uv).truncate());
        let tint = texel * point.color.truncate();
        Self {
            to_viewer: -direction.as_dvec3().normalize(),
            normal: point.shading_normal,
            geometric: point.normal,
            diffuse: material.diffuse * tint,
            specular: material.specular,
            shininess: material.shininess,
            model: material.model,
            base: material.emission + material.ambient * tint * ambient,
        }
    }

    /// Whether light along `to_light` can be seen at all: it must come from the viewer's side, by the shading normal
    /// and by the surface itself.
    pub fn faces(&self, to_light: DVec3) -> bool {
        self.normal.dot(to_light) > 0.0 && self.geometric.dot(to_light) > 0.0
    }

    /// What of the arriving light goes to the viewer, linear RGB.
    pub fn reflect(&self, arriving: &Illumination) -> Vec3 {
        let l = arriving.to_light;
        let cosine = self.normal.dot(l);
        let mut reflected = self.diffuse * cosine.max(0.0) as f32;
        if self.specular != Vec3::ZERO && cosine > 0.0 {
            reflected += self.specular * self.highlight(l, cosine);
        }
        reflected * arriving.color
    }

    fn highlight(&self, l: DVec3, cosine: f64) -> f32 {
        let base = match self.model {
            Specular::Phong => (self.normal * (2.0 * cosine) - l).dot(self.to_viewer),
            Specular::BlinnPhong => (l + self.to_viewer).normalize_or_zero().dot(self.normal),
        };
        libm::powf(base.clamp(0.0, 1.0) as f32, self.shininess)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shading(model: Specular, to_viewer: DVec3) -> Shading {
        Shading {
            to_viewer,
            normal: DVec3::Y,
            geometric: DVec3::Y,
            diffuse: Vec3::new(0.5, 0.25, 0.0),
            specular: Vec3::splat(0.5),
            shininess: 10.0,
            model,
            base: Vec3::ZERO,
        }
    }

    fn from(degrees: f64) -> Illumination {
        let to_light = DVec3::new(-degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
        Illumination { to_light, color: Vec3::splat(2.0), end: None }
    }

    /// Viewer and light 30 and 50 degrees from the normal, on opposite sides: the mirrored light is 20 degrees off the
    /// viewer, the half vector 10 degrees off the normal.
    #[test]
    fn highlights_match_the_closed_form() {
        let viewer = DVec3::new(30f64.to_radians().sin(), 30f64.to_radians().cos(), 0.0);
        for (model, angle) in [(Specular::Phong, 20f64), (Specular::BlinnPhong, 10.0)] {
            let highlight = 0.5 * angle.to_radians().cos().powi(10);
            let diffuse = 50f64.to_radians().cos();
            let expected = [0.5, 0.25, 0.0].map(|kd| (2.0 * (kd * diffuse + highlight)) as f32);
            let got = shading(model, viewer).reflect(&from(50.0));
            assert!((got - Vec3::from_array(expected)).length() < 1e-6, "{model:?}: {got} against {expected:?}");
        }
    }

    #[test]
    fn a_light_behind_gives_nothing() {
        for model in [Specular::Phong, Specular::BlinnPhong] {
            let shading = shading(model, DVec3::Y);
            assert_eq!(shading.reflect(&from(100.0)), Vec3::ZERO);
            assert!(!shading.faces(from(100.0).to_light));
        }
    }
}
