//! What moves, held against what stands still: at each time everything is where it would have been put.

use twincast::io::{LoadOptions, load};
use twincast::math::{DAffine3, DQuat, DVec3, Vec3, Vec4};
use twincast::render::Control;
use twincast::scene::{Camera, Geometry, Group, Instance, Material, Projection};
use twincast::trace::brute::Brute;
use twincast::trace::bvh::Bvh;
use twincast::{Plane, Ray, Renderer, Scene, Settings, Shape, Tracer, World};

use crate::brute_force::assert_parity;
use crate::scenes::{self, Random};

/// Interpolates as f32 can say it without rounding: entries are small multiples of 2^-4, times of 2^-3.
fn coarse(transform: &DAffine3) -> DAffine3 {
    DAffine3::from_cols_array(&transform.to_cols_array().map(|x| (x * 16.0).round() / 16.0))
}

/// Meshes, balls and planes, of which most move: they turn, grow, shear, or fly away.
fn scene(seed: u64) -> Scene {
    let mut scene = scenes::instanced(seed);
    let plane = Shape::Plane(Plane::new(Vec3::Y * -3.0, Vec3::new(0.1, 1.0, 0.0)).expect("a normal"));
    scene.geometries.push(Geometry::Shapes { shapes: vec![plane], material: 0 });
    scene.groups.push(Group { name: String::new(), geometries: 3..4 });
    for group in [0, 3, 3] {
        let transform = DAffine3::from_translation(DVec3::splat(f64::from(group)));
        scene.instances.push(Instance { name: String::new(), group, transform, transform_end: None });
    }
    let mut random = Random::new(seed + 50);
    for (i, instance) in scene.instances.iter_mut().enumerate() {
        instance.transform = coarse(&instance.transform);
        let turn = DQuat::from_scaled_axis(random.vec3().as_dvec3());
        let scale = DVec3::splat(1.0) + random.vec3().as_dvec3() * 0.4;
        let away = random.vec3().as_dvec3() * [0.5, 3.0][i % 2];
        let moved = DAffine3::from_scale_rotation_translation(scale, turn, away) * instance.transform;
        instance.transform_end = (i % 4 != 3).then(|| coarse(&moved));
    }
    scene
}

/// The scene at one time, with nothing that moves.
fn frozen(scene: &Scene, time: f64) -> Scene {
    let mut scene = scene.clone();
    for instance in &mut scene.instances {
        if let Some(end) = instance.transform_end.take() {
            let [a, b] = [&instance.transform, &end].map(|transform| transform.to_cols_array());
            let between = std::array::from_fn(|i| a[i] * (1.0 - time) + b[i] * time);
            instance.transform = DAffine3::from_cols_array(&between);
        }
    }
    scene
}

fn rays(count: usize, time: f32, seed: u64) -> Vec<Ray> {
    let targets: Vec<Vec3> = (0..200).scan(Random::new(seed), |random, _| Some(random.vec3() * 3.0)).collect();
    let aimed = scenes::rays(count, &targets, seed).into_iter();
    aimed.map(|ray| Ray { origin: ray.origin * 2.0, time, ..ray }).collect()
}

/// The very hits of the scene that stands still, by its own code: t, ids and parameters.
#[test]
fn at_each_time_things_are_where_they_should_be() {
    let scene = scene(3);
    let world = World::new(&scene).expect("sound");
    assert!(world.moves());
    let (brute, bvh) = (Brute::new(&world), Bvh::build(&world));
    let (mut hits, mut elsewhere) = (0, 0);
    let at_start = Brute::new(&World::new(&frozen(&scene, 0.0)).expect("sound"));
    for step in 0..=8u8 {
        let time = f32::from(step) / 8.0;
        let still = World::new(&frozen(&scene, f64::from(time))).expect("sound");
        assert!(!still.moves());
        assert_eq!(still.centre, world.centre, "or else rounding would differ");
        let expected = Brute::new(&still);
        for ray in rays(1500, time, u64::from(step)) {
            let hit = expected.closest(&ray);
            assert_eq!(brute.closest(&ray), hit, "brute force at {time}: {ray:?}");
            assert_eq!(bvh.closest(&ray), hit, "native at {time}: {ray:?}");
            hits += usize::from(hit.is_some());
            elsewhere += usize::from(at_start.closest(&ray) != hit);
        }
    }
    for (odd, time) in [(f32::NAN, 0.0), (-1.0, 0.0), (7.0, 1.0)] {
        for ray in rays(200, time, 99) {
            let odd = Ray { time: odd, ..ray };
            assert_eq!((brute.closest(&odd), bvh.closest(&odd)), (brute.closest(&ray), bvh.closest(&ray)), "{odd:?}");
        }
    }
    assert!(hits > 2000 && elsewhere > 1000, "{hits} hits, {elsewhere} of them by motion");
}

#[test]
fn every_tracer_gives_the_same_hits_at_mixed_times() {
    let mut random = Random::new(8);
    let mixed: Vec<Ray> = rays(3000, 0.0, 77).into_iter().map(|ray| Ray { time: random.unit(), ..ray }).collect();
    assert!(assert_parity(&scene(4), &mixed) > 300);
    // Of one origin, so that they are bundles.
    let eye = Vec3::new(0.5, 0.25, 9.0);
    let camera: Vec<Ray> = (0..2048)
        .map(|i| {
            let (x, y) = ((i % 8 + i / 64 % 4 * 8) as f32, (i / 8 % 8 + i / 256 * 8) as f32);
            let direction = Vec3::new(x / 32.0 - 0.5, y / 64.0 - 0.5, -1.0);
            Ray { time: random.unit(), ..Ray::new(eye, direction) }
        })
        .collect();
    assert!(assert_parity(&scene(5), &camera) > 300);
}

#[test]
fn all_hits_and_closest_points() {
    let scene = scene(6);
    let bvh = Bvh::build(&World::new(&scene).expect("sound"));
    let still = |time| Bvh::build(&World::new(&frozen(&scene, time)).expect("sound"));
    let (mut all, mut expected, mut count) = (Vec::new(), Vec::new(), 0);
    let at = still(0.625);
    for ray in rays(1000, 0.625, 9) {
        bvh.all_hits(&ray, &mut all);
        at.all_hits(&ray, &mut expected);
        assert_eq!(all, expected, "{ray:?}");
        count += all.len();
    }
    assert!(count > 1000, "{count} hits");
    let (start, mut random) = (still(0.0), Random::new(4));
    for _ in 0..500 {
        let point = random.vec3() * 6.0;
        assert_eq!(bvh.closest_point(point, 3.0), start.closest_point(point, 3.0), "{point}");
    }
}

#[cfg(feature = "embree")]
#[test]
fn embree_agrees_but_for_ties_and_boundary_rays() {
    use twincast::lab::compare::shoot;
    use twincast::lab::{Paired, PixelReport, Report};
    use twincast::trace::embree::Embree;
    let world = World::new(&scene(7)).expect("sound");
    let (native, embree) = (Bvh::build(&world), Embree::new(&world, &Default::default()).expect("built"));
    let paired = Paired::new(&world, &native, &embree, None);
    shoot(&paired, &world, 20_000, 3, Control::default()).expect("nobody interrupts");
    let report = Report::new("motion", &world, paired.tally(), &PixelReport::default());
    assert_eq!((report.native_wrong, report.embree_wrong), (0, 0), "{report}");
    assert!(report.agree > 18_000, "a quarter of the rays goes through corners and edges: {report}");
}

/// A glowing strip 2 wide that moves by 8 passes a point for a quarter of the time.
#[test]
fn what_passes_is_as_bright_as_it_stays() {
    let glow = Material { diffuse: Vec3::ZERO, ambient: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
    let strip = twincast::scene::Mesh::new(
        [(-5.0, -9.0), (-3.0, -9.0), (-3.0, 9.0), (-5.0, 9.0)].map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
        vec![[0, 1, 2], [0, 2, 3]],
    );
    let mut scene = Scene::from_geometries(vec![Geometry::Mesh(strip)], vec![glow]);
    scene.instances[0].transform_end = Some(DAffine3::from_translation(DVec3::X * 8.0));
    let world = World::new(&scene).expect("sound");
    let bvh = Bvh::build(&world);
    let camera = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 1.0).expect("a view");
    let camera = Camera { projection: Projection::Orthographic(1e-3), ..camera };
    let bright = |shutter: [f32; 2]| {
        let settings = Settings { width: 1, height: 1, spp: 1024, ..Settings::default() };
        let camera = Camera { shutter, ..camera.clone() };
        Renderer::new(&scene, &world, camera, settings).expect("sound").pixel(&bvh, 0, 0).x
    };
    // From x = -1 over the middle to x = 1: between times 3/8 and 5/8.
    for (shutter, expected) in [([0.0, 1.0], 0.25), ([0.0, 0.5], 0.25), ([0.375, 0.625], 1.0), ([0.7, 1.0], 0.0)] {
        let got = bright(shutter);
        assert!((got - expected).abs() < 2e-3, "{shutter:?}: {got}, not {expected}");
    }
    assert_eq!(bright([0.5, 0.5]), 1.0, "an instant");
    let refused = Renderer::new(&scene, &world, Camera { shutter: [0.6, 0.4], ..camera }, Settings::default());
    assert!(refused.expect_err("it closes before it opens").to_string().contains("shutter from 0.6 to 0.4"));
}

/// Bumps turn along with what they are on: at one instant all is as if it stood still.
#[test]
fn maps_of_normals_move_along() {
    use twincast::scene::{Mesh, Texture};
    let pixels =
        (0..64u32).map(|i| [40 + (i * 37 % 170) as u8, 60 + (i * 53 % 150) as u8, 220, 255]).collect::<Vec<_>>().into();
    let map = Texture { width: 8, height: 8, pixels, ..Texture::default() };
    let mesh = Mesh::new(
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
        vec![[0, 1, 2], [0, 2, 3]],
    );
    let mesh = Mesh { uvs: mesh.positions.iter().map(|p| p.truncate()).collect(), ..mesh };
    let material = Material { normal_texture: Some(0), ..Material::default() };
    let mut scene = Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![material]);
    scene.textures = vec![map];
    let turn = DAffine3::from_quat(DQuat::from_xyzw(0.0, 0.0, 1.0, 1.0).normalize());
    scene.instances[0].transform_end = Some(turn);
    let still = Scene {
        instances: vec![Instance { transform: turn, transform_end: None, ..scene.instances[0].clone() }],
        ..scene.clone()
    };
    let camera = Camera::look_at(DVec3::Z * 3.0, DVec3::ZERO, DVec3::Y, 1.0).expect("a view");
    let camera = Camera { shutter: [1.0, 1.0], ..camera };
    let picture = |scene: &Scene| {
        let world = World::new(scene).expect("sound");
        let settings = Settings { width: 24, height: 24, spp: 1, ..Settings::default() };
        let renderer = Renderer::new(scene, &world, camera.clone(), settings).expect("sound");
        renderer.render(&Bvh::build(&world), Control::default()).expect("nobody interrupts").pixels
    };
    let (moved, expected) = (picture(&scene), picture(&still));
    let apart = moved.iter().zip(&expected).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
    assert!(apart < 1e-3, "{apart}");
    let at_start =
        picture(&Scene { instances: vec![Instance { transform_end: None, ..scene.instances[0].clone() }], ..scene });
    assert!(at_start.iter().zip(&expected).any(|(a, b)| (*a - *b).abs().max_element() > 0.05), "it shows");
}

/// A mirror and a shadow see the time of the ray that came there.
#[test]
fn rays_that_go_on_keep_their_time() {
    let glow = Material { diffuse: Vec3::ZERO, ambient: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
    let mirror = Material { diffuse: Vec3::ZERO, ambient: Vec3::ZERO, reflection: Vec3::ONE, ..Material::default() };
    let square = |half: f32, z: f32, material| {
        let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
        let mesh =
            twincast::scene::Mesh::new(corners.map(|(x, y)| Vec3::new(x, y, z)).to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
        Geometry::Mesh(twincast::scene::Mesh { material, ..mesh })
    };
    let mut scene = Scene::from_geometries(vec![square(9.0, 0.0, 0), square(1.0, 10.0, 1)], vec![mirror, glow]);
    scene.groups = [0..1, 1..2].map(|geometries| Group { name: String::new(), geometries }).into();
    let behind = Instance { group: 1, ..scene.instances[0].clone() };
    scene.instances.push(Instance {
        transform: DAffine3::from_translation(DVec3::X * -4.0),
        transform_end: Some(DAffine3::from_translation(DVec3::X * 4.0)),
        ..behind
    });
    let world = World::new(&scene).expect("sound");
    let camera = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 1.0).expect("a view");
    let camera = Camera { projection: Projection::Orthographic(1e-3), ..camera };
    let settings = Settings { width: 1, height: 1, spp: 1024, ..Settings::default() };
    let pixel = Renderer::new(&scene, &world, camera, settings).expect("sound").pixel(&Bvh::build(&world), 0, 0);
    assert!((pixel - Vec4::new(0.25, 0.25, 0.25, 1.0)).abs().max_element() < 2e-3, "{pixel}");
}

/// A camera that moves one way sees what one that stands sees of a thing that moves the other way.
#[test]
fn a_moving_camera_is_as_things_that_move_the_other_way() {
    let away = DVec3::new(0.75, -0.25, 0.5);
    let still = {
        let mut scene = scene(11);
        scene.instances.iter_mut().for_each(|instance| instance.transform_end = None);
        // The plane without end would not be as far from the camera.
        scene.instances.retain(|instance| instance.group != 3);
        scene
    };
    let mut moving = still.clone();
    for instance in &mut moving.instances {
        instance.transform_end = Some(DAffine3::from_translation(-away) * instance.transform);
    }
    let camera = Camera::look_at(DVec3::new(1.0, 2.0, 9.0), DVec3::ZERO, DVec3::Y, 0.9).expect("a view");
    let lens = Some(twincast::scene::ThinLens { radius: 0.05, focus: 8.0, blades: 0 });
    let wide = Projection::Orthographic(7.0);
    for camera in [camera.clone(), Camera { lens, ..camera.clone() }, Camera { projection: wide, ..camera }] {
        let end = Some(twincast::scene::Pose { eye: camera.eye + away, frame: camera.frame });
        let picture = |scene: &Scene, camera: Camera, shutter| {
            let world = World::new(scene).expect("sound");
            let settings = Settings { width: 40, height: 30, spp: 8, ..Settings::default() };
            let sun = twincast::scene::Light::Directional {
                direction: DVec3::new(-1.0, -2.0, -1.0).normalize(),
                color: Vec3::ONE,
            };
            let scene = Scene { lights: vec![sun], ..scene.clone() };
            let renderer = Renderer::new(&scene, &world, Camera { shutter, ..camera }, settings).expect("sound");
            renderer.render(&Bvh::build(&world), Control::default()).expect("nobody interrupts").pixels
        };
        for shutter in [[0.0, 1.0], [0.25, 0.5]] {
            let expected = picture(&moving, camera.clone(), shutter);
            let got = picture(&still, Camera { end, ..camera.clone() }, shutter);
            let differs = |(a, b): &(&Vec4, &Vec4)| (**a - **b).abs().max_element() > 1e-3;
            // Both round their coordinates, each in its own way: rays by an edge may part.
            let differing = expected.iter().zip(&got).filter(differs).count();
            assert!(differing <= 12, "{differing} of 1200 pixels");
            let resting = picture(&still, camera.clone(), shutter);
            let moved = resting.iter().zip(&got).filter(differs).count();
            assert!(moved > 300, "it shows: {moved}");
        }
    }
}

/// At one instant it is a camera that stands where the journey is then: half-way round an axis, half-way along a line.
#[test]
fn at_each_instant_a_moving_camera_stands_somewhere() {
    let up = DVec3::Y;
    let from = |degrees: f64, eye: DVec3| {
        let angle = degrees.to_radians();
        Camera::look_at(eye, eye + DVec3::new(angle.sin(), 0.0, -angle.cos()), up, 0.8).expect("a view")
    };
    let eye = DVec3::new(1e6, 2.0, -3.0);
    let mut world = World::default();
    world.centre.x = 1e6;
    let scene = Scene::default();
    let settings = Settings { width: 16, height: 16, spp: 2, ..Settings::default() };
    let moving = Camera { end: Some(from(90.0, eye + DVec3::Z * 4.0).pose(0.0)), ..from(0.0, eye) };
    let ray = |camera: &Camera, x, y| {
        let renderer = Renderer::new(&scene, &world, camera.clone(), settings.clone()).expect("sound");
        renderer.camera_ray(x, y, 1)
    };
    for time in [0.0f32, 1.0 / 3.0, 0.75, 1.0] {
        let standing = from(90.0 * f64::from(time), eye + DVec3::Z * (4.0 * f64::from(time)));
        let moving = Camera { shutter: [time, time], ..moving.clone() };
        for (x, y) in [(0, 0), (15, 3), (8, 15)] {
            let (got, expected) = (ray(&moving, x, y), ray(&standing, x, y));
            assert_eq!(got.time, time);
            assert!((got.origin - expected.origin).length() < 1e-6, "{time}: {got:?} {expected:?}");
            assert!((got.direction - expected.direction).length() < 1e-6, "{time}: {got:?} {expected:?}");
        }
    }
}

#[test]
fn files_say_where_cameras_go() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("camera.toml");
    let load_with = |keys: &str| {
        let text = format!(
            "[[camera]]\neye = [0, 0, 5]\nlook_at = [0, 0, 0]\n{keys}\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n"
        );
        std::fs::write(&path, text).expect("written");
        load(&path, &LoadOptions::default())
    };
    let (scene, _) = load_with("").expect("sound");
    assert_eq!(scene.cameras[0].end, None);
    let (scene, _) = load_with("eye_end = [5, 0, 0]").expect("sound");
    let end = scene.cameras[0].end.expect("it moves");
    assert!(end.eye == DVec3::X * 5.0 && (end.frame.z_axis - DVec3::X).length() < 1e-15, "{end:?}");
    let (scene, _) = load_with("up_end = [1, 0, 0]").expect("sound");
    let end = scene.cameras[0].end.expect("it rolls");
    assert!(end.eye == DVec3::Z * 5.0 && (end.frame.y_axis - DVec3::X).length() < 1e-15, "{end:?}");
    let error = load_with("look_at_end = [0, 0, 5]").expect_err("nowhere to look").to_string();
    assert!(error.contains("camera.toml: line 4") && error.contains("at time 1"), "{error}");
}

#[test]
fn files_say_what_moves_and_are_refused_what_cannot() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("motion.toml");
    let text = |end: &str| {
        format!(
            "[[camera]]\neye = [0, 0, 5]\nlook_at = [0, 0, 0]\nshutter = [0.25, 0.5]\n\
             [[group.ball.sphere]]\ncentre = [0, 0, 0]\nradius = 1\n\
             [[group.pair.instance]]\ngroup = \"ball\"\nname = \"left\"\ntransform = {{ translate = [-2, 0, 0] }}\n\
             [[group.pair.instance]]\ngroup = \"ball\"\nname = \"right\"\ntransform_end = {{ translate = [0, 1, 0] }}\n\
             [[instance]]\ngroup = \"pair\"\ntransform = {{ scale = 2 }}\ntransform_end = {end}\n"
        )
    };
    std::fs::write(&path, text("[{ translate = [0, 0, 3] }, { scale = 4 }]")).expect("written");
    let (scene, _) = load(&path, &LoadOptions::default()).expect("sound");
    assert_eq!(scene.cameras[0].shutter, [0.25, 0.5]);
    let places: Vec<_> = scene.instances.iter().map(|i| (i.transform, i.transform_end)).collect();
    let scale = |s| DAffine3::from_scale(DVec3::splat(s));
    let moved = DAffine3::from_translation(DVec3::Z * 3.0) * scale(4.0);
    let (left, up) = (DAffine3::from_translation(DVec3::X * -2.0), DAffine3::from_translation(DVec3::Y));
    assert_eq!(places, [(scale(2.0) * left, Some(moved * left)), (scale(2.0), Some(moved * up))]);

    let backwards = text("{ scale = 4 }").replace("[0.25, 0.5]", "[0.5, 0.25]");
    std::fs::write(&path, backwards).expect("written");
    let error = load(&path, &LoadOptions::default()).expect_err("it closes before it opens");
    assert!(error.exit_code() == 3 && error.to_string().contains("motion.toml: line 4"), "{error}");

    std::fs::write(&path, text("{ rotate = [0, 1, 0, 180] }")).expect("written");
    let (scene, _) = load(&path, &LoadOptions::default()).expect("both ends are sound");
    let error = World::new(&scene).expect_err("it is flat on the way").to_string();
    assert!(error.contains("motion.toml: instance 0") && error.contains("pair/left"), "{error}");
    assert!(error.contains("singular") && error.contains("time"), "{error}");
}
