//! Objects in their places.

use super::*;

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
