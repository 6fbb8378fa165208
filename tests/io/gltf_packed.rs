//! What glTF files keep small: quantised and compressed meshes, and many instances of one.
//!
//! The compressed files were made with other people's encoders: `meshopt.gltf` and `meshopt_khr.gltf` with
//! meshoptimizer 1.3's, `draco.gltf` with draco3d 1.5.9's, all as published for JavaScript.

use std::path::Path;

use serde_json::json;
use twincast::io::{LoadOptions, load};
use twincast::math::{DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};
use twincast::{Scene, Warning};

use super::gltf_maker::{I8, I16, Maker, U8, U16};
use super::{Files, meshes, refused};

fn fixture(name: &str) -> (Scene, Vec<Warning>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name);
    load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// A side of the grid in both files, in vertices.
const SIDE: usize = 17;

/// Vertex `i` of the grid.
fn position(i: usize) -> Vec3 {
    Vec3::new((i % SIDE) as f32, (i / SIDE) as f32, (i * i % 7) as f32 / 8.0)
}

/// Its normal: on a spiral from pole to pole.
fn normal(i: usize) -> Vec3 {
    let z = 1.0 - 2.0 * (i as f32 + 0.5) / (SIDE * SIDE) as f32;
    let (r, a) = ((1.0 - z * z).sqrt(), i as f32 * 0.7);
    Vec3::new(r * a.cos(), r * a.sin(), z)
}

/// The triangles of the grid, each beginning with its lowest index.
fn grid() -> Vec<[u32; 3]> {
    let n = SIDE as u32;
    let quads = (0..n - 1).flat_map(|y| (0..n - 1).map(move |x| y * n + x));
    quads.flat_map(|a| [[a, a + 1, a + n], [a + 1, a + n + 1, a + n]]).collect()
}

fn lowest_first(mut triangle: [u32; 3]) -> [u32; 3] {
    let lowest = (0..3).min_by_key(|&k| triangle[k]).unwrap();
    triangle.rotate_left(lowest);
    triangle
}

#[test]
fn meshopt_streams_hold_what_was_put_in() {
    let (scene, warnings) = fixture("meshopt.gltf");
    assert_eq!(warnings, []);
    let expected: Vec<Vec3> = (0..SIDE * SIDE).map(position).collect();
    // Triangles as such, then as a sequence of indices; normals of 16 bits, then of 8.
    for (mesh, step) in meshes(&scene).iter().zip([1.0 / 32767.0, 1.0 / 64.0]) {
        assert_eq!(*mesh.positions, expected);
        assert_eq!(mesh.triangles.iter().map(|t| lowest_first(*t)).collect::<Vec<_>>(), grid());
        for (i, got) in mesh.normals.iter().enumerate() {
            assert!(got.abs_diff_eq(normal(i), 2.0 * step), "{got} where {} belongs", normal(i));
        }
    }
    assert_eq!(scene.instances.len(), 40);
    for (i, instance) in scene.instances.iter().enumerate() {
        let (angle, x) = (0.3 * i as f64, i as f64);
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, angle);
        let place = DVec3::new(1.5 * x, -0.25 * x, f64::from(1 << (i % 5)));
        let expected = DAffine3::from_rotation_translation(turn, place);
        let got = instance.transform;
        // 16 bits a component of a rotation, 20 of a translation that shares its exponent.
        assert!(got.matrix3.abs_diff_eq(expected.matrix3, 4e-4), "{i}: {got} where {expected} belongs");
        assert!((got.translation - place).length() < 1e-4 * place.length(), "{i}: {got} where {expected} belongs");
    }
}

/// Differences of bytes, of words and of bits, each way of packing them, and colours: `KHR_meshopt_compression`.
#[test]
fn meshopt_streams_of_the_second_version_hold_what_was_put_in() {
    let (scene, warnings) = fixture("meshopt_khr.gltf");
    assert_eq!(warnings, []);
    let is = meshes(&scene);
    assert_eq!(is.len(), 2);
    // Positions as f32, then in quarter millimetres of 16 bits; colours of 8 bits, then of 12.
    for (mesh, (scale, turn, shade)) in
        is.iter().zip([(1.0, 1.0 / 32767.0, 1.0 / 255.0), (4000.0, 1.0 / 64.0, 1.0 / 4095.0)])
    {
        assert_eq!(mesh.triangles.iter().map(|t| lowest_first(*t)).collect::<Vec<_>>(), grid());
        assert_eq!(mesh.positions.len(), SIDE * SIDE);
        for i in 0..SIDE * SIDE {
            let (got, expected) = (mesh.positions[i], position(i) * scale);
            assert_eq!(got, expected, "{i}");
            let (got, expected) = (mesh.normals[i], normal(i));
            assert!(got.abs_diff_eq(expected, 2.0 * turn), "{got} where {expected} belongs");
            let shares = |k: usize, most: usize| k as f32 / most as f32;
            let color = Vec4::new(shares(i % SIDE, 16), shares(i / SIDE, 16), shares(i % 5, 4), shares(i % 3, 2));
            assert!(mesh.colors[i].abs_diff_eq(color, 2.0 * shade), "{} where {color} belongs", mesh.colors[i]);
        }
    }
}

fn fixture_json(name: &str) -> serde_json::Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn broken_meshopt_streams_are_refused() {
    let altered = |name: &str, extension: &str, view: usize, key: &str, value: serde_json::Value| {
        let mut json = fixture_json(name);
        json["bufferViews"][view]["extensions"][extension][key] = value;
        Files::one("a.gltf", json.to_string())
    };
    let with = |view, key: &str, value| altered("meshopt.gltf", "EXT_meshopt_compression", view, key, value);
    refused(&with(0, "byteLength", json!(800)), "a.gltf", "/accessors/0/bufferView", "EXT_meshopt_compression");
    refused(&with(0, "byteOffset", json!(1)), "a.gltf", "/accessors/0/bufferView", "0xa0 belongs");
    refused(&with(0, "mode", json!("POINTS")), "a.gltf", "/accessors/0/bufferView", "\"POINTS\"");
    refused(&with(0, "count", json!(288)), "a.gltf", "/accessors/0/bufferView", "288 elements of 12 bytes");
    refused(&with(0, "filter", json!("QUATERNION")), "a.gltf", "/accessors/0/bufferView", "do not suit");
    refused(&with(3, "byteLength", json!(20)), "a.gltf", "/accessors/2/bufferView", "too early");
    refused(&with(4, "byteLength", json!(20)), "a.gltf", "/accessors/3/bufferView", "too early");
    refused(&with(0, "buffer", json!(7)), "a.gltf", "/accessors/0/bufferView", "buffer 7");

    let with = |view, key: &str, value| altered("meshopt_khr.gltf", "KHR_meshopt_compression", view, key, value);
    refused(&with(0, "byteLength", json!(640)), "a.gltf", "/accessors/0/bufferView", "KHR_meshopt_compression");
    refused(&with(0, "byteLength", json!(20)), "a.gltf", "/accessors/0/bufferView", "too early");
    refused(&with(0, "filter", json!("COLOR")), "a.gltf", "/accessors/0/bufferView", "do not suit");
    // Also where the buffer does not say that it is none.
    let mut json = fixture_json("meshopt_khr.gltf");
    json["buffers"][1].as_object_mut().unwrap().remove("extensions");
    Files::one("a.gltf", json.to_string()).scene("a.gltf");
    json["bufferViews"][0]["extensions"]["KHR_meshopt_compression"]["count"] = json!(-1);
    refused(&Files::one("a.gltf", json.to_string()), "a.gltf", "/accessors/0/bufferView", "KHR_meshopt_compression: ");
}

/// By the edge breaker's walk, then in sequence: positions of 14 bits over 16 metres, normals of 10, coordinates of 12.
#[test]
fn draco_data_hold_what_was_put_in() {
    // Its bytes are not said to stand for shares.
    let (_, warnings) = fixture("draco.gltf");
    let [warning] = &warnings[..] else { panic!("{warnings:?}") };
    assert!(warning.message.contains("not marked as normalized"), "{warning}");
    let mut json = fixture_json("draco.gltf");
    let colors: Vec<u64> =
        (0..2).filter_map(|i| json["meshes"][0]["primitives"][i]["attributes"]["COLOR_0"].as_u64()).collect();
    colors.iter().for_each(|&accessor| json["accessors"][accessor as usize]["normalized"] = json!(true));
    let scene = Files::one("a.gltf", json.to_string()).scene("a.gltf");
    assert_eq!(meshes(&scene).len(), 2);
    for mesh in meshes(&scene) {
        // Vertices come in any order; each knows its number by its place in the grid.
        let number = |p: &Vec3| p.x.round() as usize + SIDE * p.y.round() as usize;
        let numbers: Vec<usize> = mesh.positions.iter().map(number).collect();
        for (k, &i) in numbers.iter().enumerate() {
            let (place, uv) = (mesh.positions[k], mesh.uvs[k]);
            assert!(place.abs_diff_eq(position(i), 1e-3), "{place} where {} belongs", position(i));
            assert!(mesh.normals[k].dot(normal(i)) > 0.9999, "{} where {} belongs", mesh.normals[k], normal(i));
            let (column, row) = ((i % SIDE) as f32, (i / SIDE) as f32);
            assert!(uv.abs_diff_eq(Vec2::new(column, 16.0 - row) / 16.0, 1.0 / 4096.0), "{uv}");
            assert_eq!(mesh.colors[k], Vec4::new(column, row, 7.0, 0.0) / 255.0, "bytes are kept as they are");
        }
        let in_grid = |t: &[u32; 3]| lowest_first(t.map(|k| numbers[k as usize] as u32));
        let mut triangles: Vec<_> = mesh.triangles.iter().map(in_grid).collect();
        let mut expected = grid();
        triangles.sort_unstable();
        expected.sort_unstable();
        assert_eq!(triangles, expected);
    }
}

#[test]
fn broken_draco_data_are_refused() {
    let place = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    let broken = |pointer: &str, value: serde_json::Value, place: &str, words: &str| {
        let mut json = fixture_json("draco.gltf");
        *json.pointer_mut(pointer).unwrap() = value;
        refused(&Files::one("a.gltf", json.to_string()), "a.gltf", place, words);
    };
    broken("/bufferViews/0/byteLength", json!(1000), place, "the data are broken");
    broken("/bufferViews/0/byteLength", json!(1 << 30), place, "past its buffer's");
    broken("/accessors/0/count", json!(288), "/accessors/0/count", "288 elements of POSITION");
    let extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    broken(&format!("{extension}/attributes/NORMAL"), json!(9), place, "attribute 9, which the data do not have");
    broken(&format!("{extension}/attributes"), json!({}), place, "no POSITION");
    broken(extension, json!({}), place, "not valid");
}

#[test]
fn quantised_attributes_are_the_numbers_they_stand_for() {
    let mut maker = Maker::new();
    // Shorts without a scale, which the node has; bytes that stand for -1 to 1; shorts from 0 to 1; bytes from 0 to 1.
    let shorts = |values: &[i16]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let position = maker.accessor("VEC3", I16, false, 9, &shorts(&[0, 0, 0, 1000, 0, -500, 0, 32767, 0]));
    let bytes: Vec<u8> = [0i8, 0, 127, 0, 127, 0, -128, 0, 0].map(|x| x as u8).to_vec();
    let normal = maker.accessor("VEC3", I8, true, 9, &bytes);
    let uv = maker.accessor("VEC2", U16, true, 6, &shorts(&[0, 0, -1, 0, 0, 0x3333]));
    let color = maker.accessor("VEC4", U8, true, 12, &[255, 0, 51, 255, 0, 255, 0, 51, 0, 0, 0, 0]);
    maker.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    maker.json["meshes"] = json!([{"primitives": [{"attributes": {
        "POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv, "COLOR_0": color}}]}]);
    maker.json["nodes"] = json!([{"mesh": 0, "scale": [0.001, 0.001, 0.001]}]);
    let scene = maker.files().scene("a.gltf");
    let mesh = meshes(&scene)[0];
    let places = mesh.positions.iter().map(|p| scene.instances[0].transform.transform_point3(p.as_dvec3()));
    let expected = [DVec3::ZERO, DVec3::new(1.0, 0.0, -0.5), DVec3::new(0.0, 32.767, 0.0)];
    assert!(places.zip(expected).all(|(got, expected)| (got - expected).length() < 1e-12));
    assert_eq!(mesh.normals, [Vec3::Z, Vec3::Y, Vec3::NEG_X]);
    assert_eq!(mesh.uvs, [Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(0.0, 1.0 - 0.2)]);
    assert_eq!(mesh.colors, [Vec4::new(1.0, 0.0, 0.2, 1.0), Vec4::new(0.0, 1.0, 0.0, 0.2), Vec4::ZERO]);
}

#[test]
fn instances_of_one_node() {
    let mut maker = Maker::triangle();
    let translations = maker.floats("VEC3", &[0., 0., 0., 5., 0., 0.]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let rotations = maker.floats("VEC4", &[0., 0., 0., 1., 0., 0., half, half]);
    let scales = maker.floats("VEC3", &[1., 1., 1., 2., 3., 4.]);
    let extension = |attributes| json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    let attributes = json!({"TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales, "_ID": 99});
    maker.json["nodes"] = json!([{"mesh": 0, "translation": [0, 0, 1], "extensions": extension(attributes)}]);
    maker.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = maker.files().scene("a.gltf");
    let places: Vec<_> = scene.instances.iter().map(|i| i.transform.transform_point3(DVec3::ONE)).collect();
    // Scaled to (2, 3, 4), turned to (-3, 2, 4), moved to (2, 2, 4), and by the node to (2, 2, 5).
    assert_eq!(places.len(), 2);
    assert!((places[0] - DVec3::new(1.0, 1.0, 2.0)).length() < 1e-6, "{places:?}");
    assert!((places[1] - DVec3::new(2.0, 2.0, 5.0)).length() < 1e-6, "{places:?}");
    let place = "/nodes/0/extensions/EXT_mesh_gpu_instancing";
    let one = maker.floats("VEC3", &[1., 1., 1.]);
    maker.json["nodes"][0]["extensions"] = extension(json!({"TRANSLATION": translations, "SCALE": one}));
    refused(&maker.files(), "a.gltf", place, "2 of one attribute, 1 of another");
    maker.json["nodes"][0]["extensions"] = extension(json!({}));
    refused(&maker.files(), "a.gltf", place, "none of TRANSLATION");
    let zero = maker.floats("VEC3", &[1., 1., 1., 0., 1., 1.]);
    maker.json["nodes"][0]["extensions"] = extension(json!({"SCALE": zero}));
    let (scene, warnings) = maker.files().load("a.gltf");
    assert!(scene.instances.len() == 1 && warnings[0].message.contains("1 instances"), "{warnings:?}");
}
