//! Every way through the native tracer gives the answers of brute force, to the bit.
//!
//! | file | what |
//! | --- | --- |
//! | `bundles` | rays that go together |
//! | `numbers` | numbers at the ends of what f32 has |
//! | `placed` | objects in their places |
//! | `meshes` | odd meshes, and such as move |

mod bundles;
mod meshes;
mod numbers;
mod placed;

use twincast::math::{DAffine3, DVec3, Vec3};
use twincast::scene::{Geometry, Group, Instance, Mesh, Scene};
use twincast::trace::brute::Brute;
use twincast::trace::bvh::{Bvh, Isa, Options, Preset, Travel};
use twincast::{Batch, Hit, Ray, Tracer, Width, World};

use crate::accelerators::assert_accelerators;
use crate::scenes::{self, Random};

/// Closest hits and occlusion by rays alone, in flight and in bundles, with every preset and instruction set, against
/// brute force.
#[track_caller]
pub(crate) fn assert_parity(scene: &Scene, rays: &[Ray]) -> usize {
    let world = World::new(scene).expect("the scene is sound");
    assert_parity_of(&world, &Brute::new(&world), rays)
}

#[track_caller]
pub(crate) fn assert_parity_of(world: &World, brute: &Brute, rays: &[Ray]) -> usize {
    assert_parity_of_batches(world, brute, &[rays.to_vec()])
}

/// The same of several batches, for which trees are built once.
#[track_caller]
fn assert_parity_of_batches(world: &World, brute: &Brute, batches: &[Vec<Ray>]) -> usize {
    let expected = |rays: &Vec<Ray>| -> Vec<Option<Hit>> { rays.iter().map(|ray| brute.closest(ray)).collect() };
    let expected: Vec<_> = batches.iter().map(expected).collect();
    let batches = || batches.iter().zip(&expected);
    // What is asked ray by ray.
    let some = || batches().flat_map(|(rays, expected)| rays.iter().zip(expected).take(100));
    for (ray, expected) in some() {
        assert_eq!(brute.occluded(ray), expected.is_some());
    }
    let every = Preset::ALL.into_iter().flat_map(|preset| Isa::ALL.map(|isa| (preset, isa)));
    for (preset, isa) in every.filter(|(_, isa)| isa.is_available()) {
        let mut bvh = Bvh::build_with(world, Options { preset, isa, progress: None });
        let ways = [
            (Travel::Auto, false),
            (Travel::Auto, true),
            (Travel::Alone, false),
            (Travel::Alone, true),
            (Travel::InFlight, false),
            (Travel::InFlight, true),
        ];
        for (travel, coherent) in ways {
            bvh = bvh.travelling(travel);
            let batch = Batch { width: Width::One, coherent };
            for (rays, expected) in batches() {
                let mut hits = vec![None; rays.len()];
                bvh.closest_batch(rays, &mut hits, batch);
                for (i, ray) in rays.iter().enumerate() {
                    assert_eq!(hits[i], expected[i], "{preset:?} {isa:?} {travel:?} {batch:?} {ray:?}");
                }
                let mut occluded = vec![false; rays.len()];
                bvh.occluded_batch(rays, &mut occluded, batch);
                for (i, ray) in rays.iter().enumerate() {
                    let is_hit = expected[i].is_some();
                    assert_eq!(occluded[i], is_hit, "occluded {preset:?} {isa:?} {travel:?} {batch:?} {ray:?}");
                }
            }
        }
        for (ray, expected) in some() {
            assert_eq!(bvh.closest(ray), *expected);
            assert_eq!(bvh.occluded(ray), expected.is_some());
        }
    }
    let (rays, expected): (Vec<_>, Vec<_>) = batches().flat_map(|(rays, expected)| rays.iter().zip(expected)).unzip();
    assert_accelerators(world, &rays, &expected);
    expected.iter().flatten().count()
}

#[test]
fn random_soups() {
    for (seed, size) in [(1, 0.02), (2, 0.3), (3, 2.0)] {
        let mesh = scenes::soup(3000, size, seed);
        let rays = scenes::rays(2000, &mesh.positions.clone(), seed);
        let hits = assert_parity(&scenes::of_mesh(mesh), &rays);
        assert!(hits > 150, "{hits} hits");
    }
}

#[test]
fn closed_mesh_at_every_scale_and_place() {
    for scale in [1e-20f32, 1e-6, 1.0, 1e6, 1e15] {
        // At zero, aside of it, and so far away that tracers have their zero elsewhere.
        for offset in [Vec3::ZERO, Vec3::new(5.0, -3.0, 1.0), Vec3::new(1000.0, -300.0, 50.0)] {
            let mut mesh = scenes::bumpy_sphere(24, 0.2, 7);
            let moved: Vec<Vec3> = mesh.positions.iter().map(|p| (*p + offset) * scale).collect();
            let mut rays = scenes::rays(600, &mesh.positions.clone(), 3);
            mesh.positions = moved.into();
            let world = World::new(&scenes::of_mesh(mesh)).expect("sound");
            assert_eq!(world.centre == DVec3::ZERO, offset.length() < 10.0);
            for ray in &mut rays {
                ray.origin = (((ray.origin + offset) * scale).as_dvec3() - world.centre).as_vec3();
                ray.direction *= scale;
            }
            let hits = assert_parity_of(&world, &Brute::new(&world), &rays);
            assert!(hits > 300, "{offset} times {scale}: {hits} hits");
        }
    }
}

#[test]
fn odd_rays() {
    let mesh = scenes::bumpy_sphere(10, 0.2, 3);
    let o = Vec3::new(0.1, 0.2, 3.0);
    let d = Vec3::new(0.0, -0.05, -1.0);
    let whole = Ray::new(o, d);
    let nan = f32::NAN;
    let rays = [
        whole,
        Ray { direction: Vec3::ZERO, ..whole },
        Ray { direction: Vec3::new(nan, 0.0, 1.0), ..whole },
        Ray { origin: Vec3::new(nan, 0.0, 1.0), ..whole },
        Ray { origin: Vec3::INFINITY, ..whole },
        Ray { direction: Vec3::INFINITY, ..whole },
        Ray { tmin: 5.0, tmax: 1.0, ..whole },
        Ray { tmax: nan, ..whole },
        Ray { tmin: nan, ..whole },
        Ray { tmin: -1.0, ..whole },
        Ray { tmax: 1.0, ..whole },
        Ray { tmin: 2.5, ..whole },
        Ray { direction: d * 1e-30, ..whole },
        Ray { direction: d * 1e30, ..whole },
        Ray { direction: Vec3::new(1e-40, -0.0, -1.0), ..whole },
        Ray { direction: Vec3::new(-0.0, 0.0, -1e-42), ..whole },
    ];
    let hits = assert_parity(&scenes::of_mesh(mesh.clone()), &rays);
    assert!(hits >= 5, "{hits} hits");
    let world = World::new(&scenes::of_mesh(mesh)).expect("sound");
    let bvh = Bvh::build(&world);
    let t = bvh.closest(&whole).expect("hit").t;
    assert!(bvh.closest(&Ray { tmin: t, tmax: t, ..whole }).is_some(), "the range is closed");
    assert!(bvh.closest(&Ray { tmax: t.next_down(), ..whole }).is_none());
    assert_ne!(bvh.closest(&Ray { tmin: t.next_up(), ..whole }).map(|hit| hit.t), Some(t));
    for ray in &rays[1..10] {
        assert_eq!(bvh.closest(ray), None, "{ray:?}");
    }
}

/// From inside a closed mesh nothing leaks, at corners and edges either.
#[test]
fn watertight() {
    let mesh = scenes::bumpy_sphere(16, 0.2, 1);
    let world = World::new(&scenes::of_mesh(mesh.clone())).expect("sound");
    let bvh = Bvh::build(&world);
    let mut random = Random::new(4);
    for i in 0..200_000 {
        let corners = mesh.triangles[random.below(mesh.triangles.len())].map(|i| mesh.positions[i as usize]);
        let target = if i % 2 == 0 { corners[0] } else { corners[0].lerp(corners[1], random.unit()) };
        let origin = random.vec3() * 0.4;
        let ray = Ray::new(origin, target - origin);
        assert!(bvh.closest(&ray).is_some() && bvh.occluded(&ray), "leak: {ray:?}");
    }
}
