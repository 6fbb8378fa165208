//! A scene as its file describes it: plain data, no accelerator, nothing left to parse.
//!
//! Coordinates are right-handed, +y up, metres. Positions keep f64 precision: a [`Mesh`] holds f32 offsets from an f64
//! origin, transforms are f64. What the tracers see is made of it by [`World`](crate::World).

mod bounds;
mod camera;
pub(crate) mod check;
#[doc(hidden)]
pub mod compact;
mod environment;
mod fog;
mod instance;
mod light;
mod material;
mod mesh;
mod physical;
mod pose;
mod procedural;
mod recipes;
mod request;
mod rocks;
mod search;
mod texture;

pub use camera::{Camera, DEFAULT_FOV, Distortion, Fov, Projection, ThinLens};
#[doc(hidden)]
pub use check::fault;
pub use environment::Environment;
pub use fog::Fog;
pub use instance::{Group, Instance};
pub use light::{AreaShape, Attenuation, DefaultLighting, Light};
pub use material::{Absorption, Alpha, Interface, Material, Specular};
pub use mesh::Mesh;
#[doc(hidden)]
pub use mesh::{bounds_of, choose_origin, is_traceable_f64};
pub use physical::{MetallicRoughness, Physical, PhysicalTextures, SpecularGlossiness, Texels, Workflow};
pub use pose::{Pose, PoseInterpolation};
pub use procedural::{architecture, terrain};
pub use recipes::{RECIPES, Recipe};
pub use request::{Integrator, MAX_DEPTH, MAX_SIDE, MAX_SPP, Request};
pub use rocks::rocks;
pub use search::{Accel, AcceleratorRequest, Resolution};
pub use texture::{Filter, Pixels, Texture, Wrap};

use std::path::PathBuf;

use crate::math::{DAabb, DAffine3, DMat3, DVec3, Vec3};
use crate::shape::Shape;

/// Everything one file describes.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Meshes and lists of shapes; [`Hit::geometry`](crate::Hit) indexes this.
    pub geometries: Vec<Geometry>,
    /// Sets of geometries that are placed together.
    pub groups: Vec<Group>,
    /// Placements of groups; [`Hit::instance`](crate::Hit) indexes this.
    pub instances: Vec<Instance>,
    /// What geometries are made of.
    pub materials: Vec<Material>,
    /// Images that materials refer to.
    pub textures: Vec<Texture>,
    /// Light sources.
    pub lights: Vec<Light>,
    /// What the scene is lit by where it has no light sources.
    pub default_lighting: DefaultLighting,
    /// Viewpoints; where there are none, the view is framed on the bounds.
    pub cameras: Vec<Camera>,
    /// Light that reaches every point from everywhere, linear RGB.
    pub ambient: Vec3,
    /// Light from infinitely far, all around.
    pub environment: Option<Environment>,
    /// What fills the space between things.
    pub fog: Option<Fog>,
    /// What a ray that hits nothing sees, linear RGB; before an environment, camera rays alone; none where the picture
    /// is to be transparent.
    pub background: Option<Vec3>,
    /// What the file wants of a render.
    pub request: Request,
    /// The files that it was read from: the one that was loaded, and those that are named there and were found.
    pub files: Vec<PathBuf>,
}

/// Something rays can hit: triangles, or shapes of any other kind.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// Triangles.
    Mesh(Mesh),
    /// Shapes that are not meshes, all of one material.
    Shapes {
        /// The shapes, in the group's coordinates.
        shapes: Vec<Shape>,
        /// Index into [`Scene::materials`].
        material: u32,
    },
}

impl Geometry {
    /// How many primitives it has: triangles or shapes.
    pub fn primitive_count(&self) -> usize {
        match self {
            Self::Mesh(mesh) => mesh.triangles.len(),
            Self::Shapes { shapes, .. } => shapes.len(),
        }
    }

    /// Index of its material in [`Scene::materials`].
    pub fn material(&self) -> u32 {
        match self {
            Self::Mesh(mesh) => mesh.material,
            Self::Shapes { material, .. } => *material,
        }
    }

    /// Whether there is anything that a ray can hit: a triangle with an area, or a shape.
    #[doc(hidden)]
    pub fn has_area(&self) -> bool {
        match self {
            Self::Mesh(mesh) => mesh.has_area(),
            Self::Shapes { shapes, .. } => !shapes.is_empty(),
        }
    }

    /// The bounds of its traceable vertices under `transform`, exact up to f64 rounding for meshes.
    pub fn bounds(&self, transform: &DAffine3) -> DAabb {
        match self {
            Self::Mesh(mesh) => mesh.bounds(transform),
            Self::Shapes { shapes, .. } => shapes.iter().fold(DAabb::EMPTY, |all, shape| {
                let b = shape.bounds();
                if b.is_empty() {
                    return all;
                }
                let corners = b.corners().map(|corner| transform.transform_point3(corner.as_dvec3()));
                corners.into_iter().fold(all, DAabb::include)
            }),
        }
    }
}

impl Scene {
    /// A scene that shows `geometries` once each, as they are, with the given materials.
    pub fn from_geometries(geometries: Vec<Geometry>, materials: Vec<Material>) -> Self {
        let group = Group { name: String::new(), geometries: 0..geometries.len() as u32 };
        Self {
            geometries,
            groups: vec![group],
            instances: vec![Instance {
                name: String::new(),
                group: 0,
                transform: DAffine3::IDENTITY,
                transform_end: None,
            }],
            materials,
            ..Self::default()
        }
    }

    /// How often each group is placed.
    ///
    /// # Panics
    /// Where an instance places a group that does not exist.
    pub fn group_uses(&self) -> Vec<u32> {
        let mut uses = vec![0; self.groups.len()];
        self.instances.iter().for_each(|instance| uses[instance.group as usize] += 1);
        uses
    }

    /// The geometries of one group, with their indices.
    pub fn group_geometries(&self, group: u32) -> impl Iterator<Item = (u32, &Geometry)> {
        self.groups[group as usize].geometries.clone().map(|g| (g, &self.geometries[g as usize]))
    }

    /// Primitives as placed: those of a group that is placed twice count twice.
    pub fn primitive_count(&self) -> u64 {
        self.instances
            .iter()
            .flat_map(|instance| self.group_geometries(instance.group))
            .map(|(_, geometry)| geometry.primitive_count() as u64)
            .sum()
    }

    /// Moves the whole scene: instances, lights and cameras. Scales lengths, not intensities. The environment stays as
    /// it is: up in its picture is up, +y, whatever was up in the file.
    pub fn transform(&mut self, transform: &DAffine3) {
        for instance in &mut self.instances {
            instance.transform = *transform * instance.transform;
            instance.transform_end = instance.transform_end.map(|end| *transform * end);
        }
        for light in &mut self.lights {
            light.transform(transform);
        }
        let scale = transform.matrix3.determinant().abs().cbrt() as f32;
        for absorption in self.materials.iter_mut().filter_map(|material| material.absorption.as_mut()) {
            absorption.distance *= scale;
        }
        self.fog.iter_mut().for_each(|fog| fog.scale(scale));
        for camera in &mut self.cameras {
            camera.transform(transform);
        }
    }

    /// Gives meshes that are placed once, by a turn that only exchanges axes, the coordinates of the scene, so that
    /// tracing needs no turned copy of them. Such a turn rounds nothing.
    #[doc(hidden)]
    pub fn bake_turns(&mut self) {
        let uses = self.group_uses();
        for instance in self.instances.iter_mut().filter(|instance| uses[instance.group as usize] == 1) {
            let turn = instance.transform.matrix3;
            let entries = turn.to_cols_array();
            // One entry of a row and of a column is 1 or -1, the others 0.
            let exchanges =
                entries.iter().all(|x| [-1.0, 0.0, 1.0].contains(x)) && turn * turn.transpose() == DMat3::IDENTITY;
            let turns = exchanges && turn.determinant() > 0.0 && turn != DMat3::IDENTITY;
            let range = &self.groups[instance.group as usize].geometries;
            let geometries = &mut self.geometries[range.start as usize..range.end as usize];
            let only_meshes = geometries.iter().all(|geometry| matches!(geometry, Geometry::Mesh(_)));
            if !(turns && only_meshes && !instance.moves() && instance.transform.translation == DVec3::ZERO) {
                continue;
            }
            for geometry in geometries {
                if let Geometry::Mesh(mesh) = geometry {
                    mesh.turn(&turn);
                }
            }
            instance.transform = DAffine3::IDENTITY;
        }
    }
}
