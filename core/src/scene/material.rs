//! What a surface is made of.

use super::Physical;
use crate::math::Vec3;

/// How the highlight is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Specular {
    /// (r . v)^n with r the mirrored light direction (Phong 1975, *Illumination for computer generated pictures*).
    Phong,
    /// (n . h)^n with h half-way between light and viewer (Blinn 1977, *Models of light reflection for computer
    /// synthesized pictures*).
    #[default]
    BlinnPhong,
}

/// What divides light between the mirrored and the refracted ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interface {
    /// The material's shares, whatever the angle (Whitted 1980, *An improved illumination model for shaded display*).
    /// What would be refracted is lost under total internal reflection.
    #[default]
    Shares,
    /// Fresnel's equations for light that is not polarised; [`Material::reflection`] and [`Material::transmission`]
    /// colour the two.
    Fresnel,
    /// Two interfaces close together, as of a pane or a bubble: light passes straight on.
    Thin,
}

/// How much of a surface is there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Alpha {
    /// All of it.
    #[default]
    Opaque,
    /// All of it where its alpha is at least `cutoff`, else nothing.
    Mask {
        /// From 0 to 1.
        cutoff: f32,
    },
    /// As much as its alpha says.
    Blend,
}

/// Light is lost on its way through the inside (Beer's law): of a colour, what it is after a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Absorption {
    /// What white light is after [`distance`](Self::distance), from 0 to 1.
    pub color: Vec3,
    /// Metres, above 0.
    pub distance: f32,
}

impl Absorption {
    /// The share that is left after `length` metres.
    pub fn transmittance(&self, length: f32) -> Vec3 {
        self.color.to_array().map(|share| libm::powf(share, length / self.distance)).into()
    }
}

/// A Phong material that may also be a mirror, or let light through (Whitted 1980). Colours are linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, for messages; may be empty.
    pub name: String,
    /// Share of the scene's ambient light that is sent on.
    pub ambient: Vec3,
    /// Diffuse reflectance, before the texture.
    pub diffuse: Vec3,
    /// Specular reflectance.
    pub specular: Vec3,
    /// Exponent of the highlight, at least 0; no more than 10^10 of it counts.
    pub shininess: f32,
    /// Share of what the mirrored ray sees; no ray is traced where it is zero.
    pub reflection: Vec3,
    /// Share of what the refracted ray sees; no ray is traced where it is zero.
    pub transmission: Vec3,
    /// Index of refraction of what is behind the surface, relative to what is in front of it; above 0.
    pub ior: f32,
    /// How the two are divided.
    pub interface: Interface,
    /// What light loses inside, behind the front of a surface that refracts.
    pub absorption: Option<Absorption>,
    /// Spreads what is mirrored and refracted by (cos a)^gloss, a being the angle to the exact direction; at least 0.
    /// None is exact.
    pub gloss: Option<f32>,
    /// Scales the highlight so that `specular` is the share of light it sends on, and all shares down where they
    /// sum up to more than 1.
    pub energy_conserving: bool,
    /// Shows `diffuse` as it is, lit by nothing.
    pub unlit: bool,
    /// Light the surface gives off by itself.
    pub emission: Vec3,
    /// Multiplies `diffuse` (and `ambient`); index into [`Scene::textures`](crate::Scene::textures).
    pub diffuse_texture: Option<u32>,
    /// Multiplies `emission`; index into [`Scene::textures`](crate::Scene::textures).
    pub emission_texture: Option<u32>,
    /// Bends the shading normal; index into [`Scene::textures`](crate::Scene::textures), whose colours are numbers
    /// then.
    pub normal_texture: Option<u32>,
    /// Multiplies how far it is bent.
    pub normal_scale: f32,
    /// How much of the surface is there.
    pub alpha: Alpha,
    /// Its alpha, which that of the diffuse texture and of the vertices multiplies; from 0 to 1.
    pub opacity: f32,
    /// Which highlight.
    pub model: Specular,
    /// What the colours and the highlight follow from where textures vary more than the diffuse colour; those above are
    /// then of its average.
    pub physical: Option<Physical>,
}

impl Default for Material {
    /// Matte light grey.
    fn default() -> Self {
        Self {
            name: String::new(),
            ambient: Vec3::splat(0.8),
            diffuse: Vec3::splat(0.8),
            specular: Vec3::ZERO,
            shininess: 1.0,
            reflection: Vec3::ZERO,
            transmission: Vec3::ZERO,
            ior: 1.5,
            interface: Interface::default(),
            absorption: None,
            gloss: None,
            energy_conserving: false,
            unlit: false,
            emission: Vec3::ZERO,
            diffuse_texture: None,
            emission_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            alpha: Alpha::default(),
            opacity: 1.0,
            model: Specular::default(),
            physical: None,
        }
    }
}

impl Material {
    /// Clear glass.
    pub fn glass(ior: f32) -> Self {
        Self {
            ambient: Vec3::ZERO,
            diffuse: Vec3::ZERO,
            reflection: Vec3::ONE,
            transmission: Vec3::ONE,
            interface: Interface::Fresnel,
            ior,
            ..Self::default()
        }
    }

    /// The textures it uses.
    pub fn textures(&self) -> impl Iterator<Item = u32> {
        let own = [self.diffuse_texture, self.emission_texture, self.normal_texture].into_iter().flatten();
        own.chain(self.physical.iter().flat_map(|physical| physical.textures.all()))
    }

    /// Gives the textures it uses other indices.
    #[doc(hidden)]
    pub fn renumber_textures(&mut self, number: impl Fn(u32) -> u32) {
        let own = [&mut self.diffuse_texture, &mut self.emission_texture, &mut self.normal_texture];
        let physical = self.physical.iter_mut().flat_map(|physical| physical.textures.slots());
        own.into_iter().chain(physical).flatten().for_each(|index| *index = number(*index));
    }

    /// Whether a ray goes on from it.
    pub fn sends_on(&self) -> bool {
        !self.unlit && (self.reflection != Vec3::ZERO || self.transmission != Vec3::ZERO)
    }

    /// Whether light from anywhere else can be seen in it but by rays that go on exactly.
    pub fn is_lit(&self) -> bool {
        !self.unlit && (self.diffuse != Vec3::ZERO || self.specular != Vec3::ZERO)
    }

    /// The exponent of the highlight, but no more than 10^10: such a highlight is narrower than rays of any picture are
    /// apart, and sharper ones f64 cannot tell.
    pub(crate) fn exponent(&self) -> f32 {
        self.shininess.min(1e10)
    }

    /// What an energy-conserving highlight is scaled by: pi times the factor of its f, so that met head-on it sends on
    /// just `specular`. None for the classic one, which has no such factor.
    pub(crate) fn highlight_scale(&self) -> Option<f32> {
        let n = self.exponent();
        self.energy_conserving.then(|| match self.model {
            Specular::Phong => (n + 2.0) / 2.0,
            Specular::BlinnPhong => (n + 2.0) / 8.0 * ((n + 4.0) / (libm::exp2f(-n / 2.0) + n)),
        })
    }

    /// What all shares of an energy-conserving material are multiplied by, so that they sum up to no more than 1.
    pub fn conserving_scale(&self) -> f32 {
        let mirrored = match self.interface {
            Interface::Shares => self.reflection,
            // Taken from the others at each angle.
            Interface::Fresnel | Interface::Thin => Vec3::ZERO,
        };
        let sum = self.diffuse + self.specular + mirrored + self.transmission;
        1.0 / sum.max_element().max(1.0)
    }
}
