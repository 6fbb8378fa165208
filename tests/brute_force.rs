//! Every way through the native tracer gives the answers of brute force, to the bit.

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
fn instances_and_spheres() {
    let scene = scenes::instanced(5);
    let targets: Vec<Vec3> = (0..200).scan(Random::new(9), |random, _| Some(random.vec3() * 3.0)).collect();
    let mut rays = scenes::rays(3000, &targets, 5);
    for ray in &mut rays {
        ray.origin *= 2.0;
    }
    let hits = assert_parity(&scene, &rays);
    assert!(hits > 200, "{hits} hits");
}

/// Rays among small objects of many triangles, which are far finer than rays are apart: towards a light, and from an
/// eye. Some are aimed at corners.
#[test]
fn objects_finer_than_rays() {
    use twincast::math::{DAffine3, DQuat, DVec3};
    let mut random = Random::new(12);
    let mut scene = scenes::of_mesh(scenes::bumpy_sphere(40, 0.3, 4));
    let corners = scenes::bumpy_sphere(40, 0.3, 4).positions.to_vec();
    let first = scene.instances.pop().expect("one instance");
    let mut targets = Vec::new();
    for _ in 0..30 {
        let turn = DQuat::from_scaled_axis(random.vec3().as_dvec3() * 3.0);
        let place = random.vec3().as_dvec3() * DVec3::new(1.0, 0.2, 1.0);
        let transform = DAffine3::from_scale_rotation_translation(DVec3::splat(0.1), turn, place);
        scene.instances.push(twincast::scene::Instance { transform, ..first.clone() });
        targets
            .extend(corners.iter().step_by(40).map(|corner| transform.transform_point3(corner.as_dvec3()).as_vec3()));
    }
    let mut rays = Vec::new();
    for round in 0..41 {
        // The last ones fill no bundle, come from all sides, and are divided by octants.
        let is_last = round == 40;
        let light = if is_last { random.vec3() * 0.3 } else { Vec3::new(8.0, 10.0, 9.0) + random.vec3() };
        let start = targets[random.below(targets.len())] - Vec3::new(0.5, 0.7, 0.6);
        for _ in 0..if is_last { 60 } else { 64 } {
            let near = start + random.vec3() * 0.3;
            let through = targets[random.below(targets.len())] - light;
            let start = if is_last || random.below(4) == 0 { light + through * 1.3 } else { near };
            let direction = light - start;
            let (origin, direction) = if round % 4 == 0 && !is_last { (light, -direction) } else { (start, direction) };
            rays.push(Ray { tmax: 1.0, ..Ray::new(origin, direction) });
        }
    }
    let hits = assert_parity(&scene, &rays);
    assert!((500..2200).contains(&hits), "{hits} of {}", rays.len());
}

/// Transforms of every kind: objects that are tiny, huge, flattened, sheared, mirrored, or far away for their size.
/// Rays alone and in bundles; some bundles cross octants in the object's coordinates and not in the world's.
#[test]
fn extreme_placements() {
    use twincast::math::{DAffine3, DMat3, DQuat, DVec3};
    let mut hits = 0;
    for (case, scale) in [1.0, 1e-12, 1e9].into_iter().enumerate() {
        let mut random = Random::new(case as u64 + 40);
        let mut scene = scenes::of_mesh(scenes::bumpy_sphere(12, 0.3, case as u64));
        let first = scene.instances.pop().expect("one instance");
        let mut targets = Vec::new();
        for i in 0..10 {
            let turn = DMat3::from_quat(DQuat::from_scaled_axis(random.vec3().as_dvec3() * 3.0));
            let shape = match i {
                0 | 1 => DVec3::ONE,
                2 => DVec3::new(1.0, 1e-4, 1.0),
                3 => DVec3::new(1e-6, 1.0, 1e3),
                4 => DVec3::new(-1.0, 1.0, 0.5),
                5 => DVec3::splat(1e-5),
                6 => DVec3::splat(1e4),
                _ => DVec3::ONE + random.vec3().as_dvec3() * 0.5,
            };
            let mut matrix = turn * DMat3::from_diagonal(shape * scale);
            if i == 7 {
                matrix.x_axis += matrix.y_axis * 1e5;
            }
            let translation = random.vec3().as_dvec3() * scale * if i == 8 { 1e5 } else { 5.0 };
            let transform = DAffine3 { matrix3: matrix, translation };
            // Some three times in one place: of hits at one t the lowest number counts, in whatever order they come.
            for _ in 0..if i % 2 == 0 { 3 } else { 1 } {
                scene.instances.push(twincast::scene::Instance { transform, ..first.clone() });
            }
            targets.extend((0..20).map(|_| transform.transform_point3(random.vec3().as_dvec3()).as_vec3()));
        }
        let unit = scale as f32;
        let mut rays = Vec::new();
        for view in 0..12 {
            let eye = random.vec3() * unit * [3.0, 30.0, 0.1][view % 3];
            let target = targets[random.below(targets.len())];
            let spread = (target - eye).length() * [0.002, 0.05, 0.3][view / 3 % 3];
            rays.extend((0..64).map(|_| Ray::new(eye, target + random.vec3() * spread - eye)));
        }
        let to = rays[0].origin + Vec3::ONE * unit * 9.0;
        let end = |&target: &Vec3| Ray { tmax: 0.999, ..Ray::new(target * 1.01, to - target * 1.01) };
        rays.extend(targets.iter().map(end));
        hits += assert_parity(&scene, &rays);
    }
    assert!(hits > 500, "{hits} hits");
}

/// Directions so short that 1/d overflows on an axis, in trees whose nodes are mostly empty.
#[test]
fn short_directions() {
    let mut hits = 0;
    for count in [1, 9, 20, 60, 150] {
        let mesh = scenes::soup(count, 0.3, count as u64);
        let mut rays = Vec::new();
        for (i, target) in mesh.positions.iter().enumerate() {
            let along = [Vec3::X, Vec3::NEG_Y, Vec3::new(1e-3, 0.0, -1.0), Vec3::new(0.0, 1.0, 1.0)][i % 4];
            let length = [1e-20, 1e-36, 1e-37, 2e-38][i / 4 % 4];
            rays.push(Ray::new(target.lerp(Vec3::ZERO, 0.01) - along * 3.0, along * length));
        }
        hits += assert_parity(&scenes::of_mesh(mesh), &rays);
    }
    assert!(hits > 300, "{hits} hits");
}

#[test]
fn degenerate_meshes() {
    let mut mesh = scenes::soup(1000, 0.3, 11);
    let positions = std::sync::Arc::make_mut(&mut mesh.positions);
    positions[30] = Vec3::NAN;
    positions[33].x = f32::INFINITY;
    positions[36].y = 1e30;
    positions[40] = positions[39];
    positions[44] = positions[42].lerp(positions[43], 0.5);
    let targets = mesh.positions.iter().copied().filter(|p| p.is_finite() && p.length() < 10.0).collect::<Vec<_>>();
    let hits = assert_parity(&scenes::of_mesh(mesh), &scenes::rays(1500, &targets, 2));
    assert!(hits > 500, "{hits} hits");

    // Flat boxes, and rays within their planes.
    let grid: Vec<Vec3> =
        (0..121).map(|i| Vec3::new((i % 11) as f32, 0.0, (i / 11) as f32) * 0.2 - Vec3::new(1.0, 0.0, 1.0)).collect();
    let cell = |i: u32| [[i, i + 1, i + 11], [i + 1, i + 12, i + 11]];
    let cells = (0..110).filter(|i| i % 11 != 10).flat_map(cell).collect();
    let rays: Vec<Ray> = scenes::rays(1500, &grid, 8)
        .into_iter()
        .map(|ray| if ray.origin.x > 0.0 { Ray { origin: Vec3 { y: 0.0, ..ray.origin }, ..ray } } else { ray })
        .collect();
    let hits = assert_parity(&scenes::of_mesh(Mesh::new(grid, cells)), &rays);
    assert!(hits > 300, "{hits} hits");

    assert_eq!(assert_parity(&scenes::of_mesh(Mesh::default()), &scenes::rays(100, &[Vec3::ONE], 1)), 0);
}

/// Faces that are there twice, turned and in another order; plates upon plates, along an axis and aslant; objects
/// placed in one place: rays hit both at one t, and the lower id counts.
#[test]
fn surfaces_that_lie_on_each_other() {
    let mut random = Random::new(21);
    let sphere = scenes::bumpy_sphere(16, 0.2, 6);
    let turned = sphere.triangles.iter().rev().enumerate().map(|(i, &[a, b, c])| match i % 4 {
        0 => [a, b, c],
        1 => [b, c, a],
        2 => [c, b, a],
        _ => [b, a, c],
    });
    let twice = Mesh::new(sphere.positions.to_vec(), turned.chain(sphere.triangles.iter().copied()).collect());
    // A quarter of them shares nothing with those of the others but the plane.
    let (mut plates, mut corners) = (Vec::new(), Vec::new());
    for i in 0..80u32 {
        let p = |random: &mut Random| {
            let [x, y] = [random.unit(), random.unit()].map(|x| (x * 64.0).round() / 32.0);
            match i % 4 {
                0 => Vec3::new(x, 0.5, y),
                1 => Vec3::new(-1.25, x, y),
                2 => Vec3::new(x, y, 0.7),
                _ => Vec3::new(x, y, x + 0.5 * y),
            }
        };
        corners.extend((0..3).map(|_| p(&mut random)));
        plates.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let mut rays = scenes::rays(1500, &twice.positions.to_vec(), 4);
    // So many that those of the cameras come by whole bundles.
    rays.extend(scenes::rays(548, &corners, 5));
    // Of two cameras, one of them so wide that rays come to triangles by ones and twos.
    for (eye, width) in [(Vec3::new(2.0, 3.0, 4.0), 0.1), (Vec3::new(1.0, -2.0, 3.0), 1.0)] {
        for _ in 0..10 {
            let towards = random.vec3() - eye;
            rays.extend((0..64).map(|_| Ray::new(eye, towards + random.vec3() * width)));
        }
    }
    // Bundles past corners and edges of plates, where one is hit for sure and another of its plane is in doubt.
    let mut past = Vec::new();
    for round in 0..40 {
        let eye = Vec3::new(2.3, 3.1, 4.2);
        let [a, b] = [0; 2].map(|_| corners[random.below(corners.len())]);
        let near = [0.0, 1e-7, 1e-6, 1e-5][round % 4];
        past.extend((0..64).map(|i| Ray::new(eye, a.lerp(b, [0.0, 0.5][i % 2]) + random.vec3() * near - eye)));
        let edge = plates[random.below(plates.len())].map(|i| corners[i as usize]);
        past.extend(
            (0..64).map(|i| Ray::new(eye, edge[0].lerp(edge[1], i as f32 / 63.0) + random.vec3() * near - eye)),
        );
    }
    let mut scene = scenes::of_mesh(twice);
    let hits = assert_parity(&scene, &rays);
    assert!(hits > 800, "{hits} hits");
    let scene_of_plates = scenes::of_mesh(Mesh::new(corners, plates));
    assert_parity(&scene_of_plates, &past);
    let hits = assert_parity(&scene_of_plates, &rays);
    assert!(hits > 800, "{hits} hits");

    // The same group five times, three of them in one place, and one next to it, nearer than bounds tell.
    let place = |scene: &Scene, name: &str, shift: f32| twincast::scene::Instance {
        name: name.into(),
        transform: twincast::math::DAffine3::from_translation(twincast::math::DVec3::splat(shift.into())),
        ..scene.instances[0].clone()
    };
    scene.instances = [("a", 0.3), ("b", 0.0), ("c", 0.3f32.next_up()), ("d", 0.3), ("e", 0.3)]
        .map(|(name, shift)| place(&scene, name, shift))
        .to_vec();
    let hits = assert_parity(&scene, &rays);
    assert!(hits > 800, "{hits} hits");
}

#[test]
fn deep_trees() {
    // Coincident triangles cannot be told apart by any plane.
    let many = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]; 100_000]);
    let ray = Ray::new(Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z);
    let world = World::new(&scenes::of_mesh(many)).expect("sound");
    let hit = Bvh::build(&world).closest(&ray).expect("all of them are hit");
    assert_eq!((hit.primitive, hit.t), (0, 1.0), "the lowest id wins");

    // Sizes that halve: each split separates one triangle only.
    let scales: Vec<f32> = (0..120).map(|i| 0.5f32.powi(i)).collect();
    let positions: Vec<Vec3> = scales
        .iter()
        .flat_map(|&s| [Vec3::new(s, 0.0, 0.0), Vec3::new(s, s * 0.1, 0.0), Vec3::new(s, 0.0, s * 0.1)])
        .collect();
    let triangles = (0..120).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let rays: Vec<Ray> = scales
        .iter()
        .flat_map(|&s| {
            [
                Ray::new(Vec3::new(2.0, s * 0.03, s * 0.03), Vec3::NEG_X),
                Ray::new(Vec3::new(-1.0, s * 0.03, s * 0.03), Vec3::X),
            ]
        })
        .collect();
    assert!(assert_parity(&scenes::of_mesh(Mesh::new(positions, triangles)), &rays) > 100);
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

/// Bundles: rays that start in one point, and shadow rays that end in one.
#[test]
fn bundles() {
    let instanced = scenes::instanced(5);
    let floor = Mesh::new(
        vec![Vec3::new(-9.0, -1.0, -9.0), Vec3::new(9.0, -1.0, -9.0), Vec3::new(0.0, -1.0, 9.0)],
        vec![[0, 1, 2]],
    );
    let meshes = [scenes::soup(3000, 0.1, 3), scenes::soup(300, 2.0, 4), scenes::bumpy_sphere(40, 0.2, 5), floor];
    for (i, scene) in meshes.into_iter().map(scenes::of_mesh).chain([instanced]).enumerate() {
        let world = World::new(&scene).expect("sound");
        let brute = Brute::new(&world);
        let mut random = Random::new(i as u64);
        let (mut views, mut shadows) = (Vec::new(), Vec::new());
        for view in 0..6 {
            let eye = random.vec3() * [0.3, 3.0, 30.0, 3.0, 3000.0, 2.5][view];
            let spread = 1.0 / eye.length().max(1.0) * 3.0;
            let corner = -eye / eye.length() + random.vec3() * 0.2 * spread.min(1.0);
            let (across, down) = (random.vec3() * 0.02, random.vec3() * 0.02);
            let pixel = |k: usize| {
                corner + (across * (k % 8 + k / 64 % 6 * 8) as f32 + down * (k % 64 / 8 + k / 384 * 8) as f32) * spread
            };
            let rays: Vec<Ray> = (0..2304).map(|k| Ray::new(eye, pixel(k))).collect();
            let lit = rays.iter().filter_map(|ray| Some((ray, brute.closest(ray)?)));
            let shadow = |(ray, hit): (&Ray, Hit)| {
                let point = ray.origin + ray.direction * (hit.t * 0.9999);
                Ray { tmax: 0.999, ..Ray::new(point, eye * 1.5 + Vec3::ONE - point) }
            };
            shadows.push(lit.map(shadow).collect());
            views.push(rays);
        }
        let [seen, shaded] = [views, shadows].map(|batches| assert_parity_of_batches(&world, &brute, &batches));
        // Nothing is between the floor and the light.
        assert!(seen > 3000 && (shaded > 250 || i == 3), "scene {i}: {seen}, {shaded}");
    }
}

/// Rays that run the same way, as an orthographic camera's and those towards the sun: through corners, edges and
/// between, with ranges of all kinds and some that are not valid; near to each other, and far apart.
#[test]
fn parallel_rays() {
    let mut hits = 0;
    for (seed, mesh) in [(1, scenes::bumpy_sphere(24, 0.2, 5)), (2, scenes::soup(2000, 0.3, 5))] {
        let mut random = Random::new(seed);
        let corners = mesh.positions.clone();
        let scene = scenes::of_mesh(mesh);
        let directions =
            [Vec3::NEG_Z, Vec3::new(0.0, 2.0, 0.0), Vec3::new(1.0, -0.5, 0.25), random.vec3(), random.vec3() * 1e-3];
        let mut batches = Vec::new();
        // From so far away, too, that what f32 leaves between them is as wide as what it leaves open.
        for (k, (direction, far)) in directions.into_iter().flat_map(|way| [(way, 4.0), (way, 4e3)]).enumerate() {
            let way = direction.normalize();
            let (back, apart) = (way * far, if k % 2 == 1 { 1e-4 } else { [0.01, 0.01, 0.01, 0.5, 0.01][k / 2] });
            let across = way.any_orthonormal_vector() * apart;
            let along = way.cross(across);
            // Tiles of 8 x 8 around corners, lines through one corner as well as f32 can tell, and what does not fill a
            // bundle.
            let mut rays = Vec::new();
            for tile in 0..16 {
                let middle = corners[random.below(corners.len())] - back;
                for i in 0..64 {
                    let tiled = across * (i % 8 - 4) as f32 + along * (i / 8 - 4) as f32;
                    let offset = if tile % 2 == 0 { tiled } else { back * (i as f32 / 97.0) };
                    rays.push(Ray::new(middle + offset, direction));
                }
            }
            rays.truncate(rays.len() - 21);
            for ray in rays.iter_mut().step_by(7) {
                let length = far / direction.length();
                (ray.tmin, ray.tmax) = (length * random.unit(), length * (0.5 + random.unit()));
                match random.below(6) {
                    0 => ray.origin.x = f32::NAN,
                    1 => (ray.tmin, ray.tmax) = (ray.tmax, ray.tmin),
                    2 => ray.tmin = -1.0,
                    _ => {}
                }
            }
            batches.push(rays);
        }
        let world = World::new(&scene).expect("the scene is sound");
        hits += assert_parity_of_batches(&world, &Brute::new(&world), &batches);
    }
    assert!(hits > 3000, "{hits} hits");
}

/// What orthographic cameras see, and what of it the sun shines on: in tiles, from near and far, along axes, nearly
/// along them and across, at all sizes, among placed objects and shapes.
#[test]
fn parallel_bundles() {
    let floor = Mesh::new(
        vec![Vec3::new(-9.0, -1.0, -9.0), Vec3::new(9.0, -1.0, -9.0), Vec3::new(0.0, -1.0, 9.0)],
        vec![[0, 1, 2]],
    );
    let meshes = [scenes::soup(3000, 0.1, 3), scenes::soup(300, 2.0, 4), scenes::bumpy_sphere(40, 0.2, 5), floor];
    let sized = [1e-12, 3e8].map(|size| {
        let mesh = scenes::bumpy_sphere(12, 0.2, 6);
        Mesh::new(mesh.positions.iter().map(|&p| p * size).collect(), mesh.triangles.to_vec())
    });
    // Fixed triangles among those of placed objects, so that either may be in front.
    let mut mixed = scenes::instanced(5);
    for (geometry, size, copies) in [(3, 0.4, 1), (4, 0.3, 6)] {
        mixed.geometries.push(Geometry::Mesh(scenes::soup(300, size, 9 + geometry as u64)));
        mixed.groups.push(Group { name: String::new(), geometries: geometry..geometry + 1 });
        let turned = |i: u8| DAffine3::from_rotation_y(f64::from(i));
        let of = |i| Instance { group: geometry, transform: turned(i), ..mixed.instances[0].clone() };
        mixed.instances.extend((0..copies).map(of).collect::<Vec<_>>());
    }
    let scenes = meshes.into_iter().chain(sized).map(scenes::of_mesh).chain([mixed]);
    for (i, scene) in scenes.enumerate() {
        let world = World::new(&scene).expect("sound");
        let brute = Brute::new(&world);
        let mut random = Random::new(i as u64);
        let (mut views, mut shadows) = (Vec::new(), Vec::new());
        let size = [1.0, 1.0, 1.0, 1.0, 1e-12, 3e8, 1.0][i];
        let ways = [
            Vec3::new(-0.0, -1.0, 0.0),
            Vec3::new(1e-20, 1.0, -1e-9),
            Vec3::new(1e-3, -4e-5, -0.7),
            Vec3::new(0.6, -0.6, 0.6),
            random.vec3(),
            random.vec3() * 1e4,
        ];
        for (view, way) in ways.into_iter().enumerate() {
            let (away, spread) =
                ([3.0, 0.2, 3000.0, 3.0, 30.0, 2.5][view] * size, [0.02, 0.05, 0.02, 1e-4, 0.02, 0.02][view] * size);
            let across = way.any_orthonormal_vector() * spread;
            let down = way.cross(across) / way.length() + across * 0.1;
            let eye = random.vec3() * 0.2 * size - way / way.length() * away - across * 20.0 - down * 20.0;
            // Origins in a plane that is not quite across, or as far ahead of each other as the scene is large.
            let stagger = if view % 2 == 1 { size } else { 0.0 };
            let pixel = |k: usize| {
                let (x, y) = ((k % 8 + k / 64 % 6 * 8) as f32, (k % 64 / 8 + k / 384 * 8) as f32);
                let ahead = 0.3 * spread * x + stagger * (k * 5 % 7) as f32 / 7.0;
                eye + across * x + down * y + way / way.length() * ahead
            };
            let rays: Vec<Ray> = (0..1152).map(|k| Ray::new(pixel(k), way)).collect();
            let sun = random.vec3() * [1.0, 1e-3, 1.0, 1e5, 1.0, 1.0][view];
            let lit = rays.iter().filter_map(|ray| Some((ray, brute.closest(ray)?)));
            let shadow = |(ray, hit): (&Ray, Hit)| {
                // Before the surface, on it as well as f32 can tell, and behind it.
                let share = [1.0 - 1e-4, 1.0, 1.0 + 1e-6][random.below(3)];
                let ray = Ray::new(ray.origin + ray.direction * (hit.t * share), sun);
                if random.below(9) == 0 { Ray { tmax: size / sun.length(), ..ray } } else { ray }
            };
            shadows.push(lit.map(shadow).collect());
            views.push(rays);
        }
        let [seen, shaded] = [views, shadows].map(|batches| assert_parity_of_batches(&world, &brute, &batches));
        assert!(seen > 1200 && (shaded > 120 || i == 3), "scene {i}: {seen}, {shaded}");
    }
}

/// A t beyond all numbers is no hit: of rays that start in one point, or run the same way.
#[test]
fn a_t_that_overflows_is_no_hit() {
    let corners = [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]].map(|[x, y]| Vec3::new(x, y, 0.0) * 1e8);
    let world = World::new(&scenes::of_mesh(Mesh::new(corners.to_vec(), vec![[0, 1, 2]]))).expect("sound");
    let way = Vec3::new(1e-33, 2e-33, -1e-29);
    for (height, expected) in [(1e10, 0), (1e9, 64)] {
        let at = |i: u8| Vec3::new(f32::from(i % 8), f32::from(i / 8), 0.0);
        let from = Vec3::new(1e6, 1e6, height);
        let side_by_side: Vec<Ray> = (0..64).map(|i| Ray::new(from + at(i) * 1e4, way)).collect();
        let fan: Vec<Ray> = (0..64).map(|i| Ray::new(from, way + at(i) * (1e-4 * way.length()))).collect();
        for rays in [side_by_side, fan] {
            assert_eq!(assert_parity_of_batches(&world, &Brute::new(&world), &[rays]), expected, "from {height:e}");
        }
    }
}

/// What lies behind a ray by a t that rounds to -0 is no hit, and ahead of it by one that rounds to 0 is one: alone, of
/// one point, side by side.
#[test]
fn a_t_that_vanishes_keeps_its_side() {
    let corners = [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let scene = scenes::of_mesh(Mesh::new(corners.to_vec(), vec![[0, 1, 2]]));
    let world = World::placed(&scene).expect("sound");
    for long in [1e19, 1e20, 1e24, 1e30] {
        for (height, expected) in [(-1e-26, 0), (1e-26, 64), (-1e-30, 0), (1e-30, 64), (0.0, 64)] {
            let at = |i: u8| Vec3::new(f32::from(i % 8), f32::from(i / 8), 0.0) / 16.0;
            let (from, way) = (Vec3::new(0.0, 0.0, height), Vec3::new(0.1, 0.2, -1.0) * long);
            let side_by_side: Vec<Ray> = (0..64).map(|i| Ray::new(from + at(i), way)).collect();
            let fan: Vec<Ray> = (0..64).map(|i| Ray::new(from, way + at(i) * long)).collect();
            for rays in [side_by_side, fan] {
                assert_eq!(assert_parity(&scene, &rays), expected, "alone, from {height:e}, length {long:e}");
                let hits = assert_parity_of_batches(&world, &Brute::new(&world), &[rays]);
                assert_eq!(hits, expected, "from {height:e}, length {long:e}");
            }
        }
    }
}

/// What overflows in f32 on the way is neither lost for it nor believed.
#[test]
fn products_that_overflow() {
    let mesh = |triangles: &[[[f32; 3]; 3]]| {
        let corners = triangles.as_flattened().iter().map(|&p| Vec3::from(p)).collect();
        Mesh::new(corners, (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    };
    let ahead = |z: f32, w: f32| [[-w, -w, z], [3.0 * w, -w, z], [-w, 3.0 * w, z]];
    // Edges of 1e12 far up along a ray as steep as a bundle takes it, beside a triangle that makes the ray enter their
    // leaf.
    let beyond = [[-1.7e18, -1.7e18, 1.7e18], [-1.7e18 + 1e12, -1.7e18, 1.7e18], [-1.7e18, -1.7e18 + 1e12, 1.7e18]];
    let steep = [[1.8e18, -1.8e18, 0.0], [1.8e18, 1.8e18, -1.8e18], [-1.8e18, -1.7e18, 1.8e18]];
    // As many as make a bundle, from the one to the other.
    let many = |first: Vec3, second: Vec3| -> Vec<Ray> {
        (0..64_u8).map(|i| Ray::new(Vec3::ZERO, first.lerp(second, f32::from(i) / 63.0))).collect()
    };
    let level = many(Vec3::new(0.3, 0.2, 1.0), Vec3::new(0.31, 0.2, 1.0));
    let oblique = many(Vec3::new(0.9, 0.9, 1.0), Vec3::new(16.0, 16.0, 1.0));
    let short = many(Vec3::new(0.3, 0.2, 1.0) * 1e-30, Vec3::new(0.3, 0.21, 1.0) * 1e-30);
    // To the edge, and to a corner, of triangles whose volumes just stay within f32.
    let edge = many(Vec3::new(0.5, 0.5, 0.5), Vec3::new(0.499_999_7, 0.500_000_3, 0.500_000_1));
    let corner = many(Vec3::new(3.0, -1.0, 1.0), Vec3::new(2.999_999, -0.999_999, 1.0));
    // And how many rays hit something, however far off.
    let cases = [
        (mesh(&[ahead(1e13, 2e13), ahead(2e13, 4e13)]), level.clone(), 64),
        (mesh(&[ahead(2e13, 4e13), ahead(1e13, 2e13)]), level.clone(), 64),
        (mesh(&[ahead(2e11, 2e11)]), edge.clone(), 45),
        (mesh(&[ahead(2e11, 2e11)]), corner.clone(), 11),
        (mesh(&[ahead(5e11, 4e11), ahead(3e11, 3e11)]), edge, 64),
        (mesh(&[ahead(6e11, 6e11)]), corner, 45),
        (mesh(&[ahead(3e8, 3e7)]), many(Vec3::new(0.1, 0.05, 1.0), Vec3::new(0.1, 0.06, 1.0)), 64),
        // Their t is no number that f32 has.
        (mesh(&[ahead(1e10, 2e10)]), short, 0),
        (mesh(&[ahead(0.01, 5e9)]), level, 64),
        (mesh(&[steep]), oblique.clone(), 64),
        (mesh(&[steep, beyond]), oblique, 64),
    ];
    for (mesh, rays, expected) in cases {
        let scene = scenes::of_mesh(mesh);
        for tmax in [f32::INFINITY, 1e9, 1e10, 1e14, 3e13] {
            for tmin in [0.0, 1e-3] {
                let within: Vec<Ray> = rays.iter().map(|ray| Ray { tmin, tmax, ..*ray }).collect();
                let hits = assert_parity(&scene, &within);
                assert!(tmax < f32::INFINITY || hits == expected, "{hits} hits of {:?}", rays[0]);
            }
        }
    }
}

/// Shadow rays that are so much longer than the scene is wide that only products with their lengths overflow.
#[test]
fn shadow_rays_from_far_away() {
    // What all coordinates of rays are multiples of, so that they end in one point indeed.
    const STEP: f32 = 33_554_432.0;
    let (across, high) = (439_999_266_816.0, 549_990_694_912.0);
    let corners = [[across, high, -high], [across, -high, high], [-across, -high, -high]].map(Vec3::from);
    let light = Vec3::new(2459.0, 0.0, 1639.0) * STEP;
    let mut random = Random::new(6);
    // Close to the edges, some outside.
    let rays = (0..64 * 60).map(|_| {
        let side = random.below(3);
        let along = corners[side].lerp(corners[(side + 1) % 3], random.unit());
        let towards = along + (corners[(side + 2) % 3] - along) * (random.unit() - 0.2) * 0.05;
        let direction = ((light - towards) * 600.0 / STEP).round() * STEP;
        Ray { tmax: 1.0, ..Ray::new(light - direction, direction) }
    });
    let mut rays: Vec<Ray> = rays.collect();
    // Next to each other what goes the same way.
    rays.sort_by(|a, b| a.direction.x.total_cmp(&b.direction.x));
    assert!(rays.iter().all(|ray| ray.origin + ray.direction == light));
    let hits = assert_parity(&scenes::of_mesh(Mesh::new(corners.to_vec(), vec![[0, 1, 2]])), &rays);
    assert!(hits > 2000 && hits < rays.len(), "{hits} of {} hits", rays.len());
}

/// Numbers so small that they are multiples of the least: of boxes that are entered so soon none is left out, and of
/// triangles in one place the first is hit.
#[test]
fn numbers_that_are_not_normal() {
    for scale in [0.01, 1e-5] {
        let square = [Vec3::ZERO, Vec3::X, Vec3::ONE - Vec3::Z, Vec3::Y].map(|corner| corner * scale);
        let triangles = (0..40).flat_map(|_| [[0, 1, 2], [0, 2, 3]]).collect();
        let world = World::new(&scenes::of_mesh(Mesh::new(square.to_vec(), triangles))).expect("sound");
        let (mut random, centre) = (Random::new(8), world.centre.as_vec3());
        let rays = (0..2000).map(|i| {
            let beside = 1.0 + (random.unit() - 0.5) * [1e-7, 1e-6, 1e-3][i % 3];
            let origin = (Vec3::new(2.0, -1.25, 1.1) + random.vec3() * 0.2) * scale;
            let target = square[1].lerp(square[2], random.unit()) * Vec3::new(beside, 1.0, 1.0);
            Ray::new(origin - centre, (target - origin) / scale * [9e37, 6e37, 3e37][i / 3 % 3])
        });
        let rays: Vec<Ray> = rays.collect();
        let hits = assert_parity_of(&world, &Brute::new(&world), &rays);
        assert!(hits > 500 && hits < 1500, "{hits} of {} hits", rays.len());
    }

    // Corners as close as that to where rays start.
    let near = [[0.0, 0.0, 2e-39], [1e-38, 1e-38, 4e-39], [2e-38, 1e-38, 4e-39]].map(Vec3::from);
    let mesh = Mesh::new(near.into_iter().chain(near.map(|corner| -corner)).collect(), vec![[0, 1, 2], [3, 4, 5]]);
    let rays = (0..64_u8).map(|i| {
        let (p, q) = (f32::from(i % 8) / 8.0, f32::from(i / 8) / 8.0);
        Ray::new(Vec3::ZERO, Vec3::new(0.1 + p * 0.8, 0.05 + q * 0.8, 1.0))
    });
    let hits = assert_parity(&scenes::of_mesh(mesh), &rays.collect::<Vec<_>>());
    assert!(hits > 10, "{hits} hits");

    // Rays through the corner of a box, at t = 2^-104 and exactly: what is a share of such lengths vanishes.
    let (mut random, least) = (Random::new(12), f32::from_bits(1));
    let mut hits = 0;
    for _ in 0..12 {
        let mut number = || ((random.unit() - 0.5) * 8e5).round();
        let corner = Vec3::new(number(), number(), number());
        let [b, c] = [0.2, 0.7].map(|share| (corner * Vec3::new(share, 0.5, 1.0 - share)).round());
        let corners = [corner, b, c].map(|corner| corner * least);
        let mirrored = corners.map(|corner| -corner);
        let mesh = Mesh::new([corners, mirrored].concat(), vec![[0, 1, 2], [3, 4, 5]]);
        let rays = (0..100).map(|i| {
            let (origin, corner) = (Vec3::new(number(), number(), number()), if i % 2 == 0 { corner } else { -corner });
            Ray::new(origin * least, (corner - origin) * 2.0_f32.powi(-45))
        });
        hits += assert_parity(&scenes::of_mesh(mesh), &rays.collect::<Vec<_>>());
    }
    assert_eq!(hits, 1200);
}

/// A ray that is rounded in an object's coordinates may meet a shape which it passes in the world.
#[test]
fn shapes_that_only_the_rounded_ray_meets() {
    use twincast::math::{DAffine3, DVec3};
    use twincast::scene::Geometry;
    use twincast::{Cuboid, Shape};
    let cuboid = |min: [f32; 3], max: [f32; 3]| Shape::Cuboid(Cuboid::new(min.into(), max.into()).expect("a box"));
    let shapes = vec![cuboid([9.0; 3], [10.0, 10.00002, 10.0]), cuboid([-10.0; 3], [-9.0; 3])];
    let mut scene = Scene::from_geometries(vec![Geometry::Shapes { shapes, material: 0 }], vec![Default::default()]);
    scene.instances[0].transform = DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_4);
    assert!(scene.instances[0].transform.transform_point3(DVec3::ZERO) == DVec3::ZERO);
    let ray = |y: f32| Ray::new(Vec3::new(9.5, y, 1000.00037), Vec3::NEG_Z);
    let rays: Vec<Ray> = (-40..=40).map(|i| ray(0.707_140_9 + i as f32 * 1e-6)).collect();
    let hits = assert_parity(&scene, &rays);
    assert!(hits > 0 && hits < rays.len(), "{hits} hits");
    // Whoever counts what a ray cannot but look at counts what it hits.
    let bvh = Bvh::build(&World::new(&scene).expect("sound"));
    for ray in rays.iter().filter(|ray| bvh.closest(ray).is_some()) {
        let steps = bvh.steps(ray);
        assert!(steps.objects == 1 && steps.shapes > 0, "{steps:?} {ray:?}");
    }
}

/// Bundles whose rays are farther apart than triangles are large, so that each leaf concerns a few of them; some aimed
/// at corners and edges, some with ranges that begin or end at their hit, and shadow rays that start at corners. In the
/// world and placed.
#[test]
fn triangles_smaller_than_pixels() {
    // Squares, and with the last one distances from far away, leave f32.
    for (scale, views) in [(1.0, 6), (1e-12, 3), (1e13, 3), (1e18, 3)] {
        let hits = hits_of_small_triangles(scale, views);
        assert!(hits > 160 * views, "at {scale:e}, of {views} views, {hits} hits");
    }
}

/// Hits of everything that is cast from so many views, scenes being as large as said.
fn hits_of_small_triangles(scale: f32, views: usize) -> usize {
    use twincast::math::{DAffine3, DQuat, DVec3};
    let mut mesh = scenes::bumpy_sphere(24, 0.2, 11);
    let positions = mesh.positions.iter().map(|position| *position * scale).collect();
    mesh.positions = std::sync::Arc::new(positions);
    let mut placed = scenes::of_mesh(mesh.clone());
    let first = placed.instances.pop().expect("one instance");
    let turned = |i: f64| {
        let turn = DQuat::from_scaled_axis(DVec3::new(i, 0.7, -0.2 * i));
        DAffine3::from_scale_rotation_translation(
            DVec3::new(1.0, 0.8, 1.3),
            turn,
            DVec3::new(0.4 * i - 0.6, 0.1, 0.3 * i) * f64::from(scale),
        )
    };
    let transforms = [0.0, 1.0, 2.0].map(turned);
    let instance = |transform| twincast::scene::Instance { transform, ..first.clone() };
    placed.instances.extend(transforms.map(instance));
    let mut hits = 0;
    for (scene, transforms) in [(scenes::of_mesh(mesh.clone()), &[DAffine3::IDENTITY][..]), (placed, &transforms[..])] {
        let world = World::new(&scene).expect("sound");
        let brute = Brute::new(&world);
        let mut random = Random::new(21);
        let end_at_hits = |rays: &mut [Ray], random: &mut Random| {
            for ray in rays.iter_mut().step_by(5) {
                let Some(hit) = brute.closest(ray) else { continue };
                match random.below(4) {
                    0 => ray.tmin = hit.t,
                    1 => ray.tmin = hit.t.next_up(),
                    2 => ray.tmax = hit.t,
                    _ => ray.tmax = hit.t.next_down(),
                }
            }
        };
        let mut batches = Vec::new();
        for view in 0..views {
            let eye = (Vec3::ONE + random.vec3() * 0.5) * [3.0, 30.0, 1000.0][view % 3] * scale;
            let corner = |random: &mut Random| {
                let transform = transforms[random.below(transforms.len())];
                let at = |i: u32| transform.transform_point3(mesh.positions[i as usize].as_dvec3()).as_vec3();
                let [a, b, _] = mesh.triangles[random.below(mesh.triangles.len())];
                if random.unit() < 0.5 { at(a) } else { at(a).lerp(at(b), random.unit()) }
            };
            let mut rays: Vec<Ray> = (0..256)
                .map(|k| Ray::new(eye, if k % 3 == 0 { corner(&mut random) } else { random.vec3() * scale } - eye))
                .collect();
            let shadow = |k: usize| {
                let start = match k % 3 {
                    0 => corner(&mut random),
                    1 => random.vec3() * 1.5 * scale,
                    _ => rays[k].origin + rays[k].direction * brute.closest(&rays[k]).map_or(0.999, |hit| hit.t),
                };
                Ray { tmax: [1.0, 0.999][k % 2], ..Ray::new(start, eye - start) }
            };
            let mut shadows: Vec<Ray> = (0..256).map(shadow).collect();
            end_at_hits(&mut rays, &mut random);
            end_at_hits(&mut shadows, &mut random);
            batches.extend([rays, shadows]);
        }
        hits += assert_parity_of_batches(&world, &brute, &batches);
    }
    hits
}

/// A tree fitted to moved vertices gives the hits of brute force; one for other triangles is refused.
#[test]
fn refitted_trees() {
    let mut random = Random::new(3);
    let before = scenes::bumpy_sphere(30, 0.2, 7);
    let mut after = before.clone();
    let moved = before.positions.iter().map(|p| *p * 1.5 + random.vec3() * 0.2 + Vec3::X).collect::<Vec<_>>();
    after.positions = moved.into();
    let rays = scenes::rays(2000, &after.positions.clone(), 5);
    let [before, after] = [before, after].map(|mesh| World::new(&scenes::of_mesh(mesh)).expect("sound"));
    let brute = Brute::new(&after);
    let instanced = World::new(&scenes::instanced(5)).expect("sound");
    for preset in Preset::ALL {
        let mut bvh = Bvh::build_with(&before, preset.into());
        bvh.refit(&after).expect("the same triangles");
        let expected: Vec<Option<Hit>> = rays.iter().map(|ray| brute.closest(ray)).collect();
        assert!(expected.iter().flatten().count() > 500);
        for travel in [Travel::Alone, Travel::InFlight] {
            bvh = bvh.travelling(travel);
            let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
            bvh.closest_batch(&rays, &mut hits, Batch::default());
            bvh.occluded_batch(&rays, &mut occluded, Batch::default());
            for (i, ray) in rays.iter().enumerate() {
                assert_eq!(hits[i], expected[i], "{preset:?} {travel:?} {ray:?}");
                assert_eq!(occluded[i], expected[i].is_some(), "{preset:?} {travel:?} {ray:?}");
            }
        }
        let error = bvh.refit(&instanced).expect_err("other objects");
        assert!(error.to_string().contains("build the tree anew"), "{error}");
        let fewer = World::new(&scenes::of_mesh(scenes::bumpy_sphere(29, 0.2, 7))).expect("sound");
        assert!(bvh.refit(&fewer).is_err());

        let mut broken = scenes::bumpy_sphere(30, 0.2, 7);
        std::sync::Arc::make_mut(&mut broken.positions)[5] = Vec3::NAN;
        let broken = World::new(&scenes::of_mesh(broken)).expect("sound");
        assert!(Bvh::build_with(&before, preset.into()).refit(&broken).is_err(), "triangles that vanish");
        assert!(Bvh::build_with(&broken, preset.into()).refit(&before).is_err(), "triangles that appear");

        let mut bvh = Bvh::build_with(&instanced, preset.into());
        bvh.refit(&instanced).expect("the same");
        let fresh = Bvh::build_with(&instanced, preset.into());
        assert!(rays.iter().all(|ray| bvh.closest(ray) == fresh.closest(ray)));
    }
}
