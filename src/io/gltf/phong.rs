//! From metallic-roughness to Phong.
//!
//! With base colour b, metalness m and roughness r:
//!
//! - Kd = lerp(b, b / 2, m). A real metal has no diffuse part; but what it mirrors are its surroundings, and here there
//!   are none: it would be black but for its highlights. The diffuse half stands for even surroundings.
//! - F = lerp(0.04, b / 2, m) is left for the highlight, so that no more light is sent out than arrives.
//! - The exponent n = 2 / alpha^2 - 2 with alpha = r^2 gives the highlight of Blinn-Phong the width of the microfacets'
//!   (Walter et al. 2007, *Microfacet models for refraction through rough surfaces*).
//! - Ks = F min(1, (n + 2) / 8): (n + 2) / 8 keeps the energy of a highlight while it widens (Akenine-Moller et al. 2018,
//!   *Real-Time Rendering*, section 9.8). With F alone, a rough metal (n = 0) is white all over. Sharp highlights stop at
//!   F, as Phong's do; their true peak is hundreds of times brighter than the light's own colour.
//!
//! With the share t of `KHR_materials_transmission` (of what is not metal) and the index n of `KHR_materials_ior`:
//!
//! - Plastic's 0.04 becomes ((n - 1) / (n + 1))^2.
//! - (1 - t) Kd stays diffuse, t b goes through, the exact share of Fresnel's equations is mirrored. With a thickness in `KHR_materials_volume`
//!   light is refracted, without it goes straight through.
//! - Rough glass spreads both by the exponent n / 4: mirroring doubles the angle by which a normal is off.
//!
//! Phong has one exponent and one Ks a material, so textures of metalness and roughness count by their mean, and so does
//! the base colour's in F. Looking them up at every point would keep the pattern, and make every material of every
//! format pay for it.

use crate::image::srgb::srgb_to_linear;
use crate::math::Vec3;
use crate::scene::{Material, Texture};

/// Smallest roughness, so that the exponent stays below about 20,000.
const LEAST_ROUGHNESS: f32 = 0.1;
/// Share of a metal's colour that is diffuse, for the surroundings that it does not mirror.
const MATTE_METAL: f32 = 0.5;
/// What anything but metal mirrors, seen from the front.
const DIELECTRIC: f32 = 0.04;

/// A material of glTF with one value for each texture.
pub(super) struct MetallicRoughness {
    /// The factor, linear; a texture multiplies it at every point.
    pub(super) base: Vec3,
    /// The mean of the base colour's texture; white without one.
    pub(super) texture: Vec3,
    /// Metalness and roughness, factors times the means of their textures.
    pub(super) metal: f32,
    pub(super) roughness: f32,
    /// Index of refraction; 0 stands for infinity.
    pub(super) ior: Option<f32>,
    /// Share of what is not mirrored that goes through.
    pub(super) transmission: f32,
}

impl MetallicRoughness {
    /// The Phong material, still without a name, a texture and emission.
    pub(super) fn phong(&self) -> Material {
        let Self { base, texture, metal, roughness, ior, transmission } = *self;
        let alpha = roughness.max(LEAST_ROUGHNESS).powi(2);
        let shininess = (2.0 / (alpha * alpha) - 2.0).max(0.0);
        let dielectric = ior.map_or(DIELECTRIC, |n| if n == 0.0 { 1.0 } else { ((n - 1.0) / (n + 1.0)).powi(2) });
        let mirrored = Vec3::splat(dielectric).lerp(base * texture * (1.0 - MATTE_METAL), metal);
        let diffuse = base.lerp(base * MATTE_METAL, metal);
        let plain = Material {
            ambient: diffuse,
            diffuse,
            specular: mirrored * ((shininess + 2.0) / 8.0).min(1.0),
            shininess,
            ior: ior.filter(|n| *n > 0.0).unwrap_or(Material::default().ior),
            ..Material::default()
        };
        if transmission == 0.0 {
            return plain;
        }
        let through = transmission * (1.0 - metal);
        Material {
            ambient: diffuse * (1.0 - through),
            diffuse: diffuse * (1.0 - through),
            reflection: Vec3::ONE.lerp(base * texture, metal),
            transmission: base * texture * through,
            gloss: (roughness > LEAST_ROUGHNESS).then_some(shininess / 4.0),
            ..plain
        }
    }
}

/// The mean colour of a picture, linear.
pub(super) fn mean_color(picture: &Texture) -> Vec3 {
    mean(picture, srgb_to_linear)
}

/// The mean of a picture of numbers, which are not encoded.
pub(super) fn mean_number(picture: &Texture) -> Vec3 {
    mean(picture, |code| f32::from(code) / 255.0)
}

fn mean(picture: &Texture, linear: fn(u8) -> f32) -> Vec3 {
    // Counted by code first: the sums are then exact, and a decoding costs 256 calls.
    let mut counts = [[0u64; 256]; 3];
    for pixel in &picture.pixels {
        for (counts, code) in counts.iter_mut().zip(pixel) {
            counts[usize::from(*code)] += 1;
        }
    }
    let pixels = picture.pixels.len().max(1) as f64;
    let mean = counts.map(|counts| {
        let sum: f64 = counts.iter().zip(0..=255).map(|(&count, code)| count as f64 * f64::from(linear(code))).sum();
        (sum / pixels) as f32
    });
    mean.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: Vec3 = Vec3::new(0.5, 0.25, 1.0);

    fn values(metal: f32, roughness: f32) -> MetallicRoughness {
        MetallicRoughness { base: BASE, texture: Vec3::ONE, metal, roughness, ior: None, transmission: 0.0 }
    }

    fn material(metal: f32, roughness: f32) -> Material {
        values(metal, roughness).phong()
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
        let textured = MetallicRoughness { texture: Vec3::X, ..values(1.0, 0.5) }.phong();
        assert_eq!((textured.diffuse, textured.specular), (BASE / 2.0, BASE / 2.0 * Vec3::X));
    }

    #[test]
    fn what_lets_light_through_is_coloured_glass() {
        let glass = MetallicRoughness { transmission: 0.75, ior: Some(2.0), ..values(0.0, 0.0) }.phong();
        assert_eq!((glass.diffuse, glass.transmission, glass.reflection), (BASE * 0.25, BASE * 0.75, Vec3::ONE));
        assert!((glass.specular.x - 1.0 / 9.0).abs() < 1e-7, "((2 - 1) / (2 + 1))^2");
        assert_eq!((glass.ior, glass.gloss), (2.0, None));
        let frosted = MetallicRoughness { transmission: 1.0, ..values(0.0, 0.5) }.phong();
        assert_eq!((frosted.gloss, frosted.diffuse, frosted.ior), (Some(7.5), Vec3::ZERO, 1.5));
        let metal = MetallicRoughness { transmission: 1.0, ..values(1.0, 0.0) }.phong();
        assert_eq!((metal.transmission, metal.diffuse), (Vec3::ZERO, BASE / 2.0), "light does not go through metal");
    }

    /// Light from the hemisphere's every direction, seen from above, must not come back brighter than white: the sum of
    /// (Kd cos + Ks (n . h)^n) over the hemisphere, over pi.
    #[test]
    fn no_material_sends_out_more_than_arrives() {
        for roughness in [0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 1.0] {
            for metal in [0.0, 0.5, 1.0] {
                let white = MetallicRoughness { base: Vec3::ONE, ..values(metal, roughness) }.phong();
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
    fn means_are_of_light() {
        let pixels = vec![[0, 0, 51, 0], [255, 188, 0, 255]];
        let picture = Texture { width: 2, height: 1, pixels, ..Texture::default() };
        let color = mean_color(&picture);
        // sRGB 188 is 0.5029 of the light, 51 is 0.0331.
        assert!((color - Vec3::new(0.5, 0.25145, 0.01655)).abs().max_element() < 1e-4, "{color}");
        let numbers = mean_number(&picture);
        assert!((numbers - Vec3::new(0.5, 188.0 / 510.0, 0.1)).abs().max_element() < 1e-6, "{numbers}");
        assert_eq!(mean_color(&Texture::default()), Vec3::ZERO);
    }
}
