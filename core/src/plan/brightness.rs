//! How bright the brightest thing may be that a ray sees: what rays may be left out follows from it.

use std::cell::LazyCell;

use crate::math::{Aabb, DVec3, Vec3};
use crate::scene::{Geometry, Light, Material, Scene, Texels};
use crate::trace::World;

/// No ray sees more than this, linear and in any channel; at least 1, and infinite where nothing is known, as beside a
/// light that grows without bound.
///
/// What a ray sees is weighted along its way by what mirrors and glass leave of it. Glass has light denser within than
/// outside, by the square of its index (`SpecularDirection::scale`): a ray may weigh so much less within than what
/// comes of it, which is counted here.
pub(super) fn bound(scene: &Scene, world: &World) -> f32 {
    // They take a look at every triangle, and only lamps ask for them.
    let bounds = LazyCell::new(|| world.bounds());
    let nearest = |lamp: DVec3| if world.is_unbounded() { 0.0 } else { distance(lamp - world.centre, *bounds) };
    let arriving: f32 = scene.lights.iter().map(|light| of_light(light, &nearest)).sum();
    // Where there is none there may be a headlight.
    let arriving = if scene.lights.is_empty() { 1.0 } else { arriving };
    let environment = scene.environment.as_ref().map_or(0.0, |environment| {
        let brightest = environment.image.pixels.iter().map(|pixel| pixel.truncate().max_element()).fold(0.0, f32::max);
        brightest * environment.intensity
    });
    let behind = scene.background.map_or(0.0, |color| color.max_element());
    let fog = scene.fog.map_or(0.0, |fog| fog.color.max_element());
    let (tint, ambient) = (largest_tint(scene), scene.ambient.max_element());
    let of_material = |material: &Material| surface(material, tint, ambient, arriving + environment);
    let surfaces = scene.materials.iter().map(of_material).fold(0.0, f32::max);
    let denser: f32 = scene.materials.iter().map(radiance_scale).product();
    [environment, behind, fog, surfaces].into_iter().fold(1.0, f32::max) * denser
}

/// What a white matte surface shows of it at most; `nearest` tells how far a lamp is from everything at least.
fn of_light(light: &Light, nearest: &impl Fn(DVec3) -> f32) -> f32 {
    match light {
        Light::Directional { color, .. } => color.max_element(),
        Light::Point { color, attenuation, position, .. } | Light::Spot { color, attenuation, position, .. } => {
            let color = color.max_element();
            // The nearer the brighter. Not a product with 0, which of what is infinite would be NaN.
            if color > 0.0 { color * attenuation.factor(nearest(*position)) } else { 0.0 }
        }
        Light::Area { radiance, .. } => radiance.max_element(),
    }
}

/// How far a point is from a box; 0 from an empty one.
fn distance(point: DVec3, bounds: Aabb) -> f32 {
    if bounds.is_empty() {
        return 0.0;
    }
    let nearest = point.clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3());
    (point - nearest).length() as f32
}

/// The largest component of vertices' colours, at least 1.
fn largest_tint(scene: &Scene) -> f32 {
    let of_geometry = |geometry: &Geometry| match geometry {
        Geometry::Mesh(mesh) => mesh.brightest_color(),
        Geometry::Shapes { .. } => 1.0,
    };
    scene.geometries.iter().map(of_geometry).fold(1.0, f32::max)
}

/// What a material may look like where vertices' colours go up to `tint`, so that no part of what any place of it shows
/// (matte, highlight, ambient) is brighter than in the brightest of these. Textures' colours go up to 1. Of one that
/// follows from textures of other things, each part is a convex function of each of them, which is greatest at 0 or 1,
/// and rises or falls with the components of a colour one by one.
fn looks(material: &Material, tint: f32) -> Vec<Material> {
    let Some(physical) = material.physical else {
        let [ambient, diffuse] = [material.ambient, material.diffuse].map(|color| color * tint);
        return vec![Material { ambient, diffuse, ..material.clone() }];
    };
    let mut looks = Vec::new();
    for specular_color in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE] {
        for ends in 0..1 << 4 {
            let pick = |bit: u32| (ends >> bit & 1) as f32;
            let here = physical.phong(&Texels {
                color: Vec3::splat(tint),
                metalness: pick(0),
                roughness: pick(1),
                transmission: pick(2),
                specular: pick(3),
                specular_color,
            });
            let Material { ambient, diffuse, specular, shininess, .. } = here;
            looks.push(Material { ambient, diffuse, specular, shininess, ..material.clone() });
        }
    }
    looks
}

/// What a surface shows at most of its own, of ambient light, and of what arrives from lights.
fn surface(material: &Material, tint: f32, ambient: f32, arriving: f32) -> f32 {
    let (mut around, mut matte, mut highlight) = (0f32, 0f32, 0f32);
    for look in looks(material, tint) {
        let peak = look.highlight_scale().unwrap_or(1.0).max(1.0);
        around = around.max(look.ambient.max_element());
        matte = matte.max(look.diffuse.max_element());
        highlight = highlight.max(look.specular.max_element() * peak);
    }
    let lit = matte + highlight;
    let reflected = if material.unlit {
        // Its colour, whatever arrives.
        matte
    } else if lit > 0.0 {
        lit * arriving
    } else {
        0.0
    };
    material.emission.max_element() + around * ambient + reflected
}

/// By how much light is denser on one side of a surface than on the other.
fn radiance_scale(material: &Material) -> f32 {
    let refracts = material.transmission.max_element() > 0.0;
    if refracts { material.ior.max(material.ior.recip()).powi(2) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec4;
    use crate::scene::{
        Attenuation, Mesh, MetallicRoughness, Physical, PhysicalTextures, SpecularGlossiness, Workflow,
    };

    /// A triangle from zero to 1 along x and y, of a material, and a light.
    fn bound_of(material: Material, light: Light) -> f32 {
        let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        let mut scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![material]);
        scene.lights = vec![light];
        bound(&scene, &World::new(&scene).expect("sound"))
    }

    fn matte() -> Material {
        Material { diffuse: Vec3::splat(0.5), ambient: Vec3::ZERO, specular: Vec3::ZERO, ..Material::default() }
    }

    fn lamp(position: DVec3, attenuation: Attenuation) -> Light {
        Light::Point { position, color: Vec3::splat(40.0), attenuation, range: f64::INFINITY, radius: 0.0 }
    }

    #[test]
    fn lamps_are_as_bright_as_where_they_are_nearest() {
        let above = lamp(DVec3::new(0.5, 0.5, 2.0), Attenuation::INVERSE_SQUARE);
        assert_eq!(bound_of(matte(), above), 0.5 * 40.0 / 4.0);
        let within = DVec3::new(0.5, 0.5, 0.0);
        assert_eq!(bound_of(matte(), lamp(within, Attenuation::INVERSE_SQUARE)), f32::INFINITY);
        assert_eq!(bound_of(matte(), lamp(within, Attenuation::NONE)), 0.5 * 40.0);
        let black = Material { diffuse: Vec3::ZERO, ..matte() };
        assert_eq!(bound_of(black, lamp(within, Attenuation::INVERSE_SQUARE)), 1.0);
    }

    /// A metal by its mean, whose texture may have a spot that is none; and colours of vertices that go beyond white.
    #[test]
    fn a_surface_is_as_bright_as_its_brightest_spot() {
        let sun = Light::Directional { direction: DVec3::NEG_Z, color: Vec3::splat(10.0) };
        let workflow =
            Workflow::MetallicRoughness(MetallicRoughness { base: Vec3::ONE, ..MetallicRoughness::default() });
        let textures = PhysicalTextures { metallic_roughness: Some(0), ..PhysicalTextures::default() };
        let spotted = Material { physical: Some(Physical { workflow, textures }), ..matte() };
        for texel in [0.0, 0.25, 1.0] {
            let here = Texels { metalness: texel, roughness: texel, ..Texels::default() };
            let here = workflow_look(&spotted, &here);
            let shown = 10.0 * (here.diffuse.max_element() + here.specular.max_element());
            let bound = bound_of(spotted.clone(), sun.clone());
            assert!(bound >= shown && bound <= 25.0, "{texel}: {bound} {shown}");
        }
        // What mirrors red alone there is matte in it as well.
        let workflow = Workflow::SpecularGlossiness(SpecularGlossiness {
            diffuse: Vec3::new(0.1, 0.0, 0.0),
            specular: Vec3::new(0.5, 0.6, 0.0),
            glossiness: 1.0,
        });
        let textures = PhysicalTextures { specular_color: Some(0), ..PhysicalTextures::default() };
        let plated = Material { physical: Some(Physical { workflow, textures }), ..matte() };
        for specular_color in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE, Vec3::new(1.0, 0.83, 0.0)] {
            let here = workflow_look(&plated, &Texels { specular_color, ..Texels::default() });
            let shown = 10.0 * (here.diffuse + here.specular).max_element();
            assert!(bound_of(plated.clone(), sun.clone()) >= shown.max(1.0), "{specular_color}");
        }
        let shown = Material { unlit: true, diffuse: Vec3::splat(40.0), ..matte() };
        let dim = Light::Directional { direction: DVec3::NEG_Z, color: Vec3::splat(0.01) };
        assert_eq!(bound_of(shown, dim), 40.0);
        let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        let mesh = Mesh { colors: vec![Vec4::ONE, Vec4::new(1.0, 6.0, 1.0, 1.0), Vec4::ONE], ..mesh };
        let mut scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![matte()]);
        scene.lights = vec![sun];
        assert_eq!(bound(&scene, &World::new(&scene).expect("sound")), 6.0 * 0.5 * 10.0);
    }

    fn workflow_look(material: &Material, texels: &Texels) -> Material {
        material.physical.as_ref().expect("it follows from textures").phong(texels)
    }

    #[test]
    fn what_glows_is_denser_in_glass() {
        let sun = Light::Directional { direction: DVec3::NEG_Z, color: Vec3::ZERO };
        let glowing = Material { emission: Vec3::splat(60.0), ..matte() };
        assert_eq!(bound_of(glowing.clone(), sun.clone()), 60.0);
        let glass = Material { transmission: Vec3::ONE, ior: 2.0, ..glowing };
        assert_eq!(bound_of(glass, sun), 4.0 * 60.0);
    }
}
