//! What is in a scene, counted once: all that a plan follows from, but for what must be looked for in textures and
//! triangles.

use std::collections::BTreeMap;

use serde::Serialize;

use super::brightness;
use super::reach::reaches;
use crate::math::{DAabb, DAffine3, Vec3};
use crate::scene::{Alpha, Geometry, Light, Material, Scene};
use crate::trace::World;

/// Counts of what a scene holds. Serialises as a part of the document of `plan --json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Census {
    /// Primitives as placed, by kind.
    pub kinds: BTreeMap<&'static str, u64>,
    /// Primitives as stored: those of a group that is placed twice count once.
    pub stored: u64,
    /// Primitives as placed.
    pub placed: u64,
    /// Placements of groups.
    pub instances: u64,
    /// Placements that move.
    pub moving: u64,
    /// Of what is placed.
    pub meshes: Meshes,
    /// Of what is placed.
    pub materials: Materials,
    /// Light sources.
    pub lights: Lights,
    /// Whether light reaches every point from everywhere.
    pub ambient: bool,
    /// Whether light comes from all around.
    pub environment: bool,
    /// Whether fog fills the space between things.
    pub fog: bool,
    /// Ways on from a primitive by mirrors and glass, on average.
    pub ways: f64,
    /// The share of light that a primitive sends on, on average.
    pub albedo: f64,
    /// No ray that is sent on sees anything brighter than this, linear, at least 1; may be infinite.
    pub brightest: f32,
}

/// Meshes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Meshes {
    /// All of them.
    pub all: u64,
    /// With shading normals.
    pub normals: u64,
    /// With texture coordinates.
    pub uvs: u64,
    /// With colours of vertices.
    pub colors: u64,
}

/// Materials that something is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Materials {
    /// All of them.
    pub used: u64,
    /// Matte or with highlights.
    pub lit: u64,
    /// Mirrors and glass.
    pub sending_on: u64,
    /// That are not all there.
    pub alpha: u64,
    /// With any texture.
    pub textured: u64,
    /// With textures that bend normals.
    pub normal_mapped: u64,
    /// That give off light.
    pub glowing: u64,
    /// That show colours or textures without any light.
    pub shown_unlit: u64,
    /// That show colours without any light.
    pub unlit: u64,
    /// That send on ambient light.
    pub ambient: u64,
}

/// Light sources.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Lights {
    /// As the scene has them.
    pub given: u64,
    /// That give no light.
    pub black: u64,
    /// That give light, but to nothing in the scene.
    pub out_of_reach: u64,
    /// Those that are not black, by index.
    #[serde(skip)]
    pub bright: Vec<usize>,
    /// Those that reach something, by index.
    #[serde(skip)]
    pub reaching: Vec<usize>,
}

impl Census {
    /// Counts.
    pub fn new(scene: &Scene, world: &World) -> Self {
        let uses = scene.group_uses();
        let mut census = Self {
            instances: scene.instances.len() as u64,
            moving: scene.instances.iter().filter(|instance| instance.moves()).count() as u64,
            lights: Lights::new(scene, world),
            ambient: scene.ambient != Vec3::ZERO,
            environment: scene.environment.as_ref().is_some_and(|light| !light.is_black()),
            fog: scene.fog.is_some_and(|fog| fog.absorption != Vec3::ZERO),
            ..Self::default()
        };
        // How many primitives are made of each material.
        let mut made_of = BTreeMap::<u32, u64>::new();
        for (group, uses) in (0..).zip(uses).filter(|(_, uses)| *uses > 0) {
            let uses = u64::from(uses);
            for (_, geometry) in scene.group_geometries(group) {
                census.add(geometry, uses);
                *made_of.entry(geometry.material()).or_default() += uses * geometry.primitive_count() as u64;
            }
        }
        let default = Material::default();
        for (material, primitives) in made_of {
            let material = scene.materials.get(material as usize).unwrap_or(&default);
            census.materials.add(material);
            let share = primitives as f64 / census.placed.max(1) as f64;
            census.ways += share * ways(material);
            census.albedo += share * f64::from(albedo(material));
        }
        // Asked for only where rays go on: it may look at all of an environment, or of the world's bounds.
        census.brightest = if census.materials.sending_on > 0 { brightness::bound(scene, world) } else { 1.0 };
        census
    }

    fn add(&mut self, geometry: &Geometry, uses: u64) {
        let count = geometry.primitive_count() as u64;
        self.stored += count;
        self.placed += count * uses;
        match geometry {
            Geometry::Mesh(mesh) => {
                *self.kinds.entry("triangle").or_default() += count * uses;
                self.meshes.all += 1;
                self.meshes.normals += u64::from(!mesh.normals.is_empty());
                self.meshes.uvs += u64::from(!mesh.uvs.is_empty());
                self.meshes.colors += u64::from(!mesh.colors.is_empty());
            }
            Geometry::Shapes { shapes, .. } => {
                shapes.iter().for_each(|shape| *self.kinds.entry(shape.name()).or_default() += uses);
            }
        }
    }
}

/// Rays that a hit sends on.
fn ways(material: &Material) -> f64 {
    let sent = [material.reflection, material.transmission].into_iter().filter(|share| *share != Vec3::ZERO).count();
    if material.sends_on() { sent as f64 } else { 0.0 }
}

/// The largest share of light that it sends on in any channel.
fn albedo(material: &Material) -> f32 {
    if material.unlit {
        return 0.0;
    }
    let sum = material.diffuse + material.specular + material.reflection.max(material.transmission);
    sum.max_element().clamp(0.0, 1.0)
}

impl Materials {
    fn add(&mut self, m: &Material) {
        let textured = m.textures().next().is_some();
        for (count, holds) in [
            (&mut self.used, true),
            (&mut self.lit, m.is_lit()),
            (&mut self.sending_on, m.sends_on()),
            (&mut self.alpha, m.alpha != Alpha::Opaque),
            (&mut self.textured, textured),
            (&mut self.normal_mapped, m.normal_texture.is_some()),
            (&mut self.glowing, m.emission != Vec3::ZERO),
            (&mut self.shown_unlit, m.unlit || m.emission_texture.is_some() || m.physical.is_some()),
            (&mut self.unlit, m.unlit),
            (&mut self.ambient, m.ambient != Vec3::ZERO),
        ] {
            *count += u64::from(holds);
        }
    }
}

impl Lights {
    fn new(scene: &Scene, world: &World) -> Self {
        let bright: Vec<usize> = (0..scene.lights.len()).filter(|&i| gives_light(&scene.lights[i])).collect();
        let has_an_end = |light: &Light| match light {
            Light::Directional { .. } => false,
            Light::Point { range, .. } => range.is_finite(),
            Light::Spot { .. } | Light::Area { .. } => true,
        };
        // A plane is everywhere. Bounds take a look at every triangle.
        let may_miss = !world.is_unbounded() && bright.iter().any(|&i| has_an_end(&scene.lights[i]));
        let bounds = may_miss.then(|| {
            let bounds = world.bounds();
            DAabb { min: bounds.min.as_dvec3(), max: bounds.max.as_dvec3() }
        });
        let to_world = DAffine3::from_translation(-world.centre);
        let reaching = bright.iter().copied().filter(|&i| {
            let mut light = scene.lights[i].clone();
            light.transform(&to_world);
            bounds.is_none_or(|bounds| reaches(&light, &bounds))
        });
        let reaching: Vec<usize> = reaching.collect();
        Self {
            given: scene.lights.len() as u64,
            black: (scene.lights.len() - bright.len()) as u64,
            out_of_reach: (bright.len() - reaching.len()) as u64,
            bright,
            reaching,
        }
    }
}

fn gives_light(light: &Light) -> bool {
    match light {
        Light::Directional { color, .. } | Light::Point { color, .. } | Light::Spot { color, .. } => {
            *color != Vec3::ZERO
        }
        Light::Area { radiance, .. } => *radiance != Vec3::ZERO,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;
    use crate::scene::{Attenuation, Group, Instance, Mesh};
    use crate::shape::{Shape, Sphere};

    #[test]
    fn counts_what_is_placed_as_often_as_it_is() {
        let mesh = Mesh { normals: vec![Vec3::Z; 3], ..Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]) };
        let ball = Shape::Sphere(Sphere { centre: Vec3::ZERO, radius: 1.0 });
        let shapes = Geometry::Shapes { shapes: vec![ball.clone(), ball], material: 1 };
        let glass = Material::glass(1.5);
        let mut scene = Scene::from_geometries(vec![Geometry::Mesh(mesh), shapes], vec![Material::default(), glass]);
        let twice = Instance { transform: DAffine3::from_translation(DVec3::X), ..scene.instances[0].clone() };
        scene.instances.push(twice);
        scene.geometries.push(scene.geometries[0].clone());
        scene.groups.push(Group { name: String::new(), geometries: 2..3 });
        let near = |range| {
            let (color, attenuation) = (Vec3::ONE, Attenuation::NONE);
            Light::Point { position: DVec3::X * 50.0, color, attenuation, range, radius: 0.0 }
        };
        scene.lights = vec![near(10.0), near(60.0), Light::Directional { direction: DVec3::X, color: Vec3::ZERO }];
        let census = Census::new(&scene, &World::new(&scene).expect("sound"));
        assert_eq!(census.kinds, BTreeMap::from([("triangle", 2), ("sphere", 4)]));
        assert_eq!((census.stored, census.placed, census.instances, census.moving), (3, 6, 2, 0));
        assert_eq!(
            census.meshes,
            Meshes { all: 1, normals: 1, uvs: 0, colors: 0 },
            "what is not placed does not count"
        );
        let materials = Materials { used: 2, lit: 1, sending_on: 1, ambient: 1, ..Materials::default() };
        assert_eq!(census.materials, materials);
        let Lights { given, black, out_of_reach, reaching, bright } = census.lights;
        assert_eq!((given, black, out_of_reach, reaching, bright), (3, 1, 1, vec![1], vec![0, 1]));
        // Four of six primitives are glass, which sends on two ways.
        assert!((census.ways - 8.0 / 6.0).abs() < 1e-12 && (census.albedo - (0.8 * 2.0 + 4.0) / 6.0).abs() < 1e-6);
    }
}
