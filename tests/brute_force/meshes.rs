//! Meshes that are odd: without area, one upon the other, in trees as deep as they get, moved.

use super::*;

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
