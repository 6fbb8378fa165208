//! Every primitive on every accelerator against exact arithmetic, on rays of every class.
//!
//! Brute force is held against the oracle, primitive by primitive; everything else is held against brute force, to the
//! bit. Where a primitive stands in world coordinates the oracle's verdict must be met; where it was placed by a
//! transform, triangles are held to the same, and shapes, whose ray is rounded in their own coordinates, to what that
//! rounding allows.

use twincast::lab::oracle::{self, Id, Primitive};
use twincast::lab::rounding::{Precision, outcome};
use twincast::math::{DAffine3, DMat3, DVec3, Vec3};
use twincast::scene::{Geometry, Group, Instance, Material, Mesh, Scene};
use twincast::trace::brute::Brute;
use twincast::{Hit, Ray, Tracer, World};

use super::subjects::{self, Class, Kind, Subject};
use crate::brute_force::assert_parity_of;
use crate::scenes::Random;

/// A scene of one kind of primitive, and what rays are aimed at, in the world.
pub struct Matrix {
    pub world: World,
    pub targets: Vec<Subject>,
}

/// Some primitives of a kind in world coordinates, and a few that are placed twice.
pub fn of_kind(kind: Kind, fixed: usize, placed: usize, random: &mut Random) -> Matrix {
    let mut subjects = |count: usize| (0..count).map(|_| Subject::new(kind, random)).collect::<Vec<_>>();
    let (fixed, placed) = (subjects(fixed), subjects(placed));
    let transforms = if placed.is_empty() { Vec::new() } else { vec![turned(), sheared()] };
    let at_home = Instance { name: "fixed".into(), group: 0, transform: DAffine3::IDENTITY, transform_end: None };
    let elsewhere = transforms.iter().map(|&transform| Instance {
        name: "placed".into(),
        group: 1,
        transform,
        transform_end: None,
    });
    let mut scene = Scene {
        geometries: vec![geometry(&fixed)],
        groups: vec![Group { name: String::new(), geometries: 0..1 }],
        instances: [at_home].into_iter().chain(elsewhere).collect(),
        materials: vec![Material::default()],
        ..Scene::default()
    };
    if !placed.is_empty() {
        scene.geometries.push(geometry(&placed));
        scene.groups.push(Group { name: String::new(), geometries: 1..2 });
    }
    let moved = transforms.iter().flat_map(|m| placed.iter().map(|subject| subject.moved(m)));
    let targets = fixed.iter().cloned().chain(moved).collect();
    Matrix { world: World::new(&scene).expect("sound"), targets }
}

/// A quarter turn and half the size: it rounds nothing.
fn turned() -> DAffine3 {
    let matrix3 = DMat3::from_cols(DVec3::X * 0.5, DVec3::Z * 0.5, DVec3::NEG_Y * 0.5);
    DAffine3 { matrix3, translation: DVec3::new(3.0, 0.5, -1.0) }
}

/// It mirrors, shears, and scales axes by different factors.
fn sheared() -> DAffine3 {
    let matrix3 = DMat3::from_cols(DVec3::new(-1.3, 0.1, 0.0), DVec3::new(0.4, 0.7, 0.2), DVec3::new(0.3, -0.2, 1.9));
    DAffine3 { matrix3, translation: DVec3::new(-3.5, 0.3, 1.1) }
}

fn geometry(subjects: &[Subject]) -> Geometry {
    let corners = |subject: &Subject| match subject.body {
        subjects::Body::Triangle(corners) => Some(corners),
        subjects::Body::Shape(_) => None,
    };
    let positions: Vec<Vec3> = subjects.iter().filter_map(corners).flatten().collect();
    if positions.is_empty() {
        let shapes = subjects.iter().filter_map(|subject| match &subject.body {
            subjects::Body::Shape(shape) => Some(shape.clone()),
            subjects::Body::Triangle(_) => None,
        });
        return Geometry::Shapes { shapes: shapes.collect(), material: 0 };
    }
    let triangles = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Geometry::Mesh(Mesh::new(positions, triangles))
}

impl Matrix {
    /// Rays of a class, at one target after the other.
    pub fn rays(&self, class: Class, count: usize, random: &mut Random) -> Vec<Ray> {
        let mut ray = |i: usize| {
            let ray = self.targets[i % self.targets.len()].ray(class, random);
            // Some begin behind the first hit, or end before it: then it is the second that counts, or none.
            let nearest = oracle::closest(&self.world, &ray);
            let t = nearest.first().map_or(1.0, |(_, meeting)| meeting.t.to_f64() as f32);
            match i % 8 {
                0 => Ray { tmin: t.next_up(), ..ray },
                1 => Ray { tmin: t * 1.1, ..ray },
                2 => Ray { tmax: t, ..ray },
                3 => Ray { tmax: t.next_down().max(0.0), ..ray },
                _ => ray,
            }
        };
        (0..count).map(&mut ray).collect()
    }
}

/// What may be answered for a primitive: whether it is hit, whether it is missed, and t.
struct Allowed {
    id: Id,
    hit: bool,
    miss: bool,
    t: (f64, f64),
}

impl Allowed {
    fn new(ray: &Ray, id: Id, primitive: &Primitive<'_>) -> Self {
        let bounds = outcome(ray, primitive, Precision::Double);
        let (hit, miss) = if !primitive.is_decided_exactly() {
            (bounds.may_hit(ray), bounds.may_miss(ray))
        } else {
            let meeting = oracle::meet(ray, primitive);
            let is_hit = meeting.as_ref().is_some_and(|m| m.in_range);
            // At an end of the range the rounding of t decides.
            let unsure = meeting.is_some_and(|m| m.at_range_end) && bounds.may_hit(ray) && bounds.may_miss(ray);
            (is_hit || unsure, !is_hit || unsure)
        };
        Self { id, hit, miss, t: bounds.span(ray) }
    }
}

/// Whether `found` is an answer that is right; `Ok(true)` where only one was.
fn judge(world: &World, ray: &Ray, found: Option<Hit>) -> Result<bool, String> {
    let allowed: Vec<Allowed> = oracle::primitives(world, ray.time).map(|(id, p)| Allowed::new(ray, id, &p)).collect();
    let surely = || allowed.iter().filter(|a| !a.miss);
    // Nothing that is surely hit is nearer, whatever the rounding.
    let nearest = surely().map(|a| a.t.1).fold(f64::INFINITY, f64::min);
    let possible: Vec<&Allowed> = allowed.iter().filter(|a| a.hit && a.t.0 <= nearest).collect();
    let only = possible.len() <= 1 && possible.iter().all(|a| !a.miss);
    match found {
        None if surely().next().is_none() => Ok(only),
        None => Err(format!("missed {:?}", surely().map(|a| a.id).collect::<Vec<_>>())),
        Some(hit) => match possible.iter().find(|a| a.id == hit.id()) {
            None => Err(format!("{hit:?} is not among {:?}", possible.iter().map(|a| a.id).collect::<Vec<_>>())),
            Some(a) if !(a.t.0..=a.t.1).contains(&f64::from(hit.t)) => Err(format!("t of {hit:?} is not in {:?}", a.t)),
            Some(_) => Ok(only),
        },
    }
}

/// Rays of each class, and how many of them must be decided.
const RAYS: usize = 48;

fn hold(kinds: &[Kind]) {
    for &kind in kinds {
        let mut random = Random::new(kind as u64 + 1);
        let matrix = of_kind(kind, 10, 3, &mut random);
        let brute = Brute::new(&matrix.world);
        let (mut hits, mut decided) = (0, 0);
        for class in Class::ALL {
            let rays = matrix.rays(class, RAYS, &mut random);
            for ray in &rays {
                let found = brute.closest(ray);
                match judge(&matrix.world, ray, found) {
                    Ok(only) => decided += usize::from(only),
                    Err(why) => panic!("{kind:?}, {class:?}, {ray:?}: {why}"),
                }
                hits += usize::from(found.is_some());
            }
            assert_parity_of(&matrix.world, &brute, &rays);
            #[cfg(feature = "embree")]
            assert_embree(&matrix.world, &brute, &rays);
        }
        let all = RAYS * Class::ALL.len();
        assert!(hits > all / 3 && decided > all / 3, "{kind:?}: {hits} hits, {decided} decided, of {all}");
    }
}

/// Embree differs where rounding may decide, and nowhere else.
#[cfg(feature = "embree")]
fn assert_embree(world: &World, brute: &Brute, rays: &[Ray]) {
    use twincast::lab::{Answers, Class, classify_closest};
    use twincast::trace::embree::{Embree, Options};
    let embree = Embree::new(world, &Options::default()).expect("Embree builds");
    for ray in rays {
        let answers = Answers { native: brute.closest(ray), embree: embree.closest(ray), brute: None };
        let class = classify_closest(world, ray, &answers);
        assert!(class < Class::NativeWrong, "{class:?} {answers:?} {ray:?}");
    }
}

#[test]
fn triangles_spheres_and_planes_are_exact_everywhere() {
    hold(&[Kind::Triangle, Kind::Sphere, Kind::Plane, Kind::Disk]);
}

#[test]
fn boxes_cylinders_and_cones_are_exact_everywhere() {
    hold(&[Kind::Box, Kind::Cylinder, Kind::OpenCylinder, Kind::Cone, Kind::OpenCone]);
}

#[test]
fn ellipsoids_and_polygons_are_exact_everywhere() {
    hold(&[Kind::Ellipsoid, Kind::ConvexPolygon, Kind::ConcavePolygon]);
}
