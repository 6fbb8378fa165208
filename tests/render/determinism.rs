//! What must not change a picture.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use twincast::math::{DAffine3, DVec3, Vec3, Vec4};
use twincast::render::{Control, Counted, TileOrder};
use twincast::scene::{Attenuation, Camera, Fov, Geometry, Instance, Integrator, Light, Material, Projection};
use twincast::{Batch, Error, Renderer, Scene, Settings, Width, World};

use super::{engines, floor, matte, render, settings, torus};

/// Shiny, smooth, mirrored, of glass, shadowed, with two lights: everything a picture depends on.
fn busy_scene(place: DVec3) -> Scene {
    let shiny = Material { specular: Vec3::splat(0.4), shininess: 20.0, ..matte(0.6) };
    let shiny = Material { reflection: Vec3::splat(0.3), transmission: Vec3::new(0.2, 0.3, 0.4), ..shiny };
    let mirror = Material { reflection: Vec3::splat(0.2), ..matte(0.8) };
    let mut scene =
        Scene::from_geometries(vec![Geometry::Mesh(torus(24, DVec3::ZERO)), floor(6.0, 1)], vec![shiny, mirror]);
    scene.groups[0].geometries = 0..1;
    scene.groups.push(twincast::scene::Group { name: String::new(), geometries: 1..2 });
    let below = DAffine3::from_translation(DVec3::Y * -1.5);
    scene.instances.push(Instance { name: String::new(), group: 1, transform: below, transform_end: None });
    scene.lights = vec![
        Light::Directional { direction: DVec3::new(-1.0, -2.0, -1.0).normalize(), color: Vec3::splat(0.7) },
        Light::Point {
            position: DVec3::new(2.0, 5.0, 3.0),
            color: Vec3::splat(20.0),
            attenuation: Attenuation::INVERSE_SQUARE,
            range: 30.0,
            radius: 0.0,
        },
    ];
    let camera = Camera::look_at(DVec3::new(4.0, 5.0, 7.0), DVec3::ZERO, DVec3::Y, 0.7).unwrap();
    scene.cameras = vec![camera];
    scene.transform(&DAffine3::from_translation(place));
    scene
}

pub(super) fn bits(pixels: &[Vec4]) -> Vec<[u32; 4]> {
    pixels.iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

/// The busy scene with all that paths know beside: glass that absorbs, gloss, what glows, light from all around.
pub(super) fn busier_scene() -> Scene {
    let mut scene = busy_scene(DVec3::ZERO);
    let absorption = Some(twincast::scene::Absorption { color: Vec3::new(0.5, 0.9, 0.7), distance: 0.5 });
    scene.materials[0] = Material { absorption, ..Material::glass(1.5) };
    scene.materials[1].gloss = Some(40.0);
    let lamp = twincast::Shape::Sphere(twincast::Sphere { centre: Vec3::new(-3.0, 2.0, 0.0), radius: 0.5 });
    scene.geometries.push(Geometry::Shapes { shapes: vec![lamp], material: 2 });
    scene.materials.push(Material { emission: Vec3::new(9.0, 5.0, 2.0), ..matte(0.2) });
    scene.groups.push(twincast::scene::Group { name: String::new(), geometries: 2..3 });
    let at_rest = Instance { name: String::new(), group: 2, transform: DAffine3::IDENTITY, transform_end: None };
    let beside = DAffine3::from_translation(DVec3::new(-2.0, 1.0, 0.5));
    let moved = DAffine3::from_translation(DVec3::new(-1.5, 1.5, 0.0)) * DAffine3::from_rotation_y(0.5);
    let flies = Instance { group: 1, transform: beside, transform_end: Some(moved), ..at_rest.clone() };
    scene.instances.extend([at_rest, flies]);
    let pixels = (0..128).map(|i| Vec4::new(0.1, 0.2, 0.3, 1.0) * (i % 5) as f32).collect();
    scene.environment = Some(twincast::scene::Environment::new(twincast::Image { width: 16, height: 8, pixels }));
    scene
}

#[test]
fn threads_tile_orders_and_packets_do_not_show() {
    let plain = Settings { tile_order: TileOrder::Scanline, seed: 5, ..settings(50, 37, 3) };
    check_bits(&busy_scene(DVec3::ZERO), &plain);
    for integrator in Integrator::ALL {
        check_bits(&busier_scene(), &Settings { integrator: Some(integrator), spp: 2, ..plain.clone() });
    }
}

fn check_bits(scene: &Scene, plain: &Settings) {
    let world = World::new(scene).unwrap();
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    for engine in engines(&world) {
        let picture = |settings: &Settings, threads| {
            pool(threads).install(|| render(scene, &scene.cameras[0], settings, &engine))
        };
        let reference = bits(&picture(plain, 1).pixels);
        assert_eq!(reference, bits(&picture(plain, 2).pixels), "{}: 2 threads", engine.name);
        for tile_order in [TileOrder::Hilbert, TileOrder::Spiral] {
            let settings = Settings { tile_order, ..plain.clone() };
            assert_eq!(reference, bits(&picture(&settings, 3).pixels), "{}: {tile_order:?}", engine.name);
        }
        if engine.name == "embree" {
            continue; // Its answers depend a little on the packet.
        }
        for (width, coherent) in Width::ALL.into_iter().zip([true, false, true, true]) {
            let settings = Settings { batch: Batch { width, coherent }, ..plain.clone() };
            assert_eq!(reference, bits(&picture(&settings, 2).pixels), "{}: {width:?}", engine.name);
        }
        let reseeded = bits(&picture(&Settings { seed: 6, ..plain.clone() }, 2).pixels);
        assert_ne!(reference, reseeded, "the seed does show");
    }
}

#[test]
fn a_pixel_alone_is_the_pixel_in_the_picture() {
    let scene = busier_scene();
    let world = World::new(&scene).unwrap();
    for integrator in Integrator::ALL {
        let settings = Settings { integrator: Some(integrator), ..settings(40, 35, 4) };
        check_pixels(&scene, &world, settings);
    }
}

fn check_pixels(scene: &Scene, world: &World, settings: Settings) {
    let renderer = Renderer::new(scene, world, scene.cameras[0].clone(), settings).unwrap();
    for engine in engines(world) {
        let image = renderer.render(&*engine.tracer, Control::default()).unwrap();
        for (x, y) in (0..40).step_by(3).zip((0..35).cycle().step_by(4)) {
            let alone = renderer.pixel(&*engine.tracer, x, y);
            assert_eq!(bits(&[alone]), bits(&[image.pixels[(y * 40 + x) as usize]]), "{} {x},{y}", engine.name);
        }
    }
}

#[test]
fn far_from_zero_the_picture_is_nearly_the_same() {
    let at = |place| {
        let scene = busy_scene(place);
        let world = World::new(&scene).unwrap();
        assert!((world.centre - place).length() < 100.0);
        let engines = engines(&world);
        render(&scene, &scene.cameras[0], &settings(60, 40, 1), &engines[0])
    };
    let (near, far) = (at(DVec3::ZERO), at(DVec3::new(1e7, -3e6, 2e7)));
    let differs = |(a, b): (&Vec4, &Vec4)| (*a - *b).abs().max_element() > 0.01;
    let differing = near.pixels.iter().zip(&far.pixels).filter(|&pair| differs(pair)).count();
    assert!(differing < 10, "{differing} of {} pixels", near.pixels.len());
    assert!(near.pixels.iter().any(|p| p.x > 0.2));
}

/// Placing a group a second time makes two levels of one; what is seen stays.
#[test]
fn instances_look_like_what_they_are_instances_of() {
    let one = busy_scene(DVec3::ZERO);
    let mut two = one.clone();
    let away = DAffine3::from_translation(DVec3::Y * -1000.0);
    two.instances.push(Instance { name: String::new(), group: 0, transform: away, transform_end: None });
    let picture = |scene: &Scene, placements| {
        let world = World::new(scene).unwrap();
        assert_eq!(world.placements.len(), placements);
        let engines = engines(&world);
        render(scene, &one.cameras[0], &settings(60, 40, 1), &engines[0])
    };
    let (baked, placed) = (picture(&one, 0), picture(&two, 2));
    let same = |(a, b): &(&Vec4, &Vec4)| (**a - **b).abs().max_element() < 1e-4;
    let equal = baked.pixels.iter().zip(&placed.pixels).filter(same).count();
    assert!(equal + 10 > baked.pixels.len(), "{equal}");
}

#[test]
fn only_planned_rays_are_traced() {
    let lit = busy_scene(DVec3::ZERO);
    let unlit = Scene { lights: Vec::new(), ..lit.clone() };
    let mut plain = lit.clone();
    for material in &mut plain.materials {
        (material.reflection, material.transmission) = (Vec3::ZERO, Vec3::ZERO);
    }
    for (scene, shadows, sends_on) in [(&lit, true, true), (&unlit, false, true), (&plain, true, false)] {
        let world = World::new(scene).unwrap();
        let renderer = Renderer::new(scene, &world, scene.cameras[0].clone(), settings(20, 10, 2)).unwrap();
        for engine in engines(&world) {
            let counted = Counted::new(&*engine.tracer);
            renderer.render(&counted, Control::default()).unwrap();
            assert_eq!(counted.closest_rays() > 400, sends_on, "{}", engine.name);
            assert_eq!(counted.occluded_rays() > 0, shadows, "{}", engine.name);
            assert!(counted.occluded_rays() <= 2 * counted.closest_rays());
        }
    }
}

#[test]
fn a_render_reports_its_tiles_and_stops_when_told() {
    let scene = busy_scene(DVec3::ZERO);
    let world = World::new(&scene).unwrap();
    let renderer = Renderer::new(&scene, &world, scene.cameras[0].clone(), settings(100, 50, 1)).unwrap();
    let engine = &*engines(&world)[0].tracer;
    let (done, cancel) = (AtomicU64::new(0), AtomicBool::new(false));
    let count = |pixels| {
        done.fetch_add(pixels, Ordering::Relaxed);
    };
    renderer.render(engine, Control { cancel: Some(&cancel), on_tile: Some(&count), ..Control::default() }).unwrap();
    assert_eq!(done.swap(0, Ordering::Relaxed), 5000);

    let stop = |pixels| {
        done.fetch_add(pixels, Ordering::Relaxed);
        cancel.store(true, Ordering::Relaxed);
    };
    let stopped =
        renderer.render(engine, Control { cancel: Some(&cancel), on_tile: Some(&stop), ..Control::default() });
    assert!(matches!(stopped, Err(Error::Interrupted)));
    assert!(done.load(Ordering::Relaxed) < 5000);
}

#[test]
fn a_framing_camera_sees_the_whole_bounds() {
    let scene = busy_scene(DVec3::new(-40.0, 3.0, 9.0));
    let (world, bounds) = (World::new(&scene).unwrap(), scene.bounds());
    // Large, so that the middles of the corner pixels are close to the film's corners.
    for (width, height) in [(30_000, 10_000), (10_000, 10_000), (4000, 16_000)] {
        let camera = Camera::framing(&bounds, f64::from(width) / f64::from(height));
        let renderer = Renderer::new(&scene, &world, camera.clone(), settings(width, height, 1)).unwrap();
        // Sides of the frustum from the corner pixels' rays; every corner of the bounds lies within all four.
        let ray = |x, y| renderer.camera_ray(x, y, 0).direction.as_dvec3();
        let (right, bottom) = (width - 1, height - 1);
        let rays = [ray(0, 0), ray(right, 0), ray(right, bottom), ray(0, bottom)];
        for corner in 0..8 {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
            let to_corner = DVec3::new(pick(0), pick(1), pick(2)) - camera.eye;
            for k in 0..4 {
                let inwards = rays[k].cross(rays[(k + 1) % 4]);
                assert!(inwards.dot(to_corner) > 0.0, "{width}x{height}: corner {corner} beyond side {k}");
            }
        }
    }
}

#[test]
fn impossible_settings_are_bad_usage() {
    let scene = busy_scene(DVec3::ZERO);
    let world = World::new(&scene).unwrap();
    for bad in [settings(0, 1, 1), settings(1, 0, 1), settings(1, 1, 0), settings(70_000, 1, 1)] {
        let refused = Renderer::new(&scene, &world, scene.cameras[0].clone(), bad);
        assert!(matches!(refused.err(), Some(Error::Usage(_))));
    }
    for fov_y in [0.0, -1.0, std::f64::consts::PI, f64::NAN] {
        let camera = Camera { projection: Projection::Perspective(Fov::Vertical(fov_y)), ..scene.cameras[0].clone() };
        assert!(matches!(Renderer::new(&scene, &world, camera, settings(1, 1, 1)).err(), Some(Error::Usage(_))));
    }
}

/// Wherever it lies, and for any integrator: the same bits.
#[test]
fn a_part_of_a_picture_is_that_part_of_the_picture() {
    use twincast::render::Crop;
    let scene = busier_scene();
    let world = World::new(&scene).unwrap();
    let engines = engines(&world);
    let engine = engines.iter().find(|engine| engine.name == "native").expect("it is always there");
    for integrator in Integrator::ALL {
        let whole = Settings { integrator: Some(integrator), ..settings(90, 70, 2) };
        let picture = render(&scene, &scene.cameras[0], &whole, engine);
        for (x, y, width, height) in [(0, 0, 90, 70), (13, 7, 50, 41), (89, 69, 1, 1), (0, 33, 90, 2)] {
            let crop = Some(Crop { x, y, width, height });
            let part = render(&scene, &scene.cameras[0], &Settings { crop, ..whole.clone() }, engine);
            assert_eq!((part.width, part.height), (width, height));
            let rows = (y..y + height).map(|row| (row * 90 + x) as usize);
            let expected: Vec<Vec4> =
                rows.flat_map(|start| picture.pixels[start..start + width as usize].to_vec()).collect();
            assert_eq!(bits(&part.pixels), bits(&expected), "{integrator} {crop:?}");
        }
    }
    for (x, y, width, height) in [(0, 0, 91, 1), (80, 0, 11, 1), (0, 0, 0, 1), (0, 70, 1, 1), (u32::MAX, 0, 2, 2)] {
        let settings = Settings { crop: Some(Crop { x, y, width, height }), ..settings(90, 70, 1) };
        let refused = Renderer::new(&scene, &world, scene.cameras[0].clone(), settings);
        assert!(matches!(refused.err(), Some(Error::Usage(_))), "{x},{y},{width}x{height}");
    }
}

/// What who watches a render is shown is the picture.
#[test]
fn finished_pixels_make_the_picture() {
    use std::sync::Mutex;
    use twincast::render::{Crop, Finished};
    let scene = busy_scene(DVec3::ZERO);
    let world = World::new(&scene).unwrap();
    for crop in [None, Some(Crop { x: 20, y: 9, width: 45, height: 40 })] {
        let renderer =
            Renderer::new(&scene, &world, scene.cameras[0].clone(), Settings { crop, ..settings(100, 50, 1) }).unwrap();
        let Crop { width, height, .. } = renderer.window();
        let shown = Mutex::new(twincast::Image::new(width, height));
        let show = |finished: Finished| {
            let mut shown = shown.lock().unwrap();
            for (row, pixels) in finished.pixels.chunks(finished.width as usize).enumerate() {
                let start = ((finished.y as usize + row) * width as usize) + finished.x as usize;
                shown.pixels[start..start + pixels.len()].copy_from_slice(pixels);
            }
        };
        let control = Control { on_pixels: Some(&show), ..Control::default() };
        let picture = renderer.render(&*engines(&world)[1].tracer, control).unwrap();
        assert_eq!(bits(&shown.into_inner().unwrap().pixels), bits(&picture.pixels));
    }
}
