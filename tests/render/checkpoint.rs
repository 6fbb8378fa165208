//! Renders that are interrupted and gone on with: the same bits, whenever it happens; and what is refused.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use twincast::image::Plane;
use twincast::math::Vec3;
use twincast::render::{Adaptive, Aov, Checkpoint, Control, Filter, Picture};
use twincast::scene::{Integrator, Material};
use twincast::trace::bvh::Bvh;
use twincast::{Error, Renderer, Result, Scene, Settings, World};

use super::determinism::{bits, busier_scene};
use super::settings;

/// Every channel but the time, and the colours, as bits.
fn words(picture: &Picture) -> Vec<(String, Vec<u32>)> {
    let plane = |plane: &Plane| match plane {
        Plane::Float(values) => values.iter().map(|x| x.to_bits()).collect(),
        Plane::Uint(values) => values.clone(),
    };
    let channels = picture.channels.iter().filter(|channel| channel.name != "time");
    let mut words: Vec<_> = channels.map(|channel| (channel.name.clone(), plane(&channel.plane))).collect();
    words.push(("colours".to_owned(), bits(&picture.image.pixels).concat()));
    words
}

/// Renders with checkpoints, until so many tiles are done.
fn until(scene: &Scene, settings: &Settings, path: &Path, resume: bool, tiles: u64) -> Result<Picture> {
    let world = World::new(scene)?;
    let bvh = Bvh::build(&world);
    let renderer = Renderer::new(scene, &world, scene.cameras[0].clone(), settings.clone())?;
    let (cancel, done) = (AtomicBool::new(false), AtomicU64::new(0));
    let count = |_| {
        if done.fetch_add(1, Ordering::Relaxed) + 1 == tiles {
            cancel.store(true, Ordering::Relaxed);
        }
    };
    let control = Control { cancel: Some(&cancel), on_tile: Some(&count), ..Control::default() };
    // Often enough for checkpoints in the middle of rounds.
    let checkpoint = Checkpoint { path, every: Some(Duration::from_millis(5)), resume, engine: "native" };
    renderer.picture(&bvh, control, Some(&checkpoint))
}

#[test]
fn interrupted_renders_go_on_to_the_same_bits() {
    let scene = busier_scene();
    let adaptive = Some(Adaptive { noise: 0.03, max_spp: 48 });
    for (integrator, spp, filter, adaptive, aovs) in [
        (Integrator::Path, 40, Filter::Box, None, Aov::all()),
        (Integrator::Path, 8, Filter::Mitchell, adaptive, Aov::all()),
        (Integrator::Whitted, 20, Filter::Gaussian, None, Vec::new()),
        (Integrator::RayCast, 4, Filter::Box, adaptive, Vec::new()),
    ] {
        let integrator = Some(integrator);
        let settings = Settings { integrator, filter, adaptive, aovs, tile: 16, ..settings(50, 40, spp) };
        let world = World::new(&scene).unwrap();
        let renderer = Renderer::new(&scene, &world, scene.cameras[0].clone(), settings.clone()).unwrap();
        let whole = renderer.picture(&Bvh::build(&world), Control::default(), None).unwrap();
        for first in [1, 7, 17] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a.checkpoint.exr");
            let mut stopped = until(&scene, &settings, &path, false, first);
            let mut times = 0;
            while let Err(error) = stopped {
                assert!(matches!(error, Error::Interrupted), "{error}");
                times += 1;
                // Other tiles and threads than before change nothing.
                let settings = Settings { tile: [8, 32, 16][times % 3], ..settings.clone() };
                stopped = until(&scene, &settings, &path, true, first + 9);
                assert!(times < 100, "it gets on");
            }
            assert!(times > 0);
            for (a, b) in words(&whole).iter().zip(words(&stopped.unwrap())) {
                assert!(*a == b, "{} after {times} interruptions, {integrator:?}", a.0);
            }
        }
    }
}

#[test]
fn a_checkpoint_shows_the_picture_so_far_and_is_refused_elsewhere() {
    let scene = busier_scene();
    let settings = Settings { tile: 16, ..settings(40, 30, 64) };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.checkpoint.exr");
    let missing = until(&scene, &settings, &path, true, 3).unwrap_err();
    assert!(missing.exit_code() == 3 && missing.to_string().contains("no checkpoint to resume"), "{missing}");
    assert!(matches!(until(&scene, &settings, &path, false, 9), Err(Error::Interrupted)));
    let shown = twincast::image::read(&path).unwrap();
    assert!((shown.width, shown.height) == (40, 30) && shown.pixels.iter().any(|p| p.x > 0.1 && p.w == 1.0));

    let mut other_scene = scene.clone();
    other_scene.materials[1] = Material { diffuse: Vec3::X, ..other_scene.materials[1].clone() };
    let mut moved = scene.clone();
    moved.cameras[0].eye.x += 1e-9;
    for (scene, settings, words) in [
        (&other_scene, settings.clone(), "by its scene; begin anew"),
        (&moved, settings.clone(), "by its camera; begin anew"),
        (&scene, Settings { max_depth: Some(3), ..settings.clone() }, "by its settings: another depth; begin anew"),
        (&scene, Settings { spp: 65, ..settings.clone() }, "by its settings: spp 64, and here spp 65"),
        (&scene, Settings { seed: 1, ..settings.clone() }, "seed 0, and here seed 1"),
        (&scene, Settings { aovs: vec![Aov::Depth], ..settings.clone() }, "aovs"),
        (&scene, Settings { width: 41, ..settings.clone() }, "size 40x30, and here size 41x30"),
    ] {
        let error = until(scene, &settings, &path, true, 3).unwrap_err();
        assert!(error.exit_code() == 3 && error.to_string().contains(words), "{error}");
    }
    // Another program's, a picture that is none, and half a file.
    let whole = std::fs::read(&path).unwrap();
    let version = env!("CARGO_PKG_VERSION").as_bytes();
    let mut changed = whole.clone();
    let key = b"twincast/program\0";
    let at = whole.windows(key.len()).position(|bytes| bytes == key).unwrap();
    let number = at + whole[at..].windows(version.len()).position(|bytes| bytes == version).unwrap();
    changed[number] = b'9';
    std::fs::write(&path, &changed).unwrap();
    let error = until(&scene, &settings, &path, true, 3).unwrap_err();
    assert!(error.to_string().contains("by its program: twincast 9"), "{error}");
    // The samples with which its round began, in digits that say otherwise.
    let key = b"twincast/round\0string\0";
    let at = whole.windows(key.len()).position(|bytes| bytes == key).unwrap() + key.len() + 4;
    for digit in [b'7', b'9'] {
        let mut changed = whole.clone();
        assert!(changed[at].is_ascii_digit() && changed[at] != digit);
        changed[at] = digit;
        std::fs::write(&path, &changed).unwrap();
        let error = until(&scene, &settings, &path, true, 3).unwrap_err();
        assert!(error.exit_code() == 3 && error.to_string().contains("begin anew"), "{error}");
    }
    twincast::image::write(&path, &shown, &Default::default(), &Default::default()).unwrap();
    let error = until(&scene, &settings, &path, true, 3).unwrap_err();
    assert!(error.exit_code() == 3 && error.to_string().contains("is not a checkpoint"), "{error}");
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    assert_eq!(until(&scene, &settings, &path, true, 3).unwrap_err().exit_code(), 3);
    std::fs::write(&path, &whole).unwrap();
    assert!(matches!(until(&scene, &settings, &path, true, 3), Err(Error::Interrupted)), "the file was good");
}
