//! Denoising: what is said where there is no library, and where there is one, what becomes of pictures.
//!
//! Tests of the second kind leave off with a word on stderr where Open Image Denoise is not installed; `TWINCAST_OIDN`
//! may name it.

use std::path::Path;
use std::process::Output;

use crate::program::{command, text, twincast};

/// With this library, or the lack of it.
fn with_library(library: &str, args: &[&str]) -> Output {
    command().env("TWINCAST_OIDN", library).args(args).output().expect("the program runs")
}

/// The scene of the project that is noisy everywhere.
fn room() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/box/box.toml").to_string_lossy().into_owned()
}

#[test]
fn without_the_library_nothing_is_rendered_and_the_remedy_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("a.png").to_string_lossy().into_owned();
    let (room, nowhere) = (room(), folder.path().to_string_lossy().into_owned());
    let absent = folder.path().join("libOpenImageDenoise.so.2").to_string_lossy().into_owned();
    for library in [&nowhere, &absent] {
        let output = with_library(library, &["render", &room, "-o", &picture, "--denoise"]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(5), "{message}");
        let words = if cfg!(feature = "oidn") {
            ["error: --denoise: ", "TWINCAST_OIDN", "openimagedenoise.org", &absent]
        } else {
            ["error: --denoise: ", "not in this build", "--features", "oidn"]
        };
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
        assert!(!Path::new(&picture).exists());
    }
    // Whoever asks for no denoising needs no library.
    let output = with_library(&nowhere, &["render", &room, "-o", &picture, "--spp", "1", "--size", "8x8"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[cfg(feature = "oidn")]
#[test]
fn a_file_that_is_another_library_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("a.png").to_string_lossy().into_owned();
    // The C library's own loader opens it, and finds none of the functions.
    let output = with_library("libm.so.6", &["render", &room(), "-o", &picture, "--denoise"]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(5), "{message}");
    assert!(message.contains("libm.so.6: has no function oidnNewDevice"), "{message}");
}

#[test]
fn what_cannot_go_together_ends_with_2() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("a.exr").to_string_lossy().into_owned();
    for args in [&["--denoise", "--pixel", "3,4"][..], &["--denoise", "--aov", "noisy=LDE", "-o", &picture]] {
        let output = twincast(&[&["render", &room()], args].concat());
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", text(&output.stderr));
    }
}

#[cfg(feature = "oidn")]
mod with_the_library {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use twincast::image::denoise::{Denoiser, Guides};
    use twincast::image::{self, Channels};
    use twincast::io::{LoadOptions, load};
    use twincast::math::Vec4;
    use twincast::render::{Aov, Control, Picture};
    use twincast::trace::bvh::Bvh;
    use twincast::{Image, Renderer, Settings, World};

    use super::*;
    use crate::skip::skip;

    /// A library that is there; none, with a word, where there is none.
    fn denoiser() -> Option<Denoiser> {
        Denoiser::find().inspect_err(|error| skip(error)).ok()
    }

    /// The room, as it is seen with so many samples.
    fn picture(spp: u32, seed: u64) -> Picture {
        let (scene, _) = load(room().as_ref(), &LoadOptions::default()).unwrap();
        let world = World::new(&scene).unwrap();
        let aovs = vec![Aov::Albedo, Aov::Normal];
        let settings = Settings { width: 96, height: 96, spp, seed, aovs, ..Settings::default() };
        let renderer = Renderer::new(&scene, &world, scene.cameras[0].clone(), settings).unwrap();
        renderer.picture(&Bvh::build(&world), Control::default(), None).unwrap()
    }

    fn go_on(_: f64) -> bool {
        true
    }

    /// Mean square error, relative to the square of what it should be.
    fn relative_error(image: &Image, reference: &Image) -> f64 {
        let pairs = image.pixels.iter().zip(&reference.pixels);
        let errors = pairs.map(|(own, reference)| {
            let (own, reference) = (own.truncate(), reference.truncate());
            let relative = (own - reference) * (own - reference) / (reference * reference + 0.01);
            f64::from(relative.element_sum() / 3.0)
        });
        errors.sum::<f64>() / image.pixels.len() as f64
    }

    #[test]
    fn a_denoised_picture_is_far_nearer_to_one_of_many_samples() {
        let Some(denoiser) = denoiser() else { return };
        let (noisy, reference) = (picture(16, 0), picture(1024, 7));
        let guides = Guides::of_channels(&noisy.channels).unwrap();
        let clean = denoiser.denoise(&noisy.image, &guides, &go_on).unwrap();
        let [before, after] = [&noisy.image, &clean].map(|image| relative_error(image, &reference.image));
        eprintln!("{}: relative error {before:.5} before, {after:.5} after", denoiser.name());
        assert!(after < before / 5.0, "{after} of {before}");
        // The room is closed: all of it is covered, and stays so.
        assert!(noisy.image.pixels.iter().zip(&clean.pixels).all(|(a, b)| a.w == b.w));
        // What the guides know goes into it: by guides of nothing, edges and the picture are worse.
        let nothing = vec![[0.0; 3]; clean.pixels.len()];
        let unguided = Guides { albedo: nothing.clone(), normal: nothing };
        let unguided = denoiser.denoise(&noisy.image, &unguided, &go_on).unwrap();
        let blind = relative_error(&unguided, &reference.image);
        assert!(after < blind, "{after} with guides, {blind} without");
        // And neither chance nor the number of threads.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let again = pool.install(|| denoiser.denoise(&noisy.image, &guides, &go_on)).unwrap();
        assert_eq!(clean, again);
    }

    #[test]
    fn what_nothing_covers_stays_and_a_watch_is_told_and_obeyed() {
        let Some(denoiser) = denoiser() else { return };
        let image = Image {
            width: 40,
            height: 30,
            pixels: (0..1200).map(|i| if i % 40 < 20 { Vec4::ZERO } else { Vec4::new(0.5, 0.4, 0.3, 1.0) }).collect(),
        };
        let guides = Guides { albedo: vec![[0.5; 3]; 1200], normal: vec![[0.0, 0.0, 1.0]; 1200] };
        let called = AtomicUsize::new(0);
        let watch = |done: f64| {
            assert!((0.0..=1.0).contains(&done));
            called.fetch_add(1, Ordering::Relaxed);
            true
        };
        let clean = denoiser.denoise(&image, &guides, &watch).unwrap();
        assert!(called.into_inner() > 3);
        for (i, pixel) in clean.pixels.iter().enumerate() {
            assert!(if i % 40 < 20 { *pixel == Vec4::ZERO } else { pixel.w == 1.0 }, "{i}: {pixel}");
        }
        let stopped = denoiser.denoise(&image, &guides, &|done| done < 0.5).unwrap_err();
        assert_eq!(stopped.exit_code(), 130, "{stopped}");
        // A panic stays on this side of the foreign boundary.
        let panicked = denoiser.denoise(&image, &guides, &|_| panic!("on purpose")).unwrap_err();
        assert_eq!(panicked.exit_code(), 130, "{panicked}");
        let short = Guides { albedo: vec![[0.5; 3]; 1199], ..guides };
        assert_eq!(denoiser.denoise(&image, &short, &go_on).unwrap_err().exit_code(), 2);
    }

    #[test]
    fn files_hold_the_picture_before_and_after() {
        if denoiser().is_none() {
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
        let render = |output: &str, more: &[&str]| {
            let (room, output) = (room(), path(output));
            let args = ["render", &room, "-o", &output, "--size", "48x40", "--spp", "8"];
            let run = twincast(&[&args, more].concat());
            assert!(run.status.success() && run.stderr.is_empty(), "{more:?}: {}", text(&run.stderr));
            text(&run.stdout)
        };
        render("plain.exr", &["--aov", "noisy=L.*E,normal"]);
        let said = render("both.exr", &["--denoise", "--aov", "normal,depth", "--stats", &path("both.json")]);
        render("alone.exr", &["--denoise"]);
        let channels = |name: &str| image::read_channels(path(name).as_ref()).unwrap();
        let (plain, both, alone) = (channels("plain.exr"), channels("both.exr"), channels("alone.exr"));
        let names = |channels: &Channels| {
            let mut names: Vec<_> = channels.channels.iter().map(|channel| channel.name.clone()).collect();
            names.sort();
            names.join(" ")
        };
        assert_eq!(names(&alone), "A B G R");
        let beside = "depth.Z noisy.B noisy.G noisy.R normal.X normal.Y normal.Z";
        assert_eq!(names(&both), format!("A B G R {beside}"));
        // Normals are the render's own, and so is the noise; to the rounding of one sum in place of two.
        assert_eq!(plain.floats("normal.X"), both.floats("normal.X"));
        for component in ["R", "G", "B"] {
            let noisy = |channels: &Channels| channels.floats(&format!("noisy.{component}")).unwrap().to_vec();
            assert!(noisy(&plain).iter().zip(noisy(&both)).all(|(a, b)| (a - b).abs() <= 1e-5 * a.max(1.0)));
            assert_eq!(both.floats(component), alone.floats(component), "what stands beside it changes nothing");
            assert_ne!(both.floats(component), plain.floats(component));
        }
        let metadata = image::read_metadata(path("both.exr").as_ref()).unwrap();
        let told = metadata.texts.iter().find(|(name, _)| name == "twincast/denoiser").expect("it is told");
        assert!(told.1.starts_with("Open Image Denoise ") && said.contains(&told.1), "{told:?} {said}");
        let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(path("both.json")).unwrap()).unwrap();
        assert_eq!(stats["denoise"]["library"], told.1.as_str());
        assert!(stats["denoise"]["seconds"].as_f64().is_some_and(|seconds| seconds > 0.0));
    }
}
