//! A pixel that is explained is the pixel of the picture, and what is told adds up to it.

use twincast::math::{DVec3, Vec3, Vec4};
use twincast::render::{Control, Filter};
use twincast::scene::{Camera, Fog, Geometry, Integrator, Light, Material};
use twincast::trace::bvh::Bvh;
use twincast::{Ray, Renderer, Scene, Settings, World};

use super::determinism::busier_scene;
use super::{engines, floor, matte, settings};

/// With fog, alpha, and every kind of light.
fn everything() -> Scene {
    let mut scene = busier_scene();
    scene.fog = Some(Fog { absorption: Vec3::new(0.01, 0.02, 0.03), color: Vec3::splat(0.2), reach: 20.0 });
    scene.materials[2].alpha = twincast::scene::Alpha::Blend;
    scene.materials[2].opacity = 0.7;
    scene
}

#[test]
fn what_is_told_adds_up_to_the_pixel() {
    let scene = everything();
    let world = World::new(&scene).unwrap();
    let (mut lights, mut rays) = (0, 0);
    for integrator in Integrator::ALL {
        for (spp, filter) in [(1, Filter::Box), (5, Filter::Mitchell)] {
            let settings = Settings { integrator: Some(integrator), filter, light_samples: 2, ..settings(40, 35, spp) };
            let renderer = Renderer::new(&scene, &world, scene.cameras[0].clone(), settings).unwrap();
            for engine in engines(&world).iter().filter(|engine| engine.name != "embree") {
                let image = renderer.render(&*engine.tracer, Control::default()).unwrap();
                for (x, y) in [(20, 17), (14, 20), (25, 12), (3, 2), (30, 30), (17, 25)] {
                    let told = renderer.explain(&*engine.tracer, [x, y], None);
                    let pixel = image.pixels[(y * 40 + x) as usize];
                    assert_eq!(Vec4::from(told.value), pixel, "to the bit");
                    let (sum, scale) = (told.sum(), 1.0 + pixel.truncate().abs().max_element());
                    assert!(
                        (sum - told.color()).abs().max_element() < 1e-5 * scale,
                        "{integrator} {x},{y}: {sum} {pixel}"
                    );
                    for sample in &told.samples {
                        let off = sample.sum() - Vec4::from(sample.value).truncate();
                        assert!(off.abs().max_element() < 1e-5 * scale, "{integrator}: {sample:?}");
                        rays += sample.rays.len();
                        lights += sample.rays.iter().map(|ray| ray.lights.len()).sum::<usize>();
                    }
                }
            }
        }
    }
    assert!(rays > 500 && lights > 500, "{rays} rays, {lights} lights: there was something to tell");
}

/// A matte floor under one lamp: every number of the one term by hand.
#[test]
fn each_term_is_what_it_says() {
    let lamp = Light::Point {
        position: DVec3::new(3.0, 4.0, 0.0),
        color: Vec3::splat(50.0),
        attenuation: twincast::scene::Attenuation::INVERSE_SQUARE,
        range: f64::INFINITY,
        radius: 0.0,
    };
    let scene = Scene { lights: vec![lamp], ..Scene::from_geometries(vec![floor(5.0, 0)], vec![matte(0.5)]) };
    let world = World::new(&scene).unwrap();
    let bvh = Bvh::build(&world);
    let camera = Camera::look_at(DVec3::Y * 10.0, DVec3::ZERO, DVec3::NEG_Z, 0.1).unwrap();
    let renderer = Renderer::new(&scene, &world, camera, settings(1, 1, 1)).unwrap();
    let told = renderer.explain(&bvh, [0, 0], Some(&|ray: &Ray| bvh.steps(ray)));
    let [ray] = &told.samples[0].rays[..] else { panic!("{told:?}") };
    let hit = ray.hit.as_ref().expect("the floor");
    assert_eq!((ray.depth, ray.number, hit.geometry, hit.material, hit.front), (0, 0, 0, 0, true));
    assert!((hit.distance - 10.0).abs() < 1e-6 && DVec3::from(hit.position).length() < 1e-6, "{hit:?}");
    let [light] = &ray.lights[..] else { panic!("{ray:?}") };
    // 5 metres away at a cosine of 0.8: 50 / 25, of which half a cosine is sent on.
    assert!((light.distance.unwrap() - 5.0).abs() < 1e-6 && (light.cosine - 0.8).abs() < 1e-6, "{light:?}");
    let close = |value: [f32; 3], expected: f32| (Vec3::from(value) - expected).abs().max_element() < 1e-5;
    assert!(close(light.radiance, 2.0) && close(light.diffuse, 0.4) && close(light.contribution, 0.8), "{light:?}");
    assert_eq!((light.kind, light.visibility, light.share, light.highlight), ("point", 1.0, 1.0, [0.0; 3]));
    let steps = ray.steps.expect("it was counted");
    assert_eq!((steps.nodes, steps.blocks, steps.objects, steps.shapes), (1, 1, 0, 0));

    // The same lamp behind a lid.
    let mut shaded = scene.clone();
    let lid = twincast::Cuboid::new(Vec3::new(0.5, 1.0, -1.0), Vec3::new(1.5, 1.5, 1.0)).unwrap();
    shaded.geometries.push(Geometry::Shapes { shapes: vec![twincast::Shape::Cuboid(lid)], material: 0 });
    shaded.groups[0].geometries = 0..2;
    let world = World::new(&shaded).unwrap();
    let camera = Camera::look_at(DVec3::Y * 10.0, DVec3::ZERO, DVec3::NEG_Z, 0.1).unwrap();
    let renderer = Renderer::new(&shaded, &world, camera, settings(1, 1, 1)).unwrap();
    let told = renderer.explain(&Bvh::build(&world), [0, 0], None);
    let light = &told.samples[0].rays[0].lights[0];
    assert!(light.visibility == 0.0 && light.contribution == [0.0; 3] && close(light.diffuse, 0.4), "{light:?}");
}

/// The rays of a mirror's picture are a chain.
#[test]
fn rays_are_told_along_with_what_sent_them() {
    let mirror = Material { reflection: Vec3::splat(0.5), ..matte(0.0) };
    let scene = Scene { background: Some(Vec3::X), ..Scene::from_geometries(vec![floor(5.0, 0)], vec![mirror]) };
    let world = World::new(&scene).unwrap();
    let camera = Camera::look_at(DVec3::new(0.0, 3.0, 3.0), DVec3::ZERO, DVec3::Y, 0.1).unwrap();
    let renderer = Renderer::new(&scene, &world, camera, settings(1, 1, 1)).unwrap();
    let told = renderer.explain(&Bvh::build(&world), [0, 0], None);
    let [first, second] = &told.samples[0].rays[..] else { panic!("{told:?}") };
    assert_eq!((first.number, second.number, second.depth), (0, 1, 1));
    assert_eq!((second.weight, second.own), ([0.5; 3], [0.5, 0.0, 0.0]));
    assert!(second.hit.is_none() && second.direction[1] > 0.7, "{second:?}");
    assert!((DVec3::from(second.origin) - DVec3::from(first.hit.as_ref().unwrap().position)).length() < 1e-4);
}
