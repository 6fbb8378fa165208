//! Samples where they are needed: the error that is promised, against references that are known, and what it costs.

use std::sync::atomic::{AtomicU64, Ordering};

use twincast::image::Plane;
use twincast::math::{DVec3, Vec3, Vec4};
use twincast::render::{Adaptive, Aov, Control, Counted, Picture, Sampling};
use twincast::scene::{AreaShape, Integrator, Light, Material};
use twincast::{Image, Renderer, Scene, Settings, World};

use super::determinism::{bits, busier_scene};
use super::{engines, floor, from_above, matte, render, settings};

fn picture(scene: &Scene, settings: &Settings) -> Picture {
    counted(scene, settings).0
}

/// A picture, and how many rays were sent for a nearest hit.
fn counted(scene: &Scene, settings: &Settings) -> (Picture, u64) {
    let world = World::new(scene).unwrap();
    let renderer = Renderer::new(scene, &world, scene.cameras[0].clone(), settings.clone()).unwrap();
    let engines = engines(&world);
    let native = engines.iter().find(|engine| engine.name == "native").unwrap();
    let counted = Counted::new(&*native.tracer);
    let picture = renderer.picture(&counted, Control::default(), None).unwrap();
    (picture, counted.closest_rays())
}

fn to(noise: f32, max_spp: u32) -> Option<Adaptive> {
    Some(Adaptive { noise, max_spp })
}

fn counts(picture: &Picture) -> Vec<u32> {
    let channel = picture.channels.iter().find(|channel| channel.name == "samples").unwrap();
    let Plane::Uint(counts) = &channel.plane else { panic!("counts are integers") };
    counts.clone()
}

/// The root mean square error as it is seen: of the square roots.
fn error(picture: &Image, reference: &Image) -> f64 {
    let seen = |p: &Vec4| p.truncate().max(Vec3::ZERO).map(f32::sqrt);
    let pairs = picture.pixels.iter().zip(&reference.pixels);
    let sum: f64 = pairs.map(|(a, b)| f64::from((seen(a) - seen(b)).abs().max_element()).powi(2)).sum();
    (sum / picture.pixels.len() as f64).sqrt()
}

/// A floor under a small lamp, and a small square above it: light, dark, and a penumbra between.
fn penumbra() -> Scene {
    under_a_lamp(0.35, DVec3::new(0.4, 0.6, 0.0))
}

/// The same with a square of this half side in this place.
fn under_a_lamp(half: f32, place: DVec3) -> Scene {
    let mut scene = Scene::from_geometries(vec![floor(1.0, 0), floor(half, 0)], vec![matte(0.8)]);
    scene.groups[0].geometries = 0..1;
    scene.groups.push(twincast::scene::Group { name: String::new(), geometries: 1..2 });
    let above = twincast::math::DAffine3::from_translation(place);
    scene.instances.push(twincast::scene::Instance {
        name: String::new(),
        group: 1,
        transform: above,
        transform_end: None,
    });
    let lamp = AreaShape::Sphere { centre: DVec3::new(0.0, 3.0, 0.0), radius: 0.4 };
    scene.lights = vec![Light::Area { shape: lamp, radiance: Vec3::splat(40.0) }];
    scene.cameras = vec![from_above()];
    scene
}

/// A closed room that its lamp lights by paths: noisy everywhere.
fn room() -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/box/box.toml");
    twincast::io::load(path.as_ref(), &twincast::io::LoadOptions::default()).expect("the project's scenes load").0
}

/// Compared with as many samples for each pixel, or a few more: far better where little of the picture is noisy, and
/// better even where all of it is.
#[test]
fn as_many_samples_buy_less_error() {
    let small = under_a_lamp(0.1, DVec3::new(0.4, 0.2, 0.0));
    let scenes = [("penumbra", small, 48, 0.004, 8192, 0.5), ("room", room(), 72, 0.07, 512, 0.98)];
    for (name, scene, side, noise, many, share) in scenes {
        let integrator = (name == "room").then_some(Integrator::Path);
        let base = Settings { integrator, ..settings(side, side, 4) };
        let reference = picture(&scene, &Settings { spp: many, seed: 99, ..base.clone() }).image;
        let found = picture(&scene, &Settings { adaptive: to(noise, 1024), ..base.clone() });
        let spp = found.samples.div_ceil(u64::from(side * side)) as u32;
        let even = picture(&scene, &Settings { spp, ..base.clone() }).image;
        let (own, even) = (error(&found.image, &reference), error(&even, &reference));
        assert!(spp > 16 && own < share * even, "{name}: {spp} samples, {own} against {even}");
        assert!(own < f64::from(noise), "{name}: {own} of {noise}");
    }
}

#[test]
fn the_error_is_what_was_asked_for_with_far_fewer_samples() {
    let scene = penumbra();
    let base = settings(48, 48, 4);
    let reference = picture(&scene, &Settings { spp: 8192, seed: 99, ..base.clone() }).image;
    for (noise, saving) in [(0.02, 1.0), (0.005, 3.0)] {
        let adaptive = Settings { adaptive: to(noise, 4096), aovs: vec![Aov::Samples], ..base.clone() };
        let found = picture(&scene, &adaptive);
        let off = error(&found.image, &reference);
        assert!(off < f64::from(noise), "{off} of {noise}");
        let counts = counts(&found);
        assert_eq!(counts.iter().map(|&n| u64::from(n)).sum::<u64>(), found.samples);
        // As many for each pixel as the neediest got: what a render without a threshold takes to be as good everywhere.
        let (most, all) = (*counts.iter().max().unwrap(), found.samples as f64);
        let uniform = f64::from(most) * counts.len() as f64;
        assert!(uniform > saving * all, "noise {noise}: {uniform} against {all}");
        let evenly_lit = counts.iter().filter(|&&n| n == 16).count();
        assert!(evenly_lit > counts.len() / 4 || noise < 0.01, "{evenly_lit}");
        // Not more than it needs: with a quarter of the samples the neediest are above the threshold.
        let few = picture(&scene, &Settings { spp: most / 4, seed: 7, ..base.clone() }).image;
        let needy = |image: &Image| {
            let pixels = counts.iter().zip(image.pixels.iter().zip(&reference.pixels)).filter(|(n, _)| **n == most);
            let (own, reference): (Vec<_>, Vec<_>) = pixels.map(|(_, (a, b))| (*a, *b)).unzip();
            let image = |pixels: Vec<Vec4>| Image { width: pixels.len() as u32, height: 1, pixels };
            error(&image(own), &image(reference))
        };
        assert!(needy(&few) > 0.5 * f64::from(noise), "{} of {noise}", needy(&few));
    }
}

/// A render to a threshold that nothing reaches is one with the most samples, to the bit; and no more are taken than
/// that.
#[test]
fn the_most_samples_are_those_of_a_plain_render() {
    let scene = busier_scene();
    for integrator in Integrator::ALL {
        let plain = Settings { integrator: Some(integrator), spp: 40, ..settings(40, 30, 1) };
        let adaptive = Settings { spp: 4, adaptive: to(1e-12, 40), aovs: vec![Aov::Samples], ..plain.clone() };
        let (plain, found) = (picture(&scene, &plain), picture(&scene, &adaptive));
        let counts = counts(&found);
        assert!(counts.contains(&40) && counts.iter().all(|&n| n <= 40));
        for ((a, b), n) in plain.image.pixels.iter().zip(&found.image.pixels).zip(counts) {
            assert!(n < 40 || bits(&[*a]) == bits(&[*b]));
        }
    }
}

/// Rays that nothing sends on are camera rays: as many are traced as the picture says.
#[test]
fn samples_that_are_counted_are_taken() {
    let scene = busier_scene();
    let base = Settings { integrator: Some(Integrator::RayCast), ..settings(48, 32, 4) };
    for settings in [
        Settings { adaptive: to(0.05, 64), ..base.clone() },
        Settings { adaptive: to(0.05, 64), aovs: vec![Aov::Samples, Aov::Depth], ..base.clone() },
        Settings { aovs: vec![Aov::Samples], ..base.clone() },
        base,
    ] {
        let (picture, rays) = counted(&scene, &settings);
        assert_eq!(rays, picture.camera_rays, "{settings:?}");
        // Depth is that of a ray through the middle of each pixel.
        let beside = if settings.aovs.contains(&Aov::Depth) { 48 * 32 } else { 0 };
        assert_eq!(picture.samples + beside, picture.camera_rays);
        if settings.adaptive.is_some() && !settings.aovs.is_empty() {
            let counts = counts(&picture);
            assert!(counts.iter().any(|n| n != &counts[0]), "some pixels take more than others");
        }
    }
}

#[test]
fn neither_threads_nor_tiles_decide_who_gets_samples() {
    let scene = busier_scene();
    let integrator = Some(Integrator::Path);
    let adaptive = Settings { integrator, adaptive: to(0.05, 64), aovs: vec![Aov::Samples], ..settings(70, 45, 1) };
    let by = |threads, tile| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| picture(&scene, &Settings { tile, ..adaptive.clone() }))
    };
    let reference = by(1, 32);
    let own = counts(&reference);
    assert!(own.contains(&16) && own.iter().any(|&n| n > 32), "some are easy, some are not");
    for (threads, tile) in [(2, 32), (3, 8), (2, 64)] {
        let other = by(threads, tile);
        assert_eq!(bits(&reference.image.pixels), bits(&other.image.pixels), "{threads} threads, tiles of {tile}");
        assert_eq!(own, counts(&other));
    }
}

#[test]
fn what_is_not_there_needs_no_more_samples_and_progress_ends() {
    let mut scene = Scene::from_geometries(vec![floor(0.01, 0)], vec![Material::default()]);
    scene.cameras = vec![from_above()];
    let world = World::new(&scene).unwrap();
    let settings = Settings { adaptive: to(0.01, 1024), ..settings(64, 32, 4) };
    let renderer = Renderer::new(&scene, &world, scene.cameras[0].clone(), settings.clone()).unwrap();
    let done = AtomicU64::new(0);
    let count = |pixels| {
        done.fetch_add(pixels, Ordering::Relaxed);
    };
    let engine = &engines(&world)[0];
    let control = Control { on_tile: Some(&count), ..Control::default() };
    let found = renderer.picture(&*engine.tracer, control, None).unwrap();
    assert_eq!(done.into_inner(), 64 * 32);
    assert!(found.samples < 64 * 32 * 20, "{}", found.samples);
    assert_eq!(found.camera_rays, found.samples);
    let alone = render(&scene, &scene.cameras[0], &settings, engine);
    assert_eq!(bits(&alone.pixels), bits(&found.image.pixels));
}

#[test]
fn settings_that_do_not_go_together_are_refused() {
    let scene = penumbra();
    let world = World::new(&scene).unwrap();
    for (settings, words) in [
        (Settings { adaptive: to(0.0, 64), ..settings(8, 8, 4) }, "above 0"),
        (Settings { adaptive: to(0.1, 8), ..settings(8, 8, 4) }, "needs 16 at least"),
        (Settings { adaptive: to(0.1, 99), ..settings(8, 8, 100) }, "needs 100 at least"),
        (Settings { adaptive: to(0.1, 64), sampling: Sampling::Stratified, ..settings(8, 8, 4) }, "take sobol"),
        (Settings { tile: 24, ..settings(8, 8, 4) }, "tiles of 24x24"),
    ] {
        let error = Renderer::new(&scene, &world, scene.cameras[0].clone(), settings).err().unwrap();
        assert!(error.exit_code() == 2 && error.to_string().contains(words), "{error}");
    }
}
