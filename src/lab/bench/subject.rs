//! What is measured: a scene from a file, on a floor, or one made by rule.

use std::path::Path;

use super::rays::View;
use crate::error::{Error, Result, Warning, system_message};
use crate::io::{self, LoadOptions, UpAxis};
use crate::math::DAffine3;
use crate::scene::{self, Camera, Geometry, Group, Instance, Material, Mesh, Scene, choose_origin};
use crate::trace::World;

/// Triangles of the largest terrain: 2 n^2 at this n are 800 million.
const MAX_TERRAIN: u32 = 20_000;
/// Storeys of the largest building: 414 million triangles.
const MAX_BUILDING: u32 = 100_000;
/// Storeys where none are given: 198,720 triangles.
const STOREYS: u32 = 48;
/// Most placements: a placement takes 300 bytes or so, whatever is placed.
const MAX_INSTANCES: u32 = 10_000_000;
/// Placements where no number is given: 20.5 million triangles as placed.
const INSTANCES: u32 = 2500;

/// A scene ready to be traced, and where it is looked at from.
pub struct Subject {
    /// As it was asked for.
    pub name: String,
    /// The scene, floor and all.
    pub scene: Scene,
    /// The same as engines take it.
    pub world: World,
    /// What is looked at, and from where.
    pub view: View,
    /// The same for a renderer.
    pub camera: Camera,
}

/// A scene that no file holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Procedural {
    Terrain(u32),
    Architecture(u32),
    Instances(u32),
}

impl Procedural {
    /// By its name: `terrain1000`, `architecture`, `architecture500`, `instances`, `instances100`. None for any other
    /// name.
    ///
    /// # Errors
    /// [`Error::Input`] for a number that is missing or out of range.
    fn parse(name: &str) -> Result<Option<Self>> {
        let letters = name.trim_end_matches(|c: char| c.is_ascii_digit());
        let digits = &name[letters.len()..];
        let (rule, otherwise, largest): (fn(u32) -> Self, _, _) = match letters {
            "terrain" => (Self::Terrain, None, MAX_TERRAIN),
            "architecture" => (Self::Architecture, Some(STOREYS), MAX_BUILDING),
            "instances" => (Self::Instances, Some(INSTANCES), MAX_INSTANCES),
            _ => return Ok(None),
        };
        let number = if digits.is_empty() { otherwise } else { digits.parse().ok() };
        let odd = || Error::input(name, "", format!("must be {letters}N with N from 1 to {largest}"));
        number.filter(|n| (1..=largest).contains(n)).map(rule).map(Some).ok_or_else(odd)
    }

    fn scene(self) -> Scene {
        let of_mesh = |mesh| Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]);
        match self {
            Self::Terrain(n) => of_mesh(scene::terrain(n)),
            Self::Architecture(n) => of_mesh(scene::architecture(n)),
            Self::Instances(n) => scene::rocks(n),
        }
    }
}

impl Subject {
    /// Whether there may be a scene of this name: one that is made by rule, or a file that is there.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn check(name: &str) -> Result<()> {
        if Procedural::parse(name)?.is_none() {
            std::fs::metadata(name).map_err(|error| Error::input(name, "", system_message(&error)))?;
        }
        Ok(())
    }

    /// The scene called `name`: `terrainN` (2 N^2 triangles), `architecture` or `architectureN` (N storeys),
    /// `instances` or `instancesN` (N placements of one mesh), or a file. All but terrains stand on a floor, two
    /// triangles at the bottom of their bounds.
    ///
    /// `up` says which axis of a *file* points up; nothing is turned, the camera stands accordingly.
    ///
    /// # Errors
    /// [`Error::Input`] for a number out of range, for a file that cannot be used or has nothing to look at, and those
    /// of [`World::new`].
    pub fn new(name: &str, up: UpAxis) -> Result<(Self, Vec<Warning>)> {
        let (mut scene, warnings, up, is_terrain) = match Procedural::parse(name)? {
            Some(rule) => (rule.scene(), Vec::new(), UpAxis::Y, matches!(rule, Procedural::Terrain(_))),
            None => {
                let (scene, warnings) = io::load(Path::new(name), &LoadOptions::default())?;
                (scene, warnings, up, false)
            }
        };
        let bounds = scene.bounds();
        if bounds.radius() == 0.0 {
            return Err(Error::input(name, "", "has nothing to look at: no triangle with an area"));
        }
        if !is_terrain {
            let origin = choose_origin(&bounds);
            let floor = Mesh::new(View::new(&bounds, origin, up, false).floor().to_vec(), vec![[0, 1, 2], [1, 3, 2]]);
            add_mesh(&mut scene, Mesh { name: "floor".to_owned(), origin, ..floor });
        }
        let world = World::new(&scene)?;
        let view = View::new(&bounds, world.centre, up, is_terrain);
        let odd = || Error::input(name, "", "is too small or too large to be looked at");
        let camera = view.camera(world.centre).ok_or_else(odd)?;
        Ok((Self { name: name.to_owned(), scene, world, view, camera }, warnings))
    }
}

/// Adds a mesh in a group of its own, placed once.
fn add_mesh(scene: &mut Scene, mesh: Mesh) {
    let geometry = scene.geometries.len() as u32;
    scene.geometries.push(Geometry::Mesh(Mesh { material: scene.materials.len() as u32, ..mesh }));
    scene.materials.push(Material::default());
    let name = String::new();
    scene.groups.push(Group { name: name.clone(), geometries: geometry..geometry + 1 });
    let group = scene.groups.len() as u32 - 1;
    scene.instances.push(Instance { name, group, transform: DAffine3::IDENTITY, transform_end: None });
}
