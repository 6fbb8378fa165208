//! Every accelerator gives the hits of brute force, to the bit, and those of exact arithmetic.

mod matrix;
mod methods;
mod program;
mod subjects;

use std::time::Duration;

use twincast::lab::Entrant;
use twincast::lab::all::{Report, Setup};
use twincast::math::{DAffine3, DMat3, DVec3, UVec3, Vec3};
use twincast::render::Control;
use twincast::scene::{Camera, Geometry, Group, Instance, Material, Mesh, Scene};
use twincast::trace::accel::{Accel, Options, Resolution};
use twincast::trace::brute::Brute;
use twincast::{Batch, Hit, Ray, Renderer, Settings, Tracer, World};

use crate::scenes::{self, Random};

/// All but the native BVH, which has tests of its own, and brute force.
fn accelerators() -> impl Iterator<Item = Accel> {
    Accel::ALL.into_iter().filter(|accel| !matches!(accel, Accel::Bvh | Accel::Brute))
}

/// Closest hits, occlusion and occlusion of batches against what brute force found.
#[track_caller]
pub(crate) fn assert_accelerators(world: &World, rays: &[Ray], expected: &[Option<Hit>]) {
    for accel in accelerators() {
        assert_accelerator(world, accel, &Options::default(), rays, expected);
    }
}

#[track_caller]
fn assert_accelerator(world: &World, accel: Accel, options: &Options, rays: &[Ray], expected: &[Option<Hit>]) {
    let (tracer, name) = (accel.build(world, options).tracer, accel.name());
    for (ray, expected) in rays.iter().zip(expected) {
        assert_eq!(tracer.closest(ray), *expected, "{name} {ray:?}");
        assert_eq!(tracer.occluded(ray), expected.is_some(), "occluded {name} {ray:?}");
    }
    let mut occluded = vec![false; rays.len()];
    tracer.occluded_batch(rays, &mut occluded, Batch::default());
    for ((ray, occluded), expected) in rays.iter().zip(occluded).zip(expected) {
        assert_eq!(occluded, expected.is_some(), "occluded batch {name} {ray:?}");
    }
}

/// The same, with brute force to find what is right; the number of hits.
#[track_caller]
fn assert_brute(scene: &Scene, rays: &[Ray]) -> usize {
    let world = World::new(scene).expect("sound");
    let brute = Brute::new(&world);
    let expected: Vec<Option<Hit>> = rays.iter().map(|ray| brute.closest(ray)).collect();
    assert_accelerators(&world, rays, &expected);
    expected.iter().flatten().count()
}

/// A teapot in a stadium: a dense mesh in a corner of a large one.
fn mixed_scales() -> Mesh {
    let small = scenes::bumpy_sphere(40, 0.2, 3);
    let large = scenes::soup(60, 1.0, 4);
    let mut positions: Vec<Vec3> = small.positions.iter().map(|p| *p * 0.01 + Vec3::new(0.5, -0.3, 0.2)).collect();
    let first = positions.len() as u32;
    positions.extend(large.positions.iter());
    let triangles = small.triangles.iter().copied().chain(large.triangles.iter().map(|t| t.map(|i| i + first)));
    Mesh::new(positions, triangles.collect())
}

#[test]
fn mixed_scales_nest_grids() {
    let mesh = mixed_scales();
    let targets = mesh.positions.to_vec();
    let scene = scenes::of_mesh(mesh);
    let mut rays = scenes::rays(2000, &targets, 6);
    // Some from next to the small mesh.
    for ray in rays.iter_mut().step_by(3) {
        ray.origin = Vec3::new(0.5, -0.3, 0.2) + ray.origin * 0.008;
    }
    assert!(assert_brute(&scene, &rays) > 500);
    let world = World::new(&scene).expect("sound");
    let notes = Accel::Grid.build(&world, &Options::default()).notes.join(" ");
    let nested = notes.split(", ").nth(1).and_then(|rest| rest.split(' ').next()?.parse::<u32>().ok());
    assert!(nested.is_some_and(|nested| nested > 0), "{notes}");
}

/// Any resolution gives the same hits, and the one that was asked for.
#[test]
fn grids_of_any_resolution() {
    let mesh = scenes::soup(500, 0.2, 8);
    let rays = scenes::rays(600, &mesh.positions.to_vec(), 2);
    let world = World::new(&scenes::of_mesh(mesh)).expect("sound");
    let expected: Vec<Option<Hit>> = rays.iter().map(|ray| Brute::new(&world).closest(ray)).collect();
    for (resolution, said) in [
        (Resolution::Longest(1), " 1 x 1 x 1 "),
        (Resolution::Axes(UVec3::new(3, 50, 1)), " 3 x 50 x 1 "),
        (Resolution::Axes(UVec3::splat(90)), " 90 x 90 x 90 "),
    ] {
        let options = Options { grid: Some(resolution), ..Options::default() };
        let notes = Accel::Grid.build(&world, &options).notes.join(" ");
        assert!(notes.contains(said), "{notes}");
        assert_accelerator(&world, Accel::Grid, &options, &rays, &expected);
    }
}

/// Rays from where coordinates are a billion times those of the scene, and beyond.
#[test]
fn rays_from_far_away() {
    let mesh = scenes::bumpy_sphere(20, 0.2, 5);
    let targets = mesh.positions.to_vec();
    let mut random = Random::new(7);
    let mut rays = Vec::new();
    for distance in [1e3f32, 1e6, 1e9, 1e15] {
        for i in 0..300 {
            let direction = if i % 3 == 0 { Vec3::AXES[i / 3 % 3] } else { random.vec3() };
            let target = targets[random.below(targets.len())] * 0.9;
            rays.push(Ray::new(target - direction * distance, direction));
        }
    }
    let hits = assert_brute(&scenes::of_mesh(mesh), &rays);
    assert!(hits > 300, "{hits} hits");
}

/// Objects under transforms that shear, mirror, and scale to next to nothing along one axis or to a million times the
/// size.
#[test]
fn odd_transforms() {
    let mut scene = scenes::instanced(11);
    let shear = |k: f64| DMat3::from_cols(DVec3::X, DVec3::new(k, 1.0, 0.0), DVec3::new(0.0, -k, 1.0));
    let matrices = [
        shear(3.0),
        shear(300.0),
        DMat3::from_diagonal(DVec3::new(1.0, 1e-5, -1.0)),
        DMat3::from_diagonal(DVec3::splat(1e-4)) * shear(1.0),
        DMat3::from_diagonal(DVec3::splat(1e6)),
    ];
    for (i, matrix) in matrices.into_iter().enumerate() {
        for group in 0..3 {
            let transform =
                DAffine3 { matrix3: matrix, translation: DVec3::new(i as f64 - 2.0, f64::from(group), 0.3) };
            scene.instances.push(Instance { name: format!("odd {i}"), group, transform, transform_end: None });
        }
    }
    let targets: Vec<Vec3> = (0..200).scan(Random::new(2), |random, _| Some(random.vec3() * 2.5)).collect();
    let hits = assert_brute(&scene, &scenes::rays(1500, &targets, 3));
    assert!(hits > 200, "{hits} hits");
}

/// A setup of a small scene of meshes, spheres and instances.
fn report_of(scene: &Scene, random: u64, longest: Duration) -> Report {
    let world = World::new(scene).expect("sound");
    let camera = Camera::framing(&scene.bounds(), 1.0);
    let settings = Settings { width: 24, height: 24, ..Settings::default() };
    let renderer = Renderer::new(scene, &world, camera, settings).expect("a renderer");
    let options = Options::default();
    let size = (24, 24);
    let setup = Setup { scene: "instances", renderer: &renderer, size, random, seed: 1, longest, options: &options };
    setup.run(Control::default()).expect("nothing stops it")
}

#[test]
fn all_of_them_are_compared_and_none_is_wrong() {
    let report = report_of(&scenes::instanced(5), 3000, Duration::from_secs(60));
    assert_eq!((report.rays, report.compared), (24 * 24 + 3000, 24 * 24 + 3000));
    report.check().expect("nothing is wrong");
    assert_eq!(report.rows.len(), Entrant::all().len());
    let native = report.rows.iter().filter(|row| row.name != "embree");
    for row in native {
        assert_eq!((row.differing, row.native_wrong), (0, 0), "{}", row.name);
        assert!(row.mrays_per_s > 0.0 && row.bytes > 0, "{}", row.name);
    }
    let table = report.to_string();
    for words in ["all 3576 rays", "brute ", "groups ", "binary-bvh ", "octree ", "kd-tree ", "bsp ", "grid: a grid of"]
    {
        assert!(table.contains(words), "{words} in {table}");
    }
}

#[test]
fn brute_force_without_time_compares_a_sample_and_says_so() {
    let report = report_of(&scenes::of_mesh(scenes::soup(2000, 0.1, 1)), 30_000, Duration::ZERO);
    assert!(report.compared > 0 && report.compared < report.rays, "{} of {}", report.compared, report.rays);
    let table = report.to_string();
    assert!(table.contains("a random sample") && table.contains(&format!("of {} rays", report.rays)), "{table}");
}

#[test]
fn a_wrong_accelerator_fails_the_check() {
    let mut report = report_of(&scenes::of_mesh(scenes::soup(20, 0.5, 1)), 10, Duration::from_secs(1));
    report.check().expect("nothing is wrong");
    report.rows[3].native_wrong = 2;
    let error = report.check().expect_err("one is wrong");
    assert!(error.exit_code() == 1 && error.to_string().contains(report.rows[3].name), "{error}");
    report.rows[3].native_wrong = 0;
    report.rows[4].embree_wrong = 2;
    report.check().expect("only Embree's own");
}

/// Geometries of one group each, far apart: what a list of boxes is for.
#[test]
fn groups_are_the_scenes_own() {
    let meshes: Vec<Geometry> = (0..5)
        .map(|i| {
            let mut mesh = scenes::bumpy_sphere(8, 0.2, i);
            let moved: Vec<Vec3> = mesh.positions.iter().map(|p| *p + Vec3::X * 3.0 * i as f32).collect();
            mesh.positions = moved.into();
            Geometry::Mesh(mesh)
        })
        .collect();
    let groups = (0..5).map(|i| Group { name: String::new(), geometries: i..i + 1 }).collect();
    let instance = |group| Instance { name: String::new(), group, transform: DAffine3::IDENTITY, transform_end: None };
    let instances = (0..5).map(instance).collect();
    let scene =
        Scene { geometries: meshes, groups, instances, materials: vec![Material::default()], ..Scene::default() };
    let targets: Vec<Vec3> = (0..50).map(|i| Vec3::X * 0.3 * i as f32).collect();
    assert!(assert_brute(&scene, &scenes::rays(1500, &targets, 4)) > 300);
}

/// Point location through what is public: the cell holds the point, and names few of the items.
#[test]
fn trees_that_divide_space_know_where_points_are() {
    let mesh = scenes::soup(3000, 0.05, 2);
    let world = World::new(&scenes::of_mesh(mesh)).expect("sound");
    let mut random = Random::new(1);
    for accel in Accel::ALL {
        let tracer = accel.build(&world, &Options::default()).tracer;
        let divides_space = matches!(accel, Accel::Kd | Accel::Bsp);
        assert!(tracer.locate(Vec3::splat(50.0)).is_none());
        for _ in 0..100 {
            let point = random.vec3() * 0.9;
            let cell = tracer.locate(point);
            assert_eq!(cell.is_some(), divides_space, "{}", accel.name());
            if let Some(cell) = cell {
                assert!(cell.contains(point.as_dvec3()) && cell.items.len() < 300, "{point} {cell:?}");
            }
        }
    }
}
