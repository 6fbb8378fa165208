//! Rays that go together: from one point, to one point, or the same way.

use super::*;

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
