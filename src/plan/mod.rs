//! What this render needs, and nothing else.
//!
//! [`Plan::new`] takes a census of the scene and switches off what no pixel can show: shadow rays where no light casts
//! any, texture coordinates where no texture is used, shading normals where no mesh in view of a light has them, the
//! ambient term, lights that are black. The renderer reads the plan and never asks the scene again.

mod build;
mod integrator;

use std::collections::BTreeSet;
use std::fmt;

pub use build::{BuildChoice, BuildRequest, EMBREE_BYTES, NotEnoughMemory};

use crate::math::Vec3;
use crate::scene::{Alpha, Fog, Geometry, Integrator, Light, Material, Scene, Unlit};
use crate::shade::Attributes;
use crate::shade::light::LightSource;
use crate::shade::lights::has_emitters;
use crate::trace::World;

/// Whether instances are traced as such.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Levels {
    /// Everything is fixed in world coordinates.
    One,
    /// Objects stand in several places by transforms.
    Two,
}

/// Where light comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Lighting {
    /// No surface reflects anything: no light is looked at.
    None,
    /// The scene has no light and is not meant to be dark, so that the viewer carries one; it needs no shadow rays.
    Headlight,
    /// The scene's lights by index, without those that are black; each casts shadows.
    Lights(Vec<usize>),
}

/// How often rays are sent on by mirrors and glass where nobody says.
pub const USUAL_DEPTH: u32 = 5;
/// How often paths are scattered at most where nobody says; nearly all end earlier, by chance.
pub const USUAL_PATH_DEPTH: u32 = 64;

/// What is wanted of a render. What is none is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wishes {
    /// How far light is followed.
    pub integrator: Option<Integrator>,
    /// Stands in for the scene's own; linear RGB.
    pub background: Option<Vec3>,
    /// How often rays may be sent on.
    pub max_depth: Option<u32>,
}

/// What a render will do.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// One level of tracing or two.
    pub levels: Levels,
    /// What must be known of a surface.
    pub attributes: Attributes,
    /// Where light comes from.
    pub lighting: Lighting,
    /// Whether something moves, so that rays have times.
    pub motion: bool,
    /// Whether ambient light is added.
    pub ambient: bool,
    /// How far light is followed.
    pub integrator: Integrator,
    /// Why that far, in words.
    pub why: &'static str,
    /// How often rays may be sent on; 0 where nothing does.
    pub depth: u32,
    /// Whether anything takes light from rays on their way through it.
    pub absorption: bool,
    /// Whether textures bend normals.
    pub normal_maps: bool,
    /// Whether rays pass through surfaces that are not all there.
    pub alpha: bool,
    /// Whether light comes from all around.
    pub environment: bool,
    /// Fog between things; none where it would change nothing.
    pub fog: Option<Fog>,
    /// Linear RGB behind everything, which then is opaque; none leaves it transparent.
    pub background: Option<Vec3>,
    /// Primitives as placed.
    pub primitives: u64,
    /// Materials that something is made of.
    pub materials: usize,
}

impl Plan {
    /// The plan for a scene.
    pub fn new(scene: &Scene, world: &World, wishes: &Wishes) -> Self {
        let geometries = placed_geometries(scene);
        let used: BTreeSet<u32> = geometries.iter().map(|g| g.material()).collect();
        let default = Material::default();
        let materials: Vec<_> = used.iter().map(|&m| scene.materials.get(m as usize).unwrap_or(&default)).collect();

        let any = |holds: fn(&Material) -> bool| materials.iter().any(|material| holds(material));
        let environment = scene.environment.as_ref().is_some_and(|light| light.intensity > 0.0);
        let given: Vec<usize> = (0..scene.lights.len()).filter(|&i| gives_light(&scene.lights[i])).collect();
        let bodies = || {
            let sources: Vec<_> = given.iter().map(|&i| LightSource::new(&scene.lights[i], world.centre)).collect();
            has_emitters(scene, world, &sources)
        };
        let is_meant_dark = scene.unlit == Unlit::Darkness || !scene.lights.is_empty();
        let census = integrator::Census {
            sends_on: any(Material::sends_on),
            is_lit: any(Material::is_lit),
            is_dark: is_meant_dark && given.is_empty() && !environment && scene.ambient == Vec3::ZERO,
            emitters: &bodies,
        };
        let (integrator, why) = integrator::choose(wishes.integrator, &census);
        let is_path = integrator == Integrator::Path;

        let reflects = any(Material::is_lit) || is_path && any(Material::sends_on);
        // To paths, what is behind everything is light too.
        let shines = |color: Option<Vec3>| color.is_some_and(|color| color != Vec3::ZERO);
        let found = is_path && (shines(wishes.background.or(scene.background)) || bodies());
        let headlight = scene.unlit == Unlit::Headlight && scene.lights.is_empty() && !environment && !found;
        let lighting = match (reflects, headlight) {
            (false, _) => Lighting::None,
            (true, true) => Lighting::Headlight,
            (true, false) => Lighting::Lights(given),
        };
        let lit =
            is_path || environment || !matches!(&lighting, Lighting::None) && lighting != Lighting::Lights(vec![]);
        let sends_on = any(Material::sends_on);
        let depth = match integrator {
            Integrator::RayCast => 0,
            Integrator::Whitted if sends_on => wishes.max_depth.unwrap_or(USUAL_DEPTH),
            Integrator::Path if reflects => wishes.max_depth.unwrap_or(USUAL_PATH_DEPTH),
            Integrator::Whitted | Integrator::Path => 0,
        };
        // What ambient light stands for, paths find.
        let ambient = !is_path && scene.ambient != Vec3::ZERO && any(|m| m.ambient != Vec3::ZERO);
        let alpha = any(|m| m.alpha != Alpha::Opaque);
        let fog = scene.fog.filter(|fog| fog.absorption != Vec3::ZERO);
        let meshes = || {
            geometries.iter().filter_map(|g| match g {
                Geometry::Mesh(mesh) => Some(mesh),
                Geometry::Shapes { .. } => None,
            })
        };
        let attributes = Attributes {
            normals: (lit || depth > 0 || environment) && meshes().any(|m| !m.normals.is_empty()),
            uvs: (lit || ambient || alpha || any(|m| m.unlit || m.emission_texture.is_some() || m.physical.is_some()))
                && any(|m| m.textures().next().is_some()),
            colors: (lit || ambient || alpha || any(|m| m.unlit)) && meshes().any(|m| !m.colors.is_empty()),
        };
        Self {
            levels: if world.placements.is_empty() { Levels::One } else { Levels::Two },
            attributes,
            lighting,
            motion: world.moves(),
            ambient,
            integrator,
            why,
            depth,
            absorption: depth > 0 && any(|m| m.absorption.is_some()),
            alpha,
            normal_maps: (lit || depth > 0) && any(|m| m.normal_texture.is_some()),
            environment,
            fog,
            background: wishes.background.or(scene.background),
            primitives: world.primitive_count(),
            materials: materials.len(),
        }
    }

    /// Whether any shadow ray will be traced.
    pub fn shadows(&self) -> bool {
        matches!(&self.lighting, Lighting::Lights(lights) if !lights.is_empty())
    }
}

/// Every geometry that is placed at least once.
fn placed_geometries(scene: &Scene) -> Vec<&Geometry> {
    let groups: BTreeSet<u32> = scene.instances.iter().map(|instance| instance.group).collect();
    groups.into_iter().flat_map(|group| scene.group_geometries(group).map(|(_, geometry)| geometry)).collect()
}

fn gives_light(light: &Light) -> bool {
    match light {
        Light::Directional { color, .. } | Light::Point { color, .. } | Light::Spot { color, .. } => {
            *color != Vec3::ZERO
        }
        Light::Area { radiance, .. } => *radiance != Vec3::ZERO,
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let levels = match self.levels {
            Levels::One => "one level",
            Levels::Two => "two levels (instances)",
        };
        let lights = match &self.lighting {
            Lighting::None => "no light".to_owned(),
            Lighting::Lights(lights) if lights.is_empty() && self.integrator == Integrator::Path => {
                "light of what glows".to_owned()
            }
            Lighting::Lights(lights) if lights.is_empty() => "no light".to_owned(),
            Lighting::Headlight => "a headlight without shadows".to_owned(),
            Lighting::Lights(lights) if lights.len() == 1 => "1 light with shadows".to_owned(),
            Lighting::Lights(lights) => format!("{} lights with shadows", lights.len()),
        };
        write!(f, "{} ({}): {} primitives on {levels}, {lights}", self.integrator, self.why, self.primitives)?;
        let Attributes { normals, uvs, colors } = self.attributes;
        let parts = [
            (normals, "smooth normals"),
            (uvs, "textures"),
            (colors, "vertex colours"),
            (self.motion, "motion"),
            (self.ambient, "ambient light"),
            (self.environment, "an environment"),
            (self.absorption, "absorption"),
            (self.fog.is_some(), "fog"),
            (self.alpha, "alpha"),
            (self.normal_maps, "normal maps"),
        ];
        for (_, name) in parts.iter().filter(|(on, _)| *on) {
            write!(f, ", {name}")?;
        }
        if self.depth > 0 {
            match self.integrator {
                Integrator::RayCast | Integrator::Whitted => {
                    write!(f, ", mirrored and refracted rays to depth {}", self.depth)?;
                }
                Integrator::Path => write!(f, ", paths scattered up to {} times", self.depth)?,
            }
        }
        write!(f, ", {} {}", self.materials, if self.materials == 1 { "material" } else { "materials" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DVec3, Vec2};
    use crate::scene::Mesh;

    fn scene() -> Scene {
        let mesh = Mesh {
            uvs: vec![Vec2::ZERO; 3],
            normals: vec![Vec3::Z; 3],
            ..Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])
        };
        Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()])
    }

    fn plan(scene: &Scene) -> Plan {
        wished(scene, &Wishes::default())
    }

    fn wished(scene: &Scene, wishes: &Wishes) -> Plan {
        Plan::new(scene, &World::new(scene).unwrap(), wishes)
    }

    #[test]
    fn a_bare_scene_needs_a_headlight_and_no_shadow_rays() {
        let plan = plan(&scene());
        assert_eq!((plan.lighting.clone(), plan.shadows()), (Lighting::Headlight, false));
        assert_eq!(plan.attributes, Attributes { normals: true, uvs: false, colors: false });
        assert_eq!((plan.levels, plan.primitives, plan.background), (Levels::One, 1, None));
    }

    #[test]
    fn a_scene_that_is_meant_to_be_dark_has_no_headlight() {
        let dark = Scene { unlit: Unlit::Darkness, ..scene() };
        assert_eq!(plan(&dark).lighting, Lighting::Lights(Vec::new()));
        assert!(!plan(&dark).shadows() && plan(&dark).to_string().contains("no light"));
    }

    #[test]
    fn black_lights_and_unused_textures_cost_nothing() {
        let mut scene = scene();
        let light = |color| Light::Directional { direction: DVec3::NEG_Y, color };
        scene.lights = vec![light(Vec3::ZERO), light(Vec3::ONE)];
        scene.materials.push(Material { diffuse_texture: Some(0), ..Material::default() });
        let plan = plan(&scene);
        assert_eq!(plan.lighting, Lighting::Lights(vec![1]));
        assert!(plan.shadows() && !plan.attributes.uvs, "the textured material is not used");
        scene.lights.pop();
        assert!(!self::plan(&scene).shadows());
    }

    #[test]
    fn depth_is_for_mirrors_and_glass_that_are_there() {
        let mut scene = scene();
        scene.materials.push(Material { reflection: Vec3::ONE, ..Material::default() });
        assert_eq!(plan(&scene).depth, 0, "nothing is made of the mirror");
        let black = Material { diffuse: Vec3::ZERO, ..Material::default() };
        scene.materials[0] = Material { transmission: Vec3::X, ..black };
        let plan = plan(&scene);
        assert_eq!((plan.depth, plan.lighting), (5, Lighting::None));
        assert!(plan.attributes.normals, "they bend the ray");
    }

    #[test]
    fn the_cheapest_integrator_that_shows_everything_is_chosen() {
        let of = |scene: &Scene| plan(scene).integrator;
        let mut lit = scene();
        assert_eq!(of(&lit), Integrator::RayCast);
        lit.materials[0].reflection = Vec3::X;
        assert_eq!(of(&lit), Integrator::Whitted);
        // Darkness, and something that glows: nothing else lights the scene.
        let mut dark = scene();
        dark.lights = vec![Light::Directional { direction: DVec3::NEG_Y, color: Vec3::ZERO }];
        assert_eq!(of(&dark), Integrator::RayCast);
        dark.materials[0].emission = Vec3::ONE;
        assert_eq!((of(&dark), plan(&dark).depth), (Integrator::Path, USUAL_PATH_DEPTH));
        dark.ambient = Vec3::ONE;
        assert_eq!(of(&dark), Integrator::RayCast, "ambient light lights it too");
        dark.lights.clear();
        assert_eq!(plan(&dark).lighting, Lighting::Headlight);
        for integrator in Integrator::ALL {
            let wishes = Wishes { integrator: Some(integrator), max_depth: Some(7), ..Wishes::default() };
            let plan = wished(&lit, &wishes);
            assert_eq!(plan.integrator, integrator);
            assert_eq!(plan.depth, if integrator == Integrator::RayCast { 0 } else { 7 });
        }
        let wishes = Wishes { integrator: Some(Integrator::Path), ..Wishes::default() };
        let path = wished(&dark, &wishes);
        assert_eq!((path.lighting, path.ambient), (Lighting::Lights(vec![]), false), "what glows is light enough");
    }

    #[test]
    fn a_surface_that_only_glows_is_not_lit() {
        let mut scene = scene();
        scene.materials[0] = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        let plan = plan(&scene);
        assert_eq!((plan.lighting, plan.attributes), (Lighting::None, Attributes::default()));
    }
}
