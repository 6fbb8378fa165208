//! What this render needs, and nothing else.
//!
//! [`Plan::new`] takes a census of the scene and switches off what no pixel can show: shadow rays where no light casts
//! any, texture coordinates where no texture is used, shading normals where no mesh in view of a light has them, the
//! ambient term, lights that are black. The renderer reads the plan and never asks the scene again.

mod build;

use std::collections::BTreeSet;
use std::fmt;

pub use build::{BuildChoice, BuildRequest, EMBREE_BYTES, NotEnoughMemory};

use crate::math::Vec3;
use crate::scene::{Geometry, Light, Material, Scene, Unlit};
use crate::shade::Attributes;
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
    /// How often rays may be mirrored or refracted; 0 where no material does either.
    pub depth: u32,
    /// Linear RGB behind everything, which then is opaque; none leaves it transparent.
    pub background: Option<Vec3>,
    /// Primitives as placed.
    pub primitives: u64,
    /// Materials that something is made of.
    pub materials: usize,
}

impl Plan {
    /// The plan for a scene. `background` stands in for the scene's own, `max_depth` limits how often rays are sent on.
    pub fn new(scene: &Scene, world: &World, background: Option<Vec3>, max_depth: u32) -> Self {
        let geometries = placed_geometries(scene);
        let used: BTreeSet<u32> = geometries.iter().map(|g| g.material()).collect();
        let default = Material::default();
        let materials: Vec<_> = used.iter().map(|&m| scene.materials.get(m as usize).unwrap_or(&default)).collect();

        let reflects = materials.iter().any(|m| m.diffuse != Vec3::ZERO || m.specular != Vec3::ZERO);
        let lighting = match scene.unlit {
            _ if !reflects => Lighting::None,
            Unlit::Headlight if scene.lights.is_empty() => Lighting::Headlight,
            Unlit::Headlight | Unlit::Darkness => {
                Lighting::Lights((0..scene.lights.len()).filter(|&i| gives_light(&scene.lights[i])).collect())
            }
        };
        let lit = lighting != Lighting::None && lighting != Lighting::Lights(Vec::new());
        let sends_on = |m: &&Material| m.reflection != Vec3::ZERO || m.transmission != Vec3::ZERO;
        let depth = if materials.iter().any(sends_on) { max_depth } else { 0 };
        let ambient = scene.ambient != Vec3::ZERO && materials.iter().any(|m| m.ambient != Vec3::ZERO);
        let meshes = || {
            geometries.iter().filter_map(|g| match g {
                Geometry::Mesh(mesh) => Some(mesh),
                Geometry::Shapes { .. } => None,
            })
        };
        let attributes = Attributes {
            normals: (lit || depth > 0) && meshes().any(|m| !m.normals.is_empty()),
            uvs: (lit || ambient) && materials.iter().any(|m| m.diffuse_texture.is_some()),
            colors: (lit || ambient) && meshes().any(|m| !m.colors.is_empty()),
        };
        Self {
            levels: if world.placements.is_empty() { Levels::One } else { Levels::Two },
            attributes,
            lighting,
            motion: world.moves(),
            ambient,
            depth,
            background: background.or(scene.background),
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
            Lighting::Lights(lights) if lights.is_empty() => "no light".to_owned(),
            Lighting::Headlight => "a headlight without shadows".to_owned(),
            Lighting::Lights(lights) if lights.len() == 1 => "1 light with hard shadows".to_owned(),
            Lighting::Lights(lights) => format!("{} lights with hard shadows", lights.len()),
        };
        write!(f, "{} primitives on {levels}, {lights}", self.primitives)?;
        let Attributes { normals, uvs, colors } = self.attributes;
        let parts = [
            (normals, "smooth normals"),
            (uvs, "textures"),
            (colors, "vertex colours"),
            (self.motion, "motion"),
            (self.ambient, "ambient light"),
        ];
        for (_, name) in parts.iter().filter(|(on, _)| *on) {
            write!(f, ", {name}")?;
        }
        if self.depth > 0 {
            write!(f, ", mirrored and refracted rays to depth {}", self.depth)?;
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
        Plan::new(scene, &World::new(scene).unwrap(), None, 5)
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
    fn a_surface_that_only_glows_is_not_lit() {
        let mut scene = scene();
        scene.materials[0] = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        let plan = plan(&scene);
        assert_eq!((plan.lighting, plan.attributes), (Lighting::None, Attributes::default()));
    }
}
