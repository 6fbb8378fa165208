//! Trees in files: the same answers, and broken files do no harm.

use std::fs;
use std::path::Path;

use twincast::math::Vec3;
use twincast::scene::{Mesh, Scene, architecture};
use twincast::trace::bvh::{Bvh, Cache, CacheReport, CacheUse, Preset};
use twincast::{Batch, Hit, Ray, Tracer, World};

use crate::scenes::{self, Random};

fn hits(bvh: &Bvh, rays: &[Ray]) -> Vec<Option<Hit>> {
    let mut hits = vec![None; rays.len()];
    bvh.closest_batch(rays, &mut hits, Batch::default());
    hits
}

/// The tree from the cache, and what became of the file; that it is as the one that is built.
#[track_caller]
fn get(cache: &Cache, world: &World, preset: Preset, rays: &[Ray]) -> (Bvh, CacheReport) {
    let built = Bvh::build_with(world, preset.into());
    let (bvh, report) = cache.bvh(world, preset.into());
    assert_eq!(hits(&bvh, rays), hits(&built, rays), "{report:?}");
    assert_eq!((bvh.bytes(), bvh.sah_cost()), (built.bytes(), built.sah_cost()), "{report:?}");
    (bvh, report)
}

fn world(scene: &Scene) -> World {
    World::new(scene).expect("a sound scene")
}

/// A mesh with a corner that cannot be traced.
fn torn() -> Mesh {
    let mut mesh = scenes::soup(500, 0.2, 3);
    let mut positions = mesh.positions.to_vec();
    positions[7] = Vec3::new(0.0, f32::NAN, 0.0);
    mesh.positions = positions.into();
    mesh
}

#[test]
fn trees_that_are_read_answer_as_those_that_are_built() {
    let scenes = [
        ("torn", scenes::of_mesh(torn())),
        ("architecture", scenes::of_mesh(architecture(1))),
        ("instances and spheres", scenes::instanced(5)),
        ("nothing", Scene::default()),
    ];
    for (name, scene) in scenes {
        let (world, folder) = (world(&scene), tempfile::tempdir().expect("a folder"));
        // Made as needed.
        let cache = Cache::open(&folder.path().join("a/b")).expect("a folder");
        let targets: Vec<Vec3> = (0..200).scan(Random::new(9), |random, _| Some(random.vec3() * 2.0)).collect();
        let rays = scenes::rays(1000, &targets, 4);
        for preset in Preset::ALL {
            let (_, written) = get(&cache, &world, preset, &rays);
            assert_eq!((written.used, written.warnings.len()), (CacheUse::Written, 0), "{name} {preset:?}");
            let bytes = fs::read(&written.path).expect("a file");
            let (mut bvh, read) = get(&cache, &world, preset, &rays);
            assert_eq!((read.used, read.warnings.len()), (CacheUse::Read, 0), "{name} {preset:?}");
            assert_eq!((read.bytes, written.bytes), (bytes.len() as u64, bytes.len() as u64));
            // Fitted anew, which changes nothing here, it leaves the file alone.
            let expected = hits(&bvh, &rays);
            bvh.refit(&world).expect("the same world");
            assert!(hits(&bvh, &rays) == expected && fs::read(&read.path).expect("a file") == bytes);
        }
        assert_eq!(
            fs::read_dir(folder.path().join("a/b")).expect("a folder").count(),
            Preset::ALL.len(),
            "a file a preset"
        );
    }
}

#[test]
fn a_tree_that_was_read_is_fitted_to_moved_vertices() {
    let (before, after) = (scenes::bumpy_sphere(16, 0.1, 1), scenes::bumpy_sphere(16, 0.4, 2));
    let rays = scenes::rays(1000, &after.positions.clone(), 4);
    let after = world(&scenes::of_mesh(Mesh { triangles: before.triangles.clone(), ..after }));
    let before = world(&scenes::of_mesh(before));
    let folder = tempfile::tempdir().expect("a folder");
    let cache = Cache::open(folder.path()).expect("a folder");
    for preset in Preset::ALL {
        get(&cache, &before, preset, &rays);
        let (mut bvh, report) = get(&cache, &before, preset, &rays);
        assert_eq!(report.used, CacheUse::Read);
        bvh.refit(&after).expect("the same triangles");
        assert_eq!(hits(&bvh, &rays), hits(&Bvh::build_with(&after, preset.into()), &rays));
        assert_eq!(get(&cache, &before, preset, &rays).1.used, CacheUse::Read, "the file is as it was");
    }
}

/// A small world, its file as it should be, and rays.
struct Kept {
    world: World,
    preset: Preset,
    cache: Cache,
    folder: tempfile::TempDir,
    report: CacheReport,
    bytes: Vec<u8>,
    rays: Vec<Ray>,
}

impl Kept {
    fn new(mesh: Mesh, preset: Preset) -> Self {
        // In memory where the system has that: thousands of files are written.
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
        let folder = folder.expect("a folder");
        let cache = Cache::open(folder.path()).expect("a folder");
        let rays = scenes::rays(50, &mesh.positions.clone(), 1);
        let world = world(&scenes::of_mesh(mesh));
        let (_, report) = get(&cache, &world, preset, &rays);
        let bytes = fs::read(&report.path).expect("a file");
        Self { world, preset, cache, folder, report, bytes, rays }
    }

    /// That a file with these bytes is named, ignored and rewritten.
    #[track_caller]
    fn refuses(&self, bytes: &[u8], words: &str) {
        fs::write(&self.report.path, bytes).expect("written");
        let (_, report) = get(&self.cache, &self.world, self.preset, &self.rays);
        let [warning] = &report.warnings[..] else { panic!("one warning: {report:?}") };
        assert_eq!((&warning.path, report.used), (&self.report.path, CacheUse::Written), "{words}");
        assert!(warning.message.contains(words), "{words} in {}", warning.message);
        assert!(fs::read(&self.report.path).expect("a file") == self.bytes, "rewritten");
        assert_eq!(fs::read_dir(self.folder.path()).expect("a folder").count(), 1, "nothing is left beside it");
    }
}

#[test]
fn every_flipped_bit_and_every_missing_byte_is_found() {
    for preset in [Preset::Default, Preset::Compact] {
        let kept = Kept::new(scenes::soup(30, 0.3, 2), preset);
        for at in 0..kept.bytes.len() {
            let mut bytes = kept.bytes.clone();
            bytes[at] ^= 1 << (at % 8);
            kept.refuses(&bytes, "ignored, to be written anew");
            kept.refuses(&kept.bytes[..at], if at < 72 { "too short" } else { "bytes, where it says" });
        }
        kept.refuses(&[&kept.bytes[..], &[0]].concat(), "bytes, where it says");
        kept.refuses(&[&kept.bytes[..], &kept.bytes[..]].concat(), "bytes, where it says");
    }
}

#[test]
fn foreign_files_are_named() {
    let kept = Kept::new(scenes::bumpy_sphere(8, 0.2, 1), Preset::Compact);
    let other = Kept::new(scenes::bumpy_sphere(8, 0.2, 2), Preset::Compact);
    assert_eq!(kept.bytes.len(), other.bytes.len());
    assert_ne!(kept.report.path.file_name(), other.report.path.file_name());
    kept.refuses(&other.bytes, "other triangles or another preset");
    kept.refuses(b"solid teapot\n", "too short");
    kept.refuses(&[b'#'; 5000], "no file of this program");
    for (at, words) in [
        (8, "is of version 5, or layout, other than this program's 4"),
        (12, "another byte order"),
        (16, "or layout"),
        (24, "arrays, where"),
    ] {
        let mut bytes = kept.bytes.clone();
        bytes[at] ^= 1;
        kept.refuses(&bytes, words);
    }
    // Lengths that no file has, with the right digest of nothing.
    for at in 0..kept.bytes.len() / 8 {
        let mut bytes = kept.bytes.clone();
        bytes[8 * at..8 * at + 8].fill(0xff);
        if bytes != kept.bytes {
            kept.refuses(&bytes, "ignored");
        }
    }
}

#[test]
fn random_damage_does_no_harm() {
    let mut random = Random::new(5);
    for preset in Preset::ALL {
        let kept = Kept::new(scenes::bumpy_sphere(10, 0.2, 1), preset);
        for _ in 0..400 {
            let mut bytes = kept.bytes.clone();
            for _ in 0..1 + random.below(3) {
                let (at, to) = (random.below(bytes.len()), random.below(bytes.len()));
                let end = (at + random.below(100)).min(bytes.len());
                match random.below(5) {
                    0 => bytes.truncate(at + 1),
                    1 => bytes[at..end].iter_mut().for_each(|byte| *byte = random.bits() as u8),
                    2 => {
                        let last = bytes.len() - (end - at);
                        bytes.copy_within(at..end, to.min(last));
                    }
                    3 => drop(bytes.splice(to..to, kept.bytes[at.min(kept.bytes.len())..].iter().take(90).copied())),
                    _ => drop(bytes.drain(at..end)),
                }
                if bytes.is_empty() {
                    bytes.push(0);
                }
            }
            if bytes != kept.bytes {
                kept.refuses(&bytes, "ignored");
            }
        }
    }
}

#[test]
fn a_folder_that_cannot_be_used_costs_a_warning_or_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    fs::write(&file, "").expect("written");
    let error = Cache::open(&file.join("below")).expect_err("a file is no folder");
    assert!(error.exit_code() == 4 && error.to_string().contains("below"), "{error}");
    assert_eq!(Cache::open(&file).expect_err("a file is no folder").exit_code(), 4);

    // A folder in the file's place can neither be read nor replaced.
    let kept = Kept::new(scenes::soup(30, 0.3, 2), Preset::Default);
    fs::remove_file(&kept.report.path).expect("a file");
    fs::create_dir(&kept.report.path).expect("a folder");
    let (_, report) = get(&kept.cache, &kept.world, kept.preset, &kept.rays);
    let messages: Vec<_> = report.warnings.iter().map(ToString::to_string).collect();
    assert!(report.used == CacheUse::Failed && messages.len() == 2, "{messages:?}");
    assert!(messages[0].contains("is a directory") && messages[1].contains("not kept"), "{messages:?}");
}

#[test]
fn several_at_once_do_no_harm() {
    let kept = Kept::new(scenes::bumpy_sphere(20, 0.2, 1), Preset::Default);
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let kept = &kept;
            scope.spawn(move || {
                for round in 0..20 {
                    if (round + thread) % 4 == 0 {
                        // Some find none, and write.
                        let _ = fs::remove_file(&kept.report.path);
                    }
                    let (_, report) = get(&kept.cache, &kept.world, kept.preset, &kept.rays);
                    assert!(report.warnings.is_empty(), "{report:?}");
                }
            });
        }
    });
    assert!(fs::read(&kept.report.path).is_ok_and(|bytes| bytes == kept.bytes));
}
