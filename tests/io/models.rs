//! Models that others made.

use twincast::World;
use twincast::io::{LoadOptions, load};

use super::model;

#[test]
fn models_load_with_the_known_number_of_triangles() {
    // Triangles as placed, words of the warnings in order. The counts of the two scans are those of
    // their sources; a polygon of n corners has n - 2 triangles.
    let models: [(&str, Option<u64>, &[&str]); 12] = [
        ("nefertiti.obj", Some(99_938), &[]),
        ("stanford-bunny.obj", Some(69_451), &[]),
        ("teapot.obj", None, &[]),
        ("suzanne.obj", None, &[]),
        ("cow.obj", None, &[]),
        ("gltf/FlightHelmet/FlightHelmet.gltf", None, &[]),
        ("gltf/CornellBox.glb", None, &[]),
        ("gltf/Fox.glb", Some(576), &[]),
        ("gltf/MorphStressTest.gltf", None, &[]),
        ("gltf/SimpleSkin.gltf", Some(8), &[]),
        ("gltf/gltf_primitives.glb", None, &[]),
        ("gltf/box_sparse.glb", Some(12), &[]),
    ];
    for (name, triangles, expected) in models {
        let Some(path) = model(name) else { continue };
        let begin = std::time::Instant::now();
        let (scene, warnings) = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        eprintln!("{name}: {} triangles, {:?}, {warnings:?}", scene.primitive_count(), begin.elapsed());
        let world = World::new(&scene).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(world.primitive_count(), scene.primitive_count());
        if let Some(triangles) = triangles {
            assert_eq!(scene.primitive_count(), triangles, "{name}");
        } else if name.ends_with("obj") {
            assert_eq!(scene.primitive_count(), fans(&path), "{name}");
        }
        assert_eq!(warnings.len(), expected.len(), "{name}: {warnings:?}");
        assert!(warnings.iter().zip(expected).all(|(w, word)| w.message.contains(word)), "{name}: {warnings:?}");
    }
}

/// Triangles of an OBJ file, counted by its text.
fn fans(path: &std::path::Path) -> u64 {
    let text = String::from_utf8_lossy(&std::fs::read(path).unwrap()).into_owned();
    text.lines().filter(|l| l.starts_with("f ")).map(|l| l.split_whitespace().count() as u64 - 3).sum()
}
