//! The part of a surface that has a value for every direction: what it gives off, Lambert's lobe and the highlight.
//!
//! I = emission + ambient * La + sum over lights of (diffuse * max(n . l, 0) + specular * highlight) * light. What the
//! lights of a picture share is in [`Shading`]; each light then adds [`Shading::reflect`].

use super::highlight::Highlight;
use super::specular;
use crate::math::{DVec3, Vec3};
use crate::scene::{Interface, Material, Texture};
use crate::shade::{SurfacePoint, texture};

/// A surface with its colours looked up, ready for any number of lights.
#[derive(Clone, Copy, Debug)]
pub struct Shading {
    /// Unit vector towards the viewer.
    pub(super) to_viewer: DVec3,
    pub(super) normal: DVec3,
    /// [`SurfacePoint::horizon`].
    pub(super) horizon: DVec3,
    pub(super) diffuse: Vec3,
    pub(super) highlight: Highlight,
    /// Light the point sends out without any light source: emission and ambient.
    pub base: Vec3,
}

impl Shading {
    /// The colours of `material`, as it [is at](crate::shade::appearance::at) `point`, seen along `direction`, in a
    /// scene with the given ambient light.
    pub fn new(
        point: &SurfacePoint,
        direction: Vec3,
        material: &Material,
        textures: &[Texture],
        ambient: Vec3,
    ) -> Self {
        let texel = |texture: Option<u32>| {
            let texture = texture.and_then(|i| textures.get(i as usize));
            texture.map_or(Vec3::ONE, |t| texture::sample(t, point.uv_of(t)).truncate())
        };
        let tint = texel(material.diffuse_texture);
        let emission = match material.emission_texture {
            None => material.emission,
            texture => material.emission * texel(texture),
        };
        let mut shading = Self {
            to_viewer: -direction.as_dvec3().normalize(),
            normal: point.shading_normal,
            horizon: point.horizon,
            diffuse: material.diffuse * tint,
            highlight: Highlight::new(material),
            base: emission + material.ambient * tint * ambient,
        };
        if material.unlit {
            shading.base = emission + shading.diffuse;
            shading.scale(0.0);
        }
        if material.energy_conserving {
            shading.scale(material.conserving_scale());
        }
        match material.interface {
            Interface::Shares => {}
            // What is diffuse lies below, and gets what is not mirrored.
            Interface::Fresnel | Interface::Thin => {
                if material.is_lit() {
                    shading.scale(1.0 - specular::mirrored_share(material, point, -shading.to_viewer) as f32);
                }
            }
        }
        shading
    }

    /// The unit vector along which the surface is seen.
    pub fn direction(&self) -> DVec3 {
        -self.to_viewer
    }

    fn scale(&mut self, factor: f32) {
        self.diffuse *= factor;
        self.highlight.color *= factor;
    }

    /// Whether light along `to_light` can be seen at all: it must come from the viewer's side, by the shading normal
    /// and by the surface itself.
    pub fn faces(&self, to_light: DVec3) -> bool {
        self.normal.dot(to_light) > 0.0 && self.horizon.dot(to_light) > 0.0
    }

    /// Share of even light that is sent on by what is diffuse and by the highlight, linear RGB.
    pub fn albedo(&self) -> Vec3 {
        self.diffuse + self.highlight.color * self.highlight.share()
    }

    /// pi f cos for light along `to_light`.
    pub(super) fn value(&self, to_light: DVec3) -> Vec3 {
        let cosine = self.normal.dot(to_light);
        let matte = self.matte(cosine);
        self.shine(to_light, cosine).map_or(matte, |shine| matte + shine)
    }

    /// What of it is Lambert's lobe's.
    #[inline]
    fn matte(&self, cosine: f64) -> Vec3 {
        self.diffuse * cosine.max(0.0) as f32
    }

    /// What of it is the highlight's, if there is one.
    #[inline]
    fn shine(&self, to_light: DVec3, cosine: f64) -> Option<Vec3> {
        let is_there = self.highlight.color != Vec3::ZERO && cosine > 0.0;
        is_there.then(|| self.highlight.value(self.normal, self.to_viewer, to_light, cosine))
    }

    /// pi f cos for light along `to_light`, of Lambert's lobe and of the highlight.
    pub fn lobes(&self, to_light: DVec3) -> [Vec3; 2] {
        let cosine = self.normal.dot(to_light);
        [self.matte(cosine), self.shine(to_light, cosine).unwrap_or(Vec3::ZERO)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Specular;

    fn shading(model: Specular, to_viewer: DVec3) -> Shading {
        let material = Material { specular: Vec3::splat(0.5), shininess: 10.0, model, ..Material::default() };
        Shading {
            to_viewer,
            normal: DVec3::Y,
            horizon: DVec3::Y,
            diffuse: Vec3::new(0.5, 0.25, 0.0),
            highlight: Highlight::new(&material),
            base: Vec3::ZERO,
        }
    }

    /// Towards a light so far from the normal, on the other side than the viewer.
    fn from(degrees: f64) -> DVec3 {
        DVec3::new(-degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0)
    }

    /// Of a light of 2.
    fn reflected(shading: &Shading, degrees: f64) -> Vec3 {
        shading.lobes(from(degrees)).into_iter().sum::<Vec3>() * 2.0
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
            let got = reflected(&shading(model, viewer), 50.0);
            assert!((got - Vec3::from_array(expected)).length() < 1e-6, "{model:?}: {got} against {expected:?}");
        }
    }

    #[test]
    fn a_light_behind_gives_nothing() {
        for model in [Specular::Phong, Specular::BlinnPhong] {
            let shading = shading(model, DVec3::Y);
            assert_eq!(reflected(&shading, 100.0), Vec3::ZERO);
            assert!(!shading.faces(from(100.0)));
        }
    }
}
