//! Surfaces described by physical quantities, as glTF has them, and the Phong material that stands for one.
//!
//! Of metallic-roughness, with base colour b, metalness m and roughness r:
//!
//! - Kd = lerp(b, b / 2, m). A real metal has no diffuse part; but what it mirrors are its surroundings, and here there
//!   are none: it would be black but for its highlights. The diffuse half stands for even surroundings.
//! - F = lerp(p, b / 2, m) is left for the highlight, so that no more light is sent out than arrives. Plastic's p is
//!   0.04, or with the index n of `KHR_materials_ior` ((n - 1) / (n + 1))^2, times factor and colour of
//!   `KHR_materials_specular`, at most 1.
//! - The exponent n = 2 / alpha^2 - 2 with alpha = r^2 gives the highlight of Blinn-Phong the width of the microfacets'
//!   (Walter et al. 2007, *Microfacet models for refraction through rough surfaces*).
//! - Ks = F min(1, (n + 2) / 8): (n + 2) / 8 keeps the energy of a highlight while it widens (Akenine-Moller et al.
//!   2018, *Real-Time Rendering*, section 9.8). With F alone, a rough metal (n = 0) is white all over. Sharp highlights
//!   stop at F, as Phong's do; their true peak is hundreds of times brighter than the light's own colour.
//!
//! With the share t of `KHR_materials_transmission` (of what is not metal):
//!
//! - (1 - t) Kd stays diffuse, t b goes through, the exact share of Fresnel's equations is mirrored, times factor and
//!   colour of `KHR_materials_specular`. With a thickness in `KHR_materials_volume` light is refracted, without it goes
//!   straight through.
//! - Rough glass spreads both by the exponent n / 4: mirroring doubles the angle by which a normal is off.
//!
//! Of specular-glossiness (`KHR_materials_pbrSpecularGlossiness`) with diffuse colour d, specular f and glossiness g,
//! r = 1 - g, and what f has beyond plastic's 0.04 is metal: Kd = d (1 - max f) + max(f - 0.04, 0) / 2, and F is f
//! without that half.
//!
//! Textures of these quantities are looked up at each hit, by materials that have some. Those that have none pay
//! nothing: what is here is computed once, when they are loaded. Microfacets themselves, the alternative, wait for a
//! lobe of their own.

use super::Material;
use crate::math::Vec3;

/// Smallest roughness, so that the exponent stays below about 20,000.
const MIN_ROUGHNESS: f32 = 0.1;
/// Share of a metal's colour that is diffuse, for the surroundings that it does not mirror.
const MATTE_METAL: f32 = 0.5;
/// What anything but metal mirrors, seen from the front.
const DIELECTRIC: f32 = 0.04;

/// A surface by its physical quantities, before any texture, and the textures that multiply them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Physical {
    /// The quantities.
    pub workflow: Workflow,
    /// What they are multiplied by where they vary.
    pub textures: PhysicalTextures,
}

/// Two ways to describe the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Workflow {
    /// A base colour, and how much of a metal it is.
    MetallicRoughness(MetallicRoughness),
    /// What is diffuse and what is mirrored.
    SpecularGlossiness(SpecularGlossiness),
}

impl Workflow {
    /// Every number of it; what is left over is 0.
    pub(super) fn values(&self) -> [Vec3; 4] {
        match *self {
            Self::MetallicRoughness(MetallicRoughness {
                base,
                metalness,
                roughness,
                ior,
                specular,
                specular_color,
                transmission,
            }) => {
                let numbers = Vec3::new(metalness, roughness, ior.unwrap_or(0.0));
                [base, numbers, specular_color, Vec3::new(specular, transmission, 0.0)]
            }
            Self::SpecularGlossiness(SpecularGlossiness { diffuse, specular, glossiness }) => {
                [diffuse, specular, Vec3::splat(glossiness), Vec3::ZERO]
            }
        }
    }
}

/// A base colour, and how much of a metal it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetallicRoughness {
    /// Linear RGB.
    pub base: Vec3,
    /// From 0 to 1.
    pub metalness: f32,
    /// From 0 to 1.
    pub roughness: f32,
    /// Index of refraction; 0 stands for infinity; none for plastic's usual one.
    pub ior: Option<f32>,
    /// Multiplies what anything but metal mirrors, from 0 to 1.
    pub specular: f32,
    /// The same for each colour, from 0 up.
    pub specular_color: Vec3,
    /// Share of what is not mirrored that goes through, from 0 to 1.
    pub transmission: f32,
}

/// What is diffuse and what is mirrored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularGlossiness {
    /// Linear RGB.
    pub diffuse: Vec3,
    /// What is mirrored, seen from the front; linear RGB.
    pub specular: Vec3,
    /// 1 less the roughness; from 0 to 1.
    pub glossiness: f32,
}

/// Indices into [`Scene::textures`](crate::Scene::textures). The colour's texture is [`Material::diffuse_texture`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhysicalTextures {
    /// Numbers: roughness in green, metalness in blue.
    pub metallic_roughness: Option<u32>,
    /// A number in red.
    pub transmission: Option<u32>,
    /// A number in alpha: the factor of what is mirrored, or the glossiness.
    pub specular: Option<u32>,
    /// A colour.
    pub specular_color: Option<u32>,
}

impl PhysicalTextures {
    /// All of them.
    pub(super) fn slots(&mut self) -> [&mut Option<u32>; 4] {
        [&mut self.metallic_roughness, &mut self.transmission, &mut self.specular, &mut self.specular_color]
    }

    /// Those that there are.
    pub(super) fn all(&self) -> impl Iterator<Item = u32> + use<> {
        [self.metallic_roughness, self.transmission, self.specular, self.specular_color].into_iter().flatten()
    }
}

/// What the textures of a surface say at one place, or on average; 1 where there are none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texels {
    /// Of the base or diffuse colour, linear.
    pub color: Vec3,
    /// Multiplies the metalness.
    pub metalness: f32,
    /// Multiplies the roughness.
    pub roughness: f32,
    /// Multiplies the share that goes through.
    pub transmission: f32,
    /// Multiplies the factor of what is mirrored, or the glossiness.
    pub specular: f32,
    /// Multiplies the colour of what is mirrored, linear.
    pub specular_color: Vec3,
}

impl Default for Texels {
    fn default() -> Self {
        Self {
            color: Vec3::ONE,
            metalness: 1.0,
            roughness: 1.0,
            transmission: 1.0,
            specular: 1.0,
            specular_color: Vec3::ONE,
        }
    }
}

impl Default for MetallicRoughness {
    /// As glTF has it: white metal that is as rough as can be.
    fn default() -> Self {
        Self {
            base: Vec3::ONE,
            metalness: 1.0,
            roughness: 1.0,
            ior: None,
            specular: 1.0,
            specular_color: Vec3::ONE,
            transmission: 0.0,
        }
    }
}

impl Physical {
    /// Whether more than the diffuse colour varies over the surface, where `has_color` says that this does.
    pub fn varies(&self, has_color: bool) -> bool {
        let by_color = match &self.workflow {
            Workflow::MetallicRoughness(values) => values.metalness > 0.0 || values.transmission > 0.0,
            Workflow::SpecularGlossiness(_) => true,
        };
        self.textures.all().next().is_some() || has_color && by_color
    }

    /// The Phong material where textures say this, still without a name, textures and emission.
    pub fn phong(&self, texels: &Texels) -> Material {
        match &self.workflow {
            Workflow::MetallicRoughness(values) => values.phong(texels),
            Workflow::SpecularGlossiness(values) => values.phong(texels),
        }
    }
}

impl MetallicRoughness {
    fn phong(&self, texels: &Texels) -> Material {
        let base = self.base * texels.color;
        let metal = self.metalness * texels.metalness;
        let roughness = self.roughness * texels.roughness;
        let tint = self.specular_color * texels.specular_color * (self.specular * texels.specular);
        let normal = self.ior.map_or(DIELECTRIC, |n| if n == 0.0 { 1.0 } else { ((n - 1.0) / (n + 1.0)).powi(2) });
        let mirrored = (tint * normal).min(Vec3::ONE).lerp(base * (1.0 - MATTE_METAL), metal);
        let diffuse = base.lerp(base * MATTE_METAL, metal);
        let plain = Material {
            ior: self.ior.filter(|n| *n > 0.0).unwrap_or(Material::default().ior),
            ..shiny(diffuse, mirrored, roughness)
        };
        // Of what lets light through anywhere all is glass, also where its texture is black: it mirrors what it does
        // not let in.
        if self.transmission == 0.0 {
            return plain;
        }
        let through = self.transmission * texels.transmission * (1.0 - metal);
        Material {
            ambient: diffuse * (1.0 - through),
            diffuse: diffuse * (1.0 - through),
            reflection: tint.min(Vec3::ONE).lerp(base, metal),
            transmission: base * through,
            gloss: (roughness > MIN_ROUGHNESS).then_some(plain.shininess / 4.0),
            ..plain
        }
    }
}

impl SpecularGlossiness {
    fn phong(&self, texels: &Texels) -> Material {
        let mirrored = self.specular * texels.specular_color;
        let metal = (mirrored - DIELECTRIC).max(Vec3::ZERO);
        let below = self.diffuse * texels.color * (1.0 - mirrored.max_element().min(1.0));
        let roughness = 1.0 - self.glossiness * texels.specular;
        shiny(below + metal * MATTE_METAL, mirrored - metal * MATTE_METAL, roughness)
    }
}

/// A surface with a highlight.
fn shiny(diffuse: Vec3, mirrored: Vec3, roughness: f32) -> Material {
    let alpha = roughness.max(MIN_ROUGHNESS).powi(2);
    let shininess = (2.0 / (alpha * alpha) - 2.0).max(0.0);
    Material {
        ambient: diffuse,
        diffuse,
        specular: mirrored * ((shininess + 2.0) / 8.0).min(1.0),
        shininess,
        ..Material::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: Vec3 = Vec3::new(0.5, 0.25, 1.0);

    fn values(metalness: f32, roughness: f32) -> MetallicRoughness {
        MetallicRoughness { base: BASE, metalness, roughness, ..MetallicRoughness::default() }
    }

    fn plain(values: MetallicRoughness) -> Material {
        values.phong(&Texels::default())
    }

    fn material(metal: f32, roughness: f32) -> Material {
        plain(values(metal, roughness))
    }

    #[test]
    fn dielectrics_are_diffuse_with_a_weak_highlight() {
        let rough = material(0.0, 1.0);
        assert_eq!((rough.diffuse, rough.specular, rough.shininess), (BASE, Vec3::splat(0.01), 0.0));
        let smooth = material(0.0, 0.5);
        // alpha = 1/4: 2 * 16 - 2.
        assert_eq!((smooth.specular, smooth.shininess), (Vec3::splat(0.04), 30.0));
        assert!((material(0.0, 0.0).shininess - 19_998.0).abs() < 1.0);
    }

    #[test]
    fn metals_keep_their_colour() {
        let smooth = material(1.0, 0.5);
        assert_eq!((smooth.diffuse, smooth.specular), (BASE / 2.0, BASE / 2.0));
        let red = BASE / 2.0 * Vec3::X;
        let textured = values(1.0, 0.5).phong(&Texels { color: Vec3::X, ..Texels::default() });
        assert_eq!((textured.diffuse, textured.specular), (red, red));
    }

    #[test]
    fn what_lets_light_through_is_coloured_glass() {
        let glass = plain(MetallicRoughness { transmission: 0.75, ior: Some(2.0), ..values(0.0, 0.0) });
        assert_eq!((glass.diffuse, glass.transmission, glass.reflection), (BASE * 0.25, BASE * 0.75, Vec3::ONE));
        assert!((glass.specular.x - 1.0 / 9.0).abs() < 1e-7, "((2 - 1) / (2 + 1))^2");
        assert_eq!((glass.ior, glass.gloss), (2.0, None));
        let frosted = plain(MetallicRoughness { transmission: 1.0, ..values(0.0, 0.5) });
        assert_eq!((frosted.gloss, frosted.diffuse, frosted.ior), (Some(7.5), Vec3::ZERO, 1.5));
        let metal = plain(MetallicRoughness { transmission: 1.0, ..values(1.0, 0.0) });
        assert_eq!((metal.transmission, metal.diffuse), (Vec3::ZERO, BASE / 2.0), "light does not go through metal");
    }

    /// Light from the hemisphere's every direction, seen from above, must not come back brighter than white: the sum of
    /// (Kd cos + Ks (n . h)^n) over the hemisphere, over pi.
    #[test]
    fn no_material_sends_out_more_than_arrives() {
        for roughness in [0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 1.0] {
            for metal in [0.0, 0.5, 1.0] {
                let white = plain(MetallicRoughness { base: Vec3::ONE, ..values(metal, roughness) });
                let steps = 20_000;
                let sum: f64 = (0..steps)
                    .map(|k| {
                        let cosine = (f64::from(k) + 0.5) / f64::from(steps);
                        let half = ((1.0 + cosine) / 2.0).sqrt();
                        let highlight = half.powf(f64::from(white.shininess));
                        f64::from(white.diffuse.x) * cosine + f64::from(white.specular.x) * highlight
                    })
                    .sum();
                let sent = 2.0 * sum / f64::from(steps);
                assert!((0.4..=1.05).contains(&sent), "metal {metal}, roughness {roughness}: {sent}");
            }
        }
    }

    #[test]
    fn textures_multiply_what_they_belong_to() {
        let textured = Texels { metalness: 0.5, roughness: 0.5, ..Texels::default() };
        assert_eq!(values(1.0, 1.0).phong(&textured), material(0.5, 0.5));
        let glass = MetallicRoughness { transmission: 1.0, ..values(0.0, 0.0) };
        let half = glass.phong(&Texels { transmission: 0.5, ..Texels::default() });
        assert_eq!((half.diffuse, half.transmission), (BASE * 0.5, BASE * 0.5));
        let opaque = glass.phong(&Texels { transmission: 0.0, ..Texels::default() });
        assert_eq!((opaque.diffuse, opaque.transmission, opaque.reflection), (BASE, Vec3::ZERO, Vec3::ONE));
        // KHR_materials_specular: 0.04 times the colour times the factor, of what is not metal.
        let coloured =
            MetallicRoughness { specular: 0.5, specular_color: Vec3::new(2.0, 1.0, 0.0), ..values(0.0, 0.5) };
        assert_eq!(plain(coloured).specular, Vec3::new(0.04, 0.02, 0.0));
        let texels = Texels { specular: 0.5, specular_color: Vec3::new(0.5, 0.0, 1.0), ..Texels::default() };
        assert_eq!(coloured.phong(&texels).specular, Vec3::new(0.01, 0.0, 0.0));
    }

    #[test]
    fn specular_and_glossiness_are_the_same_materials() {
        let phong = |values: SpecularGlossiness| values.phong(&Texels::default());
        let plastic = phong(SpecularGlossiness { diffuse: BASE, specular: Vec3::splat(0.04), glossiness: 0.5 });
        assert_eq!((plastic.diffuse, plastic.shininess), (BASE * 0.96, 30.0), "what is mirrored is not diffuse");
        assert_eq!(plastic.specular, material(0.0, 0.5).specular);
        let metal = phong(SpecularGlossiness { diffuse: Vec3::ZERO, specular: BASE, glossiness: 0.5 });
        let same = material(1.0, 0.5);
        assert!((metal.diffuse - same.diffuse).abs().max_element() <= 0.02 + 1e-6, "{}", metal.diffuse);
        assert!((metal.specular - same.specular).abs().max_element() <= 0.02 + 1e-6, "{}", metal.specular);
    }
}
