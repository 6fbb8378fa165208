//! Every scene of `scenes/` looks as its reference picture does, on every engine, at the size that it asks for.
//!
//! `TWINCAST_REFRESH=1` writes the references anew; look at them before you commit them.

use std::path::{Path, PathBuf};

use twincast::image::WriteOptions;
use twincast::io::{LoadOptions, load};
use twincast::render::Control;
use twincast::trace::bvh::Bvh;
use twincast::{Image, Renderer, Settings, World, image};

const WIDTH: u32 = 320;
const HEIGHT: u32 = 180;

/// Scene file and reference of each folder.
fn pairs() -> Vec<(PathBuf, PathBuf)> {
    let folders = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes")).expect("the project has scenes");
    let folders = folders.map(|entry| entry.expect("readable").path()).filter(|path| path.is_dir());
    let scene = |folder: &Path| {
        let files = std::fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path());
        let is_scene = |path: &PathBuf| {
            path.extension().is_some_and(|suffix| twincast::io::SUFFIXES.contains(&suffix.to_str().unwrap_or_default()))
        };
        files.filter(is_scene).min().unwrap_or_else(|| panic!("{} has no scene", folder.display()))
    };
    folders.map(|folder| (scene(&folder), folder.join("reference.png"))).collect()
}

fn pictures(path: &Path) -> (WriteOptions, Vec<(&'static str, Image)>) {
    let (scene, warnings) = load(path, &LoadOptions::default()).expect("the project's scenes load");
    assert_eq!(warnings, []);
    let world = World::new(&scene).expect("sound");
    let camera = scene.cameras.first().expect("a camera").clone();
    let usual = Settings::default();
    let request = &scene.request;
    let [width, height] = request.size.unwrap_or([WIDTH, HEIGHT]);
    let (integrator, max_depth) = (request.integrator, request.max_depth);
    let settings = Settings { width, height, spp: request.spp.unwrap_or(usual.spp), integrator, max_depth, ..usual };
    let renderer = Renderer::new(&scene, &world, camera, settings).expect("sound settings");
    let control = Control::default();
    let options = WriteOptions { response: request.camera_response(), ..WriteOptions::default() };
    let native = renderer.render(&Bvh::build(&world), control).expect("rendered");
    #[cfg(feature = "embree")]
    {
        let embree = twincast::trace::embree::Embree::new(&world, &Default::default()).expect("built");
        (options, vec![("native", native), ("embree", renderer.render(&embree, control).expect("rendered"))])
    }
    #[cfg(not(feature = "embree"))]
    (options, vec![("native", native)])
}

#[test]
fn scenes_look_like_their_references() {
    let pairs = pairs();
    assert!(!pairs.is_empty());
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("references");
    std::fs::create_dir_all(&folder).expect("writable");
    for (scene, reference) in pairs {
        let name = reference.parent().and_then(Path::file_name).expect("a folder").to_string_lossy().into_owned();
        let (options, pictures) = pictures(&scene);
        for (engine, picture) in pictures {
            let written = folder.join(format!("{name}-{engine}.png"));
            image::write(&written, &picture, &Default::default(), &options).expect("written");
            if engine == "native" && std::env::var_os("TWINCAST_REFRESH").is_some() {
                std::fs::copy(&written, &reference).expect("copied");
            }
            // Both through 8 bits: native's picture is the same on every system, to the last of them. Embree's answer
            // may be another on a tie or a boundary ray, one pixel in a thousand at the very most.
            let [is, expected] = [&written, &reference].map(|path| image::read(path).expect("a picture"));
            let difference = is.difference(&expected).expect("of one size");
            let allowed = if engine == "native" { 0 } else { difference.pixels / 1000 };
            if difference.differing > allowed {
                let apart = folder.join(format!("{name}-{engine}-difference.png"));
                let picture = is.difference_image(&expected).expect("of one size");
                image::write(&apart, &picture, &Default::default(), &Default::default()).expect("written");
                panic!("{name} on {engine}: {difference:?}; see {} and {}", written.display(), apart.display());
            }
        }
    }
}

/// Files of the folder that a recipe made are made by it still, to the byte.
#[test]
fn scenes_by_rule_are_what_their_recipes_make() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let table = std::fs::read_to_string(scenes.join("README.md")).expect("a table");
    let folder = tempfile::tempdir().expect("a folder");
    let mut made = 0;
    for command in table.lines().filter_map(|line| line.split("`twincast make ").nth(1)?.split('`').next()) {
        let (name, size) = command.split_once(" --size ").expect("a size");
        let kept = ["toml", "nff"].map(|suffix| scenes.join(name).join(format!("{name}.{suffix}")));
        let kept = kept.iter().find(|path| path.is_file()).expect("a scene");
        let again = folder.path().join(kept.file_name().expect("a name"));
        let args = ["make", name, "--size", size, "-q", "-o", again.to_str().expect("UTF-8")];
        assert!(crate::program::twincast(&args).status.success(), "{command}");
        assert!(std::fs::read(kept).expect("kept") == std::fs::read(&again).expect("made"), "{command}");
        made += 1;
    }
    assert!(made >= 9, "{made}");
}
