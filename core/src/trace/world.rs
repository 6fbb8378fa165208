//! The scene as the tracers hold it: recentred, f32, one or two levels.
//!
//! A [`Scene`] keeps f64 positions; tracers work in f32. So everything is moved by [`World::centre`] first, which keeps
//! the shape of a mesh that lies far from zero. Groups that are placed once are baked into world coordinates and traced
//! as one level; groups that are placed several times, that move, or whose shapes are scaled are kept once, with a
//! transform for each placement. Baking all of them would make one level of every scene, and a million instances would
//! cost a million meshes.
//!
//! What stands here in f32 is *the* scene: exactness is judged against it, and an instanced triangle's corners are
//! `to_world` times its f32 positions, in exact arithmetic.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::limits;
use super::motion::{Motion, singular_on_the_way};
use crate::error::{Error, Result};
use crate::math::{Aabb, Affine3, DAabb, DAffine3, DMat3, DVec3, Vec3, is_traceable, placement_fault};
use crate::ray::{Hit, Ray};
use crate::scene::{Geometry, Instance, Mesh, Scene, check, choose_origin};
use crate::shape::Shape;

/// A scene made ready for tracing.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// What was subtracted from every scene coordinate.
    pub centre: DVec3,
    /// Every geometry that is traced: first the fixed ones, then those of the objects.
    pub parts: Vec<Part>,
    /// The parts in world coordinates.
    pub fixed: Range<usize>,
    /// Parts (in their own coordinates) that are placed by transforms.
    pub objects: Vec<Range<usize>>,
    /// Where the objects stand, by rising scene instance.
    pub placements: Vec<Placement>,
    lookup: Vec<Lookup>,
}

/// One geometry, as traced.
#[derive(Clone, Debug)]
pub struct Part {
    /// Index into [`Scene::geometries`].
    pub geometry: u32,
    /// Index into [`Scene::instances`] for a fixed part; for a part of an object the placement tells.
    pub instance: u32,
    /// What can be hit.
    pub primitives: Primitives,
}

/// The primitives of a part.
#[derive(Clone, Debug)]
pub enum Primitives {
    /// A triangle mesh; shared with the scene where nothing had to be moved.
    Triangles {
        /// Corners; may be NaN or infinite, such triangles cannot be hit.
        positions: Arc<Vec<Vec3>>,
        /// Indices of each triangle's corners, all below `positions.len()`.
        triangles: Arc<Vec<[u32; 3]>>,
    },
    /// Anything else.
    Shapes(Arc<Vec<Shape>>),
}

/// An object in its place.
#[derive(Clone, Debug)]
pub struct Placement {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Index into [`World::objects`].
    pub object: u32,
    /// From the object's coordinates to the world's; invertible. Of what moves, at time 0.
    pub to_world: Affine3,
    /// Its inverse in f64.
    pub to_object: DAffine3,
    /// Where it moves to; none for what stands still. [`Placement::at`] tells where it is.
    pub motion: Option<Box<Motion>>,
}

/// Where the parts of a scene instance are.
#[derive(Clone, Copy, Debug)]
struct Lookup {
    first_part: usize,
    first_geometry: u32,
    placement: Option<u32>,
}

impl World {
    /// The part and the placement that a hit names.
    ///
    /// # Panics
    /// For a hit of another world, or one that names nothing.
    pub fn locate(&self, hit: &Hit) -> (&Part, Option<&Placement>) {
        let lookup = self.lookup[hit.instance as usize];
        let part = &self.parts[lookup.first_part + (hit.geometry - lookup.first_geometry) as usize];
        (part, lookup.placement.map(|p| &self.placements[p as usize]))
    }

    /// Whether it has been made of this scene, as far as that can be told without looking at each primitive.
    pub fn is_of(&self, scene: &Scene) -> bool {
        let group = |instance: &Instance| scene.groups.get(instance.group as usize);
        let begins = |instance: &Instance| group(instance).map(|group| group.geometries.start);
        let same = |(lookup, instance): (&Lookup, &Instance)| begins(instance) == Some(lookup.first_geometry);
        self.lookup.len() == scene.instances.len() && self.lookup.iter().zip(&scene.instances).all(same)
    }

    /// Triangles as stored: those of an object that is placed twice count once.
    pub fn stored_triangles(&self) -> u64 {
        self.parts.iter().map(|part| part.primitives.triangle_count()).sum()
    }

    /// Primitives as stored.
    pub fn stored_primitives(&self) -> u64 {
        self.parts.iter().map(|part| part.primitives.len() as u64).sum()
    }

    /// Whether anything in it has no end, as planes have none.
    pub fn is_unbounded(&self) -> bool {
        self.parts.iter().any(|part| match &part.primitives {
            Primitives::Triangles { .. } => false,
            Primitives::Shapes(shapes) => shapes.iter().any(Shape::is_unbounded),
        })
    }
}

impl World {
    /// A ray over [0, infinity] as tracers of this world take it: they know the scene recentred by [`World::centre`].
    /// `origin` is in the scene's coordinates.
    pub fn ray(&self, origin: DVec3, direction: Vec3) -> Ray {
        Ray::new(self.to_world(origin), direction)
    }

    /// A point of the scene as tracers of this world take it.
    pub fn to_world(&self, point: DVec3) -> Vec3 {
        (point - self.centre).as_vec3()
    }

    /// Where a point of a ray, or [of what it meets](crate::shade::SurfacePoint), is in the scene's coordinates.
    pub fn to_scene(&self, point: DVec3) -> DVec3 {
        self.centre + point
    }
}

impl World {
    /// Recentres `scene` and decides what is baked.
    ///
    /// # Errors
    /// [`Error::Scene`], or [`Error::Input`] where the scene was read from a file, for a group or a geometry that is
    /// not there; for an instance whose transform is singular or not finite, with its name; and for more primitives in
    /// one place than tracers can name.
    ///
    /// # Panics
    /// Where a mesh names a vertex that is not there, here or when a tracer is built; [`Scene::check`] finds those.
    pub fn new(scene: &Scene) -> Result<Self> {
        Self::with(scene, true).map_err(|error| error.told_of(scene.files.first()))
    }

    /// The same with everything placed by transforms: two levels, whether they are needed or not.
    ///
    /// # Errors
    /// Those of [`World::new`].
    ///
    /// # Panics
    /// As [`World::new`] does.
    pub fn placed(scene: &Scene) -> Result<Self> {
        Self::with(scene, false).map_err(|error| error.told_of(scene.files.first()))
    }

    fn with(scene: &Scene, bakes: bool) -> Result<Self> {
        check::references(scene).map_err(Error::Scene)?;
        scene.instances.iter().enumerate().try_for_each(|(i, instance)| check_transform(i, instance))?;
        let uses = scene.group_uses();
        let is_baked = |instance: &Instance| {
            let is_mesh = |(_, geometry): (u32, &Geometry)| matches!(geometry, Geometry::Mesh(_));
            let only_meshes = scene.group_geometries(instance.group).all(is_mesh);
            // A scaled sphere is no sphere, so shapes are baked only where they merely move.
            bakes
                && !instance.moves()
                && uses[instance.group as usize] == 1
                && (only_meshes || instance.transform.matrix3 == DMat3::IDENTITY)
        };
        let (baked, placed): (Vec<_>, Vec<_>) =
            scene.instances.iter().enumerate().partition(|(_, instance)| is_baked(instance));

        let mut world = Self { centre: choose_centre(scene), ..Self::default() };
        let to_world = DAffine3::from_translation(-world.centre);
        let nowhere = Lookup { first_part: 0, first_geometry: 0, placement: None };
        world.lookup = vec![nowhere; scene.instances.len()];
        for (i, instance) in baked {
            let transform = to_world * instance.transform;
            world.lookup[i] = world.add_group(scene, instance.group, i as u32, &transform);
        }
        world.fixed = 0..world.parts.len();
        limits::check(&world.parts, "the scene, without what is placed by transforms,")?;

        let mut added: Vec<Option<(u32, Lookup, DVec3)>> = vec![None; scene.groups.len()];
        for (i, instance) in placed {
            let group = instance.group;
            let (object, lookup, origin) = *added[group as usize].get_or_insert_with(|| {
                let origin = group_origin(scene, group);
                let lookup = world.add_group(scene, group, i as u32, &DAffine3::from_translation(-origin));
                world.objects.push(lookup.first_part..world.parts.len());
                (world.objects.len() as u32 - 1, lookup, origin)
            });
            let rounded =
                |transform: &DAffine3| (to_world * *transform * DAffine3::from_translation(origin)).as_affine3();
            let start = rounded(&instance.transform);
            // The inverse of what is traced, not of what was asked for: the two differ by f32 rounding.
            let to_object = start.as_daffine3().inverse();
            world.lookup[i] = Lookup { placement: Some(world.placements.len() as u32), ..lookup };
            let motion = match &instance.transform_end {
                None => None,
                Some(end) => {
                    let motion = Motion::new(&start, rounded(end));
                    Some(Box::new(motion.map_err(|time| singular_on_the_way(i, &instance.name, time))?))
                }
            };
            world.placements.push(Placement { instance: i as u32, object, to_world: start, to_object, motion });
        }
        for object in &world.objects {
            limits::check(&world.parts[object.clone()], "an object that is placed by transforms")?;
        }
        Ok(world)
    }

    /// The bounds of everything fixed, and of every object where it stands; exact for meshes.
    pub fn bounds(&self) -> Aabb {
        let of =
            |parts: &Range<usize>| self.parts[parts.clone()].iter().map(Part::bounds).fold(Aabb::EMPTY, Aabb::union);
        // Once for each object, however often it is placed.
        let objects: Vec<Aabb> = self.objects.iter().map(of).collect();
        self.placements
            .iter()
            .fold(of(&self.fixed), |all, placement| all.union(placement.bounds(objects[placement.object as usize])))
    }

    /// Whether something moves.
    pub fn moves(&self) -> bool {
        self.placements.iter().any(|placement| placement.motion.is_some())
    }

    /// Primitives as placed: those of an object that is placed twice count twice.
    pub fn primitive_count(&self) -> u64 {
        self.placed_count(|primitives| primitives.len() as u64)
    }

    /// Triangles of meshes as placed.
    pub fn placed_triangles(&self) -> u64 {
        self.placed_count(Primitives::triangle_count)
    }

    /// What `count` says of the primitives of all parts, as often as each is placed.
    fn placed_count(&self, count: impl Fn(&Primitives) -> u64) -> u64 {
        let count =
            |parts: &Range<usize>| -> u64 { self.parts[parts.clone()].iter().map(|p| count(&p.primitives)).sum() };
        // Once for each object, however often it is placed.
        let objects: Vec<u64> = self.objects.iter().map(count).collect();
        count(&self.fixed) + self.placements.iter().map(|placement| objects[placement.object as usize]).sum::<u64>()
    }

    fn add_group(&mut self, scene: &Scene, group: u32, instance: u32, transform: &DAffine3) -> Lookup {
        let lookup = Lookup {
            first_part: self.parts.len(),
            first_geometry: scene.groups[group as usize].geometries.start,
            placement: None,
        };
        for (geometry, description) in scene.group_geometries(group) {
            let primitives = match description {
                Geometry::Mesh(mesh) => Primitives::Triangles {
                    positions: transformed(mesh, transform),
                    triangles: Arc::clone(&mesh.triangles),
                },
                Geometry::Shapes { shapes, .. } => {
                    let moved = shapes.iter().map(|shape| shape.translated(transform.translation));
                    Primitives::Shapes(Arc::new(moved.collect()))
                }
            };
            self.parts.push(Part { geometry, instance, primitives });
        }
        lookup
    }
}

impl Part {
    /// The box around the part's traceable primitives, in the part's own coordinates.
    pub fn bounds(&self) -> Aabb {
        match &self.primitives {
            Primitives::Triangles { positions, triangles } => {
                let corners = |corners: &[u32; 3]| corners.map(|i| positions[i as usize]);
                let bounds = triangles.par_chunks(1 << 14).map(|part| {
                    let traceable = part.iter().map(corners).filter(|corners| corners.iter().all(|&p| is_traceable(p)));
                    Aabb::around(traceable.flatten())
                });
                bounds.reduce(|| Aabb::EMPTY, Aabb::union)
            }
            Primitives::Shapes(shapes) => shapes.iter().map(Shape::bounds).fold(Aabb::EMPTY, Aabb::union),
        }
    }
}

impl Primitives {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Triangles { triangles, .. } => triangles.len(),
            Self::Shapes(shapes) => shapes.len(),
        }
    }

    /// How many of them are triangles of a mesh.
    fn triangle_count(&self) -> u64 {
        match self {
            Self::Triangles { triangles, .. } => triangles.len() as u64,
            Self::Shapes(_) => 0,
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Placement {
    /// `ray` in the object's coordinates, at the same t: the direction is not normalised again. Off by the rounding of
    /// each component to f32, so it serves to find boxes and shapes; triangles are tested in the world.
    pub fn object_ray(&self, ray: &Ray) -> Ray {
        object_ray(&self.to_object, ray)
    }
}

/// The same, by the transform.
pub(super) fn object_ray(to_object: &DAffine3, ray: &Ray) -> Ray {
    Ray {
        origin: to_object.transform_point3(ray.origin.as_dvec3()).as_vec3(),
        direction: to_object.transform_vector3(ray.direction.as_dvec3()).as_vec3(),
        ..*ray
    }
}

/// The mesh's positions under `transform`, rounded once; shared where nothing moves.
fn transformed(mesh: &Mesh, transform: &DAffine3) -> Arc<Vec<Vec3>> {
    // First, so that the mesh's own origin and the world's centre cancel before anything is rounded to f32.
    let origin = transform.transform_point3(mesh.origin);
    if transform.matrix3 == DMat3::IDENTITY && origin == DVec3::ZERO {
        return Arc::clone(&mesh.positions);
    }
    let place = |p: &Vec3| (transform.matrix3 * p.as_dvec3() + origin).as_vec3();
    Arc::new(mesh.positions.par_iter().with_min_len(1 << 14).map(place).collect())
}

/// Where zero of the world is put: at zero of the scene while f32 keeps the scene's shape there; else at the origin of
/// the largest mesh, which then need not be copied; else in the middle of the bounds.
fn choose_centre(scene: &Scene) -> DVec3 {
    let bounds = scene.bounds();
    if choose_origin(&bounds) == DVec3::ZERO {
        return DVec3::ZERO;
    }
    let meshes = scene.instances.iter().flat_map(|instance| {
        scene.group_geometries(instance.group).filter_map(|(_, geometry)| match geometry {
            Geometry::Mesh(mesh) => Some((mesh.triangles.len(), instance.transform.transform_point3(mesh.origin))),
            Geometry::Shapes { .. } => None,
        })
    });
    let largest = meshes.max_by_key(|(triangles, _)| *triangles).map(|(_, origin)| origin);
    largest.filter(|o| (*o - bounds.centre()).length() <= 8.0 * bounds.radius()).unwrap_or_else(|| bounds.centre())
}

/// The origin of an object's own coordinates, by the same rule.
fn group_origin(scene: &Scene, group: u32) -> DVec3 {
    let bounds = scene
        .group_geometries(group)
        .fold(DAabb::EMPTY, |all, (_, geometry)| all.union(geometry.bounds(&DAffine3::IDENTITY)));
    choose_origin(&bounds)
}

fn check_transform(index: usize, instance: &Instance) -> Result<()> {
    let Instance { name, transform, transform_end, .. } = instance;
    // Whether it passes through a singular transform at its end, as on the way there, is found later, with the time.
    let end = transform_end.as_ref().filter(|end| !end.as_affine3().is_finite());
    match placement_fault(transform).or_else(|| placement_fault(end?)) {
        Some(problem) => Err(Error::Scene(format!("instance {index} ({name:?}) {problem}"))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;
    use crate::trace::Tracer;
    use crate::trace::bvh::Bvh;

    /// Not even at the start would it be seen.
    #[test]
    fn what_moves_beyond_f32_is_refused() {
        let scene = |x: f64| {
            let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
            let mut scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]);
            scene.instances[0].transform_end = Some(DAffine3::from_translation(DVec3::X * x));
            scene
        };
        assert!(World::new(&scene(1e6)).is_ok());
        let told = World::new(&scene(1e39)).expect_err("refused").to_string();
        assert!(told.contains("moves, to where f32 does not reach"), "{told}");
    }

    /// Also where nobody has asked `Scene::check` before.
    #[test]
    fn what_is_not_there_is_refused() {
        let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        let good = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()]);
        let (mut placed, mut grouped) = (good.clone(), good.clone());
        placed.instances[0].group = 1;
        grouped.groups[0].geometries = 0..2;
        for (scene, expected) in [(placed, "places a group"), (grouped, "has geometries")] {
            let told = World::new(&scene).expect_err("refused").to_string();
            assert!(told.contains(expected) && told.contains("exist"), "{told}");
        }
        assert_eq!(World::new(&good).map(|world| world.placed_triangles()).expect("sound"), 1);
    }

    /// Wherever the scene lies, and so wherever zero is for tracers.
    #[test]
    fn rays_of_a_world_are_those_of_the_scene() {
        for away in [0.0, 6.0, 1e3, 1e6] {
            let corners = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::X * away);
            let geometry = Geometry::Mesh(Mesh::new(corners.to_vec(), vec![[0, 1, 2]]));
            let world =
                World::new(&Scene::from_geometries(vec![geometry], vec![Material::default()])).expect("a world");
            assert_eq!(world.centre == DVec3::ZERO, away == 0.0);
            let origin = DVec3::new(f64::from(away) + 0.25, 0.25, 5.0);
            let ray = world.ray(origin, Vec3::NEG_Z);
            assert_eq!(Bvh::build(&world).closest(&ray).map(|hit| hit.t), Some(5.0), "{away}");
            assert_eq!(world.to_scene(ray.origin.as_dvec3()), origin);
        }
    }
}
